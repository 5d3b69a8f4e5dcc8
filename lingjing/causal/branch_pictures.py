"""Pictures for the branches of one trace, each rendered at most once.

A picture is not rendered again if its inputs (`Sensor.key`) equal those of the trace's picture, or of a picture for
another branch; bodies out of view do not matter. A sensor engine without keys renders all pictures.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from lingjing.causal.picture_memory import PictureMemory
from lingjing.causal.recorded import recorded_frame
from lingjing.kernel.world.contract import StoredFrame
from lingjing.kernel.world.frames import without_pixels
from lingjing.kernel.world.sensor import Sensor
from lingjing.mission.schedule import Occurrence
from lingjing.plugins.engine import CaptureRequest
from lingjing.trace.occurrences import recorded_occurrences
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
        self,
        request: CaptureRequest,
        time_s: float,
        states: Sequence[BodyState],
        occurrences: Sequence[Occurrence] = (),
        *,
        pixels: bool = True,
    ) -> StoredFrame | None:
        """Return the picture of a boundary with these states; None if the engine renders none.

        Without `pixels` only its metadata are returned, which costs less to render and to send.
        """
        recorded = self._recorded_key(request)
        self._sensor.move_to(time_s, states, occurrences)
        key = self._sensor.key(request)
        if key is None:
            return self._sensor.picture(request, pixels=pixels)
        cache_key = key + msgspec.msgpack.encode((request, pixels))
        frame = self._memory.find(cache_key)
        if frame is None:
            frame = (
                self._recorded_picture(request, pixels)
                if key == recorded
                else self._sensor.picture(request, pixels=pixels)
            )
            if frame is not None:
                self._memory.keep(cache_key, frame)
        return frame

    def _recorded_picture(self, request: CaptureRequest, pixels: bool) -> StoredFrame:
        """Return the trace's picture with that name."""
        return (
            recorded_frame(self._trace, request.frame) if pixels else without_pixels(self._trace.frames[request.frame])
        )

    def _recorded_key(self, request: CaptureRequest) -> bytes | None:
        """Return the key of the trace's picture with that name, or None. The sensor may be left in the recorded
        states.
        """
        name = request.frame
        if name not in self._recorded_keys:
            key = None
            if name in self._trace.frames:
                then = self._trace.boundaries[request.tick].snapshots[-1]
                occurrences = recorded_occurrences(self._trace.boundaries, request.tick)
                self._sensor.move_to(request.time_s, then.states + then.ambient, occurrences)
                key = self._sensor.key(request)
            self._recorded_keys[name] = key
        return self._recorded_keys[name]
