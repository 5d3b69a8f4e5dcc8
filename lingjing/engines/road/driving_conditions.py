"""The effect of weather on drivers, for weather with `effects`: speed, headway, braking and sight.

Every number is a published observation of drivers or of tyres, or a geometric design standard. Of two conditions that
hold at once the stronger one counts, as in the Highway Capacity Manual; darkness adds to either.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from lingjing.engines.sea import GRAVITY
from lingjing.mission.instance import Weather

_WET_SLOWDOWN = (0.10, 0.25)
"""Reduction of the speed on wet arterials in the lightest and the heaviest rain, as shares: FHWA Road Weather
Management, "How Do Weather Events Impact Roads?"."""

_ICE_SLOWDOWN = (0.30, 0.40)
"""Reduction of the speed on snowy or slushy arterials, as shares, for the least and the greatest `ice` (as above)."""

_FOG_SLOWDOWN = 0.11
"""Reduction of the speed in low visibility, as a share: the middle of 10 to 12 % (same source)."""

_FOG_M = 1609.0
"""Visibility below which these sources speak of low visibility, metres: one mile."""

_NIGHT_SLOWDOWN = 0.03
"""Reduction of the speed on streets with half of the light, as a share: VTI notat 3-2014. In clear weather darkness
alone has hardly more effect (Jägerbrand and Sjöbergh, SpringerPlus 5:505, 2016)."""

_NIGHT_DEG = -6.0
"""Elevation of the sun below which it is night, degrees: the end of civil twilight."""

_NIGHT_SIGHT_M = 95.0
"""Distance at which drivers detect a pedestrian at night under dimmed street lamps, metres (VTI notat 3-2014)."""

_RAIN_CAPACITY, _ICE_CAPACITY, _FOG_CAPACITY = 0.1413, 0.2243, 0.1049
"""Reduction of a road's capacity in rain over 0.25 in/h, in snow over 0.5 in/h and in visibility below a quarter of a
mile, as shares: HCM 2010, exhibit 10-15 (FHWA-HOP-13-042, table 33). Headways grow by the inverse of what is left."""

_DRY, _WET, _ICY = 0.8, 0.7, 0.2
"""Friction of dry, wet and packed or icy roads: Wallman and Åström, VTI meddelande 911A, 2001 (dry 0.8 to 1.0, wet 0.7
to 0.8, packed snow 0.20 to 0.30, black ice 0.15 to 0.30). 0.8 is also SUMO's emergency braking of 8 m/s^2."""

_REACTION_S, _BRAKING_MPS2 = 2.5, 3.4
"""Reaction time (s) and deceleration (m/s^2) of the stopping sight distance: AASHTO, A Policy on Geometric Design of
Highways and Streets, 2018, section 3.2.2."""


@dataclass(frozen=True, slots=True)
class DrivingConditions:
    """The behaviour of drivers and tyres in a weather, relative to a dry road by day."""

    speed_share: float = 1.0
    """Desired speed, as a share."""
    sight_mps: float = math.inf
    """Speed from which a driver can stop within sight, m/s."""
    headway_share: float = 1.0
    """Time headway to the vehicle ahead, as a share."""
    grip: float = 1.0
    """Friction, as a share; braking has the same share."""

    def top_mps(self, speed_mps: float) -> float:
        """Return the top speed in these conditions of a vehicle with this top speed, m/s."""
        return min(speed_mps * self.speed_share, self.sight_mps)

    def braking_mps2(self, gentle_mps2: float, comfortable_mps2: float) -> float:
        """Return the deceleration of a gentle halt, m/s^2: at most the comfortable one of the vehicle, which the
        friction reduces."""
        return min(gentle_mps2, comfortable_mps2 * self.grip)


DRY_DAY = DrivingConditions()
"""A dry road by day, and every weather without `effects`."""


def driving_conditions(weather: Weather) -> DrivingConditions:
    """Return the conditions of a weather; `DRY_DAY` without its `effects`."""
    if not weather.effects:
        return DRY_DAY
    fog, night = weather.visibility_m < _FOG_M, weather.sun_elevation_deg < _NIGHT_DEG
    slowdowns = (
        _between(_WET_SLOWDOWN, weather.rain), _between(_ICE_SLOWDOWN, weather.ice), _FOG_SLOWDOWN if fog else 0.0
    )  # fmt: skip
    capacity = max(_RAIN_CAPACITY * weather.rain, _ICE_CAPACITY * weather.ice, _FOG_CAPACITY if fog else 0.0)
    wet = _DRY + (_WET - _DRY) * weather.rain
    friction = min(wet, _DRY + (_ICY - _DRY) * weather.ice)
    sight_m = min(weather.visibility_m, _NIGHT_SIGHT_M if night else math.inf)
    return DrivingConditions(
        speed_share=(1.0 - max(slowdowns)) * (1.0 - (_NIGHT_SLOWDOWN if night else 0.0)),
        sight_mps=_stopping_mps(sight_m, min(_BRAKING_MPS2, friction * GRAVITY)),
        headway_share=1.0 / (1.0 - capacity),
        grip=friction / _DRY,
    )


def _between(bounds: tuple[float, float], amount: float) -> float:
    """Return the value between two bounds for an amount of 0..1; 0 for none."""
    return bounds[0] + (bounds[1] - bounds[0]) * amount if amount > 0.0 else 0.0


def _stopping_mps(sight_m: float, braking_mps2: float) -> float:
    """Return the speed, m/s, at which the distances of reaction and braking add up to `sight_m`."""
    reach = braking_mps2 * _REACTION_S
    return math.sqrt(reach * reach + 2.0 * braking_mps2 * sight_m) - reach
