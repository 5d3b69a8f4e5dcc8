"""A fractured span: jagged ends with bent rods at both sides of the gap, a hanging slab, and rubble below."""

from __future__ import annotations

from functools import cache

import numpy as np

from lingjing.engines.camera.effects.particles import BLOT, Effects, EffectSolid, ahead, chance, decal
from lingjing.engines.camera.instances import matrix
from lingjing.engines.camera.mesh_rows import Floats
from lingjing.engines.camera.meshes import Mesh, box, merge, prism
from lingjing.engines.camera.models.shapes import at, limb, turned
from lingjing.mission.appearance import LinearRgb

# Linear colours (chosen).
BROKEN: LinearRgb = (0.46, 0.43, 0.39)
ASPHALT: LinearRgb = (0.055, 0.055, 0.058)
ROD: LinearRgb = (0.16, 0.06, 0.03)
SOIL: LinearRgb = (0.02, 0.02, 0.02)
TEETH = 9
"""Number of jagged pieces at each end (chosen)."""


def fracture(
    seed: int, place: Floats, heading_deg: float, gap_m: float, width_m: float, thickness_m: float, drop_m: float
) -> Effects:
    """Return the effects of a gap of `gap_m` in a deck along the heading.

    The deck's top is at `place`, and the rubble lies `drop_m` below it.
    """
    shape = (seed % 8, round(gap_m, 1), round(width_m, 1), round(thickness_m, 1), round(drop_m, 0))
    where = (float(place[0]), float(place[1]), float(place[2]))
    rows = matrix(where, heading_deg, 0.0, 0.0)
    key = "fracture-" + "-".join(str(part) for part in shape)
    along = ahead(heading_deg)[1]
    cracks = []
    for s in (-1.0, 1.0):
        middle = place + along * s * (0.5 * gap_m + 0.5)
        spot = (float(middle[0]), float(middle[1]), float(middle[2]) + 0.03)
        cracks.append(decal(spot, (0.55 * width_m, 1.2), heading_deg, SOIL, 0.7, BLOT, seed % 50 + s))
    return Effects(decals=np.concatenate(cracks), solids=(EffectSolid(key, rubble(*shape), rows, float(place[2])),))


@cache
def rubble(variant: int, gap_m: float, width_m: float, thickness_m: float, drop_m: float) -> Mesh:
    """Return the mesh of the whole fracture: the origin is the deck's top in the middle of the gap, y along the
    bridge."""
    return merge(
        *(_edge(variant, side, gap_m, width_m, thickness_m) for side in (-1.0, 1.0)),
        _slab(variant, gap_m, width_m, thickness_m),
        _debris(variant, gap_m, width_m, drop_m),
    )


def _edge(variant: int, side: float, gap: float, width: float, thick: float) -> Mesh:
    reach = 0.25 + 1.35 * chance(variant, 10 + int(side), TEETH)
    pieces = []
    for k in range(TEETH):
        x = -0.5 * width + (k + 0.5) * width / TEETH
        long, step = float(reach[k]), width / TEETH * 1.02
        y = side * (0.5 * gap - 0.5 * long + 0.2)
        sag = -0.10 * (k % 3)
        tilt = side * (3.0 + 4.0 * (k % 2))
        half, rough = 0.5 * (long + 0.4), chance(variant, 40 + 2 * k + int(side), 4)
        tip = [(0.5 * step, 0.1 * half), (0.3 * step * float(rough[0]), half * (0.7 + 0.5 * float(rough[1]))),
               (-0.5 * step, half * (0.9 * float(rough[2]) - 0.2))]  # fmt: skip
        ring = [(-0.5 * step, -half), (0.5 * step, -half), *tip]
        if side > 0.0:
            ring = [(-x, -y) for x, y in ring]
        tooth = merge(prism(ring, -0.96 * thick, -0.05, BROKEN), prism(ring, -0.05, 0.02, ASPHALT))
        pieces.append(turned(tooth, at((x, y, sag), 0.0, tilt)))
        end = side * (0.5 * gap - long - 0.75 - 0.3 * (k % 2))
        pieces.append(
            limb((x, y, -0.35 * thick), (x + 0.25 * ((k % 3) - 1), end, -0.6 * thick - 0.3), (0.05, 0.04), ROD, 4)
        )
    return merge(*pieces)


def _slab(variant: int, gap: float, width: float, thick: float) -> Mesh:
    """Return a third of the deck that hangs down from one end."""
    side = 1.0 if variant % 2 else -1.0
    long, wide = 0.78 * gap, 0.52 * width
    slab = merge(
        box((0.0, -0.5 * long, -0.35 * thick), (wide, long, 0.6 * thick), BROKEN),
        box((0.0, -0.5 * long, -0.03), (wide * 0.99, long * 0.99, 0.05), ASPHALT),
        *(
            box((0.15 * wide, -(0.2 + 0.3 * k) * long, 0.005), (0.18, 0.16 * long, 0.03), (0.62, 0.62, 0.60))
            for k in range(3)
        ),
    )
    hung = turned(slab, at((0.0, 0.0, 0.0), 0.0, 38.0))
    if side < 0.0:
        hung = turned(hung, at((0.0, 0.0, 0.0), 180.0))
    return turned(hung, at((0.16 * width * (1 if variant % 3 else -1), side * (0.5 * gap - 0.2), -0.15)))


def _debris(variant: int, gap: float, width: float, drop: float) -> Mesh:
    """Return slabs and lumps that stick out of the water or lie on the ground."""
    count = 12
    x, y, size, turn = (chance(variant, salt, count) for salt in (21, 22, 23, 24))
    pieces = []
    for k in range(count):
        big = 0.7 + 2.1 * float(size[k])
        lump = box((0.0, 0.0, 0.0), (big, 0.8 * big, 0.35 * big + 0.2), BROKEN if k % 3 else ASPHALT)
        place = ((float(x[k]) - 0.5) * 0.95 * width, (float(y[k]) - 0.5) * (gap - 0.6), -drop + 0.12 * big)
        pieces.append(
            turned(lump, at(place, 360.0 * float(turn[k]), 26.0 * (float(size[k]) - 0.4), 30.0 * (float(x[k]) - 0.5)))
        )
    return merge(*pieces)
