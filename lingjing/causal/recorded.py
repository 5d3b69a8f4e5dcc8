"""`RecordedRun`: the decisions that a trace holds, on fresh engines, boundary by boundary.

The instance is the trace's own and never drawn again. Policies are not asked: their recorded decisions are played,
those that were substituted included. Pictures are answered from the trace up to a boundary of one's choice, because
no recorded decision depends on them; beyond it, or everywhere, they are drawn.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Self

from lingjing.analysis.played_city import rebuilt_city
from lingjing.errors import UsageError
from lingjing.kernel.evaluators import build_evaluators
from lingjing.kernel.step import Kernel, Published, Recorder
from lingjing.kernel.world import WorldKind, open_world
from lingjing.kernel.world.contract import StoredFrame, World, WorldBoundary
from lingjing.kernel.world.frames import without_pixels
from lingjing.mission.instance import Instance
from lingjing.plugins.engine import CaptureRequest
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City
from lingjing.trace.encoding import normalise
from lingjing.trace.reader import Trace
from lingjing.trace.records import Absent, BodyState, BoundaryRecord, Command, DecisionRecord, Snapshot

PictureSource = Callable[[int, Sequence[CaptureRequest], Sequence[BodyState], bool], tuple[StoredFrame | Absent, ...]]
"""What draws pictures, called as `World.capture` is and told whether somebody may look at their pixels."""


class RecordedPictures:
    """A world whose pictures come from a trace as long as its boundary is not after `until`; later ones are drawn.

    `until` None never draws. With `pixels` a policy could look at them; without, they are black and of one pixel, and
    what is known of them (pose, boxes) is the trace's all the same. A `witness` is given each picture that the world
    drew, and answers what the kernel receives in its place. With a `camera` that draws in the world's place
    (and is told of `pixels`), what the trace holds of a later boundary is taken from it too, if all bodies stand as
    they stood then.
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
        """Those of the world."""
        return self._world.processes

    def reset(self, instance: Instance, city: City) -> WorldBoundary:
        """Reset the engines."""
        return self._world.reset(instance, city)

    def step(self, tick: int, commands: Sequence[Command]) -> WorldBoundary:
        """Step the engines."""
        return self._world.step(tick, commands)

    def capture(
        self, tick: int, requests: Sequence[CaptureRequest], states: Sequence[BodyState]
    ) -> tuple[StoredFrame | Absent, ...]:
        """What the camera answered then; what the trace does not hold is `not_recorded`."""
        if self.until is None or tick <= self.until:
            record = self._trace.boundaries[tick]
            return tuple(self._recorded(request, record) for request in requests)
        if self.camera is None:
            answers = self._world.capture(tick, requests, states)
            see = self.witness
            return (
                answers if see is None else tuple(see(one) if isinstance(one, StoredFrame) else one for one in answers)
            )
        held = self._trace.frames if self._stand_alike(tick, states) else {}
        due = [request for request in requests if request.frame not in held]
        self.asked += len(due)
        fresh = iter(self.camera(tick, due, states, self.pixels) if due else ())
        record = self._trace.boundaries[min(tick, len(self._trace.boundaries) - 1)]
        return tuple(self._recorded(one, record) if one.frame in held else next(fresh) for one in requests)

    def _stand_alike(self, tick: int, states: Sequence[BodyState]) -> bool:
        """Whether everything is where it was at that boundary of the trace."""
        if tick >= len(self._trace.boundaries):
            return False
        then = self._trace.boundaries[tick].snapshots[-1]
        now = normalise(Snapshot(time_s=then.time_s, states=tuple(states)))
        return now.states == then.states + then.ambient

    def fork(self) -> RecordedPictures:
        """A world that goes on alone, with the same pictures."""
        return RecordedPictures(self._world.fork(), self._trace, until=self.until, pixels=self.pixels)

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
    """A picture that the trace holds, as the camera would give it."""
    picture = trace.picture(frame)
    return StoredFrame(trace.frames[frame], trace.jpeg(frame), picture.depth, picture.semantic)


class RecordedRun:
    """A trace being run again; `kernel` stands at the boundary that was reached last. A context manager.

    `advance` plays the next recorded boundary, `decisions` are those of any boundary; whoever wants others gives
    them to `kernel.step` instead, or to that of a `kernel.fork()`, and sets `pictures.until` first.

    Raises `UsageError` if the trace holds no boundary, if its city is not to be had here as it was, or if an engine
    or an evaluator is not installed.
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
            raise UsageError(f"{trace.path} holds no boundary", hint="its episode was cut before it began")
        host = host or PluginHost()
        instance = trace.header.instance
        self.city = rebuilt_city(trace, host)
        scorers = [host.evaluator(name) for name in trace.header.evaluators]
        evaluators = build_evaluators(scorers, instance, host, trace.header.evaluator_options)
        self.trace = trace
        self.pictures = RecordedPictures(open_world(world, host=host), trace, until=-1 if draw else None, pixels=pixels)
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
        """What was decided at boundary `tick`, which led to the next one. Raises `UsageError` where that is not
        held."""
        if not 0 <= tick < len(self.trace.boundaries) - 1:
            last = len(self.trace.boundaries) - 2
            raise UsageError(f"no decisions at boundary {tick}", hint=f"the trace holds those of 0 to {last}")
        return self.trace.boundaries[tick + 1].decisions

    def advance(self) -> Published:
        """The next boundary, the first time boundary 0. Raises `InfrastructureError` if an engine fails."""
        tick, self._next = self._next, self._next + 1
        return self.kernel.reset() if tick == 0 else self.kernel.step(self.decisions(tick - 1))

    def advance_to(self, tick: int) -> Published:
        """Boundary `tick`, which must be after the one reached last."""
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


def _absent(request: CaptureRequest, record: BoundaryRecord) -> Absent:
    """The reason why a picture did not come, as somebody was told it."""
    for seen in record.observations:
        for one in seen.absent:
            if (one.entity, one.camera, one.tick) == (request.entity, request.camera, request.tick):
                return one
    return Absent(entity=request.entity, camera=request.camera, tick=request.tick, reason="not_recorded")
