"""Sideways motion: what SUMO does at once, shown as a car would do it.

SUMO moves a vehicle that changes lanes by a whole lane in one step, and one that parks by 3.2 m to the right. (Its own
`--lanechange.duration` works beside vehicles that are set from outside, but the vehicles then drive otherwise, and
every digest with traffic is another one.) Here each such jump is found in the positions and shown as an offset that
fades at walking speed.
"""

from __future__ import annotations

import math

import msgspec

from lingjing.trace.records import BodyState

SPEED_MPS = 1.3
_JUMP_M = (2.0, 5.0)
_LONGEST_S = 0.6


class LateralOffsets:
    """The offsets of vehicles, by id: metres to the right of where SUMO has them."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[float, float, float]] = {}

    def follow(self, body: BodyState, after_s: float, rest_m: float = 0.0) -> float:
        """The offset of a body that is read `after_s` after the last time; it fades towards `rest_m`."""
        x, y, _ = body.position
        last = self._last.get(body.id)
        offset = rest_m
        if last is not None and after_s <= _LONGEST_S:
            offset = last[2]
            east, north = x - last[0], y - last[1]
            if abs(east) + abs(north) > _JUMP_M[0]:  # what is less is no jump in whatever direction
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
        """A vehicle has been put elsewhere."""
        self._last.pop(name, None)


def shifted(body: BodyState, offset_m: float) -> BodyState:
    """The body so far to the right."""
    if offset_m == 0.0:
        return body
    (x, y, z), angle = body.position, math.radians(body.heading_deg)
    return msgspec.structs.replace(body, position=(x + offset_m * math.cos(angle), y - offset_m * math.sin(angle), z))
