"""The caller's side of the camera process: pictures within a deadline; late ones are dropped, a dead process is an
abort.

It receives its engine and the episode's city at the first request for a picture, since many episodes request none. One
camera may serve a world and its forks: a capture carries every entity's state, so the process keeps none.
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
from lingjing.mission.schedule import Occurrence
from lingjing.plugins.engine import CaptureRequest
from lingjing.processes.deadlines import OwnDeadline
from lingjing.trace.records import Absent, BodyState

START_S = 300.0
"""Seconds of a worker's own time to start and import its engines, to read a city, and to prepare a city's first
pictures. Not part of `budget.engine_s` or `budget.capture_s`. Chosen.
"""

_PATIENCE = 3
"""Number of capture deadlines after which a silent camera counts as hung. Chosen."""


class CameraProcess:
    """The caller's side of a camera process."""

    def __init__(self, worker: Worker) -> None:
        self.worker = worker
        self.runtime: Mapping[str, str] = {}
        """The process's `lingjing.numerics.runtime_fingerprint`; empty before its first picture."""
        self._lock = threading.Lock()
        self._due: tuple[Prepare, Reset] | None = None
        self._preparing: OwnDeadline | None = None
        self._serial = 0
        self._owed: dict[int, tuple[OwnDeadline, int]] = {}

    @property
    def busy(self) -> bool:
        """True if the process still draws for a deadline that has passed."""
        return bool(self._owed)

    def begin(self, engine: str, reset: Reset, *, at_once: bool) -> None:
        """Store the engine and the episode of the next pictures.

        With `at_once` the process starts the engine now, in parallel to the world process. This pays if pictures are
        certain.
        """
        self.runtime, self._preparing = {}, None
        self._due = Prepare(engines=(engine,)), reset
        if at_once:
            self._prepare(self._due[0])

    def capture(
        self,
        time_s: float,
        requests: Sequence[CaptureRequest],
        states: Sequence[BodyState],
        occurrences: Sequence[Occurrence],
        allowed_s: float,
    ) -> tuple[StoredFrame | Absent, ...]:
        """Return one answer per request.

        A picture that does not arrive within `allowed_s` seconds of the camera's own time is absent as `late` and
        dropped when it arrives. Raises `InfrastructureError` if the process has died or hangs.
        """
        with self._lock:
            try:
                if self._due is not None:
                    self._make_ready(*self._due)
                return self._captured(
                    Capture(
                        serial=self._serial + 1,
                        time_s=time_s,
                        requests=tuple(requests),
                        states=tuple(states),
                        occurrences=tuple(occurrences),
                    ),
                    allowed_s,
                )
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
        self.runtime = self.worker.ask(reset, Ready, self.worker.deadline(START_S)).runtime
        self._due = self._preparing = None

    def _captured(self, message: Capture, allowed_s: float) -> tuple[StoredFrame | Absent, ...]:
        deadline, requests = self.worker.deadline(allowed_s), message.requests
        self._serial = message.serial
        self._owed[self._serial] = (self.worker.deadline(_PATIENCE * allowed_s), len(requests))
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
        """Receive one reply. Return False if the deadline has passed."""
        patience, _ = next(iter(self._owed.values()))  # the oldest capture's patience ends first
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
            self._count_reply(reply.serial)
            if reply.serial != self._serial:
                return True
            if reply.info is None or reply.layout is None:
                answers[reply.index] = absent(requests[reply.index], "not_drawn")
            else:
                answers[reply.index] = load_frame(reply.info, reply.layout, packet.descriptors[0])
        finally:
            packet.close()
        return True

    def _count_reply(self, serial: int) -> None:
        until, count = self._owed.pop(serial)
        if count > 1:
            self._owed[serial] = (until, count - 1)
