"""JSBSim, SI in and SI out: what every aircraft of the project asks of it. The only module that imports `jsbsim`.

JSBSim has no threads and no files open after loading, so a process that holds aircraft can be forked. The world is
flat: its local north, east and down are taken as the world's axes at every place; its latitude and longitude are read
by nobody, and its own ground lies far below (the engines' terrain says what is hit).
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("JSBSIM_DEBUG", "0")  # read when the library is loaded; silences its banner

import jsbsim

from lingjing.errors import InfrastructureError
from lingjing.mission.instance import Vector

STEP_S = 1.0 / 100.0
"""Integration step. Flights at 250 Hz end within a millimetre and the same period."""

FOOT_M = 0.3048
POUND_N = 4.4482216152605
POUND_KG = 0.45359237

ReadProperty = Callable[[], float]
WriteProperty = Callable[[float], object]


class FlightDynamics:
    """One aircraft in JSBSim at its initial conditions: at an origin (latitude, longitude), elevation and heading.

    `folder` holds `<model>/<model>.xml`; None means the aircraft that come with the library. `initial` are further
    properties under `ic/`, in JSBSim's own units.
    """

    def __init__(
        self,
        model: str,
        folder: Path | None,
        origin: tuple[float, float],
        elevation_m: float,
        heading_deg: float,
        **initial: float,
    ) -> None:
        executive = jsbsim.FGFDMExec(None)
        executive.set_debug_level(0)
        if folder is not None:
            executive.set_aircraft_path(str(folder))
            executive.set_engine_path(str(folder))
            executive.set_systems_path(str(folder))
        if not executive.load_model(model):
            raise InfrastructureError(f"jsbsim cannot load the airframe `{model}` from {folder or 'its own folder'}")
        if executive.set_output_filename(0, os.devnull):  # some aircraft write a table into the working folder
            executive.disable_output()
        executive.set_dt(STEP_S)
        executive["ic/lat-geod-deg"], executive["ic/long-gc-deg"] = origin
        executive["ic/h-sl-ft"], executive["ic/psi-true-deg"] = elevation_m / FOOT_M, heading_deg
        for name, value in initial.items():
            executive[f"ic/{name.replace('_', '-')}"] = value
        if not executive.run_ic():
            raise InfrastructureError(f"jsbsim cannot initialise the airframe `{model}` at its start position")
        self._executive = executive
        self._wind = tuple(self.writer(f"atmosphere/wind-{way}-fps") for way in ("east", "north", "down"))
        self._velocity = tuple(self.reader(f"velocities/v-{way}-fps") for way in ("east", "north", "down"))
        self._attitude = tuple(self.reader(f"attitude/{angle}-rad") for angle in ("phi", "theta", "psi"))

    def __setitem__(self, name: str, value: float) -> None:
        """Set a property once, in JSBSim's unit; what is set again and again has a `writer`."""
        self._executive[name] = value

    def reader(self, name: str) -> ReadProperty:
        """What reads a property, in JSBSim's unit, without looking for its name each time."""
        read: ReadProperty = self._node(name).get_double_value
        return read

    def writer(self, name: str) -> WriteProperty:
        """What sets a property, in JSBSim's unit, at a tenth of the price of doing so by name."""
        write: WriteProperty = self._node(name).set_double_value
        return write

    def blow(self, east: float, north: float, up: float) -> None:
        """Set the air's velocity, m/s."""
        to_east, to_north, down = self._wind
        to_east(east / FOOT_M)
        to_north(north / FOOT_M)
        down(-up / FOOT_M)

    def step(self, count: int) -> None:
        """Integrate `count` steps of `STEP_S`."""
        for _ in range(count):
            self._executive.run()

    def velocity(self) -> Vector:
        """Velocity over ground (east, north, up), m/s; one that is no number is an engine failure."""
        east, north, down = self._velocity
        velocity = (east() * FOOT_M, north() * FOOT_M, -down() * FOOT_M)
        if not math.isfinite(sum(velocity)):
            raise InfrastructureError("jsbsim diverged: an aircraft's velocity is not a number")
        return velocity

    def attitude(self) -> Vector:
        """(roll, pitch, heading) in radians, heading from north clockwise."""
        roll, pitch, heading = self._attitude
        return roll(), pitch(), heading()

    def _node(self, name: str) -> jsbsim.FGPropertyNode:
        node = self._executive.get_property_manager().get_node(name)
        if node is None:
            raise InfrastructureError(f"jsbsim's airframe has no property `{name}`")
        return node
