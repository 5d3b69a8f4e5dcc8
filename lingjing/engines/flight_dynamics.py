"""The interface to JSBSim in SI units. No other module imports `jsbsim`.

JSBSim has no threads and no open files after loading, so a process with aircraft can be forked. The world is flat:
JSBSim's local north, east and down are the world's axes at every place. Its latitude and longitude are not used. Its
own ground lies far below the scene; the engines' terrain decides on contacts.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from pathlib import Path

os.environ.setdefault("JSBSIM_DEBUG", "0")  # the library reads it when it is loaded: 0 prints no banner

import jsbsim

from lingjing.errors import InfrastructureError
from lingjing.mission.instance import Vector

STEP_S = 1.0 / 100.0
"""Integration step, seconds. Test flights at 250 Hz ended within a millimetre of it, in the same control period."""

FOOT_M = 0.3048
"""One international foot in metres (exact)."""

POUND_N = 4.4482216152605
"""One pound-force in newtons (from the international pound and standard gravity)."""

POUND_KG = 0.45359237
"""One international pound in kilograms (exact)."""

ReadProperty = Callable[[], float]
WriteProperty = Callable[[float], object]


class FlightDynamics:
    """One aircraft in JSBSim.

    It starts at `origin` (latitude, longitude in degrees) with an elevation in metres and a heading in degrees.
    `folder` holds `<model>/<model>.xml`; None selects the aircraft that come with the library. `initial` holds further
    properties below `ic/`, in JSBSim's own units.

    Raises `InfrastructureError` if JSBSim cannot load or initialise the model.
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
        if executive.set_output_filename(0, os.devnull):  # some models write a table into the working folder
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
        """Set a property once, in JSBSim's unit. A `writer` is faster for a property that is set repeatedly."""
        self._executive[name] = value

    def reader(self, name: str) -> ReadProperty:
        """Return a function that reads a property, in JSBSim's unit, without searching for its name again."""
        read: ReadProperty = self._node(name).get_double_value
        return read

    def writer(self, name: str) -> WriteProperty:
        """Return a function that sets a property, in JSBSim's unit. It takes a tenth of the time of setting by name."""
        write: WriteProperty = self._node(name).set_double_value
        return write

    def set_wind(self, east: float, north: float, up: float) -> None:
        """Set the velocity of the air, m/s."""
        to_east, to_north, down = self._wind
        to_east(east / FOOT_M)
        to_north(north / FOOT_M)
        down(-up / FOOT_M)

    def step(self, count: int) -> None:
        """Integrate `count` steps of `STEP_S`."""
        for _ in range(count):
            self._executive.run()

    def velocity(self) -> Vector:
        """Return the velocity over ground (east, north, up), m/s. Raises `InfrastructureError` if it is not finite."""
        east, north, down = self._velocity
        velocity = (east() * FOOT_M, north() * FOOT_M, -down() * FOOT_M)
        if not math.isfinite(sum(velocity)):
            raise InfrastructureError("jsbsim diverged: an aircraft's velocity is not a number")
        return velocity

    def attitude(self) -> Vector:
        """Return (roll, pitch, heading) in radians; the heading is clockwise from north."""
        roll, pitch, heading = self._attitude
        return roll(), pitch(), heading()

    def _node(self, name: str) -> jsbsim.FGPropertyNode:
        node = self._executive.get_property_manager().get_node(name)
        if node is None:
            raise InfrastructureError(f"jsbsim's airframe has no property `{name}`")
        return node
