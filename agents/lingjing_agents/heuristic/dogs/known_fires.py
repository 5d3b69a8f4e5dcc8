"""A searcher's beliefs about fires: positions that improve with nearer views."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from lingjing.plugins.geometry import bearing_deg, turn_deg
from lingjing_agents.ground_plane import GroundPoint

FireState = Literal["open", "out", "false"]
"""The state of a believed fire: burning, out, or a false alarm."""

ERROR_SHARE = 0.35
"""Error of a distance as a share of it. Chosen."""

LEAST_ERROR_M = 5.0
"""Least error of a position in metres. Chosen."""
UPON_M = 3.0
"""Distance in metres to a burnt-out fire within which all flames are taken for its own. Chosen."""

ASHES_M_DEG = 120.0
"""Error of a bearing in degrees, times the distance in metres: 2 m aside. Chosen."""

CLOSER = 0.6
"""Share of the former distance below which a fire is reported again. Chosen."""


@dataclass(slots=True)
class KnownFire:
    """One believed fire."""

    place: GroundPoint
    """East and north in metres."""
    seen_from_m: float
    """The distance in metres of the best view."""
    state: FireState = "open"
    """The state."""
    reported_from_m: float = math.inf
    """The distance in metres of the last report's view; infinite before the first."""
    looked_at: GroundPoint | None = None
    """The place of the last picture of it; None before the first."""
    tries: int = 0
    """Number of attempts beside it."""
    seen_by: str = ""
    """The agent that saw it last."""
    chased: int = 0
    """Ticks of pursuit since the last sight."""

    @property
    def error_m(self) -> float:
        """Error of the position in metres."""
        return max(LEAST_ERROR_M, ERROR_SHARE * self.seen_from_m)


@dataclass(slots=True)
class KnownFires:
    """All fires that one searcher has seen or received reports of."""

    known: list[KnownFire] = field(default_factory=list)

    def of(self, state: FireState) -> tuple[KnownFire, ...]:
        """Return the fires of a state, in the order of their first report."""
        return tuple(fire for fire in self.known if fire.state == state)

    def near(self, place: GroundPoint, within_m: float, state: FireState | None = None) -> KnownFire | None:
        """Return the nearest fire within a distance of a place, or None."""
        options = [
            (math.dist(fire.place, place), i) for i, fire in enumerate(self.known) if state in (None, fire.state)
        ]
        distance, index = min(options, default=(math.inf, -1))
        return self.known[index] if distance <= within_m else None

    def add(self, place: GroundPoint, distance_m: float, by: str = "") -> KnownFire:
        """Add a view of a fire at a place from a distance. Return the known fire that it matches, or a new one."""
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

    def burnt(self, place: GroundPoint) -> None:
        """Remember a fire that went out at a place, unless one is known to have gone out there."""
        if self.near(place, LEAST_ERROR_M, "out") is None:
            self.known.append(KnownFire(place, LEAST_ERROR_M, state="out"))

    def is_behind_ashes(self, here: GroundPoint, left_deg: float, right_deg: float) -> bool:
        """Return whether a burnt-out fire lies between two bearings from here, or right here. A box there may show
        its ashes, and their size does not give a distance."""
        middle, half = left_deg + turn_deg(left_deg, right_deg) / 2.0, turn_deg(left_deg, right_deg) / 2.0
        return any(
            math.dist(here, fire.place) <= UPON_M
            or abs(turn_deg(middle, bearing_deg(here, fire.place))) <= half + ASHES_M_DEG / math.dist(here, fire.place)
            for fire in self.of("out")
        )

    def put_out(self, place: GroundPoint, within_m: float) -> KnownFire | None:
        """Mark the nearest fire within a distance of a place as out, and return it."""
        fire = self.near(place, within_m, "open")
        if fire is not None:
            fire.state = "out"
        return fire
