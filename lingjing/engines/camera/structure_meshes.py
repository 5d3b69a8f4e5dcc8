"""Meshes of bridges, slopes, solids and pipes: decks with parapets on piers, slabs, prisms, and tubes on supports."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import shapely

from lingjing.engines.camera.ground import MATERIALS
from lingjing.engines.camera.ground import SURFACES as GROUND
from lingjing.engines.camera.mesh_rows import (
    KEPT_MESHES,
    Floats,
    MeshPart,
    faces,
    joined,
    oriented,
    prism,
    sheet,
    walls,
)
from lingjing.engines.camera.meshes import cylinder, vector_of
from lingjing.mission.appearance import LinearRgb
from lingjing.scene.city import Bridge, Pipe, Slope, Solid

# Linear colours (chosen).
CONCRETE: LinearRgb = (0.36, 0.355, 0.34)
RAIL: LinearRgb = (0.42, 0.42, 0.41)
STEEL: LinearRgb = (0.34, 0.36, 0.38)
PARAPET_M, PARAPET_WIDE_M = 1.0, 0.25
"""Height and width of a bridge's parapet, metres (chosen)."""

CLEARANCE_M = 0.02
"""Depth of a deck below the road on it, metres (chosen)."""
GroundBelow = Callable[[float, float], float]
"""Function from a place (east, north) to the elevation of the ground that carries a pier there."""


def bridge(source: Bridge, number: int, under: GroundBelow) -> MeshPart:
    """Return deck, parapets and piers; the deck's top lies slightly below the road on it."""
    path = np.asarray(source.path, np.float64)
    left, right = _sides(path, source.width_m / 2.0)
    top = np.array([0.0, 0.0, -CLEARANCE_M])
    deck = _slab(left + top, right + top, source.thickness_m, number)
    inner_left, inner_right = _sides(path, source.width_m / 2.0 - PARAPET_WIDE_M)
    rise = np.array([0.0, 0.0, PARAPET_M])
    rails = [_slab(left + rise, inner_left + rise, PARAPET_M, number, RAIL),
             _slab(inner_right + rise, right + rise, PARAPET_M, number, RAIL)]  # fmt: skip
    return joined((deck, *rails, *_piers(source, path, number, under)))


def _sides(path: Floats, half: float) -> tuple[Floats, Floats]:
    """Return the lines to the left and right of a path."""
    step = np.diff(path[:, :2], axis=0)
    side = np.column_stack([-step[:, 1], step[:, 0]]) / np.maximum(np.linalg.norm(step, axis=1), 1e-6)[:, None]
    mitre = np.concatenate([side[:1], side[:-1] + side[1:], side[-1:]])
    mitre /= np.maximum(np.linalg.norm(mitre, axis=1, keepdims=True), 1e-6)
    offset = np.column_stack([mitre * half, np.zeros(len(path))])
    return path + offset, path - offset


def _slab(left: Floats, right: Floats, thickness: float, number: int, colour: LinearRgb = CONCRETE) -> MeshPart:
    """Return a slab along a pair of lines: top, bottom, sides and both ends."""
    drop = np.array([0.0, 0.0, -thickness])
    a, b, c, d = left, right, right + drop, left + drop
    sides = [_skin(p, q) for p, q in ((a, b), (b, c), (c, d), (d, a))]
    ends = [[[a[0], d[0], c[0]], [a[0], c[0], b[0]]], [[a[-1], b[-1], c[-1]], [a[-1], c[-1], d[-1]]]]
    return faces(np.concatenate([*sides, *(np.array(end) for end in ends)]), colour, number)


def _skin(p: Floats, q: Floats) -> Floats:
    return np.concatenate([np.stack([p[:-1], q[:-1], q[1:]], 1), np.stack([p[:-1], q[1:], p[1:]], 1)])


def _piers(source: Bridge, path: Floats, number: int, under: GroundBelow) -> list[MeshPart]:
    line = shapely.LineString(path[:, :2])
    if source.pier_spacing_m <= 0 or line.length < 1.0:
        return []
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1))])
    count = int(line.length // source.pier_spacing_m) + 1
    piers = []
    for at in (np.arange(count) + 0.5) * line.length / count:
        x, y, z = (float(np.interp(at, along, path[:, k])) for k in range(3))
        foot = under(x, y) - 1.5
        head = z - source.thickness_m
        if head - foot < 3.0:
            continue
        ahead = np.asarray(line.interpolate(min(at + 0.5, line.length)).coords[0]) - (x, y)
        ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-6) if at + 0.5 < line.length else np.array([1.0, 0.0])
        across = np.array([-ahead[1], ahead[0]])
        wide = min(0.62 * source.width_m, source.width_m - 0.6) / 2.0
        cap = _block((x, y), ahead, across, 1.0, wide, number, head - 1.2, head)
        legs = [0.0] if source.width_m < 11.0 else [-0.55 * wide, 0.55 * wide]
        piers += [cap, *(
            _block(np.array([x, y]) + across * leg, ahead, across, 0.75, 0.9, number, foot, head - 1.2) for leg in legs
        )]  # fmt: skip
    return piers


def _block(centre: npt.ArrayLike, ahead: Floats, across: Floats, deep: float, wide: float, number: int,
           base: float, top: float) -> MeshPart:  # fmt: skip
    at = np.asarray(centre, np.float64)
    ring = [at + ahead * deep + across * wide, at - ahead * deep + across * wide, at - ahead * deep - across * wide,
            at + ahead * deep - across * wide]  # fmt: skip
    return prism(oriented(ring), base, top, CONCRETE, number)


@lru_cache(KEPT_MESHES)
def solid(source: Solid, number: int) -> MeshPart:
    """Return a prism of the solid's material."""
    colour = MATERIALS.get(source.material, GROUND["concrete"][0])
    ring = oriented(source.polygon)
    return joined((walls(ring, source.base_m, source.top_m, colour, number),
                   sheet([ring], source.top_m, colour, number)))  # fmt: skip


def slope(source: Slope, number: int) -> MeshPart:
    """Return a slab with an inclined top."""
    colour = MATERIALS.get(source.material, CONCRETE)
    top = np.asarray(source.top, np.float64)
    if np.sum(top[:, 0] * np.roll(top[:, 1], -1) - np.roll(top[:, 0], -1) * top[:, 1]) < 0:
        top = top[::-1]
    low = top - (0.0, 0.0, source.thickness_m)
    fan = [(top[0], top[k], top[k + 1]) for k in range(1, len(top) - 1)]
    return faces(np.concatenate([np.array(fan), _outside(low, top)]), colour, number)


def _outside(low: Floats, top: Floats) -> Floats:
    low2, top2 = np.roll(low, -1, axis=0), np.roll(top, -1, axis=0)
    return np.concatenate([np.stack([low, low2, top2], 1), np.stack([low, top2, top], 1)])


def pipe(source: Pipe, number: int) -> MeshPart:
    """Return a tube along a path with flanges, on supports where it runs above the ground."""
    parts = []
    radius = source.radius_m
    for a, b in pairwise(source.path):
        start, end = np.asarray(a, np.float64), np.asarray(b, np.float64)
        length = float(np.linalg.norm(end - start))
        if length < 0.05:
            continue
        parts.append(_tube(start, end, radius, STEEL, number))
        for share in np.arange(0.5, max(length // 6.0, 1.0)) / max(length // 6.0, 1.0):
            at = start + (end - start) * share
            along = (end - start) / length
            parts.append(_tube(at - along * 0.1, at + along * 0.1, radius * 1.25, (0.16, 0.17, 0.18), number))
            if at[2] - radius > 0.3 and abs(along[2]) < 0.5:
                foot = (float(at[0]), float(at[1]), 0.0)
                parts.append(_tube(np.array(foot), at, 0.12, (0.20, 0.20, 0.21), number))
    return joined(parts)


def _tube(start: Floats, end: Floats, radius: float, colour: LinearRgb, number: int) -> MeshPart:
    mesh = cylinder(vector_of(start), vector_of(end), (radius, radius), colour, 0.4, sides=10)
    part = faces(mesh[:, :3], colour, number, gloss=0.4)
    if len(part.vertices) == len(mesh):
        part.vertices["normal"] = mesh[:, 3:6]
    return part
