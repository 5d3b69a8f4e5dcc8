"""Radio coverage: which assets do not hear each other, by distance, by what stands between them, by the weather.

A stand-in for a 2.4 GHz data link with a declared range in clear air and a clear line of sight. What stands in the way
costs signal as a knife edge does (Recommendation ITU-R P.526), over its top or around its nearer side; the worst edge
counts, and every 20 dB lost shortens the range to a tenth. Thick weather shortens it by up to a third. Who has no body
(a coordinator at a desk) is heard everywhere.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping

from lingjing.mission.instance import Entity, Instance, Vector, Weather
from lingjing.plugins.engines.bodies import entity_size
from lingjing.plugins.engines.terrain import Terrain
from lingjing.scene.city import Polygon

WAVELENGTH_M = 0.125
"""2.4 GHz."""

_SAMPLE_M = 10.0
_MOST_LOST = 1.0 / 3.0
_CLEAR_M = 5_000.0
_ANTENNA_M = 0.5
"""Height of an antenna over the top of what carries it."""
_CLEARANCE_M = 10.0
"""Edges further below the line of sight than this cost nothing worth counting."""

Pair = tuple[str, str]


class Coverage:
    """The assets under the command of agents, pair by pair. Without a declared range everybody hears everybody."""

    def __init__(self, instance: Instance, terrain: Terrain) -> None:
        embodied = {name for agent in instance.agents for name in agent.controls}
        carriers = [entity for entity in instance.entities if entity.id in embodied]
        self._range_m = instance.comms.range_m
        self._terrain = terrain
        self._heights = {entity.id: _antenna(entity) for entity in carriers}
        self._pairs = tuple(itertools.combinations(self._heights, 2)) if self._range_m is not None else ()

    def unheard(self, places: Mapping[str, Vector], weather: Weather) -> tuple[Pair, ...]:
        """The pairs, each in the instance's order, that radio does not reach between. A place that is missing counts
        as out of reach."""
        return tuple(pair for pair in self._pairs if not self._reaches(pair, places, weather))

    def _reaches(self, pair: Pair, places: Mapping[str, Vector], weather: Weather) -> bool:
        ends = [self._antenna_at(name, places) for name in pair]
        if self._range_m is None:
            return True
        if ends[0] is None or ends[1] is None:
            return False
        distance = math.dist(ends[0], ends[1])
        reach = self._range_m * clearness(weather)
        if distance > reach:
            return False
        # The loss that brings the range down to just this distance.
        bearable_db = 20.0 * math.log10(reach / distance) if distance > 0.0 else math.inf
        return not self._loses_more(bearable_db, ends[0], ends[1], distance)

    def _antenna_at(self, name: str, places: Mapping[str, Vector]) -> Vector | None:
        place = places.get(name)
        return None if place is None else (place[0], place[1], place[2] + self._heights[name])

    def _loses_more(self, bearable_db: float, first: Vector, second: Vector, distance: float) -> bool:
        """Whether any edge along the way costs more than that."""
        count = math.floor(distance / _SAMPLE_M)
        for number in range(1, count + 1):
            share = number / (count + 1)
            x, y, z = (here + share * (there - here) for here, there in zip(first, second, strict=True))
            if z - _CLEARANCE_M > self._terrain.ceiling_m(x, y):
                continue
            for block in self._terrain.solids_at(x, y, z - _CLEARANCE_M, math.inf):
                if block.base_at(x, y) > z:
                    continue  # it is overhead: a bridge, a roof on stilts
                over = min(block.top_at(x, y) - z, around_m(block.area.polygon, first, second))
                if edge_loss_db(over, share * distance, (1 - share) * distance) > bearable_db:
                    return True
        return False


def clearness(weather: Weather) -> float:
    """The share of the range that the weather leaves, 2/3..1: all of it from 5 km of visibility on."""
    return 1.0 - _MOST_LOST * (1.0 - min(1.0, weather.visibility_m / _CLEAR_M))


def around_m(outline: Polygon, first: Vector, second: Vector) -> float:
    """How far aside of the way from one end to the other the nearer side of an outline in plan reaches: the detour
    around it, as its height over the line of sight is the detour above it."""
    east, north = second[0] - first[0], second[1] - first[1]
    length = math.hypot(east, north)
    if length == 0.0:  # straight up: there is no side
        return math.inf
    aside = [(east * (y - first[1]) - north * (x - first[0])) / length for x, y in outline]
    return min(max(aside), -min(aside))


def edge_loss_db(over_m: float, from_m: float, to_m: float) -> float:
    """Loss in dB at an edge `over_m` above (negative: below) the line of sight, so far from the two ends.

    Equation (31) of ITU-R P.526-15, with the diffraction parameter of its equation (26).
    """
    parameter = over_m * math.sqrt(2.0 * (from_m + to_m) / (WAVELENGTH_M * from_m * to_m))
    if parameter <= -0.78:
        return 0.0
    return 6.9 + 20.0 * math.log10(math.sqrt((parameter - 0.1) ** 2 + 1.0) + parameter - 0.1)


def _antenna(entity: Entity) -> float:
    return entity_size(entity).height_m + _ANTENNA_M
