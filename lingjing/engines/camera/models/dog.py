"""The robot dog: a trunk and twelve links, placed by the angles of its joints.

Dimensions follow Unitree's data sheet of the Go2. Joints are in the order front left, front right, rear left, rear
right. Each has a hip (about the forward axis), a thigh and a calf (about the left axis), in radians; all are 0 with
straight legs. The origin is that of the trunk. A dog without known joints stands with its feet on its position.
"""

from __future__ import annotations

from functools import cache
from math import cos, sin

import numpy as np

from lingjing.engines.camera.meshes import Mesh, box, cylinder, ellipsoid, merge
from lingjing.engines.camera.models.palette import BLACK
from lingjing.engines.camera.models.shapes import ModelPart, Placement, limb, mirrored, shell
from lingjing.mission.appearance import LinearRgb

LEG_M = 0.213
"""Length of thigh and of calf, metres."""

HIP_AHEAD_M, HIP_ASIDE_M, THIGH_ASIDE_M = 0.1934, 0.0465, 0.0955
"""Position of a hip ahead of and beside the trunk's origin, and of the thigh beside the hip; metres."""

STANDING = (0.0, 0.9, -1.8) * 4
"""Joint angles of a dog without known joints, radians."""

FOOT_M = 0.023
"""Radius of a foot, metres."""
STANDING_M = 2.0 * LEG_M * cos(0.9) + FOOT_M
"""Height of the trunk's origin over the ground in `STANDING`, metres."""

# Linear colours (chosen).
SILVER: LinearRgb = (0.46, 0.47, 0.48)
DARK: LinearRgb = (0.05, 0.05, 0.055)

_TO_MODEL: Placement = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Rotation from the axes of joints (ahead, left, up) to those of models (right, ahead, up)."""


def dog_parts(joints: tuple[float, ...]) -> tuple[ModelPart, ...]:
    """Return trunk, hips, thighs and calves for twelve angles; without angles the dog stands on the origin."""
    known = len(joints) == 12
    angles = joints if known else STANDING
    lift = np.array([0.0, 0.0, 0.0 if known else STANDING_M])
    parts = [ModelPart("dog-trunk", trunk(), _placed(np.eye(3), lift))]
    for leg in range(4):
        hip, thigh, calf = angles[3 * leg : 3 * leg + 3]
        fore, left = (1.0 if leg < 2 else -1.0), (1.0 if leg % 2 == 0 else -1.0)
        at = np.array([fore * HIP_AHEAD_M, left * HIP_ASIDE_M, 0.0]) + lift
        turn = _about_ahead(hip)
        parts.append(ModelPart("dog-hip", _hip_link(), _placed(turn, at)))
        at = at + turn @ np.array([0.0, left * THIGH_ASIDE_M, 0.0])
        turn = turn @ _about_left(thigh)
        parts.append(ModelPart("dog-thigh", _thigh_link(), _placed(turn, at)))
        at = at + turn @ np.array([0.0, 0.0, -LEG_M])
        parts.append(ModelPart("dog-calf", _calf_link(), _placed(turn @ _about_left(calf), at)))
    return tuple(parts)


def _placed(turn: Placement, place: Placement) -> Placement:
    return np.hstack([_TO_MODEL @ turn @ _TO_MODEL.T, (_TO_MODEL @ place)[:, None]])


def _about_ahead(angle: float) -> Placement:
    c, s = cos(angle), sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _about_left(angle: float) -> Placement:
    c, s = cos(angle), sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


@cache
def trunk() -> Mesh:
    """Return the trunk with its head, a lidar dome and a handle."""

    def ring(y: float, half: float, low: float, high: float) -> tuple[float, list[tuple[float, float]]]:
        return y, [(-0.7 * half, low), (-half, 0.4 * low + 0.6 * high), (-0.7 * half, high), (0.7 * half, high),
                   (half, 0.4 * low + 0.6 * high), (0.7 * half, low), (-0.7 * half, low)]  # fmt: skip

    return merge(
        shell([ring(-0.26, 0.06, -0.03, 0.04), ring(-0.22, 0.085, -0.055, 0.062), ring(0.17, 0.085, -0.058, 0.066),
               ring(0.25, 0.065, -0.045, 0.052)], SILVER, 0.5),
        shell([ring(0.24, 0.052, -0.038, 0.050), ring(0.31, 0.056, -0.045, 0.055), ring(0.345, 0.040, -0.030, 0.045)],
              DARK, 0.6),
        ellipsoid((0.0, 0.348, 0.008), (0.022, 0.012, 0.018), (0.55, 0.62, 0.66), 0.9, rows=4, sides=8),
        cylinder((0.0, 0.285, -0.075), (0.0, 0.285, -0.03), (0.038, 0.034), BLACK, 0.5, sides=9),
        box((0.0, -0.02, 0.070), (0.10, 0.26, 0.02), DARK, 0.3),
        mirrored(box((0.088, -0.02, 0.0), (0.012, 0.26, 0.05), DARK, 0.3)),
        mirrored(cylinder((0.047, 0.1934, 0.0), (0.047, 0.27, 0.0), (0.044, 0.040), DARK, 0.3, sides=9)),
        mirrored(cylinder((0.047, -0.1934, 0.0), (0.047, -0.27, 0.0), (0.044, 0.040), DARK, 0.3, sides=9)),
    )  # fmt: skip


@cache
def _hip_link() -> Mesh:
    """Return the motor between trunk and thigh, equal on both sides."""
    return merge(
        cylinder((-0.075, 0.0, 0.0), (0.075, 0.0, 0.0), (0.045, 0.045), SILVER, 0.4, sides=10),
        cylinder((0.0, -0.045, 0.0), (0.0, 0.045, 0.0), (0.042, 0.042), DARK, 0.3, sides=10),
    )


@cache
def _thigh_link() -> Mesh:
    """Return a tapering beam from the hip to the knee."""
    return merge(
        cylinder((-0.026, 0.0, 0.0), (0.026, 0.0, 0.0), (0.047, 0.047), DARK, 0.4, sides=10),
        limb((0.0, 0.0, 0.0), (0.0, 0.006, -LEG_M), (0.040, 0.022), SILVER, 8),
        cylinder((-0.018, 0.0, -LEG_M), (0.018, 0.0, -LEG_M), (0.026, 0.026), DARK, 0.4, sides=8),
    )


@cache
def _calf_link() -> Mesh:
    """Return a thin shank and a rubber foot."""
    return merge(
        limb((0.0, 0.0, 0.0), (0.0, 0.012, -0.10), (0.018, 0.014), DARK, 6),
        limb((0.0, 0.012, -0.10), (0.0, 0.0, -LEG_M), (0.014, 0.012), DARK, 6),
        ellipsoid((0.0, 0.0, -LEG_M), (0.02, FOOT_M, FOOT_M), BLACK, rows=4, sides=7),
    )
