"""Bodies of other engines near the dogs, as boxes that move with their mirrors.

Solid are background traffic, and assets and targets with declared dimensions (`bodies.mirror_size`). A fire or a leak
is not. A body with a round outline is a box of the same area. Between two mirrors a box moves at constant velocity.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from lingjing.engines.neighbours import SolidMirror, solid_mirror
from lingjing.engines.quadruped.physics import MovingBox
from lingjing.mission.instance import Instance, Vector
from lingjing.plugins.bodies import solid_size
from lingjing.scene.sizes import SIZES, Size
from lingjing.trace.records import BodyState

POOL = 16
"""Number of boxes in a model: they stand for the bodies nearest to any dog (chosen)."""

RANGE_M = 40.0
"""Distance from a dog within which bodies are boxes, metres (chosen)."""

_SOON_S = 0.5
"""Time for which a body's motion is added to its extent, seconds (chosen)."""

_FAR_M = RANGE_M + 30.0
"""Distance beyond which a mirror is skipped without a closer check, metres (chosen)."""
_ROUND = math.sqrt(math.pi) / 2.0
"""Ratio of the side of a square to the diameter of a circle of the same area."""


class MirroredBodies:
    """The bodies of other engines; the engine's own bodies, `owns`, are left out."""

    def __init__(self, instance: Instance, owns: Iterable[str]) -> None:
        mine = set(owns)
        self._known = {entity.id: entity for entity in instance.entities if entity.id not in mine}
        sizes = (size for size in map(solid_size, self._known.values()) if size is not None)
        self._largest_m = max((_reach_m(size) for size in (*SIZES.values(), *sizes)), default=0.0)

    def nearest(self, mirrors: Sequence[BodyState], dogs: Sequence[Vector]) -> tuple[MovingBox, ...]:
        """Return the boxes of the solid bodies near the dogs, the nearest first; equally near ones are in order of
        their ids."""
        if not dogs:
            return ()
        (west, east), (south, north) = ((min(part), max(part)) for part in list(zip(*dogs, strict=True))[:2])
        near = []
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
            reach = _reach_m(solid.size) + ahead
            away = min(math.dist(state.position, dog) for dog in dogs) - reach
            if away < RANGE_M:
                near.append((away, state.id, _mover(state, solid)))
        return tuple(mover for _, _, mover in sorted(near, key=lambda entry: entry[:2])[:POOL])


def _reach_m(size: Size) -> float:
    """Return the distance from a body's middle to its corner in plan, metres."""
    return 0.5 * math.hypot(size.length_m, size.width_m)


def _mover(state: BodyState, solid: SolidMirror) -> MovingBox:
    share = 0.5 if solid.shape == "box" else 0.5 * _ROUND
    half = share * solid.size.length_m, share * solid.size.width_m, 0.5 * solid.size.height_m
    x, y, z = state.position
    base = (x, y, z - solid.sunk_m)
    return MovingBox(state.id, base, half, math.radians(90.0 - state.heading_deg), state.velocity)
