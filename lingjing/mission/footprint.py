"""Where bodies begin: the room that each takes up, which of them would overlap, and which stand on a surface.

One source for the check of a text (`lingjing.mission.feasibility.overlaps`), for the scene that puts bodies onto the
city (`lingjing.scene.anchor`) and for the engines that begin with them standing or flying. All lengths are metres.
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
"""A body whose underside is no higher than this over a surface stands on it; a higher one begins in the air. Elevations
in missions are rough by about as much (chosen)."""

_CELL_M = 20.0


class Footprint(NamedTuple):
    """The room of a body: an upright box about (`x`, `y`), from `low` to `high`, turned by `heading` (radians)."""

    x: float
    y: float
    low: float
    high: float
    half_length: float
    half_width: float
    heading: float

    def overlaps(self, other: Footprint) -> bool:
        """True if the boxes share some room."""
        if self.low >= other.high or other.low >= self.high:
            return False
        return not any(_apart(self, other, axis) for one in (self, other) for axis in _axes(one))

    def grown(self, gap_m: float) -> Footprint:
        """The box with so much more room on every side, and as much above and below."""
        return self._replace(
            low=self.low - gap_m,
            high=self.high + gap_m,
            half_length=self.half_length + gap_m,
            half_width=self.half_width + gap_m,
        )


def footprint(entity: Entity) -> Footprint | None:
    """The room that an asset takes up when the mission begins; None for a target and for what is no body there: what
    orbits or has no shape."""
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
    """How far a body reaches below its position: half of its height if its origin is its middle."""
    if entity.properties.get("origin") != "middle":
        return 0.0
    return (entity.number("height_m") or UNSAID_M) / 2.0


def stands(entity: Entity, surface_m: float) -> bool:
    """True if a body begins on a surface at this elevation, and not in the air above it."""
    return entity.position[2] - sunk_below_m(entity) <= surface_m + STANDS_M


class StartingBodies:
    """The bodies that have a place, by id, looked up by cells so that thousands cost thousands."""

    def __init__(self) -> None:
        self._cells: dict[tuple[int, int], list[tuple[str, Footprint]]] = {}

    def add(self, name: str, body: Footprint) -> None:
        """Let a body have its place."""
        for cell in _cells(body):
            self._cells.setdefault(cell, []).append((name, body))

    def met(self, body: Footprint) -> str | None:
        """The first body that one at this place would overlap; None if it is free."""
        for cell in _cells(body):
            for name, other in self._cells.get(cell, ()):
                if body.overlaps(other):
                    return name
        return None


# -- private


def _axes(body: Footprint) -> tuple[tuple[float, float], tuple[float, float]]:
    """Directions along and across a body."""
    sine, cosine = math.sin(body.heading), math.cos(body.heading)
    return (sine, cosine), (cosine, -sine)


def _apart(one: Footprint, other: Footprint, axis: tuple[float, float]) -> bool:
    """True if a line across the axis parts the two (the theorem of the separating axis)."""
    between = abs((other.x - one.x) * axis[0] + (other.y - one.y) * axis[1])
    return between >= _reach(one, axis) + _reach(other, axis)


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
