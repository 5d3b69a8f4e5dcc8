"""One airframe in JSBSim: SI in, SI out. The only module that imports `jsbsim`.

JSBSim has no threads and no files open after loading, so a process that holds airframes can be forked.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("JSBSIM_DEBUG", "0")  # read when the library is loaded; silences its banner

import jsbsim

from lingjing.errors import InfrastructureError

STEP_S = 1.0 / 250.0
"""Integration step of the flight dynamics."""

MASS_KG = 1.6
"""Mass of `aircraft/quad450`; the controller needs it to turn acceleration into thrust."""

_MODEL = "quad450"
_FOOT = 0.3048
_POUND = 4.4482216152605
_MOTORS = tuple(f"fcs/motor-{number}-thrust-lbs" for number in (1, 2, 3, 4))


@dataclass(frozen=True, slots=True)
class Sample:
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
    """A quadrotor with attitude and rate loops, standing still and held until `release`."""

    def __init__(self, latitude_deg: float, longitude_deg: float, elevation_m: float, heading_deg: float) -> None:
        executive = jsbsim.FGFDMExec(None)
        executive.set_debug_level(0)
        folder = str(Path(__file__).parent / "aircraft")
        executive.set_aircraft_path(folder)
        executive.set_engine_path(folder)
        executive.set_systems_path(folder)
        if not executive.load_model(_MODEL):
            raise InfrastructureError(f"jsbsim cannot load the airframe `{_MODEL}` from {folder}")
        executive.set_dt(STEP_S)
        executive["ic/lat-geod-deg"] = latitude_deg
        executive["ic/long-gc-deg"] = longitude_deg
        executive["ic/h-sl-ft"] = elevation_m / _FOOT
        executive["ic/psi-true-deg"] = heading_deg
        if not executive.run_ic():
            raise InfrastructureError("jsbsim cannot initialise the airframe at its start position")
        executive["forces/hold-down"] = 1.0
        self._executive = executive

    def release(self) -> None:
        """Let go: from now on the airframe flies."""
        self._executive["forces/hold-down"] = 0.0

    def blow(self, east: float, north: float, up: float) -> None:
        """Set the air's velocity, m/s."""
        self._executive["atmosphere/wind-east-fps"] = east / _FOOT
        self._executive["atmosphere/wind-north-fps"] = north / _FOOT
        self._executive["atmosphere/wind-down-fps"] = -up / _FOOT

    def command(self, roll: float, pitch: float, yaw_rate: float, thrust_n: float) -> None:
        """Set the demands of the attitude loops: radians, radians per second, newtons."""
        self._executive["fcs/roll-cmd-rad"] = roll
        self._executive["fcs/pitch-cmd-rad"] = pitch
        self._executive["fcs/yaw-rate-cmd-rad_sec"] = yaw_rate
        self._executive["fcs/thrust-cmd-lbs"] = thrust_n / _POUND

    def step(self, count: int) -> None:
        """Integrate `count` steps of `STEP_S`."""
        for _ in range(count):
            self._executive.run()

    def sample(self) -> Sample:
        """Read the state; a state that is no number is an engine failure."""
        read = self._executive
        velocity = (
            read["velocities/v-east-fps"] * _FOOT,
            read["velocities/v-north-fps"] * _FOOT,
            -read["velocities/v-down-fps"] * _FOOT,
        )
        if not math.isfinite(sum(velocity)):
            raise InfrastructureError("jsbsim diverged: an airframe's velocity is not a number")
        return Sample(
            velocity=velocity,
            roll=read["attitude/phi-rad"],
            pitch=read["attitude/theta-rad"],
            heading=read["attitude/psi-rad"],
            air_velocity=(
                read["velocities/u-aero-fps"] * _FOOT,
                read["velocities/v-aero-fps"] * _FOOT,
                read["velocities/w-aero-fps"] * _FOOT,
            ),
            thrust_n=sum(read[motor] for motor in _MOTORS) * _POUND,
            density=read["atmosphere/rho-slugs_ft3"] * 515.3788184,
        )
