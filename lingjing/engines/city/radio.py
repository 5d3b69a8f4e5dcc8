"""Radio coverage: the pairs of assets without a radio link.

The model stands for a 2.4 GHz data link with a declared range in clear air and a free line of sight. An obstacle
attenuates the signal like a knife edge (Recommendation ITU-R P.526), over its top or around its nearer side. The worst
edge counts. Each 20 dB of loss divides the range by ten. Poor visibility shortens the range by up to a third. An agent
without a body, such as a coordinator, is always connected.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lingjing.engines.close_pairs import close_pairs
from lingjing.mission.geometry2d import Polygon, contains
from lingjing.mission.instance import Entity, Instance, RadioChange, Vector, Weather
from lingjing.mission.schedule import Radio
from lingjing.plugins.bodies import entity_size
from lingjing.scene.roofs import Roofs
from lingjing.scene.terrain import Terrain

WAVELENGTH_M = 0.125
"""Wavelength of 2.4 GHz, metres."""

_SAMPLE_M = 10.0
"""Distance between samples of a line of sight, metres (chosen)."""

_MOST_LOST = 1.0 / 3.0
"""Largest share of the range that weather takes (chosen)."""

_CLEAR_M = 5_000.0
"""Visibility from which weather takes nothing, metres (chosen)."""
_ANTENNA_M = 0.5
"""Height of an antenna above the top of its carrier, metres (chosen)."""
_CLEARANCE_M = 10.0
"""Edges more than this below the line of sight have a negligible loss, metres."""
_SLACK = 1e-2
"""Margin of the bounds of heights and losses, metres and decibels. It is far above rounding errors."""
_NO_LOSS = -0.78
"""Diffraction parameter below which there is no loss (ITU-R P.526-15, equation (31))."""
_AT_A_TIME = 2000
"""Number of lines of sight that are sampled together. It limits memory to some hundred thousand samples."""

Pair = tuple[str, str]
Samples = npt.NDArray[Any]


class Coverage:
    """Radio links between the assets that agents command. Without a declared range every pair is linked."""

    def __init__(self, instance: Instance, terrain: Terrain) -> None:
        embodied = {name for agent in instance.agents for name in agent.controls}
        carriers = [entity for entity in instance.entities if entity.id in embodied]
        self._range_m = instance.comms.range_m
        self._outlines = {region.name: region.polygon for region in instance.regions}
        self._terrain, self._roofs = terrain, Roofs(terrain)
        self._heights = {entity.id: _antenna(entity) for entity in carriers}

    def unlinked(self, places: Mapping[str, Vector], weather: Weather, radio: Radio | None = None) -> tuple[Pair, ...]:
        """Return the pairs without a link; each pair is in the instance's order.

        An asset without an entry in `places` is out of reach. `radio` is the present one, if events change it.
        """
        range_m = self._range_m if radio is None else radio.range_m
        pairs = tuple(itertools.combinations(self._heights, 2))
        cut: set[Pair] = set()
        if range_m is not None:
            linked = self._linked(places, range_m * clearness(weather))
            cut.update(pair for pair in pairs if pair not in linked)
        for jam in radio.jams if radio is not None else ():
            cut.update(self._jammed(jam, pairs, places, clearness(weather)))
        return tuple(pair for pair in pairs if pair in cut)

    def _jammed(
        self, jam: RadioChange, pairs: Sequence[Pair], places: Mapping[str, Vector], clear: float
    ) -> Iterator[Pair]:
        """Yield the pairs with an end in a jammed region that are farther apart than its range."""
        if jam.range_m is None:
            return
        outline = self._outlines[jam.region]
        inside = {name for name, place in places.items() if contains(outline, place[0], place[1])}
        for first, second in pairs:
            is_jammed = first in places and second in places and not inside.isdisjoint((first, second))
            if is_jammed and math.dist(places[first], places[second]) > jam.range_m * clear:
                yield first, second

    def _linked(self, places: Mapping[str, Vector], reach_m: float) -> set[Pair]:
        names = [name for name in self._heights if name in places]
        ends = [(x, y, z + self._heights[name]) for name in names for x, y, z in (places[name],)]
        near = close_pairs(ends, math.nextafter(reach_m, math.inf))  # the range is inclusive
        linked: set[Pair] = set()
        for start in range(0, len(near), _AT_A_TIME):
            some = near[start : start + _AT_A_TIME]
            cut = self._cut([_RadioPath.between(ends[first], ends[second], reach_m) for first, second in some])
            linked.update((names[a], names[b]) for number, (a, b) in enumerate(some) if number not in cut)
        return linked

    def _cut(self, ways: Sequence[_RadioPath]) -> set[int]:
        """Return the indices of the paths with an edge of more than the tolerable loss."""
        cut: set[int] = set()
        owner, share, place = _sampled(ways)
        suspects = self._suspects(ways, owner, share, place)
        for sample, number in zip(suspects.tolist(), owner[suspects].tolist(), strict=True):
            if number not in cut and self._loses_more(ways[number], float(share[sample]), place[sample].tolist()):
                cut.add(number)
        return cut

    def _suspects(self, ways: Sequence[_RadioPath], owner: Samples, share: Samples, place: Samples) -> Samples:
        """Return the samples at which an obstacle may be high enough to break the link, the highest loss first."""
        over = self._roofs.bound(place[:, 0], place[:, 1]) - place[:, 2]
        near = np.flatnonzero(over > -_CLEARANCE_M - _SLACK)
        lengths, bearable = np.array([(way.length_m, way.bearable_db) for way in ways])[owner[near]].T
        from_m = share[near] * lengths
        parameter = over[near] * np.sqrt(2.0 * lengths / (WAVELENGTH_M * from_m * (lengths - from_m)))
        excess = _loss_db(np.maximum(parameter, _NO_LOSS)) - bearable
        ordered = near[np.argsort(-excess, kind="stable")]
        return ordered[: np.count_nonzero(excess > -_SLACK)]

    def _loses_more(self, way: _RadioPath, share: float, place: Sequence[float]) -> bool:
        x, y, z = place
        for block in self._terrain.solids_at(x, y, z - _CLEARANCE_M, math.inf):
            if block.base_at(x, y) > z:
                continue  # the obstacle is above the line: a bridge deck or a raised roof
            over = min(block.top_at(x, y) - z, around_m(block.area.polygon, way.first, way.second))
            if edge_loss_db(over, share * way.length_m, (1 - share) * way.length_m) > way.bearable_db:
                return True
        return False


@dataclass(frozen=True, slots=True)
class _RadioPath:
    """The straight line between two antennas."""

    first: Vector
    """Position of one antenna, metres."""
    second: Vector
    """Position of the other antenna, metres."""
    length_m: float
    """Length of the line, metres."""
    bearable_db: float
    """Loss that reduces the range to exactly this length, dB."""

    @classmethod
    def between(cls, first: Vector, second: Vector, reach_m: float) -> _RadioPath:
        """Return the line between two antennas, where the range without obstacles is `reach_m`."""
        length = math.dist(first, second)
        return cls(first, second, length, 20.0 * math.log10(reach_m / length) if length > 0.0 else math.inf)


def _sampled(ways: Sequence[_RadioPath]) -> tuple[Samples, Samples, Samples]:
    """Return samples about every 10 m along paths.

    The arrays hold, for each sample, the index of its path, its share of the path (0..1) and its position, shape (n,
    3).
    """
    counts = np.array([math.floor(way.length_m / _SAMPLE_M) for way in ways])
    owner = np.repeat(np.arange(len(ways)), counts)
    before = np.repeat(np.cumsum(counts) - counts, counts)
    share = (np.arange(len(owner)) - before + 1) / (counts[owner] + 1)
    first, second = np.array([way.first for way in ways]), np.array([way.second for way in ways])
    return owner, share, first[owner] + share[:, np.newaxis] * (second - first)[owner]


def clearness(weather: Weather) -> float:
    """Return the share of the range that the weather leaves, 2/3..1; it is 1 from 5 km of visibility."""
    return 1.0 - _MOST_LOST * (1.0 - min(1.0, weather.visibility_m / _CLEAR_M))


def around_m(outline: Polygon, first: Vector, second: Vector) -> float:
    """Return the distance from the line of sight to the nearer side of an outline in plan, metres.

    This is the detour around an obstacle, as its height over the line is the detour above it. It is infinite for a
    vertical line.
    """
    east, north = second[0] - first[0], second[1] - first[1]
    length = math.hypot(east, north)
    if length == 0.0:  # a vertical line has no side
        return math.inf
    aside = [(east * (y - first[1]) - north * (x - first[0])) / length for x, y in outline]
    return min(max(aside), -min(aside))


def edge_loss_db(over_m: float, from_m: float, to_m: float) -> float:
    """Return the loss in dB at an edge `over_m` above (negative: below) the line of sight.

    `from_m` and `to_m` are its distances from the two ends. Equation (31) of ITU-R P.526-15, with the diffraction
    parameter of its equation (26).
    """
    parameter = over_m * math.sqrt(2.0 * (from_m + to_m) / (WAVELENGTH_M * from_m * to_m))
    if parameter <= _NO_LOSS:
        return 0.0
    return 6.9 + 20.0 * math.log10(math.sqrt((parameter - 0.1) ** 2 + 1.0) + parameter - 0.1)


def _loss_db(parameter: Samples) -> Samples:
    """Return the losses of many edges, dB. Rounding differs from `edge_loss_db`, so use it for comparison with a
    margin."""
    return np.asarray(6.9 + 20.0 * np.log10(np.sqrt((parameter - 0.1) ** 2 + 1.0) + parameter - 0.1))


def _antenna(entity: Entity) -> float:
    return entity_size(entity).height_m + _ANTENNA_M
