"""Drivers of cars: AirSim's controls as commands of the road engine, which drives along lanes.

A throttle drives ahead at the car's own speed, a steering takes the next turn to that side, a brake stops. The engine
knows neither a speed by throttle nor an angle of the wheels, and no reverse.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from lingjing.serve.airsim.server import Call
from lingjing.trace.records import Action

Course = Literal["stop", "forward", "left", "right"]
"""The demand of a car's controls, which is a verb of the road engine."""

_AHEAD_M = (500.0, 200.0, 80.0, 30.0, 10.0)
"""Lengths of a drive ahead, metres, tried one after another: the engine refuses one beyond the end of the road."""
_TURN = 0.2
"""Least steering that demands a turn, of 1 (chosen)."""


@dataclass(frozen=True)
class Controls:
    """AirSim's `CarControls`."""

    throttle: float = 0.0
    """-1 to 1; below 0 in reverse."""
    steering: float = 0.0
    """-1 (left) to 1 (right)."""
    brake: float = 0.0
    """Position of the brake, 0 to 1."""
    handbrake: bool = False
    is_manual_gear: bool = False
    manual_gear: int = 0
    gear_immediate: bool = True

    @property
    def reverses(self) -> bool:
        """True if the car would drive backwards."""
        back = self.throttle < 0.0 or (self.is_manual_gear and self.manual_gear < 0 and self.throttle != 0.0)
        return back and not self.brakes

    @property
    def brakes(self) -> bool:
        """True if the car stops: with a brake, or without a throttle."""
        return self.brake > 0.0 or self.handbrake or self.throttle == 0.0

    @property
    def course(self) -> Course:
        """The demanded motion of the car."""
        if self.brakes:
            return "stop"
        return "right" if self.steering >= _TURN else "left" if self.steering <= -_TURN else "forward"


@dataclass
class Driver:
    """The driver of one car: turns the demand into one command after another."""

    resource: str
    controls: Controls = field(default_factory=Controls)
    _wanted: Course = "stop"
    _running: str = ""
    """The verb of the command that runs; "" without one."""
    _tried: int = 0
    """Refused lengths of a drive ahead."""
    _blocked: bool = True
    """True if there is nothing to send until the controls change."""
    _call: Call | None = None

    @property
    def waits(self) -> bool:
        """True while a call waits for its command to be accepted."""
        return self._call is not None

    def steer(self, controls: Controls, call: Call) -> None:
        """Take over controls. The call is answered when the road engine has accepted or refused their command."""
        self._finish(lambda earlier: earlier.succeed())
        changed = controls.course != self._wanted
        self.controls, self._wanted = controls, controls.course
        if not changed and (self._running or self._wanted == "stop"):
            call.succeed()
            return
        self._call, self._tried, self._blocked = call, 0, False

    def action(self) -> Action | None:
        """Return the command for the next tick; None if there is nothing to send."""
        if self._blocked or self._running == self._wanted:
            return None
        if self._running == "stop":  # it brakes, and takes no other command until it stands
            return None
        if self._running:  # a busy car takes `stop` alone
            return Action(verb="stop", resource=self.resource)
        if self._wanted == "forward":
            return Action(verb="forward", resource=self.resource, arguments={"distance": _AHEAD_M[self._tried]})
        return Action(verb=self._wanted, resource=self.resource)

    def accepted(self, verb: str) -> None:
        """Take note that the command of the last tick runs."""
        self._running = verb
        if verb != self._wanted:
            return
        self._blocked = verb == "stop"
        self._finish(lambda call: call.succeed())

    def ended(self) -> None:
        """Take note that the running command has ended: after a turn or a way ahead the car drives on."""
        if self._running in ("left", "right") and self._wanted == self._running:
            self._wanted = "forward"
        self._running, self._tried = "", 0

    def refused(self, verb: str, reason: str) -> None:
        """Take note of a refusal. Next, a shorter distance ahead is tried; if there is none, the car stays."""
        if verb == "forward" and self._tried + 1 < len(_AHEAD_M):
            self._tried += 1
            return
        self._blocked, self._wanted = True, "stop"
        self._finish(lambda call: call.fail(f"`setCarControls`: {reason}"))

    def release(self) -> None:
        """Answer the call that waits, before its command is sent: in a pause no time passes."""
        self._finish(lambda call: call.succeed())

    def close(self, reason: str) -> None:
        """Fail the call that waits."""
        self._finish(lambda call: call.fail(reason))

    def _finish(self, answer: Callable[[Call], None]) -> None:
        call, self._call = self._call, None
        if call is not None:
            answer(call)
