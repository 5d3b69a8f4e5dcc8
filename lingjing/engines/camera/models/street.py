"""Things in streets, yards and harbours: furniture, goods, tanks, and distractors.

The origin is the middle of the footprint on the ground; the front looks ahead (+y).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from math import cos, pi, sin

import numpy as np

from lingjing.engines.camera.meshes import Mesh, box, cylinder, ellipsoid, flat, merge
from lingjing.engines.camera.models.palette import BLACK, GREY, ORANGE, RED, WHITE, WOOD, YELLOW
from lingjing.engines.camera.models.shapes import limb, mirrored
from lingjing.mission.appearance import LinearRgb
from lingjing.mission.instance import Vector

# Linear colours (chosen).
STEEL: LinearRgb = (0.36, 0.37, 0.38)
CARD: LinearRgb = (0.42, 0.28, 0.14)


def _lamp() -> Mesh:
    """Return an 8 m street lamp, its arm ahead."""
    return merge(
        limb((0.0, 0.0, 0.0), (0.0, 0.0, 7.8), (0.10, 0.06), STEEL, 6),
        limb((0.0, 0.0, 7.7), (0.0, 1.8, 8.1), (0.05, 0.04), STEEL, 5),
        box((0.0, 1.9, 8.08), (0.26, 0.7, 0.10), (0.55, 0.55, 0.52)),
        box((0.0, 0.0, 0.3), (0.28, 0.28, 0.6), STEEL),
    )


def _park_lamp() -> Mesh:
    return merge(
        limb((0.0, 0.0, 0.0), (0.0, 0.0, 3.2), (0.06, 0.05), BLACK, 6),
        ellipsoid((0.0, 0.0, 3.4), (0.2, 0.2, 0.24), (0.70, 0.70, 0.66), 0.4, rows=4, sides=7),
        cylinder((0.0, 0.0, 3.6), (0.0, 0.0, 3.7), (0.22, 0.05), BLACK, sides=7),
    )


def _bench() -> Mesh:
    planks = [box((0.0, -0.18 + 0.14 * k, 0.46), (1.8, 0.11, 0.05), WOOD) for k in range(3)]
    backs = [box((0.0, -0.30, 0.62 + 0.15 * k), (1.8, 0.05, 0.10), WOOD) for k in range(2)]
    return merge(*planks, *backs, mirrored(box((0.7, -0.05, 0.23), (0.07, 0.5, 0.45), BLACK)))


def _bin(variant: int) -> Mesh:
    colour: LinearRgb = ((0.07, 0.16, 0.09), (0.10, 0.11, 0.12), (0.06, 0.14, 0.30))[variant]
    return merge(
        box((0.0, 0.0, 0.55), (0.58, 0.68, 0.95), colour, 0.2),
        box((0.0, 0.0, 1.06), (0.62, 0.74, 0.08), BLACK, 0.2),
    )


def _bollard() -> Mesh:
    return merge(
        cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 0.85), (0.09, 0.08), (0.12, 0.12, 0.13), sides=7),
        cylinder((0.0, 0.0, 0.62), (0.0, 0.0, 0.74), (0.095, 0.095), WHITE, sides=7),
    )


def _cone() -> Mesh:
    return merge(
        box((0.0, 0.0, 0.02), (0.4, 0.4, 0.04), BLACK),
        limb((0.0, 0.0, 0.04), (0.0, 0.0, 0.72), (0.15, 0.03), ORANGE, 8),
        limb((0.0, 0.0, 0.32), (0.0, 0.0, 0.50), (0.104, 0.078), WHITE, 8),
    )


def _hydrant() -> Mesh:
    return merge(
        cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 0.62), (0.13, 0.11), RED, 0.3, sides=8),
        ellipsoid((0.0, 0.0, 0.64), (0.13, 0.13, 0.12), RED, 0.3, rows=4, sides=7),
        cylinder((-0.2, 0.0, 0.42), (0.2, 0.0, 0.42), (0.06, 0.06), RED, 0.3, sides=6),
    )


def _traffic_light() -> Mesh:
    lenses = [
        cylinder((0.0, 0.16, 3.55 - 0.3 * k), (0.0, 0.19, 3.55 - 0.3 * k), (0.10, 0.10), colour, 0.4, sides=8)
        for k, colour in enumerate(((0.55, 0.03, 0.02), (0.25, 0.16, 0.02), (0.02, 0.16, 0.06)))
    ]
    return merge(
        limb((0.0, 0.0, 0.0), (0.0, 0.0, 3.7), (0.08, 0.06), STEEL, 6),
        box((0.0, 0.08, 3.25), (0.32, 0.18, 0.98), BLACK),
        *lenses,
    )  # fmt: skip


def _bus_stop() -> Mesh:
    glass: LinearRgb = (0.20, 0.26, 0.28)
    return merge(
        box((0.0, 0.0, 2.45), (4.0, 1.5, 0.10), (0.12, 0.13, 0.14)),
        box((0.0, -0.7, 1.35), (3.9, 0.05, 1.9), glass, 0.8),
        mirrored(box((1.95, -0.3, 1.3), (0.05, 0.8, 1.9), glass, 0.8)),
        mirrored(box((1.9, -0.68, 1.2), (0.08, 0.08, 2.4), STEEL)),
        mirrored(box((1.9, 0.6, 1.2), (0.08, 0.08, 2.4), STEEL)),
        box((-0.3, -0.45, 0.45), (2.4, 0.4, 0.06), WOOD),
    )


def _fence() -> Mesh:
    """Return three metres of railing along x."""
    posts = [box((-1.45 + 0.725 * k, 0.0, 0.6), (0.05, 0.05, 1.2), STEEL) for k in range(5)]
    return merge(*posts, *(box((0.0, 0.0, z), (3.0, 0.04, 0.05), STEEL) for z in (0.3, 0.7, 1.15)))


CONTAINERS: tuple[LinearRgb, ...] = (
    (0.36, 0.07, 0.04), (0.06, 0.16, 0.34), (0.10, 0.25, 0.16), (0.50, 0.24, 0.03), (0.40, 0.41, 0.42),
    (0.24, 0.06, 0.05),
)  # fmt: skip


def _container(variant: int, length: float) -> Mesh:
    colour = CONTAINERS[variant]
    dark: LinearRgb = (0.72 * colour[0], 0.72 * colour[1], 0.72 * colour[2])
    ribs = int(length / 0.75)
    sides = [
        box((s * 1.215, (k + 0.5) * length / ribs - length / 2, 1.3), (0.05, 0.30, 2.3), dark)
        for s in (-1.0, 1.0) for k in range(ribs)
    ]  # fmt: skip
    doors = [box((x, length / 2 + 0.015, 1.3), (0.05, 0.05, 2.3), STEEL) for x in (-0.85, -0.35, 0.35, 0.85)]
    return merge(box((0.0, 0.0, 1.3), (2.42, length, 2.58), colour, 0.1), *sides, *doors)


def _pallets(variant: int) -> Mesh:
    """Return goods on two pallets."""
    cloth: LinearRgb = ((0.62, 0.62, 0.60), CARD, (0.10, 0.22, 0.40))[variant]
    return merge(
        box((-0.65, 0.0, 0.07), (1.2, 0.9, 0.14), WOOD), box((0.65, 0.0, 0.07), (1.2, 0.9, 0.14), WOOD),
        box((-0.65, 0.0, 0.72), (1.1, 0.8, 1.15), cloth, 0.1), box((0.65, 0.0, 0.55), (1.1, 0.8, 0.8), CARD),
        box((0.65, 0.0, 0.96), (0.16, 0.82, 0.02), (0.55, 0.50, 0.40)),
    )  # fmt: skip


def _crates(variant: int) -> Mesh:
    shades: tuple[LinearRgb, ...] = (WOOD, (0.36, 0.25, 0.14), (0.30, 0.19, 0.10))
    spots = ((-0.5, 0.0, 0.4, 0.8), (0.42, 0.1, 0.35, 0.7), (-0.35, 0.05, 1.1, 0.6), (0.0, 0.85, 0.3, 0.6))
    return merge(*(
        box((x, y, z), (s, s, s), shades[(k + variant) % 3]) for k, (x, y, z, s) in enumerate(spots[: 3 + variant % 2])
    ))  # fmt: skip


def _drums(variant: int) -> Mesh:
    colour: LinearRgb = ((0.06, 0.16, 0.34), (0.45, 0.06, 0.04), (0.58, 0.36, 0.03))[variant]
    spots = ((-0.32, 0.0), (0.32, 0.05), (0.0, 0.58))
    return merge(*(cylinder((x, y, 0.0), (x, y, 0.88), (0.29, 0.29), colour, 0.2, sides=10) for x, y in spots))


def _tank(variant: int) -> Mesh:
    """Return a storage tank, 8 m across and 6 m high."""
    colour: LinearRgb = ((0.62, 0.62, 0.60), (0.50, 0.50, 0.48))[variant]
    return merge(
        cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 6.0), (4.0, 4.0), colour, 0.2, sides=24),
        cylinder((0.0, 0.0, 6.0), (0.0, 0.0, 6.9), (4.0, 0.3), (0.55, 0.55, 0.53), 0.2, sides=24),
        cylinder((0.0, 0.0, 4.6), (0.0, 0.0, 4.75), (4.03, 4.03), (0.40, 0.10, 0.05), sides=24),
    )


def _chimney() -> Mesh:
    """Return a 28 m stack with red rings."""
    rings = [cylinder((0.0, 0.0, z), (0.0, 0.0, z + 1.6), (r, r - 0.03), RED, sides=12)
             for z, r in ((25.6, 0.98), (20.6, 1.11))]  # fmt: skip
    return merge(cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 28.0), (1.6, 0.9), (0.48, 0.46, 0.43), sides=12), *rings)


def _steam() -> Mesh:
    """Return a steel vent; its steam is an effect."""
    return merge(
        cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.1), (0.28, 0.24), STEEL, 0.4, sides=9),
        cylinder((0.0, 0.0, 1.25), (0.0, 0.0, 1.45), (0.42, 0.05), STEEL, 0.4, sides=9),
        mirrored(box((0.2, 0.0, 1.17), (0.04, 0.04, 0.2), STEEL)),
    )


def _parasol(variant: int) -> Mesh:
    cloth: LinearRgb = (ORANGE, (0.50, 0.05, 0.04), (0.66, 0.64, 0.56), (0.05, 0.16, 0.12))[variant]
    return merge(
        limb((0.0, 0.0, 0.0), (0.0, 0.0, 2.5), (0.03, 0.03), WHITE, 5),
        limb((0.0, 0.0, 2.05), (0.0, 0.0, 2.65), (1.5, 0.02), cloth, 8),
        cylinder((0.0, 0.0, 0.70), (0.0, 0.0, 0.74), (0.45, 0.45), WHITE, sides=8),
        limb((0.0, 0.0, 0.0), (0.0, 0.0, 0.70), (0.05, 0.03), GREY, 5),
    )


def _stall(variant: int) -> Mesh:
    """Return a market stall under a striped roof."""
    cloth: LinearRgb = (ORANGE, (0.50, 0.06, 0.05), (0.05, 0.20, 0.38))[variant]
    strips = []
    for k in range(6):
        x0, x1 = -1.5 + 0.5 * k, -1.0 + 0.5 * k
        corners: list[Vector] = [(x0, -1.0, 2.6), (x1, -1.0, 2.6), (x1, 1.2, 2.2), (x0, 1.2, 2.2)]
        paint = cloth if k % 2 == 0 else WHITE
        strips.append(flat([(corners[0], corners[1], corners[2]), (corners[0], corners[2], corners[3])], paint))
    posts = [box((x, y, 1.2), (0.06, 0.06, 2.4), STEEL) for x in (-1.45, 1.45) for y in (-0.95, 1.1)]
    return merge(*strips, *posts, box((0.0, 0.4, 0.5), (2.8, 1.0, 0.95), WOOD),
                 box((0.0, 0.4, 1.02), (2.6, 0.8, 0.14), (0.45, 0.22, 0.06)))  # fmt: skip


def _billboard(variant: int) -> Mesh:
    colour: LinearRgb = ((0.06, 0.24, 0.45), (0.55, 0.10, 0.06), (0.58, 0.48, 0.10))[variant]
    return merge(
        mirrored(box((1.5, 0.0, 1.6), (0.14, 0.14, 3.2), STEEL)),
        box((0.0, 0.0, 4.2), (4.4, 0.18, 2.4), STEEL), box((0.0, 0.1, 4.2), (4.2, 0.02, 2.2), colour),
        box((-0.8, 0.115, 4.5), (2.0, 0.02, 0.4), WHITE), box((-0.5, 0.115, 3.8), (2.6, 0.02, 0.18), WHITE),
    )  # fmt: skip


def _rooftop_unit(variant: int) -> Mesh:
    """Return an air conditioner for a flat roof."""
    size = (1.8, 1.2, 1.1) if variant == 0 else (2.8, 1.6, 1.4)
    fans = [cylinder((x, 0.0, size[2]), (x, 0.0, size[2] + 0.1), (0.42, 0.42), BLACK, sides=10)
            for x in ((0.0,) if variant == 0 else (-0.7, 0.7))]  # fmt: skip
    return merge(box((0.0, 0.0, size[2] / 2), size, (0.48, 0.49, 0.49), 0.2), *fans)


def _water_tank() -> Mesh:
    return merge(
        *(box((x, y, 0.4), (0.12, 0.12, 0.8), STEEL) for x in (-0.7, 0.7) for y in (-0.7, 0.7)),
        cylinder((0.0, 0.0, 0.8), (0.0, 0.0, 2.6), (1.05, 1.05), (0.55, 0.55, 0.54), 0.4, sides=12),
        cylinder((0.0, 0.0, 2.6), (0.0, 0.0, 2.95), (1.05, 0.1), (0.50, 0.50, 0.49), 0.4, sides=12),
    )


def _gantry() -> Mesh:
    """Return a harbour crane, 30 m high, its boom ahead."""
    paint: LinearRgb = (0.07, 0.20, 0.42)
    legs = [limb((x, y, 0.0), (0.6 * x, y, 24.0), (0.55, 0.45), paint, 4) for x in (-7.0, 7.0) for y in (-6.0, 6.0)]
    return merge(
        *legs, *(box((0.0, y, 12.0), (10.0, 0.8, 0.9), paint) for y in (-6.0, 6.0)),
        box((0.0, 4.0, 24.6), (2.0, 44.0, 1.3), paint), box((0.0, -8.0, 26.6), (5.0, 7.0, 3.4), (0.60, 0.60, 0.58)),
        limb((0.0, -1.0, 25.0), (0.0, 0.0, 33.0), (0.5, 0.3), paint, 4),
        limb((0.0, 0.0, 33.0), (0.0, 23.0, 25.2), (0.12, 0.12), STEEL, 4),
        box((0.0, 14.0, 23.4), (2.2, 2.4, 1.4), YELLOW),
    )  # fmt: skip


def _silo() -> Mesh:
    return merge(
        cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 14.0), (2.6, 2.6), (0.56, 0.55, 0.52), 0.2, sides=16),
        cylinder((0.0, 0.0, 14.0), (0.0, 0.0, 15.6), (2.6, 0.4), (0.50, 0.50, 0.48), 0.2, sides=16),
        box((2.65, 0.0, 7.5), (0.12, 0.5, 15.0), STEEL),
    )


def _fountain() -> Mesh:
    angle = np.linspace(0.0, 2.0 * pi, 17)
    pool = [((0.0, 0.0, 0.36), (2.5 * cos(a), 2.5 * sin(a), 0.36), (2.5 * cos(b), 2.5 * sin(b), 0.36))
            for a, b in pairwise(angle)]  # fmt: skip
    return merge(
        limb((0.0, 0.0, 0.0), (0.0, 0.0, 0.5), (2.8, 2.8), (0.45, 0.43, 0.40), 16),
        limb((0.0, 0.0, 0.0), (0.0, 0.0, 0.5), (2.5, 2.5), (0.40, 0.38, 0.35), 16),
        flat(np.array(pool), (0.04, 0.14, 0.16), 0.8),
        cylinder((0.0, 0.0, 0.3), (0.0, 0.0, 1.0), (0.3, 0.2), (0.45, 0.43, 0.40), sides=8),
    )


VARIED: dict[str, tuple[Callable[[int], Mesh], int]] = {
    "bin": (cache(_bin), 3),
    "container": (cache(lambda variant: _container(variant, 6.06)), len(CONTAINERS)),
    "container_long": (cache(lambda variant: _container(variant, 12.19)), len(CONTAINERS)),
    "pallets": (cache(_pallets), 3),
    "crates": (cache(_crates), 4),
    "drums": (cache(_drums), 3),
    "tank": (cache(_tank), 2),
    "parasol": (cache(_parasol), 4),
    "stall": (cache(_stall), 3),
    "billboard": (cache(_billboard), 3),
    "rooftop_unit": (cache(_rooftop_unit), 2),
}
"""Builders of prop models with variants, by name, with their counts of variants."""

SINGLE: dict[str, Callable[[], Mesh]] = {
    "lamp": cache(_lamp),
    "park_lamp": cache(_park_lamp),
    "bench": cache(_bench),
    "bollard": cache(_bollard),
    "cone": cache(_cone),
    "hydrant": cache(_hydrant),
    "traffic_light": cache(_traffic_light),
    "bus_stop": cache(_bus_stop),
    "fence": cache(_fence),
    "chimney": cache(_chimney),
    "steam": cache(_steam),
    "water_tank": cache(_water_tank),
    "gantry": cache(_gantry),
    "silo": cache(_silo),
    "fountain": cache(_fountain),
}
"""Builders of prop models without variants, by name."""
