"""People on foot, at rest or in a phase of a step, in several clothes; the soles are at z = 0."""

from __future__ import annotations

from functools import cache
from math import cos, pi, sin

from lingjing.engines.camera.meshes import Mesh, box, cylinder, ellipsoid, merge
from lingjing.engines.camera.models.palette import BLACK, HAIRS, SKINS, WHITE
from lingjing.engines.camera.models.shapes import limb
from lingjing.mission.appearance import LinearRgb
from lingjing.mission.instance import Vector

PHASES = 4
"""Phases of a step."""
STAND = PHASES
"""The pose after the phases of a step: at rest."""
STEP_S = 1.1
"""Time of two steps of a walk, seconds (chosen)."""

OUTFITS: tuple[tuple[LinearRgb, LinearRgb], ...] = (
    ((0.10, 0.16, 0.32), (0.06, 0.07, 0.10)),
    ((0.50, 0.06, 0.05), (0.05, 0.06, 0.12)),
    ((0.62, 0.60, 0.55), (0.14, 0.15, 0.18)),
    ((0.10, 0.26, 0.13), (0.24, 0.19, 0.12)),
    ((0.62, 0.42, 0.06), (0.05, 0.05, 0.06)),
    ((0.05, 0.05, 0.06), (0.10, 0.13, 0.24)),
    ((0.34, 0.14, 0.30), (0.05, 0.05, 0.06)),
    ((0.20, 0.40, 0.50), (0.36, 0.33, 0.28)),
)
"""Linear colours of jacket and trousers of the n-th person (chosen)."""


@cache
def pedestrian(look: int, pose: int) -> Mesh:
    """Return a person of 1.75 m in a pose (`STAND` or a phase of a step)."""
    coat, trousers = OUTFITS[look % len(OUTFITS)]
    skin, hair = SKINS[look % len(SKINS)], HAIRS[(look // 2) % len(HAIRS)]
    stride = 0.0 if pose == STAND else 0.52 * sin(2.0 * pi * pose / PHASES + 0.4)
    parts = [
        ellipsoid((0.0, 0.02, 1.62), (0.085, 0.10, 0.125), skin, rows=5, sides=7),
        ellipsoid((0.0, -0.015, 1.66), (0.095, 0.105, 0.105), hair, rows=3, sides=7),
        limb((0.0, 0.0, 1.40), (0.0, 0.01, 1.55), (0.055, 0.05), skin, 5),
        ellipsoid((0.0, 0.0, 1.20), (0.205, 0.125, 0.30), coat, rows=4, sides=8),
        ellipsoid((0.0, 0.0, 1.39), (0.215, 0.105, 0.075), coat, rows=3, sides=6),
        cylinder((0.0, 0.0, 0.86), (0.0, 0.0, 1.06), (0.155, 0.165), coat, sides=7),
    ]
    for side in (-1.0, 1.0):
        parts += _leg(side, side * stride, trousers)
        parts += _arm(side, -side * 0.8 * stride, coat, skin)
    if look % 3 == 1:
        parts.append(box((0.0, -0.17, 1.22), (0.28, 0.14, 0.42), ((0.08, 0.08, 0.10), WHITE, BLACK)[look % 3]))
    return merge(*parts)


def _leg(side: float, swing: float, trousers: LinearRgb) -> list[Mesh]:
    bend = max(0.0, -swing) * 0.7
    hip: Vector = (side * 0.095, 0.0, 0.90)
    knee: Vector = (side * 0.10, 0.44 * sin(swing) + 0.10 * bend, 0.90 - 0.44 * cos(swing))
    back = swing - bend
    foot: Vector = (side * 0.10, knee[1] + 0.42 * sin(back), max(0.06, knee[2] - 0.42 * cos(back)))
    return [
        limb(hip, knee, (0.095, 0.07), trousers),
        limb(knee, foot, (0.07, 0.05), trousers),
        box((foot[0], foot[1] + 0.05, foot[2] - 0.02), (0.09, 0.25, 0.08), BLACK),
    ]


def _arm(side: float, swing: float, sleeve: LinearRgb, skin: LinearRgb) -> list[Mesh]:
    shoulder: Vector = (side * 0.21, 0.0, 1.40)
    elbow: Vector = (side * 0.25, 0.28 * sin(swing), 1.40 - 0.28 * cos(swing))
    hand: Vector = (side * 0.24, elbow[1] + 0.26 * sin(swing + 0.35), elbow[2] - 0.26 * cos(swing + 0.35))
    return [
        limb(shoulder, elbow, (0.06, 0.05), sleeve, 5),
        limb(elbow, hand, (0.05, 0.035), sleeve, 5),
        box(hand, (0.06, 0.07, 0.10), skin),
    ]


def pose_of(speed_mps: float, time_s: float, offset: float) -> int:
    """Return the pose of a person at a speed: `STAND` below a slow walk, else a phase of the step."""
    if speed_mps < 0.25:
        return STAND
    return int((time_s / STEP_S * max(speed_mps / 1.35, 0.5) + offset) * PHASES) % PHASES
