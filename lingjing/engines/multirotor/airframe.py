"""The airframe of a multirotor: a 450-class quadrotor with attitude and rate loops, flown by JSBSim at 100 Hz."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from lingjing.engines.flight import FOOT_M, POUND_KG, POUND_N, Flight

STEP_S = 1.0 / 100.0
"""Integration step of the flight dynamics. Flights at 250 Hz end within a millimetre and the same period."""

MASS_KG = 1.6
"""Mass of `aircraft/quad450` without a load; the controller needs it to turn acceleration into thrust."""

LIFT_N = 32.0
"""What four rotors can pull."""

_MODEL = "quad450"
_MOTORS = tuple(f"fcs/motor-{number}-thrust-lbs" for number in (1, 2, 3, 4))
_ORDERS = ("fcs/roll-cmd-rad", "fcs/pitch-cmd-rad", "fcs/yaw-rate-cmd-rad_sec", "fcs/thrust-cmd-lbs")
_SLUGS_FT3 = 515.3788184


class Sample(NamedTuple):
    """What the airframe does now: velocity (east, north, up) m/s; attitude in radians, heading from north clockwise;
    air-relative velocity in the body frame (forward, right, down) m/s; total rotor thrust in newtons; air density."""

    velocity: tuple[float, float, float]
    roll: float
    pitch: float
    heading: float
    air_velocity: tuple[float, float, float]
    thrust_n: float
    density: float


class Airframe:
    """A quadrotor, standing still and held until `release`."""

    def __init__(self, latitude_deg: float, longitude_deg: float, elevation_m: float, heading_deg: float) -> None:
        initial = {
            "lat-geod-deg": latitude_deg,
            "long-gc-deg": longitude_deg,
            "h-sl-ft": elevation_m / FOOT_M,
            "psi-true-deg": heading_deg,
        }
        self._flight = Flight(_MODEL, Path(__file__).parent / "aircraft", STEP_S, initial)
        self._flight["forces/hold-down"] = 1.0
        self._orders = tuple(self._flight.writer(name) for name in _ORDERS)
        self._motors = tuple(self._flight.reader(name) for name in _MOTORS)
        self._air = tuple(self._flight.reader(f"velocities/{axis}-aero-fps") for axis in "uvw")
        self._density = self._flight.reader("atmosphere/rho-slugs_ft3")

    def release(self) -> None:
        """Let go: from now on the airframe flies."""
        self._flight["forces/hold-down"] = 0.0

    def carry(self, load_kg: float) -> None:
        """Hang a load under the centre of mass."""
        self._flight["inertia/pointmass-weight-lbs[0]"] = load_kg / POUND_KG

    def blow(self, east: float, north: float, up: float) -> None:
        """Set the air's velocity, m/s."""
        self._flight.blow(east, north, up)

    def command(self, roll: float, pitch: float, yaw_rate: float, thrust_n: float) -> None:
        """Set the demands of the attitude loops: radians, radians per second, newtons."""
        lean, nod, turn, lift = self._orders
        lean(roll)
        nod(pitch)
        turn(yaw_rate)
        lift(thrust_n / POUND_N)

    def step(self, count: int) -> None:
        """Integrate `count` steps of `STEP_S`."""
        self._flight.step(count)

    def sample(self) -> Sample:
        """Read the state."""
        roll, pitch, heading = self._flight.attitude()
        forward, right, down = self._air
        return Sample(
            velocity=self._flight.velocity(),
            roll=roll,
            pitch=pitch,
            heading=heading,
            air_velocity=(forward() * FOOT_M, right() * FOOT_M, down() * FOOT_M),
            thrust_n=sum([thrust() for thrust in self._motors]) * POUND_N,
            density=self._density() * _SLUGS_FT3,
        )
