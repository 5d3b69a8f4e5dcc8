"""The airframe of a fixed-wing aircraft: the Cessna 172 that comes with JSBSim, at 100 Hz."""

from __future__ import annotations

import math
from typing import NamedTuple

from lingjing.engines.flight_dynamics import FOOT_M, POUND_KG, FlightDynamics
from lingjing.mission.instance import Vector

_MODEL = "c172x"

_FAR_BELOW_FT = -10_000.0
"""Elevation of JSBSim's own ground, feet: far below the scene, so that no wheel ever touches it."""

_PITCH_DEG = 3.0
"""Initial pitch, degrees: near level flight at cruise speed (chosen)."""

_MIXTURE = 0.87
"""Mixture command, 0..1 (chosen)."""

_STICKS = ("aileron", "elevator", "throttle")


class PlaneSample(NamedTuple):
    """The state of the aircraft at the end of a step."""

    velocity: Vector
    """Velocity over ground (east, north, up), m/s."""
    attitude: Vector
    """Roll, pitch and heading, rad."""
    rates: Vector
    """Body rates (p, q, r), rad/s."""
    airspeed: float
    """True airspeed, m/s."""
    fuel_flow: float
    """Fuel flow, kg/s."""


class PlaneAirframe(FlightDynamics):
    """An aircraft in level flight at `airspeed` (m/s) in a steady wind (east, north, up; m/s)."""

    def __init__(
        self, origin: tuple[float, float], elevation_m: float, heading_deg: float, airspeed: float, wind: Vector
    ) -> None:
        heading = math.radians(heading_deg)
        ahead = wind[0] * math.sin(heading) + wind[1] * math.cos(heading)
        abeam = wind[0] * math.cos(heading) - wind[1] * math.sin(heading)
        super().__init__(
            _MODEL,
            None,
            origin,
            elevation_m,
            heading_deg,
            terrain_elevation_ft=_FAR_BELOW_FT,
            theta_deg=_PITCH_DEG,
            u_fps=(airspeed + ahead) / FOOT_M,
            v_fps=abeam / FOOT_M,
        )
        self["propulsion/set-running"] = -1
        self["propulsion/fuel_freeze"] = 1  # `Aeroplane` counts the fuel; the weight stays constant
        self["fcs/mixture-cmd-norm"] = _MIXTURE
        self._sticks = tuple(self.writer(f"fcs/{stick}-cmd-norm") for stick in _STICKS)
        self._rates = tuple(self.reader(f"velocities/{axis}-rad_sec") for axis in "pqr")
        self._airspeed = self.reader("velocities/vt-fps")
        self._fuel_flow = self.reader("propulsion/engine[0]/fuel-flow-rate-pps")
        self.set_wind(*wind)

    def command(self, aileron: float, elevator: float, throttle: float) -> None:
        """Set the stick (-1..1; positive: right wing down, nose down) and the throttle (0..1)."""
        roll, nose, power = self._sticks
        roll(aileron)
        nose(elevator)
        power(throttle)

    def cut(self) -> None:
        """Stop the engine."""
        self["propulsion/engine[0]/set-running"] = 0

    def sample(self) -> PlaneSample:
        """Read the state."""
        rolling, nodding, turning = self._rates
        return PlaneSample(
            velocity=self.velocity(),
            attitude=self.attitude(),
            rates=(rolling(), nodding(), turning()),
            airspeed=self._airspeed() * FOOT_M,
            fuel_flow=self._fuel_flow() * POUND_KG,
        )
