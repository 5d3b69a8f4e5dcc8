"""What a searcher believes about fires: places that get better the nearer they are seen from."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from lingjing_agents.ground_plane import GroundPoint

FireState = Literal["open", "out", "false"]

ERROR_SHARE = 0.35
"""How wrong a distance may be, as a share of it."""

LEAST_ERROR_M = 5.0
CLOSER = 0.6
"""A fire is worth another report when it is seen from less than this share of the former distance."""


@dataclass(slots=True)
class KnownFire:
    """One believed fire: its place (m), from how far it was seen at best and who saw it last, and what came of it."""

    place: GroundPoint
    seen_from_m: float
    state: FireState = "open"
    reported_from_m: float = math.inf
    looked_at: GroundPoint | None = None
    tries: int = 0
    seen_by: str = ""
    chased: int = 0

    @property
    def error_m(self) -> float:
        """How far off the place may be."""
        return max(LEAST_ERROR_M, ERROR_SHARE * self.seen_from_m)


@dataclass(slots=True)
class KnownFires:
    """All fires one searcher has seen or heard of."""

    known: list[KnownFire] = field(default_factory=list)

    def of(self, state: FireState) -> tuple[KnownFire, ...]:
        """Those in a state, in the order they became known."""
        return tuple(fire for fire in self.known if fire.state == state)

    def near(self, place: GroundPoint, within_m: float, state: FireState | None = None) -> KnownFire | None:
        """The nearest one to a place, if there is one so near."""
        options = [
            (math.dist(fire.place, place), i) for i, fire in enumerate(self.known) if state in (None, fire.state)
        ]
        distance, index = min(options, default=(math.inf, -1))
        return self.known[index] if distance <= within_m else None

    def add(self, place: GroundPoint, distance_m: float, by: str = "") -> KnownFire:
        """Somebody sees a fire at a place from a distance: the one it must be, or a new one."""
        fresh = KnownFire(place, distance_m, seen_by=by)
        candidates = [
            (math.dist(fire.place, place), index)
            for index, fire in enumerate(self.known)
            if math.dist(fire.place, place) <= max(fire.error_m, fresh.error_m)
        ]
        if not candidates:
            self.known.append(fresh)
            return fresh
        fire = self.known[min(candidates)[1]]
        fire.seen_by = by
        if fire.state == "out":
            if distance_m > 20.0 or math.dist(fire.place, place) < LEAST_ERROR_M:
                return fire
            self.known.append(fresh)
            return fresh
        if distance_m <= fire.seen_from_m * 1.2 or fire.state == "false":
            fire.place, fire.seen_from_m = place, min(distance_m, fire.seen_from_m * 1.2)
            if fire.state == "false":
                fire.state, fire.tries = "open", fire.tries // 2
        return fire

    def put_out(self, place: GroundPoint, within_m: float) -> KnownFire | None:
        """A fire near a place is out."""
        fire = self.near(place, within_m, "open")
        if fire is not None:
            fire.state = "out"
        return fire
