"""Rocks and plants. The trees of the bay are rich; streets and parks have simple ones of less than 150 triangles."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from math import cos, pi, sin

import numpy as np

from lingjing.engines.camera.meshes import Mesh, box, cylinder, ellipsoid, flat, merge
from lingjing.engines.camera.models.palette import WOOD, YELLOW
from lingjing.engines.camera.models.shapes import blob, limb
from lingjing.mission.appearance import LinearRgb


def _rock(variant: int) -> Mesh:
    mesh = ellipsoid((0.0, 0.0, 0.1), (1.3, 1.0, 0.75), (0.20, 0.18, 0.16), 0.1, rows=7, sides=11)
    p = mesh[:, :3].astype(np.float64)
    bump = np.sin(p @ np.array([3.1, 1.7, 2.3]) + variant) + np.sin(p @ np.array([-2.2, 4.1, 1.1]) + 2.0 * variant)
    corners = (p * (1.0 + 0.16 * bump[:, None])).reshape(-1, 3, 3)
    shade = 1.0 + 0.15 * sin(2.0 * variant)
    return flat(corners, (0.20 * shade, 0.185 * shade, 0.165 * shade), 0.1)


def _tree(variant: int) -> Mesh:
    green: LinearRgb = ((0.06, 0.13, 0.03), (0.09, 0.16, 0.04), (0.05, 0.11, 0.04))[variant]
    crowns = [
        (0.0, 0.0, 5.2, 2.3), (1.2, 0.5, 4.4, 1.6), (-1.0, 0.9, 4.6, 1.7), (-0.2, -1.3, 4.2, 1.6), (0.3, 0.2, 6.5, 1.5),
    ]  # fmt: skip
    leaves = [
        ellipsoid((x, y, z), (r, r, 0.8 * r), tuple(c * (0.85 + 0.08 * k) for c in green), rows=5, sides=8)  # type: ignore[arg-type]
        for k, (x, y, z, r) in enumerate(crowns)
    ]
    return merge(cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 4.5), (0.28, 0.16), WOOD, sides=6), *leaves)


def _pine(variant: int) -> Mesh:
    green: LinearRgb = ((0.025, 0.075, 0.03), (0.035, 0.09, 0.03))[variant]
    tiers = [
        cylinder((0.0, 0.0, 1.2 + 1.7 * k), (0.0, 0.0, 4.4 + 1.7 * k), (2.0 - 0.45 * k, 0.05), green, sides=8)
        for k in range(4)
    ]
    return merge(cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 2.0), (0.22, 0.18), WOOD, sides=6), *tiers)


def _helipad() -> Mesh:
    mark: LinearRgb = (0.75, 0.72, 0.66)
    angle = np.linspace(0.0, 2.0 * pi, 33)
    ring = []
    for a, b in pairwise(angle):
        quad = [(r * cos(t), r * sin(t), 0.02) for r, t in ((2.6, a), (3.0, a), (3.0, b), (2.6, b))]
        ring += [(quad[0], quad[1], quad[2]), (quad[0], quad[2], quad[3])]
    bars = [box((x, 0.0, 0.0), (0.4, 2.6, 0.04), mark) for x in (-0.8, 0.8)]
    return merge(flat(ring, YELLOW), *bars, box((0.0, 0.0, 0.0), (1.6, 0.4, 0.04), mark))


LEAVES: tuple[LinearRgb, ...] = (
    (0.070, 0.135, 0.032), (0.095, 0.160, 0.040), (0.052, 0.110, 0.040), (0.120, 0.150, 0.035), (0.085, 0.120, 0.025),
)  # fmt: skip
"""Linear colours of crowns (chosen)."""


def _street_tree(variant: int) -> Mesh:
    """Return a lime or a plane of 7 m."""
    leaf = LEAVES[variant]
    return merge(
        limb((0.0, 0.0, 0.0), (0.0, 0.0, 3.2), (0.17, 0.11), WOOD, 5),
        blob((0.15, 0.0, 4.7), (2.05, 1.95, 1.75), leaf, variant, rows=5, sides=7),
        blob((-0.5, 0.35, 6.0), (1.35, 1.45, 1.15), leaf, variant + 7, rows=4, sides=6),
    )


def _poplar(variant: int) -> Mesh:
    """Return a slim upright tree of 10 m."""
    return merge(
        limb((0.0, 0.0, 0.0), (0.0, 0.0, 2.2), (0.16, 0.12), WOOD, 5),
        blob((0.0, 0.0, 5.8), (1.15, 1.1, 4.3), LEAVES[(variant + 2) % len(LEAVES)], variant, rows=6, sides=7),
    )


def _birch(variant: int) -> Mesh:
    """Return a light tree with a white trunk, 8 m."""
    leaf: LinearRgb = ((0.150, 0.185, 0.045), (0.120, 0.170, 0.050))[variant]
    return merge(
        limb((0.0, 0.0, 0.0), (0.1, 0.0, 4.5), (0.12, 0.07), (0.55, 0.54, 0.50), 5),
        blob((0.1, 0.1, 5.3), (1.35, 1.3, 2.3), leaf, variant + 3, rows=4, sides=6),
        blob((-0.2, -0.2, 3.8), (1.15, 1.2, 1.1), leaf, variant + 5, rows=4, sides=6),
    )


def _conifer(variant: int) -> Mesh:
    """Return a spruce of three tiers, 9 m."""
    green: LinearRgb = ((0.025, 0.075, 0.030), (0.040, 0.090, 0.040))[variant]
    tiers = [
        limb((0.0, 0.0, 0.9 + 2.2 * k), (0.0, 0.0, 4.6 + 2.2 * k), (2.0 - 0.5 * k, 0.03), green, 8) for k in range(3)
    ]
    for k, tier in enumerate(tiers):
        tier[:, 6:9] *= (0.70 + 0.30 * np.clip((tier[:, 2:3] - 0.9 - 2.2 * k) / 3.7, 0.0, 1.0)).astype(np.float32)
    return merge(limb((0.0, 0.0, 0.0), (0.0, 0.0, 1.4), (0.2, 0.18), WOOD, 5), *tiers)


def _palm(variant: int) -> Mesh:
    """Return a palm with eight drooping fronds, 7 m."""
    green: LinearRgb = (0.085, 0.150, 0.035)
    fronds = []
    for k in range(8):
        a = 2.0 * pi * k / 8 + 0.3 * variant
        x, y = cos(a), sin(a)
        knee, tip = (1.3 * x, 1.3 * y, 6.9), (2.3 * x, 2.3 * y, 5.9 - 0.3 * (k % 2))
        left, right = (-0.32 * y, 0.32 * x), (0.32 * y, -0.32 * x)
        a0, b0 = (knee[0] + left[0], knee[1] + left[1], 6.75), (knee[0] + right[0], knee[1] + right[1], 6.75)
        fronds += [((0.0, 0.0, 6.5), a0, knee), ((0.0, 0.0, 6.5), knee, b0), (a0, tip, knee), (knee, tip, b0)]
    return merge(
        limb((0.0, 0.0, 0.0), (0.25, 0.1, 6.5), (0.19, 0.12), (0.30, 0.23, 0.15), 6), flat(np.array(fronds), green)
    )


def _bush(variant: int) -> Mesh:
    leaf = LEAVES[variant]
    return merge(
        blob((0.0, 0.0, 0.45), (0.75, 0.7, 0.6), leaf, variant, rows=4, sides=7),
        blob((0.55, 0.25, 0.30), (0.5, 0.5, 0.42), leaf, variant + 4, rows=3, sides=6),
    )


def _hedge() -> Mesh:
    """Return three metres of clipped hedge along x."""
    return box((0.0, 0.0, 0.5), (3.0, 0.6, 1.0), (0.055, 0.105, 0.030))


def _flowerbed(variant: int) -> Mesh:
    bloom: LinearRgb = ((0.60, 0.08, 0.06), (0.70, 0.50, 0.06), (0.45, 0.12, 0.40))[variant]
    heads = [
        blob((0.25 * k**0.5 * cos(2.4 * k), 0.25 * k**0.5 * sin(2.4 * k), 0.34), (0.15, 0.15, 0.11), bloom, k, 3, 5)
        for k in range(9)
    ]  # fmt: skip
    return merge(cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 0.28), (0.95, 0.85), (0.10, 0.13, 0.05), sides=9), *heads)


VARIED: dict[str, tuple[Callable[[int], Mesh], int]] = {
    "rock": (cache(_rock), 5),
    "tree": (cache(_tree), 3),
    "pine": (cache(_pine), 2),
    "street_tree": (cache(_street_tree), 5),
    "poplar": (cache(_poplar), 3),
    "birch": (cache(_birch), 2),
    "conifer": (cache(_conifer), 2),
    "palm": (cache(_palm), 2),
    "bush": (cache(_bush), 5),
    "flowerbed": (cache(_flowerbed), 3),
}
"""Builders of prop models with variants, by name, with their counts of variants."""

SINGLE: dict[str, Callable[[], Mesh]] = {"helipad": cache(_helipad), "hedge": cache(_hedge)}
"""Builders of prop models without variants, by name."""
