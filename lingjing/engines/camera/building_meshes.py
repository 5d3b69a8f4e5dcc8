"""Meshes of buildings: walls, on which a shader draws windows, and roofs.

A wall carries its facade as numbers (`_Facade`): the width of a bay, the height of a storey, and the share of glass
across and up. The shader draws the windows, so a tower has as few triangles as a hut. `colour.a` of a wall is its
gloss. `layer` of a wall holds the seed of the building, because walls need no layer.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from math import atan2, cos, sin

import numpy as np
import numpy.typing as npt
import shapely

from lingjing.engines.camera.facade_meshes import DWELLINGS, balconies, entrance
from lingjing.engines.camera.mesh_rows import (
    KEPT_MESHES,
    Floats,
    MeshPart,
    Style,
    faces,
    joined,
    oriented,
    prism,
    sheet,
    walls,
)
from lingjing.mission.appearance import LinearRgb
from lingjing.scene.city import Building


@dataclass(frozen=True, slots=True)
class _Facade:
    """The pattern of a wall."""

    bay_m: float
    """Width of a bay, metres."""
    across: float
    """Share of its width that is glass, 0..1."""
    up: float
    """Share of a storey's height that is glass, 0..1."""


FACADES: dict[str, _Facade] = {
    "punched": _Facade(3.2, 0.44, 0.50),
    "ribbon": _Facade(6.0, 0.97, 0.46),
    "curtain": _Facade(1.6, 0.90, 0.86),
    "blank": _Facade(8.0, 0.0, 0.0),
    "industrial": _Facade(5.0, 0.62, 0.20),
}
"""Facades by name; dimensions are chosen."""

DWELLING_BAY_M = 2.45
"""Width of a bay of houses and blocks of flats with single windows, metres: windows of 1.1 m (chosen)."""

PARAPET_M = 0.7
"""Height of the wall around a flat roof, metres (chosen)."""


@lru_cache(KEPT_MESHES)
def building(source: Building, number: int) -> tuple[MeshPart, MeshPart, MeshPart]:
    """Return (walls, roof, small details) of a building, all drawn with the id `number`."""
    eaves = source.top_m - (source.roof_m if source.roof != "flat" else 0.0)
    eaves = max(eaves, source.base_m + 0.3)
    style = _style(source, eaves)
    glass = 0.75 if source.facade == "curtain" else 0.25
    parapet = PARAPET_M if source.roof == "flat" and eaves - source.base_m > 4.0 and _roomy(source) else 0.0
    rings = [source.polygon, *source.holes]
    around = [
        walls(ring, source.base_m, eaves + parapet, source.colour, number, style=style, gloss=glass, inwards=k > 0)
        for k, ring in enumerate(rings)
    ]
    for part in around:
        part.vertices["layer"] = source.seed % 1024
    details = [_parapet(source, eaves, parapet, number)] if parapet else []
    if source.roof == "flat":
        details += _plant(source, eaves, number)
    if source.entrance is not None:
        details.append(entrance(source, number))
    details += balconies(source, eaves, style[1], number)
    return joined(around), _roof(source, eaves, number), joined(details)


def _style(sourcee: Building, eaves: float) -> Style:
    """Return (bay, storey, share of glass across, share up) of a building's walls."""
    look = FACADES.get(sourcee.facade, FACADES["punched"])
    storey = (eaves - sourcee.base_m) / max(sourcee.levels, 1)
    storey = storey if 2.2 <= storey <= 9.0 else 3.3
    bay_m = DWELLING_BAY_M if sourcee.use in DWELLINGS and look.across < 0.9 else look.bay_m
    return bay_m, storey, look.across, look.up


def _roomy(source: Building) -> bool:
    return float(shapely.Polygon(source.polygon, source.holes).buffer(-1.5).area) > 20.0


def _parapet(source: Building, eaves: float, height: float, number: int) -> MeshPart:
    """Return the inner side and the top of the wall around a flat roof."""
    shape = shapely.Polygon(source.polygon, source.holes)
    inner = shape.buffer(-0.35, join_style="mitre")
    colour = _mixed(source.colour, (0.5, 0.5, 0.5), 0.3)
    parts = []
    for part in shapely.get_parts(inner):
        for k, ring in enumerate((part.exterior, *part.interiors)):
            parts.append(walls(np.asarray(ring.coords)[:-1], eaves, eaves + height, colour, number, inwards=k == 0))
    for part in shapely.get_parts(shape.difference(inner)):
        rings = [np.asarray(ring.coords)[:-1] for ring in (part.exterior, *part.interiors)]
        parts.append(sheet(rings, eaves + height, colour, number))
    return joined(parts)


def _roof(source: Building, eaves: float, number: int) -> MeshPart:
    rise = source.top_m - eaves
    if source.roof == "flat" or rise < 0.2:
        return sheet([source.polygon, *source.holes], eaves, source.roof_colour, number)
    if source.roof in ("gabled", "hipped") and len(source.polygon) <= 6:
        return _ridged(source, eaves, rise, number)
    if source.roof == "dome":
        return _dome(source, eaves, rise, number)
    return _pyramid(source, eaves, rise, number)


def _plant(source: Building, eaves: float, number: int) -> list[MeshPart]:
    """Return what stands on a flat roof, lift houses and air plants, drawn from the building's seed."""
    shape = shapely.Polygon(source.polygon, source.holes)
    inner = shape.buffer(-3.0)
    if inner.is_empty or inner.area < 30.0 or source.use in ("house",):
        return []
    west, south, east, north = inner.bounds
    _, turn = _frame(source)
    boxes: list[MeshPart] = []
    chance = np.random.default_rng(source.seed & 0xFFFFFFFF)
    wanted = int(min(2 + inner.area / 350.0, 9))
    for k in range(wanted * 3):
        x, y = west + (east - west) * chance.random(), south + (north - south) * chance.random()
        lift = k == 0 and source.top_m - source.base_m > 12.0
        wide, deep, high = (4.5, 6.0, 3.2) if lift else (1.6 + 2.2 * chance.random(), 1.4 + chance.random(), 1.3)
        ring = _turned([(-wide / 2, -deep / 2), (wide / 2, -deep / 2), (wide / 2, deep / 2), (-wide / 2, deep / 2)],
                       (x, y), turn)  # fmt: skip
        if inner.contains(shapely.Polygon(ring)):
            grey = 0.32 + 0.2 * chance.random()
            colour = _mixed(source.colour, (grey, grey, grey), 0.25 if lift else 0.9)
            boxes.append(prism(ring, eaves, eaves + high, colour, number))
        if len(boxes) >= wanted:
            break
    return boxes


def _frame(source: Building) -> tuple[Floats, float]:
    """Return the centre and the direction (radians from east) of the longer side of the smallest enclosing
    rectangle."""
    box = shapely.Polygon(source.polygon).minimum_rotated_rectangle
    if not isinstance(box, shapely.Polygon):
        return np.asarray(source.polygon)[0], 0.0
    corners = np.asarray(box.exterior.coords)[:4]
    a, b = corners[1] - corners[0], corners[2] - corners[1]
    side = a if np.linalg.norm(a) >= np.linalg.norm(b) else b
    return corners.mean(axis=0), atan2(side[1], side[0])


def _turned(points: npt.ArrayLike, centre: npt.ArrayLike, turn: float) -> Floats:
    c, s = cos(turn), sin(turn)
    turned = np.asarray(points, np.float64) @ np.array([[c, s], [-s, c]])
    return np.asarray(turned + np.asarray(centre, np.float64))


def _ridged(source: Building, eaves: float, rise: float, number: int) -> MeshPart:
    """Return a gabled or hipped roof over the smallest rectangle around the outline, with half a metre of overhang."""
    box = shapely.Polygon(source.polygon).minimum_rotated_rectangle
    if not isinstance(box, shapely.Polygon):
        return sheet([source.polygon], eaves, source.roof_colour, number)
    corners = np.asarray(box.exterior.coords)[:4]
    centre, turn = _frame(source)
    local = _turned(corners - centre, (0.0, 0.0), -turn)
    half_long, half_wide = np.abs(local).max(axis=0) + 0.45
    ridge = half_long - (half_wide if source.roof == "hipped" else 0.0)
    ridge = max(ridge, 0.2)
    low, top = eaves - 0.15, eaves + rise
    a, b, c, d = ((-half_long, -half_wide), (half_long, -half_wide), (half_long, half_wide), (-half_long, half_wide))
    p, q = (-ridge, 0.0), (ridge, 0.0)
    three = [(a, b, q), (a, q, p), (c, d, p), (c, p, q), (b, c, q), (d, a, p)]
    heights = {a: low, b: low, c: low, d: low, p: top, q: top}
    place = np.array([[(*_turned([v], centre, turn)[0], heights[v]) for v in face] for face in three])
    colours = [source.roof_colour] * 4 + [source.roof_colour if source.roof == "hipped" else source.colour] * 2
    parts = [faces(face[None], colour, number) for face, colour in zip(place, colours, strict=True)]
    under = [_turned([v], centre, turn)[0] for v in (a, b, c, d)]
    return joined((*parts, sheet([under], low, _mixed(source.colour, (0.1, 0.1, 0.1), 0.4), number, down=True)))


def _pyramid(source: Building, eaves: float, rise: float, number: int) -> MeshPart:
    ring = oriented(source.polygon)
    tip = np.array([*_inner_point(ring), eaves + rise])
    low = np.column_stack([ring, np.full(len(ring), eaves)])
    high = np.roll(low, -1, axis=0)
    return faces(np.stack([low, high, np.broadcast_to(tip, low.shape)], axis=1), source.roof_colour, number)


def _dome(source: Building, eaves: float, rise: float, number: int) -> MeshPart:
    """Return a dome: the outline shrunk towards its middle along a quarter of an ellipse."""
    ring = oriented(source.polygon)
    middle = _inner_point(ring)
    steps = np.linspace(0.0, np.pi / 2, 7)
    rings = [np.column_stack([middle + (ring - middle) * cos(t), np.full(len(ring), eaves + rise * sin(t))])
             for t in steps]  # fmt: skip
    parts = []
    for low, high in pairwise(rings):
        low2, high2 = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
        parts.append(np.concatenate([np.stack([low, low2, high2], 1), np.stack([low, high2, high], 1)]))
    return faces(np.concatenate(parts), source.roof_colour, number, gloss=0.3)


def _inner_point(ring: Floats) -> Floats:
    shape = shapely.Polygon(ring)
    point = shape.centroid if shape.contains(shape.centroid) else shape.representative_point()
    return np.array([point.x, point.y])


def _mixed(a: LinearRgb, b: LinearRgb, share: float) -> LinearRgb:
    return (a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share, a[2] + (b[2] - a[2]) * share)


__all__ = ["FACADES", "building"]
