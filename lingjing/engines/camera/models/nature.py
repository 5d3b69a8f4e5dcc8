"""Rocks and plants. Crowns are lumpy bodies with leaf cards on them: small triangles that stand out at all angles.

The fragment shader of plants (`object.frag`, `DULL`) tears the rims of crowns and mottles them. Small plants in a
picture have simpler meshes (`reduced_meshes`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import pairwise
from math import cos, pi, sin

import numpy as np

from lingjing.engines.camera.meshes import Mesh, box, cylinder, ellipsoid, flat, merge
from lingjing.engines.camera.models.palette import YELLOW
from lingjing.engines.camera.models.shapes import blob, limb
from lingjing.mission.appearance import LinearRgb
from lingjing.mission.instance import Vector


def _rock(variant: int) -> Mesh:
    mesh = ellipsoid((0.0, 0.0, 0.1), (1.3, 1.0, 0.75), (0.20, 0.18, 0.16), 0.1, rows=7, sides=11)
    p = mesh[:, :3].astype(np.float64)
    bump = np.sin(p @ np.array([3.1, 1.7, 2.3]) + variant) + np.sin(p @ np.array([-2.2, 4.1, 1.1]) + 2.0 * variant)
    corners = (p * (1.0 + 0.16 * bump[:, None])).reshape(-1, 3, 3)
    shade = 1.0 + 0.15 * sin(2.0 * variant)
    return flat(corners, (0.20 * shade, 0.185 * shade, 0.165 * shade), 0.1)


def _leafy(crowns: Sequence[tuple[Vector, Vector]], leaf: LinearRgb, seed: int, cards: int, size_m: float) -> Mesh:
    """Return crowns (centre, radii; m) with leaf cards of `size_m` spread evenly over them; lower leaves are darker."""
    area = np.array([r[0] * r[2] for _, r in crowns])
    counts = np.maximum(np.rint(cards * area / area.sum()), 3).astype(int)
    low = min(c[2] - r[2] for c, r in crowns)
    span = max(c[2] + r[2] for c, r in crowns) - low
    inner: LinearRgb = (0.62 * leaf[0], 0.62 * leaf[1], 0.62 * leaf[2])
    bodies = [blob(centre, (0.93 * r[0], 0.93 * r[1], 0.93 * r[2]), inner, seed + 7 * k, rows=5, sides=7)
              for k, (centre, r) in enumerate(crowns)]  # fmt: skip
    leaves = [_cards(centre, r, int(n), seed + 31 * k, size_m, leaf)
              for k, ((centre, r), n) in enumerate(zip(crowns, counts, strict=True))]  # fmt: skip
    mesh = merge(*bodies, *leaves)
    mesh[:, 6:9] *= 0.78 + 0.57 * np.clip((mesh[:, 2:3] - low) / span, 0.0, 1.0)
    return mesh


def _cards(centre: Vector, radii: Vector, count: int, seed: int, size_m: float, leaf: LinearRgb) -> Mesh:
    """Return leaf cards over an ellipsoid. Their normals are those of the ellipsoid, so that a crown is lit as a
    whole."""
    number = np.arange(count) + 0.5
    high, turn = 1.0 - 2.0 * number / count, GOLDEN * number + seed
    flat_out = np.sqrt(1.0 - high * high)
    out = np.stack([flat_out * np.cos(turn), flat_out * np.sin(turn), high], axis=1)
    chance = np.random.default_rng(1000 + seed)
    roll, push, tone = chance.random((3, count))
    middle = np.array(centre) + out * np.array(radii) * (0.90 + 0.17 * push)[:, None]
    aside = np.cross(out, chance.normal(size=(count, 3)))
    aside /= np.linalg.norm(aside, axis=1)[:, None]
    along = np.cross(out, aside) * 0.75 + out * (0.9 * roll - 0.25)[:, None]
    size = size_m * (0.75 + 0.5 * tone)[:, None]
    corners = np.stack([middle + size * (aside - 0.55 * along), middle + size * along,
                        middle - size * (aside + 0.55 * along)], axis=1)  # fmt: skip
    mesh = flat(corners, leaf)
    mesh[:, 3:6] = np.repeat(out, 3, axis=0)
    mesh[:, 6:9] *= np.repeat(0.72 + 0.56 * chance.random((count, 1)), 3, axis=0)
    return mesh


def thinned(mesh: Mesh) -> Mesh | None:
    """Return a plant with half of its leaf cards, which cover the same area; None for one without cards."""
    corners = mesh.reshape(-1, 3, mesh.shape[1])
    face = np.cross(corners[:, 1, :3] - corners[:, 0, :3], corners[:, 2, :3] - corners[:, 0, :3])
    across = np.abs(np.einsum("ij,ij->i", face, corners[:, 0, 3:6])) < CARD_COSINE * np.linalg.norm(face, axis=1)
    cards = np.flatnonzero(across & (corners[:, :, 3:6] == corners[:, :1, 3:6]).all(axis=(1, 2)))
    if len(cards) < LEAST_CARDS:
        return None
    fewer = corners.copy()
    middle = fewer[cards, :, :3].mean(axis=1, keepdims=True)
    fewer[cards, :, :3] = middle + (fewer[cards, :, :3] - middle) * np.float32(2.0**0.5)
    return np.ascontiguousarray(np.delete(fewer, cards[1::2], axis=0).reshape(-1, mesh.shape[1]))


CARD_COSINE, LEAST_CARDS = 0.999, 40
"""Cosine between face and normal from which a triangle is no leaf card, and least number of cards that are thinned
(chosen)."""

GOLDEN = 2.399963
"""The golden angle, radians: points at its multiples spread evenly over a sphere."""


def _tree(variant: int) -> Mesh:
    green: LinearRgb = ((0.06, 0.13, 0.03), (0.09, 0.16, 0.04), (0.05, 0.11, 0.04))[variant]
    crowns = [
        (0.0, 0.0, 5.2, 2.3), (1.2, 0.5, 4.4, 1.6), (-1.0, 0.9, 4.6, 1.7), (-0.2, -1.3, 4.2, 1.6), (0.3, 0.2, 6.5, 1.5),
    ]  # fmt: skip
    leaves = _leafy([((x, y, z), (r, r, 0.8 * r)) for x, y, z, r in crowns], green, variant, 420, 0.42)
    return merge(cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 4.5), (0.28, 0.16), BARK, sides=6), leaves)


def _pine(variant: int) -> Mesh:
    green: LinearRgb = ((0.040, 0.100, 0.042), (0.052, 0.110, 0.045))[variant]
    return merge(limb((0.0, 0.0, 0.0), (0.0, 0.0, 2.0), (0.22, 0.18), BARK), _boughs(1.1, 9.5, 2.0, green, variant))


def _boughs(low: float, top: float, reach: float, green: LinearRgb, seed: int) -> Mesh:
    """Return the boughs of a conifer between two heights: rings of drooping triangles around a dark core; metres."""
    chance = np.random.default_rng(500 + seed)
    core = (0.6 * green[0], 0.6 * green[1], 0.6 * green[2])
    parts = [limb((0.0, 0.0, low), (0.0, 0.0, top), (0.62 * reach, 0.02), core)]
    for ring in range(RINGS):
        share = ring / (RINGS - 1)
        long, up = reach * (1.0 - 0.93 * share), low + (top - low) * 0.93 * share
        boughs = 14 - ring
        turn = 2.0 * pi * (np.arange(boughs) + 0.37 * ring + 0.3 * chance.random(boughs)) / boughs
        reached = long * (0.80 + 0.35 * chance.random(boughs))
        out = np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
        side = np.stack([-np.sin(turn), np.cos(turn), 0.0 * turn], axis=1)
        wide = 0.22 + 0.36 * long
        root = np.array([0.0, 0.0, up + 0.42 * long + 0.25])
        tip = out * reached[:, None] + np.array([0.0, 0.0, up - 0.12 * long])
        knee = out * (0.60 * reached)[:, None] + np.array([0.0, 0.0, up + 0.10 * long])
        left, right = knee + 0.5 * wide * side, knee - 0.5 * wide * side
        roots = np.broadcast_to(root, tip.shape)
        mesh = flat(np.concatenate([np.stack([roots, left, right], 1), np.stack([left, tip, right], 1)]), green)
        lit = out * 0.8 + np.array([0.0, 0.0, 0.6])
        mesh[:, 3:6] = np.repeat(np.concatenate([lit, lit]), 3, axis=0)
        mesh[:, 6:9] *= np.repeat(np.tile(0.75 + 0.5 * chance.random((boughs, 1)), (2, 1)), 3, axis=0)
        parts.append(mesh)
    return merge(*parts)


RINGS = 12
"""Rings of boughs of a conifer (chosen)."""
BARK: LinearRgb = (0.125, 0.098, 0.075)
"""Linear colour of trunks (chosen)."""


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
        limb((0.0, 0.0, 0.0), (0.0, 0.0, 3.4), (0.17, 0.11), BARK, 5),
        *(limb((0.0, 0.0, 2.4), end, (0.07, 0.03), BARK, 4)
          for end in ((1.1, 0.3, 4.1), (-0.9, 0.8, 4.3), (-0.2, -1.0, 4.0))),
        _leafy(
            [((0.45, 0.1, 4.6), (1.65, 1.55, 1.25)), ((-0.75, 0.45, 4.9), (1.35, 1.40, 1.15)),
             ((-0.15, -0.75, 4.7), (1.40, 1.20, 1.10)), ((0.0, 0.15, 5.95), (1.35, 1.35, 1.10))],
            leaf, variant, 260, 0.36,
        ),
    )  # fmt: skip


def _poplar(variant: int) -> Mesh:
    """Return a slim upright tree of 10 m."""
    return merge(
        limb((0.0, 0.0, 0.0), (0.0, 0.0, 2.2), (0.16, 0.12), BARK, 5),
        _leafy(
            [((0.0, 0.0, 4.0), (1.1, 1.05, 2.5)), ((0.05, 0.0, 7.2), (0.85, 0.8, 2.9))],
            LEAVES[(variant + 2) % len(LEAVES)],
            variant,
            210,
            0.30,
        ),
    )


def _birch(variant: int) -> Mesh:
    """Return a light tree with a white trunk, 8 m."""
    leaf: LinearRgb = ((0.150, 0.185, 0.045), (0.120, 0.170, 0.050))[variant]
    return merge(
        limb((0.0, 0.0, 0.0), (0.1, 0.0, 4.5), (0.12, 0.07), (0.55, 0.54, 0.50), 5),
        _leafy(
            [((0.1, 0.1, 5.5), (1.30, 1.25, 2.2)), ((-0.25, -0.2, 3.9), (1.15, 1.2, 1.15))],
            leaf,
            variant + 3,
            200,
            0.27,
        ),
    )


def _conifer(variant: int) -> Mesh:
    """Return a spruce of three tiers, 9 m."""
    green: LinearRgb = ((0.045, 0.105, 0.045), (0.060, 0.120, 0.055))[variant]
    return merge(limb((0.0, 0.0, 0.0), (0.0, 0.0, 1.4), (0.2, 0.18), BARK, 5), _boughs(0.8, 9.0, 2.0, green, variant))


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
        _leafy(
            [((0.0, 0.0, 0.45), (0.75, 0.7, 0.6)), ((0.55, 0.25, 0.30), (0.5, 0.5, 0.42))], leaf, variant, 110, 0.16
        ),
    )


def _hedge() -> Mesh:
    """Return three metres of clipped hedge along x."""
    chance = np.random.default_rng(77)
    count = 150
    x, y, z = 3.0 * (chance.random(count) - 0.5), 0.62 * (chance.random(count) - 0.5), 1.02 * chance.random(count)
    face = np.arange(count) % 3
    y, z = np.where(face < 2, np.sign(y) * 0.31, y), np.where(face == 2, 1.01, z)
    leaves = np.stack([x, y, z], axis=1)[:, None, :] + 0.09 * chance.normal(size=(count, 3, 3))
    cards = flat(leaves, (0.075, 0.130, 0.036))
    cards[:, 6:9] *= np.repeat(0.7 + 0.6 * chance.random((len(cards) // 3, 1)), 3, axis=0)
    return merge(box((0.0, 0.0, 0.5), (2.98, 0.58, 0.98), (0.042, 0.080, 0.024)), cards)


def _flowerbed(variant: int) -> Mesh:
    bloom: LinearRgb = ((0.60, 0.08, 0.06), (0.70, 0.50, 0.06), (0.45, 0.12, 0.40))[variant]
    heads = [
        blob((0.25 * k**0.5 * cos(2.4 * k), 0.25 * k**0.5 * sin(2.4 * k), 0.34), (0.15, 0.15, 0.11), bloom, k, 3, 5)
        for k in range(9)
    ]  # fmt: skip
    return merge(cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 0.28), (0.95, 0.85), (0.10, 0.13, 0.05), sides=9), *heads)


@cache
def coarser(name: str, variant: int) -> tuple[Mesh, ...]:
    """Return the coarser levels of detail of a model of `VARIED`: with half and with a quarter of the leaf cards."""
    if name in BOUGHED:
        return ()
    levels: list[Mesh] = []
    mesh: Mesh | None = VARIED[name][0](variant)
    while mesh is not None and len(levels) < COARSER_LEVELS and (mesh := thinned(mesh)) is not None:
        levels.append(mesh)
    return tuple(levels)


COARSER_LEVELS = 2
"""Most coarser levels of a plant (chosen)."""
BOUGHED = ("pine", "conifer")
"""Plants with boughs instead of leaf cards."""

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
