"""Models of the sea, waterline at z = 0: the lifeboat, boats, buoys and flotsam."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import cos, sin

import numpy as np

from lingjing.engines.camera.meshes import Mesh, box, cylinder, ellipsoid, flat, loft, merge, torus, two_sided
from lingjing.engines.camera.models.palette import (
    BLACK,
    GREY,
    HULL_BLUE,
    HULL_GREEN,
    ORANGE,
    RED,
    WHITE,
    WOOD,
    YELLOW,
)
from lingjing.mission.appearance import LinearRgb


def _hull(length: float, beam: float, depth: float, colour: LinearRgb, inside: LinearRgb, draught: float) -> Mesh:
    """Return an open hull: outer skin, inner skin, floor and gunwale; the stern is flat, the bow is a point."""
    stations = np.linspace(-0.5, 0.5, 9)
    shape = np.clip(1.0 - np.maximum(stations + 0.05, 0.0) ** 2 * 3.3 - np.maximum(-stations - 0.2, 0) * 0.35, 0.02, 1)
    outer, inner, rim = [], [], []
    for station, width in zip(stations, shape, strict=True):
        half, y = 0.5 * beam * float(width), float(station) * length
        sheer = depth - draught + 0.30 * depth * max(0.0, float(station)) ** 2 * 4.0
        thin = max(half - 0.09, 0.01)
        chine, low = 0.82 * half, -0.2 * draught
        outer.append((y, [(half, sheer), (chine, low), (0.0, -draught), (-chine, low), (-half, sheer)]))
        inner.append((y * 0.97, [(-thin, sheer), (-0.8 * thin, 0.10), (0.8 * thin, 0.10), (thin, sheer)]))
        rim.append((y, [(-half, sheer + 0.01), (-thin, sheer + 0.01), (thin, sheer + 0.01), (half, sheer + 0.01)]))
    edge = [[(y, ring[k : k + 2]) for y, ring in rim] for k in (0, 2)]
    back = [(p[0], outer[0][0], p[1]) for p in outer[0][1]]
    fan = [(back[0], back[k + 1], back[k]) for k in range(1, len(back) - 1)]
    return merge(
        loft([(y, ring[::-1]) for y, ring in outer[::-1]], colour, 0.3),
        loft(inner, inside),
        *(loft(side, WHITE) for side in edge),
        two_sided(flat(np.array(fan), colour)),
    )


@cache
def lifeboat() -> Mesh:
    """Return an 8 m orange rescue boat with a wheelhouse aft, a grey fender and a white foredeck."""
    fender = [
        cylinder((s * 1.36, -3.9, 0.75), (s * 1.36, 1.4, 0.85), (0.17, 0.17), GREY, sides=8) for s in (-1.0, 1.0)
    ] + [cylinder((s * 1.36, 1.4, 0.85), (s * 0.25, 4.0, 1.15), (0.17, 0.14), GREY, sides=8) for s in (-1.0, 1.0)]
    return merge(
        _hull(8.2, 2.7, 1.35, ORANGE, (0.55, 0.50, 0.44), 0.5),
        *fender,
        box((0.0, -1.2, 1.35), (1.7, 2.2, 1.5), ORANGE, 0.3),
        box((0.0, -0.05, 1.65), (1.5, 0.12, 0.6), (0.02, 0.04, 0.06), 0.9),
        box((0.0, -1.2, 1.65), (1.74, 1.6, 0.45), (0.02, 0.04, 0.06), 0.9),
        box((0.0, -1.2, 2.14), (1.9, 2.5, 0.10), WHITE),
        box((0.0, -1.2, 2.25), (0.25, 1.0, 0.12), ORANGE),
        cylinder((0.0, -1.9, 2.1), (0.0, -1.9, 3.6), (0.05, 0.03), GREY, sides=6),
        box((0.0, -1.9, 3.1), (1.0, 0.12, 0.12), WHITE),
        box((0.0, 1.6, 0.78), (1.5, 2.2, 0.08), WHITE),
        box((0.0, -3.9, 0.5), (0.9, 0.5, 1.2), BLACK, 0.3),
        torus((0.0, 1.4, 0.9), 0.36, 0.09, (ORANGE, WHITE, ORANGE, WHITE)),
    )


def _buoy(colour: LinearRgb) -> Callable[[], Mesh]:
    def build() -> Mesh:
        return merge(
            ellipsoid((0.0, 0.0, 0.12), (0.36, 0.36, 0.34), colour, 0.3, rows=8, sides=14),
            cylinder((0.0, 0.0, 0.4), (0.0, 0.0, 0.62), (0.07, 0.05), BLACK, sides=7),
            torus((0.0, 0.0, 0.66), 0.06, 0.02, (GREY,), sides=6),
        )

    return build


def _channel_buoy() -> Mesh:
    return merge(
        cylinder((0.0, 0.0, -0.4), (0.0, 0.0, 0.45), (0.75, 0.75), YELLOW, 0.2, sides=16),
        cylinder((0.0, 0.0, 0.45), (0.0, 0.0, 2.1), (0.45, 0.10), YELLOW, 0.2, sides=8),
        box((0.0, 0.0, 2.3), (0.5, 0.06, 0.06), BLACK),
        box((0.0, 0.0, 2.3), (0.06, 0.06, 0.5), BLACK),
    )


def _driftwood(variant: int) -> Mesh:
    length = 1.4 + 0.5 * variant
    return merge(
        cylinder((0.0, -length / 2, -0.03), (0.1, length / 2, 0.02), (0.14, 0.09), WOOD, sides=8),
        cylinder((0.03, 0.1, 0.03), (0.45, 0.4, 0.12), (0.05, 0.02), WOOD, sides=6),
        cylinder((0.0, -0.3, 0.0), (-0.35, -0.6, 0.16), (0.06, 0.03), (0.32, 0.24, 0.16), sides=6),
    )


def _crate() -> Mesh:
    slats = [box((0.0, 0.0, z), (0.84, 0.64, 0.05), (0.40, 0.26, 0.13)) for z in (0.0, 0.12, 0.24)]
    return merge(box((0.0, 0.0, -0.02), (0.8, 0.6, 0.5), (0.30, 0.19, 0.10)), *slats)


def _barrel(variant: int) -> Mesh:
    colour = (HULL_BLUE, RED, (0.10, 0.25, 0.10))[variant]
    return merge(cylinder((0.0, -0.45, 0.08), (0.0, 0.45, 0.08), (0.29, 0.29), colour, 0.3, sides=14))


def _jerrycan() -> Mesh:
    red: LinearRgb = (0.70, 0.06, 0.03)
    return merge(
        box((0.0, 0.0, 0.05), (0.34, 0.46, 0.20), red, 0.2),
        box((0.0, 0.28, 0.06), (0.10, 0.12, 0.10), BLACK),
        box((0.0, 0.0, 0.17), (0.06, 0.3, 0.05), red),
    )


def _seaweed(variant: int) -> Mesh:
    angles = [2.4 * k + variant for k in range(9)]
    return merge(
        *(
            ellipsoid((0.32 * k**0.5 * cos(a), 0.32 * k**0.5 * sin(a), 0.0), (0.42, 0.26, 0.035), (0.07, 0.08, 0.015),
                      rows=4, sides=8)
            for k, a in enumerate(angles)
        )
    )  # fmt: skip


def _tarpaulin(variant: int) -> Mesh:
    colour = ((0.05, 0.20, 0.42), (0.75, 0.30, 0.05))[variant]
    steps = np.linspace(-0.8, 0.8, 7)
    height = 0.06 + 0.05 * np.sin(3.1 * steps[:, None] + variant) * np.cos(4.3 * steps[None, :])
    sections = [(float(y), [(float(x * (1.0 - 0.15 * abs(y))), float(height[i, j])) for i, x in enumerate(steps)])
                for j, y in enumerate(steps)]  # fmt: skip
    return two_sided(loft(sections, colour, 0.2))


def _seats(beam: float, spots: tuple[float, ...], height: float) -> list[Mesh]:
    return [box((0.0, y, height), (beam * 0.86, 0.28, 0.05), WOOD) for y in spots]


def _rowing_boat(variant: int) -> Mesh:
    paint = (WHITE, HULL_GREEN, HULL_BLUE)[variant]
    return merge(_hull(4.2, 1.5, 0.7, paint, (0.34, 0.22, 0.12), 0.2), *_seats(1.5, (-1.2, 0.0, 1.0), 0.34))


def _dinghy(variant: int) -> Mesh:
    tube: LinearRgb = ((0.12, 0.12, 0.13), (0.60, 0.60, 0.58), ORANGE)[variant]
    sides = [cylinder((s * 0.72, -1.7, 0.18), (s * 0.72, 0.8, 0.22), (0.22, 0.22), tube, 0.2, 10) for s in (-1, 1)]
    bow = [cylinder((s * 0.72, 0.8, 0.22), (s * 0.12, 1.75, 0.34), (0.22, 0.20), tube, 0.2, 10) for s in (-1, 1)]
    return merge(
        *sides,
        *bow,
        box((0.0, -0.3, 0.08), (1.2, 2.9, 0.08), GREY),
        box((0.0, -0.5, 0.3), (1.1, 0.3, 0.06), WOOD),
        box((0.0, -1.8, 0.4), (0.4, 0.35, 0.8), BLACK, 0.4),
    )


def _fishing_boat(variant: int) -> Mesh:
    paint = (HULL_BLUE, HULL_GREEN, (0.40, 0.06, 0.05))[variant]
    return merge(
        _hull(9.5, 3.1, 1.8, paint, (0.36, 0.30, 0.22), 0.7),
        box((0.0, 1.1, 1.6), (1.9, 2.2, 1.9), WHITE, 0.2),
        box((0.0, 1.1, 2.0), (1.95, 2.25, 0.5), (0.02, 0.04, 0.06), 0.9),
        box((0.0, 1.1, 2.6), (2.2, 2.6, 0.12), (0.55, 0.12, 0.08)),
        cylinder((0.0, -0.3, 1.0), (0.0, -0.3, 5.2), (0.07, 0.05), WOOD, sides=7),
        cylinder((0.0, -0.3, 2.0), (0.0, -3.4, 4.0), (0.05, 0.04), WOOD, sides=6),
        box((0.5, -2.2, 0.5), (0.9, 1.1, 0.6), (0.12, 0.30, 0.42)),
        box((-0.6, -3.1, 0.45), (0.8, 0.8, 0.5), (0.45, 0.30, 0.12)),
    )


def _sailboat() -> Mesh:
    deck = [(0.0, -3.6), (1.1, -2.6), (1.2, 0.0), (0.75, 2.4), (0.0, 3.9), (-0.75, 2.4), (-1.2, 0.0), (-1.1, -2.6)]
    fan = [((0.0, 0.0, 0.92), (*deck[k], 0.85), (*deck[(k + 1) % 8], 0.85)) for k in range(8)]
    return merge(
        _hull(8.4, 2.6, 1.5, WHITE, (0.5, 0.36, 0.2), 0.6),
        flat(fan, (0.52, 0.36, 0.20)),
        box((0.0, 0.6, 1.05), (1.3, 2.4, 0.45), WHITE, 0.3),
        cylinder((0.0, 1.2, 0.9), (0.0, 1.2, 10.5), (0.08, 0.05), (0.55, 0.55, 0.56), 0.6, sides=7),
        cylinder((0.0, 1.1, 2.0), (0.0, -2.6, 2.0), (0.06, 0.05), (0.55, 0.55, 0.56), 0.4, sides=7),
        cylinder((0.0, 1.0, 2.15), (0.0, -2.4, 2.12), (0.16, 0.12), HULL_BLUE, sides=8),
    )


def _life_ring() -> Mesh:
    return torus((0.0, 0.0, 0.04), 0.31, 0.085, (ORANGE, WHITE) * 4)


VARIED: dict[str, tuple[Callable[[int], Mesh], int]] = {
    "driftwood": (cache(_driftwood), 3),
    "barrel": (cache(_barrel), 3),
    "seaweed": (cache(_seaweed), 4),
    "tarpaulin": (cache(_tarpaulin), 2),
    "rowing_boat": (cache(_rowing_boat), 3),
    "dinghy": (cache(_dinghy), 3),
    "fishing_boat": (cache(_fishing_boat), 3),
}
"""Builders of prop models with variants, by name, with their counts of variants."""

SINGLE: dict[str, Callable[[], Mesh]] = {
    "buoy_orange": cache(_buoy(ORANGE)),
    "buoy_red": cache(_buoy(RED)),
    "buoy_yellow": cache(_channel_buoy),
    "life_ring": cache(_life_ring),
    "crate": cache(_crate),
    "jerrycan": cache(_jerrycan),
    "sailboat": cache(_sailboat),
}
"""Builders of prop models without variants, by name."""
