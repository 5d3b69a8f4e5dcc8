"""Buildings → walls that a shader gives windows, and roofs.

A wall carries its facade as numbers (`Facade`): the width of a bay and the height of a storey, how much of a bay is
glass across and up; the shader draws the windows, so that a tower is as many triangles as a hut. `colour.a` of a wall
is its gloss; the seed of a building rides in `layer`, which walls do not need.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from math import atan2, cos, sin

import numpy as np
import numpy.typing as npt
import shapely

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
from lingjing.scene.camera_geometry import heading_vector
from lingjing.scene.city import Building


@dataclass(frozen=True, slots=True)
class Facade:
    """Width of a bay (m), share of it that is glass across and up (0..1; 0: none)."""

    bay_m: float
    across: float
    up: float


FACADES: dict[str, Facade] = {
    "punched": Facade(3.2, 0.44, 0.50),
    "ribbon": Facade(6.0, 0.97, 0.46),
    "curtain": Facade(1.6, 0.90, 0.86),
    "blank": Facade(8.0, 0.0, 0.0),
    "industrial": Facade(5.0, 0.62, 0.20),
}
PARAPET_M = 0.7


@lru_cache(KEPT_MESHES)
def building(given: Building, number: int) -> tuple[MeshPart, MeshPart, MeshPart]:
    """(walls, roof, small details) of a building, all with the id `number`."""
    eaves = given.top_m - (given.roof_m if given.roof != "flat" else 0.0)
    eaves = max(eaves, given.base_m + 0.3)
    style = _style(given, eaves)
    glass = 0.75 if given.facade == "curtain" else 0.25
    parapet = PARAPET_M if given.roof == "flat" and eaves - given.base_m > 4.0 and _roomy(given) else 0.0
    rings = [given.polygon, *given.holes]
    around = [
        walls(ring, given.base_m, eaves + parapet, given.colour, number, style=style, gloss=glass, inwards=k > 0)
        for k, ring in enumerate(rings)
    ]
    for part in around:
        part.vertices["layer"] = given.seed % 1024
    details = [_parapet(given, eaves, parapet, number)] if parapet else []
    if given.roof == "flat":
        details += _plant(given, eaves, number)
    if given.entrance is not None:
        details.append(_entrance(given, number))
    return joined(around), _roof(given, eaves, number), joined(details)


def _style(given: Building, eaves: float) -> Style:
    """(bay, storey, share of glass across, up)."""
    look = FACADES.get(given.facade, FACADES["punched"])
    storey = (eaves - given.base_m) / max(given.levels, 1)
    storey = storey if 2.2 <= storey <= 9.0 else 3.3
    return look.bay_m, storey, look.across, look.up


def _roomy(given: Building) -> bool:
    return float(shapely.Polygon(given.polygon, given.holes).buffer(-1.5).area) > 20.0


def _parapet(given: Building, eaves: float, height: float, number: int) -> MeshPart:
    """The inner side and the top of the wall around a flat roof."""
    shape = shapely.Polygon(given.polygon, given.holes)
    inner = shape.buffer(-0.35, join_style="mitre")
    colour = _mixed(given.colour, (0.5, 0.5, 0.5), 0.3)
    parts = []
    for one in shapely.get_parts(inner):
        for k, ring in enumerate((one.exterior, *one.interiors)):
            parts.append(walls(np.asarray(ring.coords)[:-1], eaves, eaves + height, colour, number, inwards=k == 0))
    for one in shapely.get_parts(shape.difference(inner)):
        rings = [np.asarray(ring.coords)[:-1] for ring in (one.exterior, *one.interiors)]
        parts.append(sheet(rings, eaves + height, colour, number))
    return joined(parts)


def _roof(given: Building, eaves: float, number: int) -> MeshPart:
    rise = given.top_m - eaves
    if given.roof == "flat" or rise < 0.2:
        return sheet([given.polygon, *given.holes], eaves, given.roof_colour, number)
    if given.roof in ("gabled", "hipped") and len(given.polygon) <= 6:
        return _ridged(given, eaves, rise, number)
    if given.roof == "dome":
        return _dome(given, eaves, rise, number)
    return _pyramid(given, eaves, rise, number)


def _plant(given: Building, eaves: float, number: int) -> list[MeshPart]:
    """What stands on a flat roof: lift houses and air plants, by the building's seed."""
    shape = shapely.Polygon(given.polygon, given.holes)
    inner = shape.buffer(-3.0)
    if inner.is_empty or inner.area < 30.0 or given.use in ("house",):
        return []
    west, south, east, north = inner.bounds
    _, turn = _frame(given)
    found: list[MeshPart] = []
    chance = np.random.default_rng(given.seed & 0xFFFFFFFF)
    wanted = int(min(2 + inner.area / 350.0, 9))
    for k in range(wanted * 3):
        x, y = west + (east - west) * chance.random(), south + (north - south) * chance.random()
        lift = k == 0 and given.top_m - given.base_m > 12.0
        wide, deep, high = (4.5, 6.0, 3.2) if lift else (1.6 + 2.2 * chance.random(), 1.4 + chance.random(), 1.3)
        ring = _turned([(-wide / 2, -deep / 2), (wide / 2, -deep / 2), (wide / 2, deep / 2), (-wide / 2, deep / 2)],
                       (x, y), turn)  # fmt: skip
        if inner.contains(shapely.Polygon(ring)):
            grey = 0.32 + 0.2 * chance.random()
            colour = _mixed(given.colour, (grey, grey, grey), 0.25 if lift else 0.9)
            found.append(prism(ring, eaves, eaves + high, colour, number))
        if len(found) >= wanted:
            break
    return found


def _frame(given: Building) -> tuple[Floats, float]:
    """The centre and the direction (radians from east) of the longer side of the smallest rectangle around."""
    box = shapely.Polygon(given.polygon).minimum_rotated_rectangle
    if not isinstance(box, shapely.Polygon):
        return np.asarray(given.polygon)[0], 0.0
    corners = np.asarray(box.exterior.coords)[:4]
    a, b = corners[1] - corners[0], corners[2] - corners[1]
    side = a if np.linalg.norm(a) >= np.linalg.norm(b) else b
    return corners.mean(axis=0), atan2(side[1], side[0])


def _turned(points: npt.ArrayLike, centre: npt.ArrayLike, turn: float) -> Floats:
    c, s = cos(turn), sin(turn)
    turned = np.asarray(points, np.float64) @ np.array([[c, s], [-s, c]])
    return np.asarray(turned + np.asarray(centre, np.float64))


def _ridged(given: Building, eaves: float, rise: float, number: int) -> MeshPart:
    """A gabled or hipped roof over the smallest rectangle around the outline, with half a metre of overhang."""
    box = shapely.Polygon(given.polygon).minimum_rotated_rectangle
    if not isinstance(box, shapely.Polygon):
        return sheet([given.polygon], eaves, given.roof_colour, number)
    corners = np.asarray(box.exterior.coords)[:4]
    centre, turn = _frame(given)
    local = _turned(corners - centre, (0.0, 0.0), -turn)
    half_long, half_wide = np.abs(local).max(axis=0) + 0.45
    ridge = half_long - (half_wide if given.roof == "hipped" else 0.0)
    ridge = max(ridge, 0.2)
    low, top = eaves - 0.15, eaves + rise
    a, b, c, d = ((-half_long, -half_wide), (half_long, -half_wide), (half_long, half_wide), (-half_long, half_wide))
    p, q = (-ridge, 0.0), (ridge, 0.0)
    three = [(a, b, q), (a, q, p), (c, d, p), (c, p, q), (b, c, q), (d, a, p)]
    heights = {a: low, b: low, c: low, d: low, p: top, q: top}
    place = np.array([[(*_turned([v], centre, turn)[0], heights[v]) for v in face] for face in three])
    colours = [given.roof_colour] * 4 + [given.roof_colour if given.roof == "hipped" else given.colour] * 2
    parts = [faces(face[None], colour, number) for face, colour in zip(place, colours, strict=True)]
    under = [_turned([v], centre, turn)[0] for v in (a, b, c, d)]
    return joined((*parts, sheet([under], low, _mixed(given.colour, (0.1, 0.1, 0.1), 0.4), number, down=True)))


def _pyramid(given: Building, eaves: float, rise: float, number: int) -> MeshPart:
    ring = oriented(given.polygon)
    tip = np.array([*_inner_point(ring), eaves + rise])
    low = np.column_stack([ring, np.full(len(ring), eaves)])
    high = np.roll(low, -1, axis=0)
    return faces(np.stack([low, high, np.broadcast_to(tip, low.shape)], axis=1), given.roof_colour, number)


def _dome(given: Building, eaves: float, rise: float, number: int) -> MeshPart:
    """The outline shrunk towards its middle along a quarter of an ellipse."""
    ring = oriented(given.polygon)
    middle = _inner_point(ring)
    steps = np.linspace(0.0, np.pi / 2, 7)
    rings = [np.column_stack([middle + (ring - middle) * cos(t), np.full(len(ring), eaves + rise * sin(t))])
             for t in steps]  # fmt: skip
    parts = []
    for low, high in pairwise(rings):
        low2, high2 = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
        parts.append(np.concatenate([np.stack([low, low2, high2], 1), np.stack([low, high2, high], 1)]))
    return faces(np.concatenate(parts), given.roof_colour, number, gloss=0.3)


def _inner_point(ring: Floats) -> Floats:
    shape = shapely.Polygon(ring)
    point = shape.centroid if shape.contains(shape.centroid) else shape.representative_point()
    return np.array([point.x, point.y])


def _entrance(given: Building, number: int) -> MeshPart:
    """A door with a canopy on the wall."""
    assert given.entrance is not None
    x, y, bearing = given.entrance
    out, right = np.array(heading_vector(bearing)), np.array(heading_vector(bearing + 90.0))
    at = np.array([x, y])
    wide = 1.1 if given.use in ("house", "residential") else 2.0
    glass: LinearRgb = (0.03, 0.045, 0.055)
    door = [at - right * wide, at + right * wide, at + right * wide + out * 0.12, at - right * wide + out * 0.12]
    roof = [at - right * (wide + 0.5), at + right * (wide + 0.5), at + right * (wide + 0.5) + out * 1.6,
            at - right * (wide + 0.5) + out * 1.6]  # fmt: skip
    base = given.base_m
    return joined((
        prism(oriented(door), base, base + 2.5, glass, number, gloss=0.6),
        prism(oriented(roof), base + 2.8, base + 3.0, _mixed(given.colour, (0.2, 0.2, 0.2), 0.5), number),
    ))  # fmt: skip


def _mixed(a: LinearRgb, b: LinearRgb, share: float) -> LinearRgb:
    return (a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share, a[2] + (b[2] - a[2]) * share)


__all__ = ["FACADES", "building"]
