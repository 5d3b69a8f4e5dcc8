"""The camera process as the caller sees it: pictures within a deadline, late ones dropped, a dead one an abort.

It gets its engine and the episode's city when the first picture is asked for: many an episode asks for none. One camera
may serve a world and its forks: a capture carries every entity's state, so nothing is remembered.
"""

from __future__ import annotations

import threading
import warnings
from collections.abc import Mapping, Sequence

from lingjing.kernel.world.contract import StoredFrame
from lingjing.kernel.world.guarded_calls import absent
from lingjing.kernel.world.handle import Worker
from lingjing.kernel.world.messages import Capture, PictureReply, Prepare, Ready, Reset, encoded
from lingjing.kernel.world.shared import load_frame
from lingjing.plugins.engine import CaptureRequest
from lingjing.processes.deadlines import OwnDeadline
from lingjing.trace.records import Absent, BodyState

START_S = 300.0
"""What a worker may take to come up and import its engines, or to take in a city, and a camera to make a city's first
pictures ready: seconds of its own time, and no part of `budget.engine_s` or `budget.capture_s`."""

_PATIENCE = 3
"""How many deadlines a camera may be late before it counts as hung."""


class CameraProcess:
    """The caller's end of a camera process.

    `taken` is its `lingjing.numerics.runtime_fingerprint` once it has drawn.
    """

    def __init__(self, worker: Worker) -> None:
        self.worker = worker
        self.taken: Mapping[str, str] = {}
        self._lock = threading.Lock()
        self._due: tuple[Prepare, Reset] | None = None
        self._preparing: OwnDeadline | None = None
        self._serial = 0
        self._owed: dict[int, tuple[OwnDeadline, int]] = {}

    @property
    def busy(self) -> bool:
        """Whether it still draws for a deadline that has passed."""
        return bool(self._owed)

    def begin(self, engine: str, reset: Reset, *, at_once: bool) -> None:
        """Note the engine and the episode of the next pictures; `at_once` has the process start the engine now, beside
        the world process, since pictures are sure to come."""
        self.taken, self._preparing = {}, None
        self._due = Prepare(engines=(engine,)), reset
        if at_once:
            self._prepare(self._due[0])

    def capture(
        self, time_s: float, requests: Sequence[CaptureRequest], states: Sequence[BodyState], allowed_s: float
    ) -> tuple[StoredFrame | Absent, ...]:
        """One answer per request; what has not come within `allowed_s` seconds of the camera's own time is `late` and
        dropped when it comes."""
        with self._lock:
            try:
                if self._due is not None:
                    self._make_ready(*self._due)
                return self._captured(time_s, requests, states, allowed_s)
            except BaseException:
                self.worker.kill()
                raise

    def _prepare(self, prepare: Prepare) -> OwnDeadline:
        self._preparing = self.worker.deadline(START_S)
        self.worker.send(encoded(prepare), self._preparing)
        return self._preparing

    def _make_ready(self, prepare: Prepare, reset: Reset) -> None:
        preparing = self._preparing or self._prepare(prepare)
        for problem in self.worker.expect(Ready, preparing).problems:
            warnings.warn(problem, RuntimeWarning, stacklevel=4)
        self.taken = self.worker.ask(reset, Ready, self.worker.deadline(START_S)).taken
        self._due = self._preparing = None

    def _captured(
        self, time_s: float, requests: Sequence[CaptureRequest], states: Sequence[BodyState], allowed_s: float
    ) -> tuple[StoredFrame | Absent, ...]:
        deadline = self.worker.deadline(allowed_s)
        self._serial += 1
        self._owed[self._serial] = (self.worker.deadline(_PATIENCE * allowed_s), len(requests))
        message = Capture(serial=self._serial, time_s=time_s, requests=tuple(requests), states=tuple(states))
        self.worker.send(encoded(message), deadline)
        answers: list[StoredFrame | Absent] = [absent(request, "late") for request in requests]
        while self._serial in self._owed and self._collect(requests, answers, deadline):
            pass
        return tuple(answers)

    def _collect(
        self,
        requests: Sequence[CaptureRequest],
        answers: list[StoredFrame | Absent],
        deadline: OwnDeadline,
    ) -> bool:
        """Take in one reply; False when the deadline has passed."""
        patience, _ = next(iter(self._owed.values()))  # that of the oldest is the first to end
        is_hanging = patience.left_s() < deadline.left_s()
        try:
            reply, packet = self.worker.receive(patience if is_hanging else deadline)
        except TimeoutError:
            if is_hanging:
                raise self.worker.hung(patience.allowed_s) from None
            return False
        try:
            if not isinstance(reply, PictureReply):
                raise self.worker.fault(reply)
            self._settle(reply.serial)
            if reply.serial != self._serial:
                return True
            if reply.info is None or reply.layout is None:
                answers[reply.index] = absent(requests[reply.index], "not_drawn")
            else:
                answers[reply.index] = load_frame(reply.info, reply.layout, packet.descriptors[0])
        finally:
            packet.close()
        return True

    def _settle(self, serial: int) -> None:
        until, count = self._owed.pop(serial)
        if count > 1:
            self._owed[serial] = (until, count - 1)
