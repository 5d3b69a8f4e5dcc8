"""The request handlers of a worker: one for the world process, one for the camera process."""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Iterator

from lingjing.kernel.world.contract import StoredFrame
from lingjing.kernel.world.cosimulation import CoSimulation
from lingjing.kernel.world.engine_group import EngineGroup, close_engines, start_engines
from lingjing.kernel.world.first_pictures import FirstPictures, capture_key
from lingjing.kernel.world.held_cities import unpacked
from lingjing.kernel.world.messages import (
    Admitted,
    Advance,
    Begin,
    Capture,
    PictureReply,
    Prepare,
    Ready,
    Reported,
    Request,
    Reset,
    Step,
    Stepped,
    Submit,
    TakeEvents,
    WorkerMessage,
)
from lingjing.kernel.world.placed_worlds import PlacedReplies, WorldStart, start_of
from lingjing.kernel.world.sensor import Sensor
from lingjing.kernel.world.shared import CallMonitor, store_frame
from lingjing.numerics import runtime_fingerprint
from lingjing.plugins.engine import Engine
from lingjing.plugins.host import PluginHost

ReplyWithDescriptors = tuple[WorkerMessage, tuple[int, ...]]
"""A reply and the descriptors that accompany it. The generator that yields it closes them after the reply was sent."""


class RequestHandler:
    """Base of the handlers, with the engine objects of the present episode."""

    def __init__(self, find_host: Callable[[], PluginHost], progress: CallMonitor) -> None:
        self._find_host = find_host
        self._host: PluginHost | None = None
        self._enter = progress.enter
        self._engines: dict[str, Engine] = {}
        self._runtimes: dict[tuple[str, ...], dict[str, str]] = {}

    def answer(self, request: Request) -> Iterator[ReplyWithDescriptors]:
        """Yield the replies to one request. Raises what the engines raise."""
        raise NotImplementedError

    def close(self) -> tuple[str, ...]:
        """Close all engines. Return the error messages."""
        engines, self._engines = self._engines, {}
        return close_engines(engines, self._enter)

    def _renewed(self, names: tuple[str, ...]) -> Ready:
        """Close the old engines and create new ones."""
        problems = self.close()
        if self._host is None:
            self._host = self._find_host()
        self._engines = start_engines(self._host, names, self._enter)
        return Ready(problems=problems)

    def _is_reset(self) -> Ready:
        """Return the reply to `Reset` with the runtime fingerprint, read once: what the engines load stays loaded."""
        names = tuple(self._engines)
        if names not in self._runtimes:
            self._runtimes[names] = runtime_fingerprint()
        return Ready(runtime=self._runtimes[names])


class WorldHandler(RequestHandler):
    """The handler of the world process: whole ticks, or single macro-steps if the caller hosts engines too.

    Each episode has new engine objects, so that nothing but imports carries over.
    """

    def __init__(self, find_host: Callable[[], PluginHost], progress: CallMonitor) -> None:
        super().__init__(find_host, progress)
        self._engine_group: EngineGroup | None = None
        self._cosimulation: CoSimulation | None = None
        self._placed: PlacedReplies | None = None

    def place(self, start: WorldStart) -> None:
        """Bring the engines to boundary 0 and keep the replies for forks of this process. Raises what engines raise."""
        self._reply(start.prepare)
        ready = self._reply(start.reset)
        begun = self._reply(Begin())
        assert isinstance(ready, Ready)
        self._placed = PlacedReplies(start, ready, begun)

    def answer(self, request: Request) -> Iterator[ReplyWithDescriptors]:
        """Yield one reply to each request."""
        yield self._reply(request), ()

    def _reply(self, request: Request) -> WorkerMessage:
        kept = self._placed.to(request) if self._placed is not None else None
        if kept is not None:
            return kept
        self._placed = None  # from here on the engines leave boundary 0 or are replaced
        match request:
            case Prepare():
                gc.unfreeze()
                self._engine_group = self._cosimulation = None
                return self._renewed(request.engines)
            case Reset():
                self._engine_group = EngineGroup(request.instance, unpacked(request.city), self._engines, self._enter)
                self._cosimulation = CoSimulation(request.instance, (self._engine_group,)) if request.coupled else None
                return self._is_reset()
            case Begin() if self._engine_group is not None:
                ready = self._begin(self._engine_group)
                # Instance and city live until the episode's end. Frozen, they cost no garbage collection, and a
                # forked copy shares their memory pages.
                gc.freeze()
                return ready
            case Step() if self._cosimulation is not None:
                return Stepped(boundary=self._cosimulation.step(request.tick, request.commands, request.occurrences))
            case TakeEvents() if self._engine_group is not None:
                self._engine_group.take_events(request.occurrences)
                return Ready()
            case Submit() if self._engine_group is not None:
                return Admitted(receipts=self._engine_group.submit(request.commands))
            case Advance() if self._engine_group is not None:
                return Reported(reports=self._engine_group.advance(request.until, request.foreign, request.ambient))
        raise RuntimeError(f"{type(request).__name__} is not allowed in this state of the world process")

    def _begin(self, ensemble: EngineGroup) -> WorkerMessage:
        if self._cosimulation is None:
            return Reported(reports=ensemble.reset())
        return Stepped(boundary=self._cosimulation.reset())


class CameraHandler(RequestHandler):
    """The handler of the camera process: pictures are drawn, encoded and sent one by one.

    One engine object with its graphics context stays from episode to episode: a picture depends on nothing before it.
    """

    def __init__(self, find_host: Callable[[], PluginHost], progress: CallMonitor) -> None:
        super().__init__(find_host, progress)
        self._sensor: Sensor | None = None
        self._start = b""
        self._first = FirstPictures()

    def answer(self, request: Request) -> Iterator[ReplyWithDescriptors]:
        """Yield one reply, or one for each requested picture."""
        match request:
            case Prepare():
                yield self._prepare(request), ()
            case Reset() if self._sensor is not None:
                self._sensor.reset(request.instance, unpacked(request.city))
                self._start = start_of((self._sensor.name,), request).key
                yield self._is_reset(), ()
            case Capture() if self._sensor is not None:
                yield from self._capture(self._sensor, request)
            case _:
                raise RuntimeError(f"{type(request).__name__} is not allowed in this state of the camera process")

    def _prepare(self, request: Prepare) -> WorkerMessage:
        (name,) = request.engines
        if name in self._engines:
            return Ready()
        ready = self._renewed(request.engines)
        self._sensor = Sensor(name, self._engines[name], self._enter)
        return ready

    def _capture(self, sensor: Sensor, request: Capture) -> Iterator[ReplyWithDescriptors]:
        """Yield the pictures one by one. Those of boundary 0 are cached for the next episode with an equal
        beginning.
        """
        key = capture_key(self._start, request) if request.time_s == 0.0 else b""
        kept = self._first.find(key) if key else None
        if kept is not None:
            for index, frame in enumerate(kept):
                yield from _sent(request.serial, index, frame)
            return
        sensor.move_to(request.time_s, request.states, request.occurrences)
        drawn: list[StoredFrame | None] = []
        for index, wanted in enumerate(request.requests):
            frame = sensor.picture(wanted)
            yield from _sent(request.serial, index, frame)
            if key:
                drawn.append(frame)
        if key:
            self._first.keep(key, drawn)


def _sent(serial: int, index: int, frame: StoredFrame | None) -> Iterator[ReplyWithDescriptors]:
    if frame is None:
        yield PictureReply(serial=serial, index=index), ()
        return
    layout, descriptor = store_frame(frame)
    try:
        yield PictureReply(serial=serial, index=index, info=frame.info, layout=layout), (descriptor,)
    finally:
        os.close(descriptor)
