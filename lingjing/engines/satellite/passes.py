"""Passes: the view of a satellite at an instant, the next passes, and an orbit that is made to pass over a place.

The search runs forward from simulation time 0 on a fixed grid. Its answer therefore depends only on the requested time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from lingjing.engines.satellite.earth import Horizon, earth_fixed, elevation_deg, off_track_km
from lingjing.engines.satellite.orbit import DAY_S, JulianDate, Orbit, circular, circular_rate
from lingjing.mission.instance import Vector
from lingjing.scene.outlines import wrapped

LEAST_ELEVATION_DEG = 30.0
"""Elevation from which pictures of the region are possible, degrees (chosen)."""

HEIGHT_KM = 550.0
"""Height of an orbit that is made to pass, km (chosen)."""

_INCLINATION = math.radians(97.6)
"""Inclination of a sun-synchronous orbit at `HEIGHT_KM`, rad."""

_POLAR = math.radians(90.0)
"""Inclination of the orbit over a scene that `_INCLINATION` does not reach, rad."""

_FAR_NORTH_DEG = 80.0
"""Latitude from which the orbit is polar, degrees (chosen)."""

_ROUNDS = 8
"""Newton steps in the search for an orbit; fewer suffice (chosen)."""

_LOW_DEG = -15.0
"""Elevation below which the search takes large steps, degrees (chosen)."""

_SLOW_S, _FINE_S = 60.0, 10.0
"""Large and small step of the search, seconds (chosen)."""


@dataclass(frozen=True, slots=True)
class SatelliteView:
    """The satellite relative to the region and to the scene's origin."""

    region: Vector
    """Position relative to the region (east, north, up), km."""
    position: Vector
    """Position relative to the scene's origin (east, north, up), km."""
    velocity: Vector
    """Velocity in the frame of the origin (east, north, up), km/s."""
    elevation_deg: float
    """Elevation above the region's horizon, degrees."""
    off_track_km: float
    """Distance of the region from the ground track, km."""


class PassSearch:
    """The passes of one satellite over one region. Times are simulation seconds."""

    def __init__(self, orbit: Orbit, start: JulianDate, origin: Horizon, region: Horizon, swath_km: float) -> None:
        self._orbit, self._start = orbit, start
        self._origin, self._region = origin, region
        self._half_km = swath_km / 2.0
        self._passes: list[tuple[float, float]] = []
        self._searched = 0.0

    def view(self, time_s: float) -> SatelliteView:
        """Return the view at a time."""
        position, velocity = earth_fixed(self._orbit, self._start.later(time_s))
        region = self._region.relative(position)
        return SatelliteView(
            region=region,
            position=self._origin.relative(position),
            velocity=self._origin.rotated(velocity),
            elevation_deg=elevation_deg(region),
            off_track_km=off_track_km(position, velocity, self._region.place),
        )

    def sees(self, view: SatelliteView) -> bool:
        """Return whether a picture of the region is possible."""
        return view.elevation_deg >= LEAST_ELEVATION_DEG and view.off_track_km <= self._half_km

    def next_pass_s(self, time_s: float) -> float:
        """Return the seconds until the region comes into view.

        The value is 0 while the region is in view, and one day if it does not come into view within a day.
        """
        for start, end in self._passes:
            if end > time_s:
                return min(max(start - time_s, 0.0), DAY_S)
        while self._searched < time_s + DAY_S:
            next_pass = self._search()
            if next_pass is not None and next_pass[1] > time_s:
                return min(max(next_pass[0] - time_s, 0.0), DAY_S)
        return DAY_S

    def _search(self) -> tuple[float, float] | None:
        """Advance the search by one step, and return the pass that begins there, if any."""
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
        """Return the time between the two at which the view begins or ends, to a millisecond."""
        while abs(inside - outside) > 1e-3:
            middle = 0.5 * (outside + inside)
            outside, inside = (outside, middle) if self.sees(self.view(middle)) else (middle, inside)
        return inside


def passing(name: str, start: JulianDate, over: Horizon, latitude_deg: float, at_s: float) -> Orbit:
    """Return a circular orbit that is exactly above `over` (a place at `latitude_deg`) `at_s` seconds after `start`."""
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
    """Return geocentric latitude and longitude of an Earth-fixed place, rad."""
    return math.atan2(place[2], math.hypot(place[0], place[1])), math.atan2(place[1], place[0])
