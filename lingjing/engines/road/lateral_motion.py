"""Gradual sideways motion, where SUMO moves a vehicle at once.

SUMO moves a vehicle that changes lanes by a whole lane in one step, and a parking vehicle by 3.2 m to the right. This
module detects such a jump in the positions and shows it as an offset that fades at walking speed. SUMO's own
`--lanechange.duration` would also work beside vehicles that are set from outside. But vehicles then drive differently,
which would change every digest with traffic.
"""

from __future__ import annotations

import math

import msgspec

from lingjing.trace.records import BodyState

SPEED_MPS = 1.3
"""Speed at which an offset fades, m/s: a walking speed (chosen)."""

_JUMP_M = (2.0, 5.0)
"""Least and largest size of a sideways jump, metres (chosen: about a lane)."""

_LONGEST_S = 0.6
"""Longest time between two readings between which a jump is detected, seconds (chosen)."""


class LateralOffsets:
    """The sideways offsets of vehicles by id: metres to the right of SUMO's position."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[float, float, float]] = {}

    def follow(self, body: BodyState, after_s: float, rest_m: float = 0.0) -> float:
        """Return the offset of a body, read `after_s` after the last time; it fades towards `rest_m`."""
        x, y, _ = body.position
        last = self._last.get(body.id)
        offset = rest_m
        if last is not None and after_s <= _LONGEST_S:
            offset = last[2]
            east, north = x - last[0], y - last[1]
            if abs(east) + abs(north) > _JUMP_M[0]:  # a shorter way is no jump in any direction
                angle = math.radians(body.heading_deg)
                across = east * math.cos(angle) - north * math.sin(angle)
                if _JUMP_M[0] < abs(across) < _JUMP_M[1]:
                    offset -= across
            if offset != rest_m:
                most = SPEED_MPS * after_s
                offset += min(max(rest_m - offset, -most), most)
        self._last[body.id] = (x, y, offset)
        return offset

    def forget(self, name: str) -> None:
        """Forget the position of a vehicle that was placed elsewhere."""
        self._last.pop(name, None)


def shifted(body: BodyState, offset_m: float) -> BodyState:
    """Return the body shifted to the right by an offset."""
    if offset_m == 0.0:
        return body
    (x, y, z), angle = body.position, math.radians(body.heading_deg)
    return msgspec.structs.replace(body, position=(x + offset_m * math.cos(angle), y - offset_m * math.sin(angle), z))
