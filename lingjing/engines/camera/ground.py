"""The ground of a city: meshes by class, solids with the plane of their shadows, and the shore map.

Natural land (`sand`, `grass`, `rock`) is a height field. It rises from just below the water at the polygon's edge to
`top_m`. The polygon is its outermost extent, and the top is flat except for a relief of a tenth. Concrete is a prism
with quay walls, exactly as high as the city declares.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import lru_cache

import msgspec
import numpy as np
import numpy.typing as npt
import shapely
from scipy import ndimage  # always, since a trace names the libraries of each process, whatever the cache holds

from lingjing.engines.camera.array_cache import cached_array
from lingjing.engines.camera.classes import CLASSES, prop_class
from lingjing.engines.camera.meshes import Mesh, flat, indexed, merge, prism
from lingjing.mission.appearance import LinearRgb
from lingjing.mission.geometry2d import Polygon
from lingjing.scene.city import City, Land

SURFACES: dict[str, tuple[LinearRgb, float]] = {
    "sand": ((0.42, 0.33, 0.21), 1.0 / 14.0),
    "grass": ((0.085, 0.12, 0.035), 1.0 / 5.0),
    "rock": ((0.17, 0.155, 0.14), 1.0 / 1.4),
    "concrete": ((0.30, 0.30, 0.29), 1.0),
}
"""Linear colour and slope of the edge for each surface (chosen)."""

MATERIALS: dict[str, LinearRgb] = {
    "wood": (0.26, 0.17, 0.10),
    "plaster": (0.62, 0.57, 0.48),
    "tile": (0.36, 0.11, 0.06),
    "metal": (0.34, 0.38, 0.42),
    "iron": (0.05, 0.05, 0.055),
    "white": (0.80, 0.80, 0.78),
    "red": (0.55, 0.04, 0.03),
    "blue": (0.05, 0.13, 0.30),
    "green": (0.05, 0.17, 0.10),
    "paint": (0.62, 0.46, 0.08),
}
"""Linear colours of materials of solids (chosen)."""

SHORE_SIZE = 1024
"""Side of the shore map, texels (chosen)."""

PATCH_CELLS = 24
"""Side of a patch, cells of the height field (chosen)."""

BURIED_M = 3.0
"""Distance behind the slope of a higher land from which lower land below it cannot show, metres (chosen)."""

SHORE_REACH_M = 160.0
"""Largest distance to land that the shore map holds, metres (chosen)."""

FLAT_M = 0.3
"""Height up to which a land of a town belongs to its even ground, metres (chosen)."""

HeightGrid = npt.NDArray[np.floating]


@dataclass(frozen=True, slots=True)
class _Patch:
    """A piece of ground that is drawn or culled as a whole."""

    triangles: npt.NDArray[np.uint32]
    """Triangles (n, 3) of indices of the land's vertices."""
    centre: npt.NDArray[np.float64]
    """Centre of the bounding sphere, metres."""
    radius: float
    """Radius of the bounding sphere, metres."""


@dataclass(frozen=True, slots=True)
class LandSurface:
    """The ground of one land."""

    cls: int
    """Class id."""
    vertices: Mesh
    """Vertices (n, 10) as in `meshes`."""
    patches: tuple[_Patch, ...]
    """Patches."""


@dataclass(frozen=True, slots=True)
class Ground:
    """The static meshes of a city's ground."""

    level_m: float
    """Elevation of the open water, metres."""
    surfaces: tuple[LandSurface, ...]
    """The ground of every land."""
    solids: tuple[tuple[float, Mesh], ...]
    """Meshes of the solids, by the elevation of the plane of their shadows."""
    shore: npt.NDArray[np.uint8]
    """The shore map, (SHORE_SIZE, SHORE_SIZE, 2) bytes."""
    bounds: tuple[float, float, float, float]
    """Extent of the city: west, south, east, north; metres."""


def water_level(city: City) -> float:
    """Return the elevation of the open water; the datum if the city has no water."""
    return city.waters[0].level_m if city.waters else city.datum_m


def build_ground(city: City, noise: npt.NDArray[np.uint8], town: bool = False) -> Ground:
    """Return all static geometry of a city. For a town it holds only lands that rise over its `town_ground`."""
    level = water_level(city)
    shown = msgspec.structs.replace(city, lands=tuple(land for land in city.lands if not is_flat(land)))
    surfaces = _surfaces(shown if town else city, level)
    solids = () if town else _solids(city, level)
    return Ground(level, surfaces, solids, _shore_map(city, noise), city.bounds)


def is_flat(land: Land) -> bool:
    """Return whether a land of a town belongs to its even ground."""
    return abs(land.top_m) <= FLAT_M


def height_under(city: City, east: float, north: float) -> float:
    """Return the elevation of the highest land at a point, or else of the water."""
    tops = [land.top_m for land in city.lands if shapely.contains_xy(_area(land.polygon), east, north)]
    return max(tops, default=water_level(city))


@lru_cache(64)
def _area(polygon: Polygon) -> shapely.Polygon:
    """Return the polygon of a land. It is cached: every body of every picture needs the same few lands."""
    return shapely.Polygon(polygon)


def fill(polygon: Polygon, xs: HeightGrid, ys: HeightGrid) -> npt.NDArray[np.bool_]:
    """Return the grid points (len(ys), len(xs)) inside a polygon by the even-odd rule."""
    a = np.array(polygon)
    b = np.roll(a, -1, axis=0)
    mask = np.zeros((len(ys), len(xs)), bool)
    for row, y in enumerate(ys):
        hit = (a[:, 1] > y) != (b[:, 1] > y)
        if hit.any():
            p, q = a[hit], b[hit]
            crossings = np.sort(p[:, 0] + (y - p[:, 1]) * (q[:, 0] - p[:, 0]) / (q[:, 1] - p[:, 1]))
            mask[row] = np.searchsorted(crossings, xs) % 2 == 1
    return mask


def _surfaces(city: City, level: float) -> tuple[LandSurface, ...]:
    return tuple(
        _quay(land, level) if land.surface == "concrete" else _height_field(land, level, number, _buried(city, land))
        for number, land in enumerate(city.lands)
    )


def _quay(land: Land, level: float) -> LandSurface:
    mesh = _prism(land.polygon, level - 3.0, land.top_m, SURFACES["concrete"][0])
    vertices, index = indexed(mesh)
    return LandSurface(prop_class(land.surface), vertices, (_patch(vertices, index.reshape(-1, 3)),))


def _buried(city: City, land: Land) -> shapely.Geometry:
    """Return the area in which higher land covers this one so deep inside its own edge that this one cannot show."""
    rise = land.top_m - water_level(city) + 1.0
    over = [
        shapely.Polygon(other.polygon).buffer(-BURIED_M - rise / SURFACES.get(other.surface, SURFACES["grass"])[1])
        for other in city.lands
        if other.top_m > land.top_m
    ]
    return shapely.union_all(over)


def _patch(vertices: Mesh, triangles: npt.NDArray[np.uint32]) -> _Patch:
    points = vertices[np.unique(triangles), :3].astype(np.float64)
    centre = (points.min(axis=0) + points.max(axis=0)) / 2.0
    return _Patch(triangles, centre, float(np.linalg.norm(points - centre, axis=1).max()))


def _prism(polygon: Polygon, base: float, top: float, colour: LinearRgb) -> Mesh:
    """Return a prism over any simple polygon."""
    shape = shapely.Polygon(polygon)
    if shapely.equals(shape, shape.convex_hull):
        return prism(shapely.get_coordinates(shapely.orient_polygons(shape))[:-1], base, top, colour)
    walls = [
        corner
        for (ax, ay), (bx, by) in zip(polygon, (*polygon[1:], polygon[0]), strict=True)
        for corner in ((ax, ay, base), (bx, by, base), (bx, by, top), (ax, ay, base), (bx, by, top), (ax, ay, top))
    ]
    lid = [
        (x, y, top)
        for triangle in shapely.get_parts(shapely.constrained_delaunay_triangles(shape))
        for x, y in shapely.get_coordinates(shapely.orient_polygons(triangle))[:3]
    ]
    return flat(np.array([*walls, *lid]), colour)


def _height_field(land: Land, level: float, number: int, buried: shapely.Geometry) -> LandSurface:
    colour, slope = SURFACES.get(land.surface, SURFACES["grass"])
    west, south, east, north = shapely.Polygon(land.polygon).bounds
    step = max(3.0, (east - west) / 140.0)
    xs, ys = np.arange(west - step, east + 2 * step, step), np.arange(south - step, north + 2 * step, step)
    into = cached_array(_name("edge", land.polygon, step), lambda: _steps_inside(fill(land.polygon, xs, ys)))
    into = (into - np.sign(into) * 0.5) * step
    height = _profile(into, land.top_m - level, slope, xs, ys, number) + level
    keep = (into > -1.5 * step) & ~shapely.contains_xy(buried, *np.meshgrid(xs, ys))
    return _surface_of(prop_class(land.surface), xs, ys, height, keep, colour)


def _steps_inside(mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.float64]:
    """Return the distance of each grid point from the other side of the edge in grid steps; negative outside."""
    inside: npt.NDArray[np.float64] = ndimage.distance_transform_edt(mask)
    outside: npt.NDArray[np.float64] = ndimage.distance_transform_edt(~mask)
    return inside - outside


def _name(kind: str, *content: object) -> str:
    """Return the name of a cached array by what determines it."""
    return f"{kind} {hashlib.sha256(msgspec.msgpack.encode(content)).hexdigest()}"


def _profile(into: HeightGrid, rise: float, slope: float, xs: HeightGrid, ys: HeightGrid, number: int) -> HeightGrid:
    """Return the height over the water by the distance inside the polygon, with relief that fades at the edge."""
    x, y = np.meshgrid(xs, ys)
    relief = np.sin(x / 17.0 + number) * np.sin(y / 13.0 + 2.0 * number) + 0.6 * np.sin(x / 7.3 - y / 9.1 + number)
    ramp = -0.15 + slope * (into + 0.6 * relief)
    rise = max(rise, 1e-3)
    hills = 0.5 * np.sin(x / 210.0 + 0.7) * np.sin(y / 170.0 + np.sin(x / 330.0)) if rise > 15.0 else 0.0
    top = rise * (1.0 + 0.05 * relief + hills)
    smooth = np.minimum(ramp, top)
    return np.asarray(np.where(ramp > 0.7 * top, smooth - 0.05 * top * np.clip(1.7 - ramp / top, 0.0, 1.0), smooth))


def _surface_of(
    cls: int, xs: HeightGrid, ys: HeightGrid, height: HeightGrid, keep: npt.NDArray[np.bool_], colour: LinearRgb
) -> LandSurface:
    step = xs[1] - xs[0]
    dy, dx = np.gradient(height, step)
    normal = np.stack([-dx, -dy, np.ones_like(dx)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    x, y = np.meshgrid(xs, ys)
    shade = 1.0 + 0.12 * np.sin(x / 23.0 + 1.3 * np.sin(y / 19.0))
    paint = np.concatenate([np.array(colour) * shade[..., None], np.zeros((*shade.shape, 1))], axis=-1)
    rows = np.concatenate([np.stack([x, y, height], -1), normal, paint], axis=-1).astype(np.float32)
    vertices = rows.reshape(-1, rows.shape[-1])
    number = np.arange(len(vertices), dtype=np.uint32).reshape(height.shape)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    wanted = keep[:-1, :-1] & keep[:-1, 1:] & keep[1:, 1:] & keep[1:, :-1]
    patches = []
    for row in range(0, wanted.shape[0], PATCH_CELLS):
        for column in range(0, wanted.shape[1], PATCH_CELLS):
            part = np.s_[row : row + PATCH_CELLS, column : column + PATCH_CELLS]
            here = wanted[part]
            if here.any():
                corners = [np.stack([p[part][here] for p in t], axis=1) for t in ((a, b, c), (a, c, d))]
                patches.append(_patch(vertices, np.concatenate(corners)))
    return LandSurface(cls, vertices, tuple(patches))


def _solids(city: City, level: float) -> tuple[tuple[float, Mesh], ...]:
    parts: dict[float, list[Mesh]] = {}
    for solid in city.solids:
        x, y = np.array(solid.polygon).mean(axis=0)
        plane = height_under(city, float(x), float(y))
        colour = MATERIALS.get(solid.material, SURFACES["concrete"][0])
        parts.setdefault(plane, []).append(_prism(solid.polygon, solid.base_m, solid.top_m, colour))
    return tuple((plane, merge(*meshes)) for plane, meshes in sorted(parts.items()))


def _wet(city: City, xs: HeightGrid, ys: HeightGrid) -> npt.NDArray[np.bool_]:
    """Return which grid points are water; a city without waters is drawn in the sea."""
    wet = np.zeros((len(ys), len(xs)), bool)
    for water in city.waters:
        here = fill(water.polygon, xs, ys)
        for hole in water.holes:
            here &= ~fill(hole, xs, ys)
        wet |= here
    return wet if city.waters else ~wet


def _shore_map(city: City, noise: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Return the shore map, (SHORE_SIZE, SHORE_SIZE, 2) bytes; `noise` is a part of `noise_texture`."""
    shapes = city.bounds, city.waters, [land.polygon for land in city.lands], noise.tobytes()
    return cached_array(_name("shore", *shapes), lambda: _drawn_shore(city, noise))


def _drawn_shore(city: City, noise: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Draw the shore map.

    The first channel is the square root of the distance to land over `SHORE_REACH_M`. The second is slow noise.
    """
    west, south, east, north = city.bounds
    cell = (east - west) / SHORE_SIZE
    xs = west + cell * (np.arange(SHORE_SIZE) + 0.5)
    ys = south + (north - south) / SHORE_SIZE * (np.arange(SHORE_SIZE) + 0.5)
    land = ~_wet(city, xs, ys)
    for part in city.lands:
        land |= fill(part.polygon, xs, ys)
    reach = np.full(land.shape, SHORE_REACH_M)
    if land.any():
        reach = np.minimum(ndimage.distance_transform_edt(~land) * cell, SHORE_REACH_M)
    for edge in (reach[0], reach[-1], reach[:, 0], reach[:, -1]):
        edge[:] = SHORE_REACH_M  # pictures repeat the edge beyond the bounds, where a shore may run another way
    near = np.sqrt(reach / SHORE_REACH_M) * 255.0
    patches = np.kron(noise, np.ones((SHORE_SIZE // len(noise), SHORE_SIZE // len(noise)), np.uint8))
    patches = ndimage.uniform_filter(patches.astype(np.float32), SHORE_SIZE // len(noise) * 2, mode="wrap")
    return np.stack([np.rint(near), patches], axis=-1).astype(np.uint8)


__all__ = ["CLASSES", "Ground", "build_ground", "height_under", "water_level"]
