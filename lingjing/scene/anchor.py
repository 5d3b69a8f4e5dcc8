"""`anchor`: place a mission's entities on the city, on the `road`, `roof`, `facade`, … they declare (ADR 0007).

A mission gives places in metres and does not know the city. An entity with a property `on` moves to the nearest
suitable place. Its elevation becomes that of the surface below it, and its heading follows the road, the deck or the
wall. Of the two directions of a road it takes the one nearer to its declared heading.

Rules for places:

- No two entities share a roof or a facade, and vehicles on a lane keep a distance.
- No two assets that exist from the start overlap: the later one gives way.
- If an interaction names its actor and its range, the place is within reach of such a body: a fire on a roof is near
  enough to a road for the fire truck.
- On a map, vehicles and what they drive to are on roads that lead everywhere and back.
- An entity without `on` stays where it is, unless it would begin inside a building or, on the ground, on a road.
- An entity that is drawn from a region stays in that region.
- A place outside of the city or under its ground is an error, and so is a move beyond the mission's limit
  (`lingjing.scene.displacement`).

Regions made of roads get their outlines here too. The result is a pure function of the arguments; entities are placed
in the order of their declaration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from math import cos, hypot, inf, radians, sin
from typing import TypeVar

import msgspec

from lingjing.errors import MissionError
from lingjing.mission.feasibility.start_places import OFF_M, UNDER_M
from lingjing.mission.footprint import StartingBodies, footprint, stands
from lingjing.mission.geometry2d import area_distance, contains, edge_distance
from lingjing.mission.instance import Entity, Instance, Vector
from lingjing.mission.instance_entities import GROUND_REACH_M
from lingjing.mission.kinds import engine_kind, spoken
from lingjing.scene.camera_geometry import offset_xy, turn_deg
from lingjing.scene.city import Building, City, Road, Tile
from lingjing.scene.displacement import check_displacements
from lingjing.scene.footing import Footing, rings
from lingjing.scene.lines import line_length, point_at, project
from lingjing.scene.places_alike import PlacesAlike
from lingjing.scene.road_map import read_road_map
from lingjing.scene.terrain import Terrain
from lingjing.scene.tiles import Tiles

REACH_M = 400.0
"""Farthest move of an entity, metres (chosen): beyond it the mission and the scene do not fit."""

VEHICLES_APART_M = 9.0
"""Least distance between vehicles on one lane, metres (chosen)."""
WALKERS_APART_M = 1.0
"""Least distance between entities on the ground, metres (chosen)."""
LANE_END_M = 6.0
"""Distance that vehicles and entities on roads keep from the ends of a lane, metres (chosen: clear of the
crossings)."""

ALONG_M = 3.0
"""Step of the search along a line, metres (chosen)."""

OTHER_LANE_M = 7.0
"""A lane that is farther than the nearest by at most this may be chosen for its direction, metres (chosen)."""

ROOF_EDGE_M = 2.0
"""Least distance from the edge of a roof, metres (chosen)."""
SLACK_M = 5.0
"""Reserve of an interaction's range, metres (chosen): a vehicle on the far lane of the road still reaches."""

APART_M = 1.0
"""Least distance between a body that gives way and the other body, metres (chosen)."""

APART_REACH_M = 50.0
"""Farthest move of a body that gives way to others, metres (chosen)."""

STAND_CLEAR_M = 1.2
"""Clearance of an entity that is moved out of the way, metres (chosen)."""
SHORE_CLEAR_M = 1.0
"""Smallest distance from water of a body that begins on dry ground, metres (chosen: a robot dog's length; nearer to the
edge of a sea wall its first step falls)."""
BODY_CLEAR_M = 0.6
"""Clearance of an asset on the ground or in front of an entrance, metres (chosen)."""
TARGET_CLEAR_M = 1.5
"""Clearance of a target on the ground, metres (chosen)."""

_RADII_M = (40.0, 120.0, REACH_M)
"""Radii of the search for candidates, metres: the first that gives enough of them is used."""


def anchor(instance: Instance, city: City, *, imported: bool = False) -> Instance:
    """Return the instance with its entities and regions placed on the city.

    `imported`: True for the document of another program; its bodies are moved as far as the city requires. If it has
    road vehicles, walking bodies begin off the road, where they do not block a vehicle that they wait for. Raises
    `MissionError` if an entity has no suitable place within `REACH_M` (and in the region that it is drawn from) or
    within the mission's `displacement`; if a place is outside of the city or under its ground; or if no road has the
    name that a region requires.
    """
    from lingjing.scene.regions import resolve_region

    drives = any(entity.role == "asset" and entity.engine == _ROAD for entity in instance.entities)
    anchoring = _Anchoring(instance, city, walks_off_road=imported and drives)
    # Hidden entities come last: if a public one gave way to them, its place would reveal theirs.
    order = sorted(instance.entities, key=lambda entity: "position" in entity.hidden)
    placed = {entity.id: anchoring.entity(entity) for entity in order}
    entities = tuple(placed[entity.id] for entity in instance.entities)
    if not imported:
        check_displacements(instance, entities)
    regions = tuple(
        region if region.on_map is None else resolve_region(region, instance, city) for region in instance.regions
    )
    return msgspec.structs.replace(instance, entities=entities, regions=regions)


# -- private

_Item = TypeVar("_Item")
FAST_ROADS = ("motorway", "trunk")
"""Beginnings of OpenStreetMap's classes of roads without stops."""
MAP = "map"
"""The kind of scene with roads that the edge of the map may cut off from each other."""
_ROAD = "road"


class _Anchoring:
    """One pass over an instance's entities. It remembers the roofs, facades and places that are in use."""

    def __init__(self, instance: Instance, city: City, *, walks_off_road: bool) -> None:
        self._instance = instance
        self._walks_off_road = walks_off_road
        self._city = city
        self._tiles = Tiles(city)
        self._footing = Footing(city, self._tiles)
        self._roofs: set[str] = set()
        self._facades: set[str] = set()
        self._vehicles: list[tuple[float, float]] = []
        self._walkers: list[tuple[float, float]] = []
        self._bodies = StartingBodies()
        self._rules: dict[str, Callable[[Entity], Entity]] = {
            "road": self._on_road,
            "roof": self._on_roof,
            "facade": self._on_facade,
            "ground": self._on_ground,
            "bridge": self._on_bridge,
            "pipe": self._on_pipe,
        }

    @cached_property
    def _terrain(self) -> Terrain:
        return Terrain(self._city)

    def entity(self, declared: Entity) -> Entity:
        """Return an entity at its place in the city, clear of all bodies placed so far. Raises `MissionError` without
        one.
        """
        placed = self.standing(self._apart(self.placed(declared)), declared.position[2])
        room = footprint(placed)
        if room is not None:
            self._bodies.add(placed.id, room)
        return placed

    def placed(self, entity: Entity) -> Entity:
        """Return the entity on the surface that it declares, or out of the way if it declares none."""
        on = entity.properties.get("on")
        if on is None:
            return self._out_of_the_way(entity)
        rule = self._rules.get(str(on))
        if rule is None:
            known = ", ".join(self._rules)
            raise MissionError(f"`{entity.id}` is on '{on}', which no scene has", hint=f"known: {known}")
        return rule(entity)

    def standing(self, entity: Entity, declared_m: float) -> Entity:
        """Return the entity unchanged after the checks of its place.

        Raises `MissionError` if it is outside of the city or under its ground. An asset that is always on a surface
        must be on that surface, and be declared near its elevation.
        """
        x, y, z = entity.position
        west, south, east, north = self._city.bounds
        if not engine_kind(entity.engine).anywhere and not (west <= x <= east and south <= y <= north):
            raise MissionError(
                f"`{entity.id}` begins {_where(entity)}, outside of the scene `{self._city.id}`, "
                f"which lies within ({west:g} m, {south:g} m) and ({east:g} m, {north:g} m)",
                hint="move it into the scene, or choose a larger one",
            )
        if entity.role == "asset" and engine_kind(entity.engine).landbound and z < self._surface(x, y) - UNDER_M:
            raise MissionError(
                f"`{entity.id}` begins {_where(entity)} at an elevation of {z:g} m, under the surface of the scene, "
                f"which lies at {self._surface(x, y):g} m there",
                hint="give it the elevation it begins at",
            )
        if entity.role == "asset":
            self._check_surface(entity, declared_m)
        return entity

    def _check_surface(self, entity: Entity, declared_m: float) -> None:
        surface, (x, y, z) = engine_kind(entity.engine).stands_on, entity.position
        if surface == "water" and not self._footing.is_water(x, y):
            raise MissionError(
                f"`{entity.id}` begins {_where(entity)}, which is on land", hint="move it into the water"
            )
        level = z  # on a road: the elevation at which the scene has placed the entity
        if surface in ("water", "ground"):
            level = max(self._surface(x, y), self._footing.roof_over(x, y) or -inf)
        if surface and declared_m != self._city.datum_m and abs(declared_m - level) > OFF_M:
            raise MissionError(
                f"`{entity.id}` begins {_where(entity)} at an elevation of {declared_m:g} m, "
                f"and is always on {spoken(surface)}, which lies at {level:g} m there",
                hint="give it the elevation it begins at, or leave that out",
            )

    def _surface(self, x: float, y: float) -> float:
        """Elevation of the ground, or of the water where there is water."""
        if self._footing.is_water(x, y):
            return min(water.level_m for water in self._city.waters if contains(water.polygon, x, y))
        return self._footing.height(x, y)

    # -- bodies that keep apart

    def _is_free(self, entity: Entity) -> bool:
        """True if no other body begins at the entity's place; always True for an entity without a body."""
        room = footprint(entity)
        return room is None or self._bodies.overlapping(room) is None

    def _apart(self, entity: Entity) -> Entity:
        """Return the entity, moved if necessary to the nearest similar place that no other body occupies."""
        if self._is_free(entity):
            return entity
        alike = PlacesAlike(entity, self._terrain, self._footing)
        for x, y in rings(*entity.position[:2], APART_REACH_M):
            moved = _moved(entity, (x, y, entity.position[2]))
            room = footprint(moved)
            if room is None or self._bodies.overlapping(room.grown(APART_M)) is not None:
                continue
            if self._is_in_city(x, y) and _in_region(entity, x, y) and alike.suits(x, y):
                return moved
        raise self._nothing(entity, "free place", APART_REACH_M)

    def _is_in_city(self, x: float, y: float) -> bool:
        west, south, east, north = self._city.bounds
        return west <= x <= east and south <= y <= north

    # -- roads

    def _on_road(self, entity: Entity) -> Entity:
        vehicle = entity.role == "asset"
        ways = sorted(self._lanes(entity), key=lambda way: way[:2])
        if not ways:
            raise self._nothing(entity, "road")
        near = [way for way in ways if way[0] <= ways[0][0] + OTHER_LANE_M]
        if vehicle:
            near.sort(key=lambda way: (round(abs(turn_deg(entity.heading_deg, way[3])) / 60.0), way[0], way[1]))
        for _, _, line, _ in (*near, *ways):
            at_m = self._free_on(line, entity, self._vehicles if vehicle else ())
            if at_m is not None:
                place, heading = point_at(line, at_m)
                if vehicle:
                    self._vehicles.append(place[:2])
                return _moved(entity, place, heading)
        raise self._nothing(entity, "free road")

    def _lanes(self, entity: Entity) -> Iterator[tuple[float, str, tuple[Vector, ...], float]]:
        """Yield distance, id, line and heading of every lane for cars near an entity."""
        x, y, _ = entity.position

        def lanes(tile: Tile) -> Iterator[tuple[float, str, tuple[Vector, ...], float]]:
            for road in tile.roads:
                if road.tunnel or not self._leads_on(road) or (entity.role == "target" and self._is_fast(road)):
                    continue
                for lane in road.lanes:
                    if lane.kind == "car" and line_length(lane.shape) > 2.0:
                        at = _kept_inside(lane.shape, project(lane.shape, x, y).at_m)
                        (px, py, _), heading = point_at(lane.shape, at)
                        yield hypot(px - x, py - y), lane.id, lane.shape, heading

        yield from self._around(entity, lanes, lambda way: way[0])

    def _leads_on(self, road: Road) -> bool:
        """False for a road of a map from which not every place can be reached and left again."""
        return self._connected is None or road.id in self._connected

    def _is_fast(self, road: Road) -> bool:
        """True for an expressway of a map: no vehicle halts there, and the way back may be kilometres long."""
        return self._connected is not None and road.kind.startswith(FAST_ROADS)

    @cached_property
    def _connected(self) -> frozenset[str] | None:
        """The roads of a map that lead everywhere and back; None for other scenes: all their roads do."""
        if self._instance.scene.kind != MAP or not self._city.network:
            return None
        return read_road_map(self._city.network).connected

    def _free_on(
        self, line: tuple[Vector, ...], entity: Entity, vehicles: Sequence[tuple[float, float]]
    ) -> float | None:
        """Position on a lane, nearest to an entity, that is in its region and keeps its distance from vehicles; or
        None.
        """
        x, y, _ = entity.position
        wanted = _kept_inside(line, project(line, x, y).at_m)
        for at in _outwards(line, wanted):
            if at != _kept_inside(line, at):
                continue
            (px, py, pz), heading = point_at(line, at)
            if not _in_region(entity, px, py) or not self._is_free(_moved(entity, (px, py, pz), heading)):
                continue
            if all(hypot(px - vx, py - vy) >= _apart(vx - px, vy - py, line, at) for vx, vy in vehicles):
                return at
        return None

    # -- buildings

    def _on_roof(self, entity: Entity) -> Entity:
        x, y, _ = entity.position
        within = _road_reach_m(entity, self._instance)

        def roofs(tile: Tile) -> Iterator[tuple[float, str, Building]]:
            for building in tile.buildings:
                if building.id not in self._roofs and building.roof_m == 0.0:
                    yield area_distance(building.polygon, x, y), building.id, building

        for _, _, building in sorted(self._around(entity, roofs, lambda item: item[0]), key=lambda item: item[:2]):
            spot = self._roof_spot(building, entity, within)
            if spot is not None:
                self._roofs.add(building.id)
                return _with_building(_moved(entity, (*spot, building.top_m)), building)
        raise self._nothing(entity, "flat roof" if within is None else f"flat roof within {within:g} m of a road")

    def _roof_spot(self, building: Building, entity: Entity, within: float | None) -> tuple[float, float] | None:
        """The place on a roof nearest to an entity: off its edge, under no other building, within reach of a road; or
        None.
        """
        x, y, _ = entity.position
        west, south = (min(axis) for axis in zip(*building.polygon, strict=True))
        east, north = (max(axis) for axis in zip(*building.polygon, strict=True))
        columns, rows = max(1, int((east - west) / 2.0)), max(1, int((north - south) / 2.0))
        spots = [(west + (c + 0.5) * (east - west) / columns, south + (r + 0.5) * (north - south) / rows)
                 for c in range(columns) for r in range(rows)]  # fmt: skip
        spots = [(round(min(max(x, west), east), 3), round(min(max(y, south), north), 3)), *spots]
        lanes = self._lane_lines(building, within)
        for px, py in sorted(spots, key=lambda spot: (hypot(spot[0] - x, spot[1] - y), spot)):
            if not contains(building.polygon, px, py) or edge_distance(building.polygon, px, py) < ROOF_EDGE_M:
                continue
            if self._footing.roof_over(px, py) != building.top_m or not _in_region(entity, px, py):
                continue
            if within is None or any(project(line, px, py).off_m <= within - SLACK_M for line in lanes):
                return round(px, 3), round(py, 3)
        return None

    def _lane_lines(self, building: Building, within: float | None) -> list[tuple[Vector, ...]]:
        if within is None:
            return []
        x, y = building.polygon[0]
        size = max(hypot(px - x, py - y) for px, py in building.polygon)
        return [
            lane.shape
            for tile in self._tiles.near(x, y, size + within)
            for road in tile.roads
            if not road.tunnel and not road.bridge and self._leads_on(road)
            for lane in road.lanes
            if lane.kind == "car" and project(lane.shape, x, y).off_m < size + within
        ]

    def _on_facade(self, entity: Entity) -> Entity:
        x, y, _ = entity.position

        def facades(tile: Tile) -> Iterator[tuple[float, str, Building]]:
            for building in tile.buildings:
                if building.entrance is not None and building.base_m < 1.0 and building.id not in self._facades:
                    yield area_distance(building.polygon, x, y), building.id, building

        candidates = sorted(self._around(entity, facades, lambda item: item[0]), key=lambda item: item[:2])
        for _, _, building in candidates:
            if building.entrance is None:
                continue
            door, bearing = building.entrance, building.entrance[2]
            east, north = offset_xy(door, bearing, 0.3)
            outside = round(east, 3), round(north, 3)
            if not _in_region(entity, *outside):
                continue
            front = offset_xy(door, bearing, 3.0)
            if self._footing.is_clear(*front, BODY_CLEAR_M):
                self._facades.add(building.id)
                height = self._footing.height(*front)
                return _with_building(_moved(entity, (*outside, height), bearing), building)
        raise self._nothing(entity, "building with an entrance")

    # -- the ground

    def _on_ground(self, entity: Entity) -> Entity:
        body = entity.role == "asset"
        x, y, _ = entity.position
        spot = self._footing.nearest_clear(
            x, y, BODY_CLEAR_M if body else TARGET_CLEAR_M, GROUND_REACH_M, off_road=not body or self._walks_off_road,
            apart=self._walkers, apart_m=WALKERS_APART_M, inside=entity.drawn_in,
            suits=self._suits(entity, off_shore=body),
        )  # fmt: skip
        if spot is None:
            raise self._nothing(entity, "free ground", GROUND_REACH_M)
        self._walkers.append(spot)
        return _moved(entity, (*spot, self._footing.height(*spot)))

    def _suits(
        self, entity: Entity, above_m: float = 0.0, *, off_shore: bool = False
    ) -> Callable[[float, float], bool]:
        """Return a predicate: True if the entity, so far above the ground at a place, would touch no other body.

        With `off_shore` the place is not at the water's edge either.
        """

        def suits(x: float, y: float) -> bool:
            dry = not off_shore or not self._footing.is_shore(x, y, SHORE_CLEAR_M)
            return dry and self._is_free(_moved(entity, (x, y, self._footing.height(x, y) + above_m)))

        return suits

    def _out_of_the_way(self, entity: Entity) -> Entity:
        """Return an entity without `on`: unchanged, unless it would begin inside a building or stand on a road."""
        x, y, z = entity.position
        if engine_kind(entity.engine).stands_on == "water":
            return self._clear_of_structures(entity) if self._footing.is_water(x, y) else entity
        roof, floor = self._footing.roof_over(x, y), self._footing.height(x, y)
        if entity.role == "asset" and z == self._city.datum_m < floor and not self._footing.is_water(x, y):
            z = floor  # without a declared elevation, an asset on land begins on the ground, not at the water's level
            entity = _moved(entity, (x, y, z))
        buried = roof is not None and z < roof - 0.01
        on_ground = entity.role == "asset" and floor <= z and stands(entity, floor)
        clear = not on_ground or (
            self._footing.is_clear(x, y, BODY_CLEAR_M, off_road=True)
            and not self._footing.is_shore(x, y, SHORE_CLEAR_M)
        )
        if (clear and not buried) or self._footing.is_water(x, y):
            return self._clear_of_structures(entity)
        spot = self._footing.nearest_clear(
            x, y, STAND_CLEAR_M, GROUND_REACH_M, off_road=True, apart=self._walkers, apart_m=2.0 * STAND_CLEAR_M,
            inside=entity.drawn_in, suits=self._suits(entity, max(0.0, z - floor), off_shore=on_ground),
        )  # fmt: skip
        if spot is None:
            raise self._nothing(entity, "free ground", GROUND_REACH_M)
        self._walkers.append(spot)
        moved = _moved(entity, (*spot, self._footing.height(*spot) + max(0.0, z - floor)))
        return self._clear_of_structures(moved)

    def _clear_of_structures(self, entity: Entity) -> Entity:
        """Return a body that flies or floats at a place outside of decks, piers and walls.

        One that stands is put onto its surface: out of the top of a structure, or down if it begins close above.
        """
        kind = engine_kind(entity.engine)
        if footprint(entity) is None or (kind.floor is None and kind.stands_on != "water"):
            return entity
        alike = PlacesAlike(entity, self._terrain, self._footing)
        east, north, up = entity.position
        if not alike.is_inside_structure():
            return _moved(entity, (east, north, up + rise)) if (rise := alike.rise_m()) else entity
        for x, y in rings(east, north, APART_REACH_M):
            moved = _moved(entity, (x, y, up))
            if self._is_in_city(x, y) and _in_region(entity, x, y) and alike.suits(x, y) and self._is_free(moved):
                return moved
        raise self._nothing(entity, "free place", APART_REACH_M)

    # -- bridges and pipes

    def _on_bridge(self, entity: Entity) -> Entity:
        return self._on_line(entity, "bridge", lambda tile: ((bridge.id, bridge.path) for bridge in tile.bridges))

    def _on_pipe(self, entity: Entity) -> Entity:
        return self._on_line(entity, "pipe", lambda tile: ((pipe.id, pipe.path) for pipe in tile.pipes))

    def _on_line(
        self, entity: Entity, what: str, lines: Callable[[Tile], Iterator[tuple[str, tuple[Vector, ...]]]]
    ) -> Entity:
        x, y, _ = entity.position

        def ways(tile: Tile) -> Iterator[tuple[float, str, tuple[Vector, ...]]]:
            for name, line in lines(tile):
                if len(line) > 1:
                    yield project(line, x, y).off_m, name, line

        candidates = sorted(self._around(entity, ways, lambda item: item[0]), key=lambda item: item[:2])
        for _, _, line in candidates:
            at = _nearest_in_region(entity, line)
            if at is not None:
                place, heading = point_at(line, at)
                return _moved(entity, place, heading)
        raise self._nothing(entity, what)

    # -- all of them

    def _around(
        self, entity: Entity, items: Callable[[Tile], Iterator[_Item]], distance: Callable[[_Item], float]
    ) -> list[_Item]:
        """The items near an entity, from the smallest circle of `_RADII_M` that holds enough of them."""
        x, y, _ = entity.position
        candidates: list[_Item] = []
        for radius in _RADII_M:
            tiles = self._tiles.near(x, y, radius)
            candidates = [item for tile in tiles for item in items(tile) if distance(item) <= radius]
            if len(candidates) >= _ENOUGH:
                break
        return candidates

    def _nothing(self, entity: Entity, what: str, reach_m: float = REACH_M) -> MissionError:
        where = _where(entity).removeprefix("at ")
        region = " and in the region it is drawn from" if entity.drawn_in else ""
        return MissionError(
            f"there is no {what} for `{entity.id}` within {reach_m:g} m of {where}{region} "
            f"in the scene `{self._city.id}`",
            hint="move its position, change what it is `on`, or choose a scene that has one",
        )


_ENOUGH = 12
"""Least number of candidates: with fewer, the circle is widened, since some of them may not suit."""


def _moved(entity: Entity, place: Vector, heading: float | None = None) -> Entity:
    x, y, z = (round(value, 3) for value in place)
    turned = entity.heading_deg if heading is None else round(heading, 3) % 360.0
    return msgspec.structs.replace(entity, position=(x, y, z), heading_deg=turned)


def _where(entity: Entity) -> str:
    x, y, _ = entity.position
    return "at its place" if "position" in entity.hidden else f"at ({x:g} m, {y:g} m)"


def _in_region(entity: Entity, x: float, y: float) -> bool:
    """True if a place, rounded to the millimetre, is in the region that the entity's place is drawn from."""
    return not entity.drawn_in or contains(entity.drawn_in, round(x, 3), round(y, 3))


def _nearest_in_region(entity: Entity, line: tuple[Vector, ...]) -> float | None:
    """Position along a line, nearest to an entity, that is in its region; None if there is none."""
    x, y, _ = entity.position
    wanted, total = project(line, x, y).at_m, line_length(line)
    inside = (at for at in _outwards(line, wanted) if 0.0 <= at <= total)
    return next((at for at in inside if _in_region(entity, *point_at(line, at)[0][:2])), None)


def _outwards(line: tuple[Vector, ...], wanted: float) -> Iterator[float]:
    """Yield positions along a line, from `wanted` on, alternating to both sides."""
    yield wanted
    for step in range(1, int(line_length(line) / ALONG_M) + 1):
        yield from (wanted + ALONG_M * step, wanted - ALONG_M * step)


def _with_building(entity: Entity, building: Building) -> Entity:
    hidden = {*entity.hidden, "building"} if "position" in entity.hidden else entity.hidden
    properties = {**entity.properties, "building": building.id}
    return msgspec.structs.replace(entity, properties=properties, hidden=tuple(sorted(hidden)))


def _kept_inside(line: tuple[Vector, ...], at: float) -> float:
    total = line_length(line)
    margin = min(LANE_END_M, total / 2.0)
    return min(total - margin, max(margin, at))


def _apart(dx: float, dy: float, line: tuple[Vector, ...], at: float) -> float:
    """Least distance from another vehicle: `VEHICLES_APART_M` along the same lane, 0 beside it."""
    heading = radians(point_at(line, at)[1])
    across = abs(dx * cos(heading) - dy * sin(heading))
    return 0.0 if across > 2.4 else VEHICLES_APART_M


def _road_reach_m(entity: Entity, instance: Instance) -> float | None:
    """The smallest range of the interactions that vehicles on a road perform with an entity; None without any."""
    reaches = (
        interaction.within_m
        for interaction in entity.interactions
        if interaction.by == _ROAD or any(actor.engine == _ROAD for actor in instance.actors(interaction))
    )
    return min(reaches, default=None)
