"""What a worker does with a request: the handler of the world process and the handler of the camera process."""

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
    WorkerMessage,
)
from lingjing.kernel.world.placed_worlds import PlacedReplies, WorldStart, start_by
from lingjing.kernel.world.sensor import Sensor
from lingjing.kernel.world.shared import CallMonitor, store_frame
from lingjing.numerics import runtime_fingerprint
from lingjing.plugins.engine import Engine
from lingjing.plugins.host import PluginHost

ReplyWithDescriptors = tuple[WorkerMessage, tuple[int, ...]]
"""A reply and the descriptors that go with it; who yields it closes them after it was sent."""


class RequestHandler:
    """A worker's trade, and the engine objects of the present episode."""

    def __init__(self, find_host: Callable[[], PluginHost], progress: CallMonitor) -> None:
        self._find_host = find_host
        self._host: PluginHost | None = None
        self._enter = progress.enter
        self._engines: dict[str, Engine] = {}
        self._taken: dict[tuple[str, ...], dict[str, str]] = {}

    def answer(self, request: Request) -> Iterator[ReplyWithDescriptors]:
        """The replies to one request; raises what the engines raise."""
        raise NotImplementedError

    def close(self) -> tuple[str, ...]:
        """Close all engines; returns what went wrong."""
        engines, self._engines = self._engines, {}
        return close_engines(engines, self._enter)

    def _renewed(self, names: tuple[str, ...]) -> Ready:
        """Close the old engines and create the new."""
        problems = self.close()
        if self._host is None:
            self._host = self._find_host()
        self._engines = start_engines(self._host, names, self._enter)
        return Ready(problems=problems)

    def _is_reset(self) -> Ready:
        """Says what this process runs with these engines: read once, what they load is loaded for good."""
        names = tuple(self._engines)
        if names not in self._taken:
            self._taken[names] = runtime_fingerprint()
        return Ready(taken=self._taken[names])


class WorldHandler(RequestHandler):
    """Motion engines: whole ticks when they are all here, single macro-steps when the caller hosts some too.

    Each episode gets fresh engine objects, so that nothing carries over but what was imported.
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
        """One reply to each request."""
        yield self._reply(request), ()

    def _reply(self, request: Request) -> WorkerMessage:
        kept = self._placed.to(request) if self._placed is not None else None
        if kept is not None:
            return kept
        self._placed = None  # the engines go on, or others take their place
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
                # What the episode is played on stays until its end: collections need not walk through a whole city
                # again and again, and a forked copy shares its pages untouched.
                gc.freeze()
                return ready
            case Step() if self._cosimulation is not None:
                return Stepped(boundary=self._cosimulation.step(request.tick, request.commands))
            case Submit() if self._engine_group is not None:
                return Admitted(receipts=self._engine_group.submit(request.commands))
            case Advance() if self._engine_group is not None:
                return Reported(reports=self._engine_group.advance(request.until, request.foreign, request.ambient))
        raise RuntimeError(f"{type(request).__name__} came out of turn to the world process")

    def _begin(self, ensemble: EngineGroup) -> WorkerMessage:
        if self._cosimulation is None:
            return Reported(reports=ensemble.reset())
        return Stepped(boundary=self._cosimulation.reset())


class CameraHandler(RequestHandler):
    """The sensor engine: pictures are drawn, encoded and handed over one by one, each as soon as it is there.

    One engine object stays from episode to episode with its graphics context: a picture depends on nothing before it.
    """

    def __init__(self, find_host: Callable[[], PluginHost], progress: CallMonitor) -> None:
        super().__init__(find_host, progress)
        self._sensor: Sensor | None = None
        self._start = b""
        self._first = FirstPictures()

    def answer(self, request: Request) -> Iterator[ReplyWithDescriptors]:
        """One reply, or one for each picture asked for."""
        match request:
            case Prepare():
                yield self._prepare(request), ()
            case Reset() if self._sensor is not None:
                self._sensor.reset(request.instance, unpacked(request.city))
                self._start = start_by((self._sensor.name,), request).key
                yield self._is_reset(), ()
            case Capture() if self._sensor is not None:
                yield from self._capture(self._sensor, request)
            case _:
                raise RuntimeError(f"{type(request).__name__} came out of turn to the camera process")

    def _prepare(self, request: Prepare) -> WorkerMessage:
        (name,) = request.engines
        if name in self._engines:
            return Ready()
        ready = self._renewed(request.engines)
        self._sensor = Sensor(name, self._engines[name], self._enter)
        return ready

    def _capture(self, sensor: Sensor, request: Capture) -> Iterator[ReplyWithDescriptors]:
        """The pictures, one by one; those of boundary 0 are kept for the next episode that begins alike."""
        key = capture_key(self._start, request) if request.time_s == 0.0 else b""
        kept = self._first.find(key) if key else None
        if kept is not None:
            for index, frame in enumerate(kept):
                yield from _sent(request.serial, index, frame)
            return
        sensor.settle(request.time_s, request.states)
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
