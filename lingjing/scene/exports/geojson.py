"""A city as GeoJSON (RFC 7946): one feature for each piece, in degrees of WGS84."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from lingjing.mission.frames import to_geodetic
from lingjing.mission.geometry2d import Polygon
from lingjing.scene.city import City, Tile
from lingjing.scene.tiles import Tiles

Feature = dict[str, Any]


def encode(city: City) -> bytes:
    """Return the file. Every piece has the property `kind`; `base_m` and `top_m` are elevations in metres."""
    writer = _Writer(city.origin)
    features = [
        *(writer.area("water", w.polygon, w.holes, level_m=w.level_m) for w in city.waters),
        *(writer.area("land", part.polygon, top_m=part.top_m, surface=part.surface) for part in city.lands),
        *(feature for tile in Tiles(city) for feature in writer.tile(tile)),
    ]
    document = {
        "type": "FeatureCollection",
        "name": city.id,
        "attribution": city.attribution,
        "origin": {"latitude": city.origin[0], "longitude": city.origin[1]},
        "features": features,
    }
    return json.dumps(document, ensure_ascii=False, allow_nan=False).encode()


class _Writer:
    """Makes features from pieces in metres about an origin."""

    def __init__(self, origin: tuple[float, float]) -> None:
        self._origin = origin

    def tile(self, tile: Tile) -> Iterator[Feature]:
        """Yield the features of a tile."""
        for area in tile.areas:
            yield self.area("area", area.polygon, area.holes, surface=area.surface, top_m=area.top_m)
        for solid in tile.solids:
            yield self.area(
                "solid", solid.polygon, id=solid.id, base_m=solid.base_m, top_m=solid.top_m, material=solid.material
            )
        for slope in tile.slopes:
            plane = tuple((x, y) for x, y, _ in slope.top)
            yield self.area("slope", plane, id=slope.id, material=slope.material)
        for building in tile.buildings:
            yield self.area(
                "building", building.polygon, building.holes, id=building.id, name=building.name, use=building.use,
                base_m=building.base_m, top_m=building.top_m, levels=building.levels,
            )  # fmt: skip
        for road in tile.roads:
            for lane in road.lanes:
                yield self.line(
                    "lane", lane.shape, id=lane.id, road=road.id, name=road.name, road_kind=road.kind,
                    lane_kind=lane.kind, width_m=lane.width_m, speed_mps=road.speed_mps, bridge=road.bridge,
                    tunnel=road.tunnel,
                )  # fmt: skip
        for junction in tile.junctions:
            yield self.area("junction", junction.polygon, id=junction.id, lights=junction.lights)
        for bridge in tile.bridges:
            yield self.line("bridge", bridge.path, id=bridge.id, name=bridge.name, width_m=bridge.width_m)
        for pipe in tile.pipes:
            yield self.line("pipe", pipe.path, id=pipe.id, radius_m=pipe.radius_m)
        for prop in tile.props:
            place = {"type": "Point", "coordinates": self._place(prop.position)}
            yield _feature(
                "prop", place, {"id": prop.id, "class": prop.cls, "model": prop.model, "z_m": prop.position[2]}
            )

    def area(self, kind: str, outline: Polygon, holes: Sequence[Polygon] = (), **properties: object) -> Feature:
        """Return a polygon. Its outer ring runs anticlockwise and its holes clockwise, as the standard asks."""
        from shapely import Polygon as Shape
        from shapely.geometry.polygon import orient

        shape = orient(Shape(outline, holes))
        rings = [[self._place(point) for point in ring.coords] for ring in (shape.exterior, *shape.interiors)]
        return _feature(kind, {"type": "Polygon", "coordinates": rings}, properties)

    def line(self, kind: str, path: Sequence[Sequence[float]], **properties: object) -> Feature:
        """Return a line, with the elevations of its points as a property."""
        geometry = {"type": "LineString", "coordinates": [self._place(point) for point in path]}
        return _feature(kind, geometry, {**properties, "z_m": [point[2] if len(point) > 2 else 0.0 for point in path]})

    def _place(self, point: Sequence[float]) -> list[float]:
        latitude, longitude = to_geodetic(point[0], point[1], self._origin)
        return [longitude, latitude]


def _feature(kind: str, geometry: Mapping[str, object], properties: Mapping[str, object]) -> Feature:
    return {"type": "Feature", "geometry": geometry, "properties": {"kind": kind, **properties}}
