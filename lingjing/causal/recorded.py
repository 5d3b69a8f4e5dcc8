"""The recorded decisions of a trace on fresh engines, boundary by boundary.

The instance is that of the trace. Policies do not run: the recorded decisions are played, substituted ones included.
Pictures come from the trace up to a chosen boundary, because no recorded decision depends on them; after it, or
everywhere, they are rendered.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Self

from lingjing.analysis.played_city import rebuilt_city
from lingjing.engines.remote.recorded import recorded_plugins
from lingjing.errors import UsageError
from lingjing.kernel.evaluators import build_evaluators
from lingjing.kernel.step import Kernel, Published, Recorder
from lingjing.kernel.world import WorldKind, open_world
from lingjing.kernel.world.contract import StoredFrame, World, WorldBoundary
from lingjing.kernel.world.frames import without_pixels
from lingjing.mission.instance import Instance
from lingjing.mission.schedule import Occurrence
from lingjing.plugins.engine import CaptureRequest
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City
from lingjing.trace.encoding import normalise
from lingjing.trace.reader import Trace
from lingjing.trace.records import Absent, BodyState, BoundaryRecord, Command, DecisionRecord, Snapshot

PictureSource = Callable[
    [int, Sequence[CaptureRequest], Sequence[BodyState], Sequence[Occurrence], bool], tuple[StoredFrame | Absent, ...]
]
"""A renderer, called like `World.capture` with a flag that is True if a policy may use the pixels."""


class _RecordedPictures:
    """A world with pictures from a trace up to the boundary `until`; later ones are rendered.

    `until`: None never renders. `pixels`: False replaces pictures by black ones of one pixel; their poses and boxes
    are still the trace's. `witness`: receives each rendered picture and returns the one for the kernel. `camera`:
    renders in place of the world; later pictures are then still taken from the trace if all bodies have the recorded
    states.
    """

    def __init__(self, world: World, trace: Trace, *, until: int | None = None, pixels: bool = False) -> None:
        self._world = world
        self._trace = trace
        self.until = until
        self.pixels = pixels
        self.camera: PictureSource | None = None
        self.witness: Callable[[StoredFrame], StoredFrame] | None = None
        self.asked = 0

    @property
    def processes(self) -> Mapping[str, Mapping[str, str]]:
        """The processes of the world."""
        return self._world.processes

    def reset(self, instance: Instance, city: City) -> WorldBoundary:
        """Reset the engines."""
        return self._world.reset(instance, city)

    def step(self, tick: int, commands: Sequence[Command], occurrences: Sequence[Occurrence] = ()) -> WorldBoundary:
        """Step the engines."""
        return self._world.step(tick, commands, occurrences)

    def capture(
        self,
        tick: int,
        requests: Sequence[CaptureRequest],
        states: Sequence[BodyState],
        occurrences: Sequence[Occurrence] = (),
    ) -> tuple[StoredFrame | Absent, ...]:
        """Return the recorded pictures; one that the trace does not hold is `not_recorded`."""
        if self.until is None or tick <= self.until:
            record = self._trace.boundaries[tick]
            return tuple(self._recorded(request, record) for request in requests)
        if self.camera is None:
            answers = self._world.capture(tick, requests, states, occurrences)
            see = self.witness
            return (
                answers
                if see is None
                else tuple(
                    see(request_or_answer) if isinstance(request_or_answer, StoredFrame) else request_or_answer
                    for request_or_answer in answers
                )
            )
        held = self._trace.frames if self._has_recorded_states(tick, states) else {}
        missing = [request for request in requests if request.frame not in held]
        self.asked += len(missing)
        fresh = iter(self.camera(tick, missing, states, occurrences, self.pixels) if missing else ())
        record = self._trace.boundaries[min(tick, len(self._trace.boundaries) - 1)]
        return tuple(
            self._recorded(request_or_answer, record) if request_or_answer.frame in held else next(fresh)
            for request_or_answer in requests
        )

    def _has_recorded_states(self, tick: int, states: Sequence[BodyState]) -> bool:
        """Return whether all bodies have the states of that boundary of the trace."""
        if tick >= len(self._trace.boundaries):
            return False
        then = self._trace.boundaries[tick].snapshots[-1]
        now = normalise(Snapshot(time_s=then.time_s, states=tuple(states)))
        return now.states == then.states + then.ambient

    def fork(self) -> _RecordedPictures:
        """Return an independent copy of the world with the same pictures."""
        return _RecordedPictures(self._world.fork(), self._trace, until=self.until, pixels=self.pixels)

    def close(self) -> None:
        """End the engines."""
        self._world.close()

    def _recorded(self, request: CaptureRequest, record: BoundaryRecord) -> StoredFrame | Absent:
        info = self._trace.frames.get(request.frame)
        if info is None:
            return _absent(request, record)
        if not self.pixels:
            return without_pixels(info)
        return recorded_frame(self._trace, info.id)


def recorded_frame(trace: Trace, frame: str) -> StoredFrame:
    """Return a picture of the trace in the form of the camera."""
    picture = trace.picture(frame)
    return StoredFrame(trace.frames[frame], trace.jpeg(frame), picture.depth, picture.semantic, picture.instance)


class RecordedRun:
    """A context manager that runs a trace again; `kernel` is at the boundary reached last.

    `advance` plays the next recorded boundary. To play other decisions, set `pictures.until` and pass them to
    `kernel.step`, or to that of a `kernel.fork()`. Raises `UsageError` if the trace holds no boundary, if its city
    cannot be rebuilt, or if an engine or an evaluator is not installed.
    """

    def __init__(
        self,
        trace: Trace,
        *,
        world: WorldKind = "process",
        draw: bool = False,
        pixels: bool = False,
        host: PluginHost | None = None,
        record: Recorder | None = None,
        referenced: frozenset[str] = frozenset(),
    ) -> None:
        if not trace.boundaries:
            raise UsageError(f"{trace.path} holds no boundary", hint="its episode was cut before boundary 0")
        host = with_recorded_engines(trace, host or PluginHost())
        instance = trace.header.instance
        self.city = rebuilt_city(trace, host)
        scorers = [host.evaluator(name) for name in trace.header.evaluators]
        evaluators = build_evaluators(scorers, instance, host, trace.header.evaluator_options)
        self.trace = trace
        self.pictures = _RecordedPictures(
            open_world(world, host=host), trace, until=-1 if draw else None, pixels=pixels
        )
        self.kernel = Kernel(
            instance,
            self.city,
            self.pictures,
            privileged=frozenset(binding.agent for binding in trace.header.bindings if binding.privileged),
            evaluators=evaluators,
            record=record,
            policy_seed=trace.header.policy_seed,
            referenced=referenced,
        )
        self._next = 0

    def decisions(self, tick: int) -> tuple[DecisionRecord, ...]:
        """Return the decisions at boundary `tick`, which led to the next one. Raises `UsageError` if the trace does
        not hold them.
        """
        if not 0 <= tick < len(self.trace.boundaries) - 1:
            last = len(self.trace.boundaries) - 2
            raise UsageError(f"no decisions at boundary {tick}", hint=f"the trace holds those of 0 to {last}")
        return self.trace.boundaries[tick + 1].decisions

    def advance(self) -> Published:
        """Advance to the next boundary, at first to boundary 0. Raises `InfrastructureError` if an engine fails."""
        tick, self._next = self._next, self._next + 1
        return self.kernel.reset() if tick == 0 else self.kernel.step(self.decisions(tick - 1))

    def advance_to(self, tick: int) -> Published:
        """Advance to boundary `tick`, which must be after the current one. Raises `UsageError`."""
        if not self._next <= tick < len(self.trace.boundaries):
            last = len(self.trace.boundaries) - 1
            raise UsageError(f"boundary {tick} cannot be reached", hint=f"go on to one of {self._next} to {last}")
        while self._next < tick:
            self.advance()
        return self.advance()

    def close(self) -> None:
        """End the engines."""
        self.pictures.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


def with_recorded_engines(trace: Trace, host: PluginHost) -> PluginHost:
    """Return a host in which the trace answers for the engines that foreign sessions played."""
    bindings = trace.header.remote_engines
    return host.with_engines(recorded_plugins(bindings, trace.engine_frames, host.engine)) if bindings else host


def _absent(request: CaptureRequest, record: BoundaryRecord) -> Absent:
    """Return the recorded reason for a missing picture."""
    for seen in record.observations:
        for missing in seen.absent:
            if (missing.entity, missing.camera, missing.tick) == (request.entity, request.camera, request.tick):
                return missing
    return Absent(entity=request.entity, camera=request.camera, tick=request.tick, reason="not_recorded")
