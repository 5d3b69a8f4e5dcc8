"""The camera of all branches: one process that renders pictures on request, in turn.

A graphics context does not survive a fork and takes seconds to create, so branches do not create their own. The camera
process is forked before anything is rendered and starts its engine with the first picture. A branch opens its own
channel when it needs a picture. Pictures depend only on the states in the request, so one camera serves independent
branches (`branch_pictures` avoids repeated rendering). If no policy may use pixels, none are sent. Pictures of
branches are never late, because the durations of rendering are not recorded.
"""

from __future__ import annotations

import os
import select
import socket
import sys
import traceback
from collections.abc import Sequence
from typing import NoReturn

import msgspec

from lingjing.causal.branch_pictures import BranchPictures
from lingjing.causal.processor_time import cpu_of
from lingjing.decoding import from_msgpack
from lingjing.errors import InfrastructureError, LingjingError, hint_of
from lingjing.kernel.world.contract import StoredFrame
from lingjing.kernel.world.engine_group import start_engines
from lingjing.kernel.world.frames import without_pixels
from lingjing.kernel.world.guarded_calls import absent, no_sensor
from lingjing.kernel.world.messages import Failed, PictureReply, decoded_reply, encoded
from lingjing.kernel.world.selection import select_engines
from lingjing.kernel.world.sensor import Sensor
from lingjing.kernel.world.shared import load_frame, store_frame
from lingjing.mission.schedule import Occurrence
from lingjing.plugins.engine import CaptureRequest
from lingjing.plugins.host import PluginHost
from lingjing.processes.channel import Channel, ChannelClosedError
from lingjing.processes.linux import end_with_parent, fork
from lingjing.scene.city import City
from lingjing.trace.reader import Trace
from lingjing.trace.records import Absent, BodyState


class _PictureRequest(msgspec.Struct, frozen=True):
    """A request for the pictures of one boundary. Each is answered by a `PictureReply` with `tick` as its serial."""

    tick: int
    time_s: float
    """Simulated time, seconds."""
    requests: tuple[CaptureRequest, ...]
    states: tuple[BodyState, ...]
    """The states of all bodies."""
    occurrences: tuple[Occurrence, ...]
    """All occurrences of the mission's events before the boundary."""
    pixels: bool
    """False if only metadata are needed."""


class SharedCamera:
    """The client of the camera in a process and its forks. A fork opens its own channel with its first picture."""

    def __init__(self, trace: Trace, city: City, host: PluginHost) -> None:
        self._tick_s = trace.header.instance.clock.tick_s
        ours, theirs = socket.socketpair()
        self._asking = Channel(ours)
        self._channel: tuple[int, Channel] | None = None
        parent = os.getpid()
        self._process = fork(with_threads=True)  # policies may run threads; `branch_process` rejects them later
        if self._process == 0:
            self._asking.close()
            _serve(Channel(theirs), trace, city, host, parent)
        theirs.close()

    @property
    def cpu_s(self) -> float:
        """CPU time of rendering so far, seconds; 0.0 if the camera has ended."""
        try:
            return cpu_of(self._process)
        except OSError:
            return 0.0

    def capture(
        self,
        tick: int,
        requests: Sequence[CaptureRequest],
        states: Sequence[BodyState],
        occurrences: Sequence[Occurrence] = (),
        pixels: bool = True,
    ) -> tuple[StoredFrame | Absent, ...]:
        """Render the pictures of a boundary; without `pixels` each has a single black pixel. Raises
        `InfrastructureError` if the camera fails or has ended.
        """
        message = _PictureRequest(tick, tick * self._tick_s, tuple(requests), tuple(states), tuple(occurrences), pixels)
        try:
            channel = self._opened()
            channel.send(msgspec.msgpack.encode(message))
            return tuple(self._answer(channel, request) for request in requests)
        except ChannelClosedError:
            raise InfrastructureError("the camera of the branches has ended") from None

    def _opened(self) -> Channel:
        if self._channel is None or self._channel[0] != os.getpid():
            ours, theirs = socket.socketpair()
            with theirs:
                try:
                    self._asking.send(b"", (theirs.fileno(),))
                except ChannelClosedError:
                    ours.close()
                    raise
            self._channel = os.getpid(), Channel(ours)
        return self._channel[1]

    def _answer(self, channel: Channel, request: CaptureRequest) -> StoredFrame | Absent:
        packet = channel.receive()
        try:
            reply = decoded_reply(packet.payload)
            if isinstance(reply, Failed):
                raise InfrastructureError(reply.message, hint=reply.hint)
            assert isinstance(reply, PictureReply)
            if reply.info is None:
                return absent(request, "not_drawn")
            if reply.layout is None:
                return without_pixels(reply.info)
            return load_frame(reply.info, reply.layout, packet.descriptors[0])
        finally:
            packet.close()


def _serve(asking: Channel, trace: Trace, city: City, host: PluginHost, parent: int) -> NoReturn:
    """Serve until the other end of the socket is closed by all processes."""
    try:
        end_with_parent(parent)
        _Service(asking, trace, city, host).run()
    except BaseException:  # a bug: its traceback explains why the camera has ended
        traceback.print_exc()
        raise
    finally:
        sys.stderr.flush()
        os._exit(0)


class _Service:
    """The camera process."""

    def __init__(self, asking: Channel, trace: Trace, city: City, host: PluginHost) -> None:
        self._asking = asking
        self._trace, self._city, self._host = trace, city, host
        self._pictures: BranchPictures | None = None
        self._poller = select.poll()
        self._poller.register(asking, select.POLLIN)
        self._channels: dict[int, Channel] = {}

    def run(self) -> None:
        while True:
            for descriptor, _ in self._poller.poll():
                if descriptor != self._asking.fileno():
                    self._draw(descriptor)
                elif not self._accept():
                    return

    def _accept(self) -> bool:
        try:
            packet = self._asking.receive()
        except ChannelClosedError:
            return False
        for descriptor in packet.descriptors:
            self._channels[descriptor] = Channel(socket.socket(fileno=descriptor))
            self._poller.register(descriptor, select.POLLIN)
        return True

    def _draw(self, descriptor: int) -> None:
        channel = self._channels[descriptor]
        try:
            self._answer(channel, from_msgpack(channel.receive().payload, _PictureRequest))
        except ChannelClosedError:
            self._poller.unregister(descriptor)
            self._channels.pop(descriptor).close()

    def _answer(self, channel: Channel, request: _PictureRequest) -> None:
        try:
            pictures = self._ready()
            for index, capture in enumerate(request.requests):
                frame = pictures.picture(
                    capture, request.time_s, request.states, request.occurrences, pixels=request.pixels
                )
                if frame is None or not request.pixels:
                    info = None if frame is None else frame.info
                    channel.send(encoded(PictureReply(serial=request.tick, index=index, info=info)))
                    continue
                layout, memory = store_frame(frame)
                reply = PictureReply(serial=request.tick, index=index, info=frame.info, layout=layout)
                try:
                    channel.send(encoded(reply), (memory,))
                finally:
                    os.close(memory)
        except LingjingError as error:
            channel.send(encoded(Failed(message=str(error), hint=hint_of(error))))

    def _ready(self) -> BranchPictures:
        if self._pictures is None:
            instance = self._trace.header.instance
            name = select_engines(instance, self._host).sensor
            if name is None:
                raise no_sensor()
            sensor = Sensor(name, start_engines(self._host, (name,))[name])
            sensor.reset(instance, self._city)
            self._pictures = BranchPictures(self._trace, sensor)
        return self._pictures
