"""What an agent believes about people at sea: positions that drift, merged when they are near each other."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from lingjing.plugins.policy import Datum, Weather
from lingjing_agents.ground_plane import GroundPoint

SightingState = Literal["open", "rescued", "missed"]


@dataclass(slots=True)
class Sighting:
    """One believed person: where it was seen (east, north, m) and when (s), how sure (0..1), and what came of it."""

    x: float
    y: float
    time_s: float
    confidence: float
    cell: str | None = None
    state: SightingState = "open"
    reports: int = 1


@dataclass(slots=True)
class Sightings:
    """All sightings of one agent. Positions move with the water's current as `weather` has it; `drifts` says whether
    such targets float at all."""

    weather: Weather
    merge_m: float = 35.0
    drifts: bool = True
    known: list[Sighting] = field(default_factory=list)

    def heed(self, weather: Weather, time_s: float) -> None:
        """Take on the weather of `time_s`: what floats has drifted with the current before until then."""
        if weather == self.weather:
            return
        for sighting in self.known:
            sighting.x, sighting.y = self.where(sighting, time_s)
            sighting.time_s = time_s
        self.weather = weather

    def where(self, sighting: Sighting, time_s: float) -> GroundPoint:
        """Where a sighting has drifted to by `time_s`."""
        if not self.drifts:
            return sighting.x, sighting.y
        bearing = math.radians(self.weather.current_to_deg)
        run = self.weather.current_mps * (time_s - sighting.time_s)
        return sighting.x + run * math.sin(bearing), sighting.y + run * math.cos(bearing)

    def nearest(
        self, point: GroundPoint, time_s: float, *, within: float = math.inf, state: SightingState | None = None
    ) -> Sighting | None:
        """The nearest sighting to `point` (m) at `time_s`, if one in that state is within `within` metres."""
        near = [
            (math.dist(point, self.where(sighting, time_s)), index)
            for index, sighting in enumerate(self.known)
            if state is None or sighting.state == state
        ]
        distance, index = min(near, default=(math.inf, -1))
        return self.known[index] if index >= 0 and distance <= within else None

    def add(self, fresh: Sighting) -> Sighting:
        """Merge `fresh` into the sighting it belongs to, or remember it as a new one; returns the one that is kept.

        A missed one that is seen again is open again; the newer position replaces the older one."""
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
        """All sightings in that state, in the order they became known."""
        return tuple(sighting for sighting in self.known if sighting.state == state)


def confidence_in(body: dict[str, Datum]) -> float:
    """A message's `confidence` in 0..1, or 0.5 if it has none that can be read."""
    value = body.get("confidence")
    return min(1.0, max(0.0, float(value))) if isinstance(value, (int, float)) and math.isfinite(value) else 0.5


def name_in(body: dict[str, Datum], field_name: str) -> str | None:
    """A message's text field, or None."""
    value = body.get(field_name)
    return value if isinstance(value, str) else None
