"""Regions that only the city can resolve: `road("Bund")` and `along(road("Bund"), 20 m)` as outlines."""

from __future__ import annotations

from typing import Any

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission.evaluate import Scope, number
from lingjing.mission.geometry2d import normalised
from lingjing.mission.instance import Instance, Region
from lingjing.scene.city import City, Road
from lingjing.scene.cutting import polygons
from lingjing.scene.tiles import Tiles

CROSSING_M = 18.0
"""Half of the longest gap of a road at a crossing that is closed, metres (chosen)."""


def resolve_region(region: Region, instance: Instance, city: City) -> Region:
    """Return the region with its polygon in this city. Raises `MissionError` if no road has the requested name."""
    if region.on_map is None:
        return region
    shape = _Resolver(instance, city).shape(region.on_map, region.name)
    return msgspec.structs.replace(region, polygon=_outline(shape, region.name), on_map=None)


# -- private


class _Resolver:
    def __init__(self, instance: Instance, city: City) -> None:
        self._regions = {region.name: region for region in instance.regions}
        self._scope = Scope(parameters=instance.settings)
        self._city = city

    def shape(self, expr: ex.Expr, name: str) -> Any:
        """A shapely geometry. shapely is imported here, so that missions without such regions do not load it."""
        import shapely

        match expr:
            case ex.Ref(name=other, kind="region"):
                known = self._regions[other]
                return shapely.Polygon(known.polygon) if known.on_map is None else self.shape(known.on_map, name)
            case ex.Call(function="road", arguments=(ex.Text(value=street),)):
                return self._closed(shapely.union_all([
                    shapely.LineString([point[:2] for point in lane.shape]).buffer(lane.width_m / 2.0, cap_style="flat")
                    for road in self._roads(street) for lane in road.lanes
                ]))  # fmt: skip
            case ex.Call(function="along", arguments=(road, width)):
                return self.shape(road, name).buffer(number(width, self._scope), cap_style="flat")
            case ex.Call(function="buffer", arguments=(part, distance)):
                return self.shape(part, name).buffer(number(distance, self._scope))
            case ex.Call(function="union", arguments=parts):
                return shapely.union_all([self.shape(part, name) for part in parts])
        raise MissionError(
            f"region '{name}' cannot be placed on the map", hint="write road(…), along(…, width) or a union"
        )

    def _roads(self, street: str) -> list[Road]:
        roads = [road for tile in Tiles(self._city) for road in tile.roads if road.name == street and road.lanes]
        if not roads:
            known = sorted({road.name for tile in Tiles(self._city) for road in tile.roads if road.name})
            hint = f"its roads are {', '.join(known[:12])}" if known else "its roads have no names"
            raise MissionError(f"the scene `{self._city.id}` has no road named '{street}'", hint=hint)
        return roads

    @staticmethod
    def _closed(shape: Any) -> Any:
        return shape.buffer(CROSSING_M, join_style="mitre").buffer(-CROSSING_M, join_style="mitre")


def _outline(shape: Any, name: str) -> tuple[tuple[float, float], ...]:
    parts = sorted(polygons(shape), key=lambda part: -part.area)
    if not parts:
        raise MissionError(f"region '{name}' is empty on this map", hint="name another road")
    if len(parts) > 1 and parts[1].area > 0.2 * parts[0].area:
        raise MissionError(
            f"region '{name}' falls into {len(parts)} pieces on this map",
            hint="name a road that runs through, or widen it",
        )
    return normalised([(round(x, 3), round(y, 3)) for x, y in parts[0].simplify(0.1).exterior.coords])
