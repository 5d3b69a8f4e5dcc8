"""When a satellite sees the region: the view at an instant, the passes to come, and an orbit made to pass.

Passes are searched forward from simulation time 0 on a grid of their own, so that the answer depends on the time asked
for and on nothing else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from lingjing.engines.satellite.earth import Horizon, earth_fixed, elevation_deg, off_track_km
from lingjing.engines.satellite.orbit import DAY_S, JulianDate, Orbit, circular, circular_rate
from lingjing.mission.instance import Vector
from lingjing.scene.outlines import wrapped

LEAST_ELEVATION_DEG = 30.0
"""From which elevation pictures are worth taking."""

HEIGHT_KM = 550.0
"""Height of an orbit made to pass."""

_INCLINATION, _POLAR = math.radians(97.6), math.radians(90.0)
_FAR_NORTH_DEG = 80.0
_ROUNDS = 8
_LOW_DEG = -15.0
_SLOW_S, _FINE_S = 60.0, 10.0


@dataclass(frozen=True, slots=True)
class SatelliteView:
    """The satellite from the region and from the scene's origin: (east, north, up) in km, velocity in km/s."""

    region: Vector
    position: Vector
    velocity: Vector
    elevation_deg: float
    off_track_km: float


class PassSearch:
    """One satellite over one region. Times are simulation seconds."""

    def __init__(self, orbit: Orbit, start: JulianDate, origin: Horizon, region: Horizon, swath_km: float) -> None:
        self._orbit, self._start = orbit, start
        self._origin, self._region = origin, region
        self._half_km = swath_km / 2.0
        self._passes: list[tuple[float, float]] = []
        self._searched = 0.0

    def view(self, time_s: float) -> SatelliteView:
        """What there is to see at a time."""
        position, velocity = earth_fixed(self._orbit, self._start.later(time_s))
        region = self._region.seen(position)
        return SatelliteView(
            region=region,
            position=self._origin.seen(position),
            velocity=self._origin.turned(velocity),
            elevation_deg=elevation_deg(region),
            off_track_km=off_track_km(position, velocity, self._region.place),
        )

    def sees(self, view: SatelliteView) -> bool:
        """Whether a picture of the region can be taken."""
        return view.elevation_deg >= LEAST_ELEVATION_DEG and view.off_track_km <= self._half_km

    def next_pass_s(self, time_s: float) -> float:
        """Seconds until the region comes into view; 0 while it is, a day if it does not within a day."""
        for start, end in self._passes:
            if end > time_s:
                return min(max(start - time_s, 0.0), DAY_S)
        while self._searched < time_s + DAY_S:
            found = self._search()
            if found is not None and found[1] > time_s:
                return min(max(found[0] - time_s, 0.0), DAY_S)
        return DAY_S

    def _search(self) -> tuple[float, float] | None:
        """Go on by one step of the grid; the pass that was found there, if any."""
        view = self.view(self._searched)
        if not self.sees(view):
            self._searched += _SLOW_S if view.elevation_deg < _LOW_DEG else _FINE_S
            return None
        start = self._edge(self._searched - _FINE_S, self._searched) if self._searched > 0.0 else 0.0
        last = self._searched
        while last < self._searched + DAY_S and self.sees(self.view(last + _FINE_S)):
            last += _FINE_S
        end = self._edge(last + _FINE_S, last)
        self._searched = last + _FINE_S
        self._passes.append((start, end))
        return start, end

    def _edge(self, outside: float, inside: float) -> float:
        """The time between the two at which the view begins or ends, to a millisecond."""
        while abs(inside - outside) > 1e-3:
            middle = 0.5 * (outside + inside)
            outside, inside = (outside, middle) if self.sees(self.view(middle)) else (middle, inside)
        return inside


def passing(name: str, start: JulianDate, over: Horizon, latitude_deg: float, at_s: float) -> Orbit:
    """A circular orbit that is right above `over` (a place at `latitude_deg`) `at_s` seconds after `start`."""
    inclination = _INCLINATION if abs(latitude_deg) < _FAR_NORTH_DEG else _POLAR
    latitude, longitude = _direction(over.place)
    rise = math.asin(math.sin(latitude) / math.sin(inclination))
    slope = math.sin(inclination) * math.cos(rise) / math.cos(latitude)
    anomaly, node = rise - circular_rate(HEIGHT_KM) * at_s, 0.0
    for _ in range(_ROUNDS):
        orbit = circular(name, start, HEIGHT_KM, inclination, node, anomaly)
        below = _direction(earth_fixed(orbit, start.later(at_s))[0])
        anomaly += wrapped(latitude - below[0]) / slope
        node += wrapped(longitude - below[1])
    return circular(name, start, HEIGHT_KM, inclination, node, anomaly)


def _direction(place: Vector) -> tuple[float, float]:
    """Geocentric latitude and longitude of an Earth-fixed place."""
    return math.atan2(place[2], math.hypot(place[0], place[1])), math.atan2(place[1], place[0])
