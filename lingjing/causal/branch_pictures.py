"""`BranchPictures`: pictures of branches of one trace, each drawn once at most.

A picture is not drawn again where what it depends on (`Sensor.key`) was the same when the trace's was taken, or when
another branch asked: what moved elsewhere is no reason. A sensor engine that cannot tell draws all of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from lingjing.causal.picture_memory import PictureMemory
from lingjing.causal.recorded import recorded_frame
from lingjing.kernel.world.contract import StoredFrame
from lingjing.kernel.world.frames import without_pixels
from lingjing.kernel.world.sensor import Sensor
from lingjing.plugins.engine import CaptureRequest
from lingjing.trace.reader import Trace
from lingjing.trace.records import BodyState


class BranchPictures:
    """Takes pictures with a sensor that was reset for the trace's episode."""

    def __init__(self, trace: Trace, sensor: Sensor) -> None:
        self._trace = trace
        self._sensor = sensor
        self._memory = PictureMemory()
        self._recorded_keys: dict[str, bytes | None] = {}

    def picture(
        self, wanted: CaptureRequest, time_s: float, states: Sequence[BodyState], *, pixels: bool = True
    ) -> StoredFrame | None:
        """The picture at a boundary where everything stands so; None if the engine draws none. Without `pixels` what
        is known of it, which costs less to draw and nothing to hand on."""
        recorded = self._recorded_key(wanted)
        self._sensor.settle(time_s, states)
        key = self._sensor.key(wanted)
        if key is None:
            return self._sensor.picture(wanted, pixels=pixels)
        named = key + msgspec.msgpack.encode((wanted, pixels))
        frame = self._memory.find(named)
        if frame is None:
            frame = self._held(wanted, pixels) if key == recorded else self._sensor.picture(wanted, pixels=pixels)
            if frame is not None:
                self._memory.keep(named, frame)
        return frame

    def _held(self, wanted: CaptureRequest, pixels: bool) -> StoredFrame:
        """The trace's picture of that name."""
        return recorded_frame(self._trace, wanted.frame) if pixels else without_pixels(self._trace.frames[wanted.frame])

    def _recorded_key(self, wanted: CaptureRequest) -> bytes | None:
        """What the trace's picture of that name depended on, None if it holds none; the sensor may stand there then."""
        name = wanted.frame
        if name not in self._recorded_keys:
            key = None
            if name in self._trace.frames:
                then = self._trace.boundaries[wanted.tick].snapshots[-1]
                self._sensor.settle(wanted.time_s, then.states + then.ambient)
                key = self._sensor.key(wanted)
            self._recorded_keys[name] = key
        return self._recorded_keys[name]
