"""The space of bodies at their start: their footprints, overlaps between them, and bodies that stand on a surface.

It is used by the check of a mission's text (`lingjing.mission.feasibility.start_places`), by the scene that places
bodies in the city (`lingjing.scene.anchor`), and by the engines that start them on the ground or in the air. All
lengths are metres.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

from lingjing.mission.appearance import BARE, UNSAID_M
from lingjing.mission.instance import Entity
from lingjing.mission.kinds import engine_kind

STANDS_M = 1.0
"""A body stands on a surface if its underside is at most this far above it; a higher one begins in the air. Elevations
in missions have errors of about this size (chosen)."""

_CELL_M = 20.0
"""Side of a cell of the spatial index, metres (chosen: larger than most bodies)."""


class Footprint(NamedTuple):
    """The space of a body: an upright box about (`x`, `y`), from `low` to `high`, turned by `heading` (radians)."""

    x: float
    y: float
    low: float
    high: float
    half_length: float
    half_width: float
    heading: float

    def overlaps(self, other: Footprint) -> bool:
        """True if the boxes have a common volume."""
        if self.low >= other.high or other.low >= self.high:
            return False
        return not any(_apart(self, other, axis) for box in (self, other) for axis in _axes(box))

    def grown(self, gap_m: float) -> Footprint:
        """The box enlarged by `gap_m` on every side, above and below."""
        return self._replace(
            low=self.low - gap_m,
            high=self.high + gap_m,
            half_length=self.half_length + gap_m,
            half_width=self.half_width + gap_m,
        )


def footprint(entity: Entity) -> Footprint | None:
    """The space of an asset at the start; None for a target, a satellite and an entity without a shape."""
    kind = engine_kind(entity.engine)
    bare = entity.properties.get("shape") == BARE
    if entity.role != "asset" or kind.orbits or bare:
        return None
    length, width, height = (entity.number(name) or UNSAID_M for name in ("length_m", "width_m", "height_m"))
    x, y, z = entity.position
    low, heading = z - sunk_below_m(entity), math.radians(entity.heading_deg)
    if kind.floor is not None:  # aircraft touch each other as upright cylinders
        length = width = max(length, width)
        heading = 0.0
    return Footprint(x, y, low, low + height, length / 2.0, width / 2.0, heading)


def sunk_below_m(entity: Entity) -> float:
    """The part of a body below its position, metres: half of its height if its origin is its middle."""
    if entity.properties.get("origin") != "middle":
        return 0.0
    return (entity.number("height_m") or UNSAID_M) / 2.0


def stands(entity: Entity, surface_m: float) -> bool:
    """True if a body begins on a surface at this elevation, and not in the air above it."""
    return entity.position[2] - sunk_below_m(entity) <= surface_m + STANDS_M


class StartingBodies:
    """Bodies by id with a spatial index, so that the cost is linear in their number."""

    def __init__(self) -> None:
        self._cells: dict[tuple[int, int], list[tuple[str, Footprint]]] = {}

    def add(self, name: str, body: Footprint) -> None:
        """Add a body."""
        for cell in _cells(body):
            self._cells.setdefault(cell, []).append((name, body))

    def overlapping(self, body: Footprint) -> str | None:
        """The id of the first body that overlaps this space; None if it is free."""
        for cell in _cells(body):
            for name, other in self._cells.get(cell, ()):
                if body.overlaps(other):
                    return name
        return None


# -- private


def _axes(body: Footprint) -> tuple[tuple[float, float], tuple[float, float]]:
    """Unit vectors along and across a body."""
    sine, cosine = math.sin(body.heading), math.cos(body.heading)
    return (sine, cosine), (cosine, -sine)


def _apart(first: Footprint, second: Footprint, axis: tuple[float, float]) -> bool:
    """True if a line across the axis separates the two (separating axis theorem)."""
    between = abs((second.x - first.x) * axis[0] + (second.y - first.y) * axis[1])
    return between >= _reach(first, axis) + _reach(second, axis)


def _reach(body: Footprint, axis: tuple[float, float]) -> float:
    along, across = _axes(body)
    return body.half_length * abs(along[0] * axis[0] + along[1] * axis[1]) + body.half_width * abs(
        across[0] * axis[0] + across[1] * axis[1]
    )


def _cells(body: Footprint) -> Iterator[tuple[int, int]]:
    reach = math.hypot(body.half_length, body.half_width)
    return itertools.product(_span(body.x, reach), _span(body.y, reach))


def _span(middle: float, reach: float) -> range:
    return range(math.floor((middle - reach) / _CELL_M), math.floor((middle + reach) / _CELL_M) + 1)
