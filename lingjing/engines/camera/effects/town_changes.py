"""Changes of the static city by targets: a gap in a bridge, a building in the colour that its mission declares.

All functions depend only on tiles and the mission's entities. `changes_of` searches the tiles near each entity. It
returns the changed tiles, the buildings that are drawn as an entity, and the surroundings that each effect needs.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import TypeVar

import msgspec

from lingjing.engines.camera.effects.free_space import free_heading, roof_shift
from lingjing.engines.camera.models import look_of
from lingjing.engines.camera.models.places import KERB_M
from lingjing.mission.appearance import COLOURS
from lingjing.mission.geometry2d import Polygon, area_distance
from lingjing.mission.instance import Entity, Vector
from lingjing.scene.camera_geometry import heading_vector
from lingjing.scene.city import Bridge, Building, Lane, Pieces, Road, Solid, Tile
from lingjing.scene.lines import LinePlace, between, project, section

AWARE = (
    "bridge_fracture", "pipeline_leak", "reference_building", "destination", "delivery_point", "warehouse",
    "queue_of_people", "building_fire",
)  # fmt: skip
"""Looks that depend on their surroundings."""
NEAR_M = 40.0
"""Largest distance of a target from its bridge or building, metres; the nearest one counts (chosen)."""
TILES_M = 80.0
"""Distance around a target within which tiles are searched, metres: the first corner of an anchored building may be as
far."""
VERGE_M = 0.8
"""Distance from a road's edge to the middle of things beside it, metres (chosen)."""
GAP_M = 8.0
"""Length of a fracture's gap without the property `width_m`, metres (chosen)."""
BESIDE_M, OVER_M = 30.0, 6.0
"""Distances (m) that a bridge extends beside its path, and that things on it rise above it."""
Path = tuple[Vector, ...]
WorldBox = tuple[float, float, float, float, float, float]
"""A box in the world: west, south, low, east, north, high; metres."""
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Site:
    """The surroundings of a target."""

    ground_m: float = 0.0
    """Elevation of the ground below it, metres."""
    heading_deg: float | None = None
    """Heading of its bridge or pipe, or a free heading of a queue, degrees; None keeps its own."""
    width_m: float = 12.0
    """Width of its bridge, metres."""
    thickness_m: float = 1.2
    """Thickness of its bridge, metres."""
    deck_m: float | None = None
    """Elevation of its bridge's deck, metres; None off bridges."""
    radius_m: float = 0.4
    """Radius of its pipe, metres."""
    kerb_m: float = KERB_M
    """Distance to its right at which its road ends, metres."""
    inward: tuple[float, float] = (0.0, 0.0)
    """Shift (m, east and north) that moves it off the edges of its roof."""


@dataclass(frozen=True, slots=True)
class TownChanges:
    """The changes of a town by a mission."""

    tiles: dict[tuple[int, int], Pieces] = field(default_factory=dict)
    """Changed tiles, by key."""
    entity_buildings: dict[str, int] = field(default_factory=dict)
    """Index of the entity that a building stands for, by building id."""
    places: dict[str, tuple[int, int]] = field(default_factory=dict)
    """Key of the tile of each of these buildings."""
    sites: dict[str, Site] = field(default_factory=dict)
    """Surroundings of each entity, by id."""

    def content(self, key: tuple[int, int]) -> tuple[Pieces | None, dict[str, int]]:
        """Return the changed pieces of a tile (None without a change), and the entities that its buildings stand
        for."""
        mine = {building: number for building, number in self.entity_buildings.items() if self.places[building] == key}
        return self.tiles.get(key), mine


def changes_of(
    near: Callable[[float, float, float], tuple[Tile, ...]],
    ground: Callable[[float, float], float],
    entities: Sequence[Entity],
    without: Collection[str] = (),
    razed: bool = False,
) -> TownChanges:
    """Return the changes of a city by a mission's entities.

    `near` returns the tiles around a point (`Tiles.near`), `ground` the elevation of ground or water. Entities in
    `without` change nothing; with `razed`, a building that stands for one of them is removed.
    """
    made = TownChanges()
    for number, entity in enumerate(entities):
        if look_of(entity) not in AWARE:
            continue
        x, y, _ = entity.position
        tiles = near(x, y, TILES_M)
        made.sites[entity.id] = site_of(entity, tiles, ground(x, y))
        chosen = facing_building([building for tile in tiles for building in tile.buildings], entity)
        left_out = entity.id in without
        if not left_out:
            made.entity_buildings.update((building, number) for building in chosen)
            made.places.update((b.id, tile.key) for tile in tiles for b in tile.buildings if b.id in chosen)
        for tile in tiles:
            before = made.tiles.get(tile.key, tile)
            if left_out:
                after = _razed(before, chosen) if razed else before
            else:
                after = with_change(before, entity, chosen, made.sites[entity.id])
            if after is not before:
                made.tiles[tile.key] = after
    return made


def changed_boxes(
    first: TownChanges,
    second: TownChanges,
    load: Callable[[tuple[int, int]], Pieces],
    ground: Callable[[float, float], float],
) -> tuple[WorldBox, ...]:
    """Return the boxes in which two sets of changes differ in shape, one for each tile that differs.

    `load` returns a tile without changes (`Tiles.load`), `ground` the elevation of ground or water.
    """
    boxes = []
    for key in sorted({*first.tiles, *second.tiles}):
        sides = [_spanning(side.tiles.get(key) or load(key)) for side in (first, second)]
        points = [
            (x, y, z)
            for mine, others in (sides, sides[::-1])
            for span in mine if span not in others
            for x, y, z in _outline(span)
        ]  # fmt: skip
        if points:
            low, high = ([pick(values) for values in zip(*points, strict=True)] for pick in (min, max))
            floor = min(ground(x, y) for x, y, _ in points)
            boxes.append((low[0] - BESIDE_M, low[1] - BESIDE_M, min(low[2], floor) - OVER_M,
                          high[0] + BESIDE_M, high[1] + BESIDE_M, high[2] + OVER_M))  # fmt: skip
    return tuple(boxes)


def _spanning(pieces: Pieces) -> list[Bridge | Road | Solid]:
    return [*pieces.bridges, *pieces.roads, *pieces.solids]


def _outline(piece: Bridge | Road | Solid) -> Iterator[Vector]:
    if isinstance(piece, Bridge):
        yield from piece.path
    elif isinstance(piece, Road):
        for lane in piece.lanes:
            yield from lane.shape
    else:
        yield from ((x, y, z) for x, y in piece.polygon for z in (piece.base_m, piece.top_m))


def _razed(pieces: Pieces, removed: Collection[str]) -> Pieces:
    """Return the pieces without some buildings; the same object if it has none of them."""
    left = tuple(building for building in pieces.buildings if building.id not in removed)
    return pieces if len(left) == len(pieces.buildings) else msgspec.structs.replace(pieces, buildings=left)


def site_of(entity: Entity, near: Iterable[Pieces], ground_m: float) -> Site:
    """Return the surroundings of an entity among the pieces near it; `ground_m` is the elevation of the ground."""
    x, y, _ = entity.position
    look = look_of(entity)
    if look == "bridge_fracture":
        spans = [(bridge, bridge.path) for piece in near for bridge in piece.bridges]
        nearest = _nearest(spans, x, y)
        if nearest is not None:
            bridge, deck = nearest
            top_m = between(deck.start, deck.end, deck.share)[2]
            return Site(ground_m, deck.heading_deg, bridge.width_m, bridge.thickness_m, top_m)
    if look == "pipeline_leak":
        pipe = _nearest([(pipe, pipe.path) for piece in near for pipe in piece.pipes], x, y)
        if pipe is not None:
            return Site(ground_m, pipe[1].heading_deg, radius_m=pipe[0].radius_m)
    if look == "building_fire":
        return Site(ground_m, inward=roof_shift(entity.position, near))
    if look == "queue_of_people":
        return Site(ground_m, free_heading(entity, near))
    if entity.properties.get("on") == "road":
        return Site(ground_m, kerb_m=_kerb(near, entity))
    return Site(ground_m)


def with_change(pieces: Pieces, entity: Entity, painted: Collection[str], site: Site) -> Pieces:
    """Return the pieces with the entity's bridge broken or its buildings in `painted`; the same object if it has none
    of them."""
    if look_of(entity) == "bridge_fracture" and not entity.dormant:
        pieces = _broken(pieces, entity, site)
    name = entity.properties.get("colour")
    colour = COLOURS.get(name) if isinstance(name, str) else None
    if colour is None or not any(building.id in painted for building in pieces.buildings):
        return pieces
    buildings = tuple(
        msgspec.structs.replace(building, colour=colour) if building.id in painted else building
        for building in pieces.buildings
    )
    return msgspec.structs.replace(pieces, buildings=buildings)


def facing_building(buildings: Sequence[Building], entity: Entity) -> tuple[str, ...]:
    """Return the id of the building that an entity stands for: its anchor, or else the nearest of `buildings`."""
    if look_of(entity) != "reference_building":
        return ()
    anchored = entity.properties.get("building")
    if isinstance(anchored, str):
        return tuple(building.id for building in buildings if building.id == anchored)
    x, y, _ = entity.position
    away, nearest = min(((area_distance(b.polygon, x, y), b.id) for b in buildings), default=(inf, ""))
    return (nearest,) if away <= NEAR_M else ()


def gap_of(entity: Entity) -> float:
    """Return the length of a fracture's gap along its bridge, metres."""
    width = entity.properties.get("width_m", GAP_M)
    return max(2.0, float(width)) if isinstance(width, int | float) else GAP_M


def split(path: Path, x: float, y: float, gap_m: float) -> tuple[Path, Path]:
    """Return the rest of a path on both sides of a gap of `gap_m` around its point nearest to (x, y)."""
    at = project(path, x, y).at_m
    return section(path, 0.0, at - 0.5 * gap_m), section(path, at + 0.5 * gap_m, inf)


def _kerb(near: Iterable[Pieces], entity: Entity) -> float:
    """Return the distance from an entity on a lane over the lanes to its right to things at the kerb, metres."""
    x, y, _ = entity.position
    best = (NEAR_M, KERB_M)
    for road in (road for pieces in near for road in pieces.roads):
        run = VERGE_M
        for lane in road.lanes:
            if len(lane.shape) > 1:
                best = min(best, (project(lane.shape, x, y).off_m, run + 0.5 * lane.width_m))
            run += lane.width_m
    return best[1]


def _broken(pieces: Pieces, entity: Entity, site: Site) -> Pieces:
    """Return the pieces without those in the gap: deck, lanes, railings."""
    gap = gap_of(entity)
    bridges = tuple(part for bridge in pieces.bridges for part in _cut_bridge(bridge, entity, gap))
    roads = tuple(part for road in pieces.roads for part in (_cut_road(road, entity, gap) if road.bridge else (road,)))
    solids = tuple(part for solid in pieces.solids for part in _cut_solid(solid, entity, site, gap))
    if (bridges, roads, solids) == (pieces.bridges, pieces.roads, pieces.solids):
        return pieces
    return msgspec.structs.replace(pieces, bridges=bridges, roads=roads, solids=solids)


def _cut_solid(solid: Solid, entity: Entity, site: Site, gap: float) -> tuple[Solid, ...]:
    """Return the parts of a solid on the deck (a railing, a kerb) on both sides of the gap."""
    if site.deck_m is None or site.heading_deg is None or not site.deck_m - 0.3 <= solid.base_m <= site.deck_m + 3.0:
        return (solid,)
    x, y, _ = entity.position
    east, north = heading_vector(site.heading_deg)
    along = [(px - x) * east + (py - y) * north for px, py in solid.polygon]
    aside = [abs((px - x) * north - (py - y) * east) for px, py in solid.polygon]
    if max(along) <= -0.5 * gap or min(along) >= 0.5 * gap or min(aside) > 0.5 * site.width_m + 1.0:
        return (solid,)
    sides = [_clipped(solid.polygon, [sign * s - 0.5 * gap for s in along]) for sign in (-1.0, 1.0)]
    return tuple(
        msgspec.structs.replace(solid, id=f"{solid.id}-{end}", polygon=side)
        for end, side in zip("ab", sides, strict=True) if len(side) > 2
    )  # fmt: skip


def _clipped(polygon: Polygon, inside: list[float]) -> Polygon:
    """Return the part of a convex polygon with positive values at its corners (Sutherland and Hodgman, one edge)."""
    out = []
    for k, (here, value) in enumerate(zip(polygon, inside, strict=True)):
        (bx, by), after = polygon[(k + 1) % len(polygon)], inside[(k + 1) % len(polygon)]
        if value >= 0.0:
            out.append(here)
        if value * after < 0.0:
            t = value / (value - after)
            out.append((here[0] + t * (bx - here[0]), here[1] + t * (by - here[1])))
    return tuple(out)


def _cut_bridge(bridge: Bridge, entity: Entity, gap: float) -> tuple[Bridge, ...]:
    x, y, _ = entity.position
    if project(bridge.path, x, y).off_m > NEAR_M:
        return (bridge,)
    return tuple(msgspec.structs.replace(bridge, path=path) for path in split(bridge.path, x, y, gap) if path)


def _cut_road(road: Road, entity: Entity, gap: float) -> tuple[Road, ...]:
    x, y, _ = entity.position
    if not road.lanes or project(road.lanes[0].shape, x, y).off_m > NEAR_M:
        return (road,)
    halves: tuple[list[Lane], list[Lane]] = ([], [])
    for lane in road.lanes:
        for half, shape in zip(halves, split(lane.shape, x, y, gap), strict=True):
            if shape:
                half.append(msgspec.structs.replace(lane, shape=shape))
    return tuple(msgspec.structs.replace(road, lanes=tuple(half)) for half in halves if half)


def _nearest(things: list[tuple[T, Path]], x: float, y: float) -> tuple[T, LinePlace[Vector]] | None:
    """Return the thing with the nearest path, and the place on it; None if none is within `NEAR_M`."""
    places = [(thing, project(path, x, y)) for thing, path in things if len(path) > 1]
    thing, place = min(places, key=lambda entry: entry[1].off_m, default=(None, None))
    return None if thing is None or place is None or place.off_m > NEAR_M else (thing, place)


__all__ = [
    "Site",
    "TownChanges",
    "changed_boxes",
    "changes_of",
    "facing_building",
    "gap_of",
    "site_of",
    "split",
    "with_change",
]
