"""What moves near the dogs and is another engine's: boxes from mirrors, the nearest ones first.

Solid are background traffic, assets and targets of a listed type (`bodies.mirror_size`): a fire or a leak is nothing
to bump into. Between two mirrors everything goes on along its velocity.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from lingjing.engines.quadruped.physics import MovingBox
from lingjing.mission.instance import Instance, Vector
from lingjing.plugins.bodies import solid_size
from lingjing.plugins.neighbours import solid_mirror
from lingjing.scene.sizes import SIZES, Size
from lingjing.trace.records import BodyState

POOL = 16
"""Boxes in a model: the movers nearest to any dog."""

RANGE_M = 40.0
_SOON_S = 0.5
_FAR_M = RANGE_M + 30.0


class Lookout:
    """Knows what the others are; `owns` are not among them."""

    def __init__(self, instance: Instance, owns: Iterable[str]) -> None:
        mine = set(owns)
        self._known = {entity.id: entity for entity in instance.entities if entity.id not in mine}
        sizes = (size for size in map(solid_size, self._known.values()) if size is not None)
        self._largest_m = max((_reach_m(size) for size in (*SIZES.values(), *sizes)), default=0.0)

    def nearest(self, mirrors: Sequence[BodyState], dogs: Sequence[Vector]) -> tuple[MovingBox, ...]:
        """The solid ones that come near, nearest first; ties go by name."""
        if not dogs:
            return ()
        (west, east), (south, north) = ((min(part), max(part)) for part in list(zip(*dogs, strict=True))[:2])
        found = []
        for state in mirrors:
            x, y, _ = state.position
            if not (west - _FAR_M < x < east + _FAR_M and south - _FAR_M < y < north + _FAR_M):
                continue
            ahead = _SOON_S * math.hypot(*state.velocity)
            far = RANGE_M + self._largest_m + ahead
            if not any(abs(x - dog[0]) < far and abs(y - dog[1]) < far for dog in dogs):
                continue
            solid = solid_mirror(state, self._known.get(state.id))
            if solid is None:
                continue
            size, hovers = solid
            reach = _reach_m(size) + ahead
            away = min(math.dist(state.position, dog) for dog in dogs) - reach
            if away < RANGE_M:
                found.append((away, state.id, _mover(state, size, hovers=hovers)))
        return tuple(mover for _, _, mover in sorted(found, key=lambda one: one[:2])[:POOL])


def _reach_m(size: Size) -> float:
    """From a body's middle to its corner in plan."""
    return 0.5 * math.hypot(size.length_m, size.width_m)


def _mover(state: BodyState, size: Size, *, hovers: bool) -> MovingBox:
    half = 0.5 * size.length_m, 0.5 * size.width_m, 0.5 * size.height_m
    x, y, z = state.position
    base = (x, y, z - half[2]) if hovers else (x, y, z)
    return MovingBox(state.id, base, half, math.radians(90.0 - state.heading_deg), state.velocity)
