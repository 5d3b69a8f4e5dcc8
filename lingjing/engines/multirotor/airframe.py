"""The airframe of a multirotor: a 450-class quadrotor with attitude and rate loops, flown by JSBSim at 100 Hz."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from lingjing.engines.flight_dynamics import FOOT_M, POUND_KG, POUND_N, FlightDynamics
from lingjing.mission.instance import Vector

MASS_KG = 1.6
"""Mass of `aircraft/quad450` without a load; the controller needs it to turn acceleration into thrust."""

LIFT_N = 32.0
"""What four rotors can pull."""

_MODEL = "quad450"
_MOTORS = tuple(f"fcs/motor-{number}-thrust-lbs" for number in (1, 2, 3, 4))
_ORDERS = ("fcs/roll-cmd-rad", "fcs/pitch-cmd-rad", "fcs/yaw-rate-cmd-rad_sec", "fcs/thrust-cmd-lbs")
_SLUGS_FT3 = 515.3788184


class RotorSample(NamedTuple):
    """What the airframe does now: velocity (east, north, up) m/s; (roll, pitch, heading) in radians, heading from north
    clockwise; air-relative velocity in the body frame (forward, right, down) m/s; total rotor thrust in newtons; air
    density."""

    velocity: Vector
    attitude: Vector
    air_velocity: Vector
    thrust_n: float
    density: float


class QuadrotorAirframe(FlightDynamics):
    """A quadrotor, standing still and held until `release`."""

    def __init__(self, origin: tuple[float, float], elevation_m: float, heading_deg: float) -> None:
        super().__init__(_MODEL, Path(__file__).parent / "aircraft", origin, elevation_m, heading_deg)
        self["forces/hold-down"] = 1.0
        self._orders = tuple(self.writer(name) for name in _ORDERS)
        self._motors = tuple(self.reader(name) for name in _MOTORS)
        self._air = tuple(self.reader(f"velocities/{axis}-aero-fps") for axis in "uvw")
        self._density = self.reader("atmosphere/rho-slugs_ft3")

    def release(self) -> None:
        """Let go: from now on the airframe flies."""
        self["forces/hold-down"] = 0.0

    def carry(self, load_kg: float) -> None:
        """Hang a load under the centre of mass."""
        self["inertia/pointmass-weight-lbs[0]"] = load_kg / POUND_KG

    def command(self, roll: float, pitch: float, yaw_rate: float, thrust_n: float) -> None:
        """Set the demands of the attitude loops: radians, radians per second, newtons."""
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
            thrust_n=sum([thrust() for thrust in self._motors]) * POUND_N,
            density=self._density() * _SLUGS_FT3,
        )
