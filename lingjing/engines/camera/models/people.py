"""People: the figures of `people.npz` that are drawn on foot and in the water, and their colours.

The soles of a person on foot are at z = 0; the waterline of a person in the water is.
"""

from __future__ import annotations

from math import cos, radians, sin

from lingjing.engines.camera.models.palette import BLACK, HAIRS, ORANGE, SKINS, WHITE, YELLOW
from lingjing.engines.camera.models.shapes import HERE, ModelPart, Placement
from lingjing.engines.camera.models.skeleton import PHASES, gait, posed
from lingjing.engines.camera.models.stored import Palette
from lingjing.mission.appearance import LinearRgb
from lingjing.mission.instance import Vector

STANDING = ("stand-0", "stand-1", "stand-2")
"""Poses of a person at rest."""
LYING_DOWN = frozenset(("injured", "unconscious", "fallen", "lying", "dead"))
"""Status words of a person on the ground."""
SEATED = frozenset(("sitting", "seated"))
"""Status words of a seated person."""

WALKERS = (
    "jacket", "coat", "tshirt", "suit", "blouse", "hoodie", "dress", "worker", "heavy", "elder", "skirt", "child",
)  # fmt: skip
"""Figures of people on foot."""
COATS: tuple[LinearRgb, ...] = (
    (0.10, 0.16, 0.32), (0.50, 0.06, 0.05), (0.62, 0.60, 0.55), (0.04, 0.045, 0.055), (0.10, 0.26, 0.13),
    (0.34, 0.14, 0.30), (0.20, 0.40, 0.50), (0.62, 0.42, 0.06), (0.16, 0.15, 0.14), (0.30, 0.19, 0.10),
)  # fmt: skip
"""Linear colours of coats (chosen)."""
TROUSERS: tuple[LinearRgb, ...] = (
    (0.06, 0.07, 0.10), (0.05, 0.06, 0.12), (0.14, 0.15, 0.18), (0.10, 0.13, 0.24), (0.24, 0.19, 0.12),
    (0.05, 0.05, 0.06), (0.36, 0.33, 0.28),
)  # fmt: skip
"""Linear colours of trousers (chosen)."""
GREY_HAIR: LinearRgb = (0.45, 0.44, 0.42)
HIGH_VISIBILITY: LinearRgb = (0.62, 0.66, 0.04)
COUNT = 2 * len(WALKERS)
"""People on foot that differ."""

CLOTHES: tuple[tuple[LinearRgb, bool], ...] = (
    (ORANGE, True),
    ((0.90, 0.30, 0.03), True),
    ((0.03, 0.05, 0.12), False),
    ((0.80, 0.50, 0.02), True),
    ((0.55, 0.06, 0.06), False),
    ((0.10, 0.12, 0.10), False),
)
"""Upper body of the n-th person in the water: linear colour, and whether it is a life vest. Dark ones are harder to
detect."""
WAVES = PHASES
"""Phases of waving."""
WAVE_PERIOD_S = 2.0
"""Time of one wave of the arms, seconds (chosen)."""


def on_foot(number: int, pose: str, rows: Placement = HERE) -> ModelPart:
    """Return the `number`-th person in a pose."""
    number %= COUNT
    figure = WALKERS[number % len(WALKERS)]
    levels = posed(figure, pose, _palette(number, figure))
    return ModelPart(f"person-{number}-{pose}", levels[0], rows, levels[1:])


def pose_on_foot(number: int, status: str, speed_mps: float, position: Vector, heading_deg: float) -> str:
    """Return the pose of a person: lying or seated by its status, else standing or in a phase of its gait.

    The distance walked is the place along the heading, so the phase needs no memory, and feet do not slide.
    """
    if status in LYING_DOWN:
        return "lie"
    if status in SEATED:
        return "sit"
    h = radians(heading_deg)
    walked_m = position[0] * sin(h) + position[1] * cos(h) + 0.53 * number
    return gait(speed_mps, walked_m) or STANDING[number % len(STANDING)]


def in_water(number: int, time_s: float) -> ModelPart:
    """Return the `number`-th person in the water, up to the chest, waving."""
    look = number % len(CLOTHES)
    colour, vest = CLOTHES[look]
    phase = int((time_s / WAVE_PERIOD_S + 0.37 * (number + 1)) * WAVES) % WAVES
    palette: Palette = (("coat", colour), ("shirt", colour if not vest else SKINS[look % len(SKINS)]),
                        ("trousers", (0.05, 0.06, 0.09)), ("skin", SKINS[look % len(SKINS)]),
                        ("hair", HAIRS[look % len(HAIRS)]), ("shoes", BLACK))  # fmt: skip
    levels = posed("lifevest" if vest else "swimmer", f"swim-{phase}", palette)
    return ModelPart(f"person-in-water-{look}-{phase}", levels[0], HERE, levels[1:])


def _palette(number: int, figure: str) -> Palette:
    coat = COATS[(3 * number + number // len(WALKERS)) % len(COATS)]
    trousers = TROUSERS[(number + 2 * (number // len(WALKERS))) % len(TROUSERS)]
    hair = GREY_HAIR if figure in ("elder", "heavy") else HAIRS[(number // 2) % len(HAIRS)]
    if figure == "worker":
        coat = HIGH_VISIBILITY if number < len(WALKERS) else ORANGE
    if figure == "suit":
        coat = trousers = (0.045, 0.05, 0.065) if number < len(WALKERS) else (0.16, 0.16, 0.17)
    return (("coat", coat), ("trousers", trousers), ("shirt", WHITE if number % 2 else (0.40, 0.46, 0.56)),
            ("skin", SKINS[number % len(SKINS)]), ("hair", hair), ("shoes", (0.035, 0.025, 0.02)),
            ("bag", COATS[(number + 4) % len(COATS)]), ("helmet", YELLOW))  # fmt: skip
