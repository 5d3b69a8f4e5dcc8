"""What moves near the dogs and is another engine's: boxes from mirrors, the nearest ones first.

Vehicles, people and other assets are solid; targets only where their size is known (a fire or a leak is nothing to
bump into). Between two mirrors everything goes on along its velocity.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from lingjing.mission.instance import Instance, Vector
from lingjing.plugins.engines.bodies import SIZES, Size, entity_size, size_of
from lingjing.plugins.engines.quadruped.physics import Mover
from lingjing.trace.records import BodyState

POOL = 16
"""Boxes in a model: the movers nearest to any dog."""

RANGE_M = 40.0
_ABSENT = frozenset(("dormant", "rescued"))
_SOON_S = 0.5


class Lookout:
    """Knows what the others are; `owns` are not among them."""

    def __init__(self, instance: Instance, owns: Iterable[str]) -> None:
        mine = set(owns)
        self._known = {entity.id for entity in instance.entities}
        self._sizes: dict[str, Size] = {
            entity.id: entity_size(entity)
            for entity in instance.entities
            if entity.id not in mine and (entity.role == "asset" or _listed((entity.type, *entity.bases)))
        }

    def nearest(self, mirrors: Sequence[BodyState], dogs: Sequence[Vector]) -> tuple[Mover, ...]:
        """The solid ones that come near, nearest first; ties go by name."""
        found = []
        for state in mirrors:
            size = self._size(state)
            if size is None or state.status in _ABSENT:
                continue
            reach = 0.5 * math.hypot(size.length_m, size.width_m) + _SOON_S * math.hypot(*state.velocity)
            away = min((math.dist(state.position, dog) for dog in dogs), default=math.inf) - reach
            if away < RANGE_M:
                found.append((away, state.id, _mover(state, size)))
        return tuple(mover for _, _, mover in sorted(found, key=lambda one: one[:2])[:POOL])

    def _size(self, state: BodyState) -> Size | None:
        if state.id in self._known:
            return self._sizes.get(state.id)
        return size_of(state.kind)


def _mover(state: BodyState, size: Size) -> Mover:
    half = 0.5 * size.length_m, 0.5 * size.width_m, 0.5 * size.height_m
    return Mover(state.id, state.position, half, math.radians(90.0 - state.heading_deg), state.velocity)


def _listed(names: Iterable[str]) -> bool:
    return any(name in SIZES for name in names)
