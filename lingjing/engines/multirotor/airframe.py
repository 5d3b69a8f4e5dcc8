"""The airframe of a multirotor: a 450-class quadrotor with attitude and rate loops in JSBSim at 100 Hz."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from lingjing.engines.flight_dynamics import FOOT_M, POUND_KG, POUND_N, FlightDynamics
from lingjing.mission.instance import Vector
from lingjing.sums import total

MASS_KG = 1.6
"""Mass of `aircraft/quad450` without load, kg. The controller uses it to turn acceleration into thrust."""

LIFT_N = 32.0
"""Largest thrust of the four rotors together, newtons (as in `aircraft/quad450`)."""

_MODEL = "quad450"
_MOTORS = tuple(f"fcs/motor-{number}-thrust-lbs" for number in (1, 2, 3, 4))
_ORDERS = ("fcs/roll-cmd-rad", "fcs/pitch-cmd-rad", "fcs/yaw-rate-cmd-rad_sec", "fcs/thrust-cmd-lbs")
_SLUGS_FT3 = 515.3788184
"""One slug per cubic foot in kg/m^3."""


class RotorSample(NamedTuple):
    """The state of the airframe at the end of a step."""

    velocity: Vector
    """Velocity over ground (east, north, up), m/s."""
    attitude: Vector
    """Roll, pitch and heading, rad; the heading is clockwise from north."""
    air_velocity: Vector
    """Velocity relative to the air in the body frame (forward, right, down), m/s."""
    thrust_n: float
    """Total thrust of the rotors, newtons."""
    density: float
    """Density of the air, kg/m^3."""


class QuadrotorAirframe(FlightDynamics):
    """A quadrotor, held in place until `release`."""

    def __init__(self, origin: tuple[float, float], elevation_m: float, heading_deg: float) -> None:
        super().__init__(_MODEL, Path(__file__).parent / "aircraft", origin, elevation_m, heading_deg)
        self["forces/hold-down"] = 1.0
        self._orders = tuple(self.writer(name) for name in _ORDERS)
        self._motors = tuple(self.reader(name) for name in _MOTORS)
        self._air = tuple(self.reader(f"velocities/{axis}-aero-fps") for axis in "uvw")
        self._density = self.reader("atmosphere/rho-slugs_ft3")

    def release(self) -> None:
        """Let the airframe fly from now on."""
        self["forces/hold-down"] = 0.0

    def set_load(self, load_kg: float) -> None:
        """Set the load below the centre of mass, kg."""
        self["inertia/pointmass-weight-lbs[0]"] = load_kg / POUND_KG

    def command(self, roll: float, pitch: float, yaw_rate: float, thrust_n: float) -> None:
        """Set the demands of the attitude loops: roll and pitch in rad, yaw rate in rad/s, thrust in newtons."""
        lean, nod, turn, lift = self._orders
        lean(roll)
        nod(pitch)
        turn(yaw_rate)
        lift(thrust_n / POUND_N)

    def sample(self) -> RotorSample:
        """Read the state."""
        forward, right, down = self._air
        return RotorSample(
            velocity=self.velocity(),
            attitude=self.attitude(),
            air_velocity=(forward() * FOOT_M, right() * FOOT_M, down() * FOOT_M),
            thrust_n=total([thrust() for thrust in self._motors]) * POUND_N,
            density=self._density() * _SLUGS_FT3,
        )
