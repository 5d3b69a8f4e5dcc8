"""Radio coverage: which assets do not hear each other, by distance, by what stands between them, by the weather.

A stand-in for a 2.4 GHz data link with a declared range in clear air and a clear line of sight. What stands in the way
costs signal as a knife edge does (Recommendation ITU-R P.526), over its top or around its nearer side; the worst edge
counts, and every 20 dB lost shortens the range to a tenth. Thick weather shortens it by up to a third. Who has no body
(a coordinator at a desk) is heard everywhere.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lingjing.engines.close_pairs import close_pairs
from lingjing.mission.geometry2d import Polygon
from lingjing.mission.instance import Entity, Instance, Vector, Weather
from lingjing.plugins.bodies import entity_size
from lingjing.scene.roofs import Roofs
from lingjing.scene.terrain import Terrain

WAVELENGTH_M = 0.125
"""2.4 GHz."""

_SAMPLE_M = 10.0
_MOST_LOST = 1.0 / 3.0
_CLEAR_M = 5_000.0
_ANTENNA_M = 0.5
"""Height of an antenna over the top of what carries it."""
_CLEARANCE_M = 10.0
"""Edges further below the line of sight than this cost nothing worth counting."""
_SLACK = 1e-2
"""Metres and decibels that a bound is kept clear of what it bounds: no rounding matters."""
_NO_LOSS = -0.78
_AT_A_TIME = 2000
"""Ways that are sampled together: some hundred thousand places at most."""

Pair = tuple[str, str]
Samples = npt.NDArray[Any]


class Coverage:
    """The assets under the command of agents, pair by pair. Without a declared range everybody hears everybody."""

    def __init__(self, instance: Instance, terrain: Terrain) -> None:
        embodied = {name for agent in instance.agents for name in agent.controls}
        carriers = [entity for entity in instance.entities if entity.id in embodied]
        self._range_m = instance.comms.range_m
        self._terrain, self._roofs = terrain, Roofs(terrain)
        self._heights = {entity.id: _antenna(entity) for entity in carriers}

    def unheard(self, places: Mapping[str, Vector], weather: Weather) -> tuple[Pair, ...]:
        """The pairs, each in the instance's order, that radio does not reach between. A place that is missing counts
        as out of reach."""
        if self._range_m is None:
            return ()
        heard = self._heard(places, self._range_m * clearness(weather))
        return tuple(pair for pair in itertools.combinations(self._heights, 2) if pair not in heard)

    def _heard(self, places: Mapping[str, Vector], reach_m: float) -> set[Pair]:
        names = [name for name in self._heights if name in places]
        ends = [(x, y, z + self._heights[name]) for name in names for x, y, z in (places[name],)]
        near = close_pairs(ends, math.nextafter(reach_m, math.inf))  # the range is inclusive
        heard: set[Pair] = set()
        for start in range(0, len(near), _AT_A_TIME):
            some = near[start : start + _AT_A_TIME]
            cut = self._cut([RadioPath.between(ends[one], ends[other], reach_m) for one, other in some])
            heard.update((names[a], names[b]) for number, (a, b) in enumerate(some) if number not in cut)
        return heard

    def _cut(self, ways: Sequence[RadioPath]) -> set[int]:
        """The numbers of the ways along which any edge costs more than is bearable."""
        cut: set[int] = set()
        owner, share, place = _sampled(ways)
        suspects = self._suspects(ways, owner, share, place)
        for sample, number in zip(suspects.tolist(), owner[suspects].tolist(), strict=True):
            if number not in cut and self._loses_more(ways[number], float(share[sample]), place[sample].tolist()):
                cut.add(number)
        return cut

    def _suspects(self, ways: Sequence[RadioPath], owner: Samples, share: Samples, place: Samples) -> Samples:
        """The samples at which something may be high enough to cost too much, the highest loss first."""
        over = self._roofs.bound(place[:, 0], place[:, 1]) - place[:, 2]
        near = np.flatnonzero(over > -_CLEARANCE_M - _SLACK)
        lengths, bearable = np.array([(way.length_m, way.bearable_db) for way in ways])[owner[near]].T
        from_m = share[near] * lengths
        parameter = over[near] * np.sqrt(2.0 * lengths / (WAVELENGTH_M * from_m * (lengths - from_m)))
        excess = _loss_db(np.maximum(parameter, _NO_LOSS)) - bearable
        found = near[np.argsort(-excess, kind="stable")]
        return found[: np.count_nonzero(excess > -_SLACK)]

    def _loses_more(self, way: RadioPath, share: float, place: Sequence[float]) -> bool:
        x, y, z = place
        for block in self._terrain.solids_at(x, y, z - _CLEARANCE_M, math.inf):
            if block.base_at(x, y) > z:
                continue  # it is overhead: a bridge, a roof on stilts
            over = min(block.top_at(x, y) - z, around_m(block.area.polygon, way.first, way.second))
            if edge_loss_db(over, share * way.length_m, (1 - share) * way.length_m) > way.bearable_db:
                return True
        return False


@dataclass(frozen=True, slots=True)
class RadioPath:
    """From one antenna to another. `bearable_db` is the loss that brings the range down to just its length."""

    first: Vector
    second: Vector
    length_m: float
    bearable_db: float

    @classmethod
    def between(cls, first: Vector, second: Vector, reach_m: float) -> RadioPath:
        """The way, where radio reaches so far."""
        length = math.dist(first, second)
        return cls(first, second, length, 20.0 * math.log10(reach_m / length) if length > 0.0 else math.inf)


def _sampled(ways: Sequence[RadioPath]) -> tuple[Samples, Samples, Samples]:
    """Places about every 10 m along ways, (n, 3), with the number of each one's way and the share it lies at."""
    counts = np.array([math.floor(way.length_m / _SAMPLE_M) for way in ways])
    owner = np.repeat(np.arange(len(ways)), counts)
    before = np.repeat(np.cumsum(counts) - counts, counts)
    share = (np.arange(len(owner)) - before + 1) / (counts[owner] + 1)
    first, second = np.array([way.first for way in ways]), np.array([way.second for way in ways])
    return owner, share, first[owner] + share[:, np.newaxis] * (second - first)[owner]


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
    if parameter <= _NO_LOSS:
        return 0.0
    return 6.9 + 20.0 * math.log10(math.sqrt((parameter - 0.1) ** 2 + 1.0) + parameter - 0.1)


def _loss_db(parameter: Samples) -> Samples:
    """The same for very many, to be compared and not to be believed to the last digit."""
    return np.asarray(6.9 + 20.0 * np.log10(np.sqrt((parameter - 0.1) ** 2 + 1.0) + parameter - 0.1))


def _antenna(entity: Entity) -> float:
    return entity_size(entity).height_m + _ANTENNA_M
