"""`InlineWorld`: every engine in the caller, for debuggers. It reports the same boundaries and pictures as
`ProcessWorld`.

No engine can be killed here, so deadlines are checked after the call. A late boundary is an infrastructure abort, a
late picture is absent, and an engine that never returns hangs the caller. As in the other world, time spent in a run
queue and the preparation of the camera count for no budget.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence

from lingjing.errors import InfrastructureError, UsageError
from lingjing.kernel.world.contract import StoredFrame, World, WorldBoundary
from lingjing.kernel.world.cosimulation import CoSimulation, macro_steps
from lingjing.kernel.world.engine_group import EngineGroup, close_engines, start_engines
from lingjing.kernel.world.guarded_calls import absent, name_plugin, no_episode, no_sensor
from lingjing.kernel.world.selection import select_engines
from lingjing.kernel.world.sensor import Sensor
from lingjing.kernel.world.times import EngineTimes
from lingjing.mission.instance import Instance
from lingjing.mission.schedule import Occurrence
from lingjing.plugins.engine import CaptureRequest, Engine
from lingjing.plugins.host import PluginHost
from lingjing.processes.deadlines import OwnDeadline
from lingjing.scene.city import City
from lingjing.trace.records import Absent, BodyState, Command


class InlineWorld:
    """A `World` without processes: co-simulation and sensor in the caller. See `World` for the methods."""

    def __init__(self, host: PluginHost) -> None:
        self._host = host
        self._motion: dict[str, Engine] = {}
        self._drawing: dict[str, Engine] = {}
        self.processes: Mapping[str, Mapping[str, str]] = {}
        self._instance: Instance | None = None
        self._cosimulation: CoSimulation | None = None
        self._sensor: Sensor | None = None
        self._undrawn: tuple[str, City] | None = None
        self._times = EngineTimes()

    def reset(self, instance: Instance, city: City) -> WorldBoundary:
        """Start an episode on new motion engines; the sensor engine keeps its graphics context."""
        roles = select_engines(instance, self._host)
        macro_steps(instance.clock)  # reject a tick that is no multiple of `sync` before anything starts
        self._end_episode()
        try:
            self._motion = start_engines(self._host, (*roles.local, *roles.remote))
            self._undrawn = (roles.sensor, city) if roles.sensor is not None else None
            self._cosimulation = CoSimulation(instance, (EngineGroup(instance, city, self._motion, self._times.enter),))
            self._instance = instance
            self._times.clear()
            boundary = self._cosimulation.reset()
            self._times.check(instance.budget.engine_s)
            return boundary
        except BaseException as error:
            name_plugin(error, self._host)
            self.close()
            raise

    def step(self, tick: int, commands: Sequence[Command], occurrences: Sequence[Occurrence] = ()) -> WorldBoundary:
        """Advance to boundary `tick` in the caller."""
        instance, cosimulation = self._episode()
        try:
            self._times.clear()
            boundary = cosimulation.step(tick, commands, occurrences)
            self._times.check(instance.budget.engine_s)
        except InfrastructureError as error:
            name_plugin(error, self._host)
            self.close()
            raise
        return boundary

    def capture(
        self,
        tick: int,
        requests: Sequence[CaptureRequest],
        states: Sequence[BodyState],
        occurrences: Sequence[Occurrence] = (),
    ) -> tuple[StoredFrame | Absent, ...]:
        """Draw the pictures one after another; those that end after `budget.capture_s` are absent."""
        instance, _ = self._episode()
        if not requests:
            return ()
        try:
            sensor = self._ready_sensor(instance)
            deadline = OwnDeadline(os.getpid(), instance.budget.capture_s, watched=True)
            sensor.move_to(tick * instance.clock.tick_s, states, occurrences)
            return tuple(self._draw(sensor, request, deadline) for request in requests)
        except InfrastructureError as error:
            name_plugin(error, self._host)
            raise

    def fork(self) -> World:
        """Raise `UsageError`: engines in the caller cannot be copied."""
        raise UsageError("a world in the caller cannot be forked", hint="use `--world process`")

    def close(self) -> None:
        """Close all engines. An engine that fails to close is reported as a warning. Idempotent."""
        self._end_episode()
        drawing, self._drawing = self._drawing, {}
        _warn(close_engines(drawing))

    def _end_episode(self) -> None:
        motion, self._motion = self._motion, {}
        self._instance = self._cosimulation = self._sensor = self._undrawn = None
        _warn(close_engines(motion))

    def _ready_sensor(self, instance: Instance) -> Sensor:
        """Return the sensor engine, started and prepared for the city before the first picture of an episode."""
        if self._undrawn is not None:
            name, city = self._undrawn
            if name not in self._drawing:
                self._drawing = start_engines(self._host, (name,))
            sensor = Sensor(name, self._drawing[name])
            sensor.reset(instance, city)
            self._sensor, self._undrawn = sensor, None
        if self._sensor is None:
            raise no_sensor()
        return self._sensor

    def _draw(self, sensor: Sensor, request: CaptureRequest, deadline: OwnDeadline) -> StoredFrame | Absent:
        if deadline.left_s() <= 0.0:
            return absent(request, "late")
        frame = sensor.picture(request)
        if frame is None:
            return absent(request, "not_drawn")
        return absent(request, "late") if deadline.left_s() <= 0.0 else frame

    def _episode(self) -> tuple[Instance, CoSimulation]:
        if self._instance is None or self._cosimulation is None:
            raise no_episode()
        return self._instance, self._cosimulation


def _warn(problems: Sequence[str]) -> None:
    for problem in problems:
        warnings.warn(problem, RuntimeWarning, stacklevel=3)
