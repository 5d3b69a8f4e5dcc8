"""`FleetEngine`: the base class of engines of moving bodies: admission, the step clock, receipts, boundaries.

A concrete engine builds its world (`build`), starts commands (`start`), takes steps (`step`), and reports the progress
(`progress`) and the states (`states`) of its bodies. It reports through `self.requests` and `self.emit`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Mapping, Sequence

from lingjing.plugins.engine import Boundary, CaptureRequest, EngineSpec, Frame
from lingjing.plugins.requests import Refusal, Requests
from lingjing.plugins.step_clock import StepClock
from lingjing.scene.city import City
from lingjing.trace.records import BodyState, Command, Receipt, Route, TaskEvent


class FleetEngine(ABC):
    """The five methods over a fleet of bodies that step together every `step_s` seconds."""

    step_s: float
    """The engine's own step; set by the class, or in `build` before it returns."""

    at_once: Collection[str] = ()
    """The verbs that complete when they are admitted, also beside a pending request of their body."""

    def reset(self, spec: EngineSpec, city: City, seed: int) -> Boundary:
        """Build the fleet. Returns READY(0)."""
        self.name = spec.engine
        self._owns = frozenset(spec.owns)
        self.tick_s = spec.instance.clock.tick_s
        self.requests = Requests(spec.engine)
        self._events: list[TaskEvent] = []
        self._routes: list[Route] = []
        self.build(spec, city, seed)
        self.clock = StepClock(self.step_s)
        return self._boundary()

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Admit or reject each command. Admitted ones start at once."""
        how = self.requests
        return tuple(
            (how.answer if command.verb in self.at_once else how.admit)(command, self.clock.time_s, self._examine)
            for command in commands
        )

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Step to `until`. Reports progress of pending requests at decision boundaries."""
        self.look(mirrors)
        for _ in range(self.clock.steps_until(until)):
            self.clock.done += 1
            self.step()
        if self.clock.is_boundary(self.tick_s):
            for body, share in self.progress().items():
                self.requests.run(body, until, share)
        return self._boundary()

    def capture(self, requests: Sequence[CaptureRequest]) -> tuple[Frame, ...]:
        """Return no pictures: a fleet has no sensors."""
        return ()

    def close(self) -> None:  # noqa: B027 - most fleets hold nothing that needs closing
        """Release the fleet."""

    @abstractmethod
    def build(self, spec: EngineSpec, city: City, seed: int) -> None:
        """Make the bodies. May set `step_s`."""

    @abstractmethod
    def start(self, command: Command) -> None:
        """Begin a command to an owned entity, or raise `Refusal`."""

    @abstractmethod
    def step(self) -> None:
        """Take one step of `step_s`. `self.clock.now_s` is the time at its end."""

    @abstractmethod
    def states(self) -> Iterable[BodyState]:
        """Return every owned entity at `self.clock.time_s`, which is `self.clock.remainder_s` after the last step."""

    def progress(self) -> Mapping[str, float]:
        """Return the completed share of each pending request by body, 0 to 1."""
        return {}

    def look(self, mirrors: Sequence[BodyState]) -> None:  # noqa: B027 - blind is a fine default
        """Receive the states of other engines' entities at the start of the interval (`self.clock.time_s`). The default
        ignores them."""

    def ambient(self) -> Iterable[BodyState]:
        """Return movers that are no entities: background traffic."""
        return ()

    def emit(self, kind: str, *entities: str, **values: float) -> None:
        """Report a task event at the current step."""
        self._events.append(TaskEvent(kind=kind, entities=entities, time_s=self.clock.now_s, values=values))

    def publish(self, route: Route) -> None:
        """Report a planned route."""
        self._routes.append(route)

    def _examine(self, command: Command) -> None:
        if command.resource not in self._owns:
            raise Refusal("unknown_resource", f"`{command.resource}` is none of `{self.name}`")
        self.start(command)

    def _boundary(self) -> Boundary:
        events, self._events = tuple(self._events), []
        routes, self._routes = tuple(self._routes), []
        return Boundary(
            engine=self.name,
            time_s=self.clock.time_s,
            states=tuple(self.states()),
            receipts=self.requests.drain(),
            events=events,
            routes=routes,
            ambient=tuple(self.ambient()),
        )


__all__ = ["FleetEngine"]
