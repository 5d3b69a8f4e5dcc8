"""The country and the sea around a city, for an eye high above it.

The ground of a city ends at `town_ground.REACH_M`, and the scene cuts off its lands. That suffices for an eye in the
air, but from orbit it would be an island. Here everything continues: a land that leaves the bounds continues in the
direction of its borders, and ground and sea spread as they do in the city. It is drawn only for eyes above `HIGH_M`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from lingjing.engines.camera.classes import CLASSES
from lingjing.engines.camera.ground import is_flat
from lingjing.engines.camera.mesh_rows import MeshPart, joined, polygons, sheet
from lingjing.engines.camera.road_meshes import SURFACES, surface_id
from lingjing.engines.camera.town_ground import TownGround, outwards, shape_of
from lingjing.scene.city import City, Land

HIGH_M = 3000.0
"""Height from which the surrounding country is drawn, metres: above all aircraft (chosen)."""
SPAN_M = 2_000_000.0
"""Distance to which country and sea are drawn, metres. From 550 km it is 15 degrees below the horizontal, where haze
hides all."""
LEAVES_M = -1.0
"""Distance beyond the bounds from which a corner of a land is a cut by the scene, metres; -1 includes the bounds
themselves."""
LAP_M = 40.0
"""Overlap of a continued land with the original, metres, so that no gap shows (chosen)."""
OVER = 3.0
"""Layer of country: above the ground of the city, which is no country."""


@dataclass(frozen=True, slots=True)
class FarCountry:
    """The country and the waters around a city."""

    lands: MeshPart
    """Flat lands around the city's own."""
    waters: tuple[tuple[float, MeshPart], ...]
    """Waters that reach farther than the city's, by level (m)."""


def build_far_country(city: City, town_ground: TownGround) -> FarCountry:
    """Return the country and the waters around a city."""
    bounds = shapely.box(*city.bounds)
    cut = [(land, shape) for land in reversed(city.lands) for shape in _onward(city, land)]
    lands = [_flat(shape.difference(bounds).difference(_own(land).buffer(-LAP_M)), land.surface, land.top_m)
             for land, shape in cut]  # fmt: skip
    if town_ground.sea is not None:
        return FarCountry(joined(lands), ())
    far = [outwards(city, shape_of(water), SPAN_M) for water in city.waters]
    flat = [_own(land) for land in city.lands if is_flat(land)]
    around = shapely.box(-SPAN_M, -SPAN_M, SPAN_M, SPAN_M).difference(bounds)
    around = around.difference(shapely.union_all([*far, *flat, *(shape for _, shape in cut)]))
    levels: dict[float, list[MeshPart]] = {}
    for water, shape in zip(city.waters, far, strict=True):
        parts = [sheet(rings, water.level_m, (0.0, 0.0, 0.0), CLASSES["water"]) for rings in polygons(shape)]
        levels.setdefault(water.level_m, []).extend(parts)
    waters = tuple((level, joined(parts)) for level, parts in sorted(levels.items()) if parts)
    return FarCountry(joined([*lands, _flat(around, "grass", 0.0)]), waters)


def _own(land: Land) -> shapely.Geometry:
    return shapely.make_valid(shapely.Polygon(land.polygon))


def _onward(city: City, land: Land) -> Iterator[shapely.Geometry]:
    """Yield the continuation of a land if the scene has cut it off."""
    west, south, east, north = city.bounds
    corners, centre = np.asarray(land.polygon, np.float64), np.array([(west + east) / 2.0, (south + north) / 2.0])
    half = np.array([(east - west) / 2.0, (north - south) / 2.0])
    out = (np.abs(corners - centre) - half).max(axis=1)
    if is_flat(land) and land.surface != "concrete" and out.max() >= LEAVES_M:
        yield shapely.make_valid(shapely.Polygon(_pushed(corners, out >= LEAVES_M, centre)))


def _pushed(
    corners: npt.NDArray[np.float64], out: npt.NDArray[np.bool_], centre: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Return a land's outline with the corners in `out` moved far away.

    The end of a border that comes from inside moves along that border; other corners move away from the centre.
    """
    before, after = np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0)
    from_before, from_after = ~np.roll(out, 1) & np.roll(out, -1), np.roll(out, 1) & ~np.roll(out, -1)
    start = np.where(from_before[:, None], before, np.where(from_after[:, None], after, centre))
    way = corners - start
    pushed = corners + way / np.maximum(np.linalg.norm(way, axis=1), 1.0)[:, None] * SPAN_M
    return np.where(out[:, None], pushed, corners)


def _flat(shape: shapely.Geometry, surface: str, height: float) -> MeshPart:
    colour, style = SURFACES.get(surface, SURFACES["concrete"])
    number = surface_id(surface)
    return joined(sheet(rings, height, colour, number, style=style, layer=OVER) for rings in polygons(shape))


__all__ = ["HIGH_M", "SPAN_M", "FarCountry", "build_far_country"]
