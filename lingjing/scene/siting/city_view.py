"""The parts of a city that siting reads: doors, roofs, bridges, pipes, waters, and roads that lead on and back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import dist
from typing import Any

from lingjing.mission.geometry2d import Vector2
from lingjing.mission.instance import Vector
from lingjing.scene.anchor import FAST_ROADS
from lingjing.scene.camera_geometry import bearing_deg, turn_deg
from lingjing.scene.city import Building, City
from lingjing.scene.footing import BODIES_M, HEAD_M, STEP_M
from lingjing.scene.lines import line_length
from lingjing.scene.road_map import RoadMap, RoadSegment, read_road_map
from lingjing.scene.tiles import Tiles

CLEAR_M, STEM_CLEAR_M = 0.9, 0.6
"""Clearance of a dog from walls and from stems, metres (chosen: its half length and its stray)."""

JOINT_M = 15.0
"""Widest gap between two decks of one bridge, metres (chosen: a junction on the bridge)."""
JOINT_DEG = 35.0
"""Largest bend between two decks of one bridge, degrees (chosen)."""


@dataclass(frozen=True, slots=True)
class Door:
    """An entrance of a building."""

    place: Vector2
    """A point 0.3 m in front of it, metres."""
    bearing_deg: float
    building: Building


class CityView:
    """A city as siting reads it. Everything is read once and in the city's order."""

    def __init__(self, city: City) -> None:
        self.city = city
        self.tiles = list(Tiles(city))

    @cached_property
    def doors(self) -> tuple[Door, ...]:
        """The entrances at ground level."""
        from lingjing.scene.camera_geometry import offset_xy

        return tuple(
            Door(_rounded(offset_xy(building.entrance, building.entrance[2], 0.3)), building.entrance[2], building)
            for tile in self.tiles
            for building in tile.buildings
            if building.entrance is not None and building.base_m < 1.0
        )

    @cached_property
    def buildings(self) -> tuple[Building, ...]:
        """All buildings of the city."""
        return tuple(building for tile in self.tiles for building in tile.buildings)

    @cached_property
    def roads(self) -> RoadMap | None:
        """The road map; None without roads."""
        return read_road_map(self.city.network) if self.city.network else None

    @cached_property
    def segments(self) -> tuple[RoadSegment, ...]:
        """The segments in the city from which every other one can be reached, on the ground."""
        if self.roads is None:
            return ()
        connected = self.roads.connected
        roads = (road for tile in self.tiles for road in tile.roads if not road.kind.startswith(FAST_ROADS))
        shown = {road.id for road in roads if not road.tunnel and not road.bridge}
        return tuple(s for s in self.roads.segments.values() if s.id in connected and s.id in shown)

    @cached_property
    def water(self) -> Any:
        """The waters without lands, as a prepared shapely geometry."""
        import shapely

        wet = shapely.union_all([
            shapely.make_valid(shapely.Polygon(water.polygon, water.holes)) for water in self.city.waters
        ])  # fmt: skip
        dry = shapely.union_all([shapely.make_valid(shapely.Polygon(land.polygon)) for land in self.city.lands])
        whole = shapely.difference(wet, dry)
        shapely.prepare(whole)
        return whole

    @cached_property
    def obstacles(self) -> tuple[Any, tuple[float, ...]]:
        """The obstacles of a dog: the shapes in an STRtree, and the clearance of each, metres."""
        import shapely

        outlines, margins = [], []
        for tile in self.tiles:
            low = [(b.polygon, b.base_m) for b in tile.buildings]
            low += [(solid.polygon, solid.base_m) for solid in tile.solids if solid.top_m > STEP_M]
            walls = [shapely.make_valid(shapely.Polygon(outline)) for outline, base_m in low if base_m < HEAD_M]
            stems = [(prop, BODIES_M[prop.cls] * prop.scale) for prop in tile.props if prop.cls in BODIES_M]
            outlines += [*walls, *(shapely.Point(prop.position[:2]) for prop, _ in stems)]
            margins += [*(CLEAR_M for _ in walls), *(radius + STEM_CLEAR_M for _, radius in stems)]
        return shapely.STRtree(outlines), tuple(margins)

    @cached_property
    def bridges(self) -> tuple[tuple[Vector, ...], ...]:
        """The centre lines of bridges, joined from their decks, longest first."""
        return _chains([bridge.path for tile in self.tiles for bridge in tile.bridges], JOINT_M)

    @cached_property
    def pipes(self) -> tuple[tuple[Vector, ...], ...]:
        """The centre lines of pipelines, longest first."""
        return _chains([pipe.path for tile in self.tiles for pipe in tile.pipes], 1.0)


def _rounded(place: Sequence[float]) -> Vector2:
    return round(place[0], 2), round(place[1], 2)


def _chains(lines: list[tuple[Vector, ...]], gap_m: float) -> tuple[tuple[Vector, ...], ...]:
    """Lines joined where one continues another, longest first."""
    left = sorted((line for line in lines if len(line) > 1), key=lambda line: (-line_length(line), line))
    chains = []
    while left:
        chain = left.pop(0)
        grown = True
        while grown:
            grown = False
            for joined in _joined(chain, left, gap_m):
                chain, used = joined
                left.remove(used)
                grown = True
                break
        chains.append(chain)
    return tuple(sorted(chains, key=lambda line: (-line_length(line), line)))


def _joined(
    chain: tuple[Vector, ...], others: list[tuple[Vector, ...]], gap_m: float
) -> Iterator[tuple[tuple[Vector, ...], tuple[Vector, ...]]]:
    for other in others:
        for line in (other, other[::-1]):
            if _continues(chain, line, gap_m):
                yield _together(chain, line), other
            elif _continues(line, chain, gap_m):
                yield _together(line, chain), other


def _continues(first: tuple[Vector, ...], second: tuple[Vector, ...], gap_m: float) -> bool:
    if dist(first[-1], second[0]) > gap_m:
        return False
    return abs(turn_deg(_bearing(first[-2:]), _bearing(second[:2]))) <= (JOINT_DEG if gap_m > 1.0 else 180.0)


def _bearing(step: Sequence[Vector]) -> float:
    return bearing_deg(step[0][:2], step[1][:2])


def _together(first: tuple[Vector, ...], second: tuple[Vector, ...]) -> tuple[Vector, ...]:
    return (*first, *(second[1:] if dist(first[-1], second[0]) < 0.01 else second))
