"""The airframe of a fixed-wing aircraft: JSBSim's Cessna 172, as it comes with the library, at 100 Hz."""

from __future__ import annotations

import math
from typing import NamedTuple

from lingjing.engines.flight import FOOT_M, POUND_KG, Flight
from lingjing.mission.instance import Vector

STEP_S = 1.0 / 100.0
"""Integration step of the flight dynamics."""

_MODEL = "c172x"
_FAR_BELOW_FT = -10_000.0
_PITCH_DEG = 3.0
_MIXTURE = 0.87
_STICKS = ("aileron", "elevator", "throttle")


class Sample(NamedTuple):
    """What the aircraft does now: velocity over ground (east, north, up) m/s; (roll, pitch, heading) and body rates
    (p, q, r) in radians; true airspeed m/s; fuel flow kg/s."""

    velocity: Vector
    attitude: Vector
    rates: Vector
    airspeed: float
    fuel_flow: float


class Airframe:
    """An aircraft in level flight at `airspeed` in a steady wind (east, north)."""

    def __init__(
        self, origin: tuple[float, float], elevation_m: float, heading_deg: float, airspeed: float, wind: Vector
    ) -> None:
        heading = math.radians(heading_deg)
        ahead = wind[0] * math.sin(heading) + wind[1] * math.cos(heading)
        abeam = wind[0] * math.cos(heading) - wind[1] * math.sin(heading)
        initial = {
            "lat-geod-deg": origin[0],
            "long-gc-deg": origin[1],
            "terrain-elevation-ft": _FAR_BELOW_FT,
            "h-sl-ft": elevation_m / FOOT_M,
            "psi-true-deg": heading_deg,
            "theta-deg": _PITCH_DEG,
            "u-fps": (airspeed + ahead) / FOOT_M,
            "v-fps": abeam / FOOT_M,
        }
        self._flight = Flight(_MODEL, None, STEP_S, initial)
        self._flight["propulsion/set-running"] = -1
        self._flight["propulsion/fuel_freeze"] = 1  # the engine here counts the fuel; the weight stays as it is
        self._flight["fcs/mixture-cmd-norm"] = _MIXTURE
        self._sticks = tuple(self._flight.writer(f"fcs/{stick}-cmd-norm") for stick in _STICKS)
        self._rates = tuple(self._flight.reader(f"velocities/{axis}-rad_sec") for axis in "pqr")
        self._airspeed = self._flight.reader("velocities/vt-fps")
        self._fuel_flow = self._flight.reader("propulsion/engine[0]/fuel-flow-rate-pps")
        self.blow(*wind)

    def blow(self, east: float, north: float, up: float) -> None:
        """Set the air's velocity, m/s."""
        self._flight.blow(east, north, up)

    def command(self, aileron: float, elevator: float, throttle: float) -> None:
        """Set stick (-1..1: right wing down, nose down) and throttle (0..1)."""
        roll, nose, power = self._sticks
        roll(aileron)
        nose(elevator)
        power(throttle)

    def cut(self) -> None:
        """The engine stops."""
        self._flight["propulsion/engine[0]/set-running"] = 0

    def step(self, count: int) -> None:
        """Integrate `count` steps of `STEP_S`."""
        self._flight.step(count)

    def sample(self) -> Sample:
        """Read the state."""
        rolling, nodding, turning = self._rates
        return Sample(
            velocity=self._flight.velocity(),
            attitude=self._flight.attitude(),
            rates=(rolling(), nodding(), turning()),
            airspeed=self._airspeed() * FOOT_M,
            fuel_flow=self._fuel_flow() * POUND_KG,
        )
