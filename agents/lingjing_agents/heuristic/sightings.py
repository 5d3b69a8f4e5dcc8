"""An agent's beliefs about people at sea: drifting positions, merged when they are near each other."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from lingjing.plugins.policy import Datum, Weather
from lingjing_agents.ground_plane import GroundPoint

SightingState = Literal["open", "rescued", "missed"]
"""The state of a believed target: to be served, served, or not found."""


@dataclass(slots=True)
class Sighting:
    """One believed target."""

    x: float
    """East in metres at `time_s`."""
    y: float
    """North in metres at `time_s`."""
    time_s: float
    """Simulated time of the position in seconds."""
    confidence: float
    """Confidence of the detection, 0 to 1."""
    cell: str | None = None
    """The search cell, if known."""
    state: SightingState = "open"
    """The state."""
    reports: int = 1
    """Number of merged reports."""


@dataclass(slots=True)
class Sightings:
    """All sightings of one agent."""

    weather: Weather
    """The present weather, with the water's current."""
    merge_m: float = 35.0
    """Distance in metres within which sightings are merged."""
    drifts: bool = True
    """True if such targets drift with the current."""
    known: list[Sighting] = field(default_factory=list)
    """The sightings in the order of their first report."""

    def heed(self, weather: Weather, time_s: float) -> None:
        """Take the weather of `time_s`. Positions are first moved with the previous current up to then."""
        if weather == self.weather:
            return
        for sighting in self.known:
            sighting.x, sighting.y = self.where(sighting, time_s)
            sighting.time_s = time_s
        self.weather = weather

    def where(self, sighting: Sighting, time_s: float) -> GroundPoint:
        """Return the drifted position of a sighting at `time_s`."""
        if not self.drifts:
            return sighting.x, sighting.y
        bearing = math.radians(self.weather.current_to_deg)
        run = self.weather.current_mps * (time_s - sighting.time_s)
        return sighting.x + run * math.sin(bearing), sighting.y + run * math.cos(bearing)

    def nearest(
        self, point: GroundPoint, time_s: float, *, within: float = math.inf, state: SightingState | None = None
    ) -> Sighting | None:
        """Return the nearest sighting to `point` (m) at `time_s`, of that state and within `within` metres, or None."""
        near = [
            (math.dist(point, self.where(sighting, time_s)), index)
            for index, sighting in enumerate(self.known)
            if state is None or sighting.state == state
        ]
        distance, index = min(near, default=(math.inf, -1))
        return self.known[index] if index >= 0 and distance <= within else None

    def add(self, fresh: Sighting) -> Sighting:
        """Merge `fresh` into the nearest sighting, or store it as a new one. Return the stored one.

        The newer position replaces the older one. A missed sighting that is reported again is open again.
        """
        old = self.nearest((fresh.x, fresh.y), fresh.time_s, within=self.merge_m)
        if old is None:
            self.known.append(fresh)
            return fresh
        if fresh.time_s >= old.time_s and old.state != "rescued":
            old.x, old.y, old.time_s = fresh.x, fresh.y, fresh.time_s
            old.state = "open"
        old.confidence = max(old.confidence, fresh.confidence)
        old.reports += 1
        return old

    def of(self, state: SightingState) -> tuple[Sighting, ...]:
        """Return all sightings of that state, in the order of their first report."""
        return tuple(sighting for sighting in self.known if sighting.state == state)


def confidence_in(body: dict[str, Datum]) -> float:
    """Return a message's `confidence` in 0 to 1, or 0.5 without a valid one."""
    value = body.get("confidence")
    return min(1.0, max(0.0, float(value))) if isinstance(value, (int, float)) and math.isfinite(value) else 0.5


def name_in(body: dict[str, Datum], field_name: str) -> str | None:
    """Return a message's text field, or None."""
    value = body.get(field_name)
    return value if isinstance(value, str) else None
