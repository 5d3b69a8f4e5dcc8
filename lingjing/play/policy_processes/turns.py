"""Turns: requests to processes of policies that are waited for at once, each with its deadline."""

from __future__ import annotations

import select
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from lingjing.play.policy_processes.agent_process import PolicyProcess
from lingjing.play.policy_processes.messages import (
    CallFailed,
    CancelCall,
    PolicyAnswerMessage,
    PolicyRequest,
    RaisedError,
)
from lingjing.processes.deadlines import Deadline, OwnDeadline

_CANCEL_S = 1.0
"""How long a call that was cancelled may take to end: seconds of the process's own time."""

_LONGEST_WAIT_S = 0.5
"""After so long deadlines are looked at again, which a busy machine may have put off."""

RequestList = list[tuple[PolicyRequest, Sequence[int]]]
"""RequestList with their descriptors, in order."""


@dataclass(slots=True)
class Turn:
    """RequestList to one process that are answered one after the other; `answer` is that to the last of them, or the
    first that is a failure."""

    process: PolicyProcess
    requests: RequestList
    deadline: Deadline
    started: float = field(default_factory=time.monotonic)
    wall_s: float = 0.0
    answer: PolicyAnswerMessage | None = None
    ended: str = ""
    is_late: bool = False

    @property
    def is_over(self) -> bool:
        """True if nothing more is to be waited for."""
        return self.answer is not None or bool(self.ended)

    def send_next(self) -> None:
        """Send the next request."""
        request, slots = self.requests.pop(0)
        self.process.send(request, slots)

    def receive(self) -> None:
        """Take in what has come."""
        try:
            answer = self.process.receive()
        except EOFError as error:
            self._end(ended=str(error))
            return
        if answer is None:
            return
        if self.requests and not self.is_late and not isinstance(answer, CallFailed | RaisedError):
            self.send_next()
        else:
            self._end(answer)

    def expire(self) -> None:
        """The deadline has passed: cancel the call, and end the process if that has been tried."""
        if self.is_late:
            self.process.end()
            self._end(ended="it did not answer in time")
            return
        self.is_late = True
        self.deadline = OwnDeadline(self.process.pid, _CANCEL_S, watched=True)
        self.process.send(CancelCall())

    def _end(self, answer: PolicyAnswerMessage | None = None, ended: str = "") -> None:
        self.answer, self.ended = answer, ended
        self.wall_s = time.monotonic() - self.started


def wait_for(turns: Iterable[Turn]) -> None:
    """Serve the processes until each turn is over; one whose deadline passes is cancelled, then ended. Whatever
    interrupts the waiting ends every process that has not answered."""
    turns = tuple(turns)
    try:
        while waiting := [turn for turn in turns if not turn.is_over]:
            left_s = min(turn.deadline.left_s() for turn in waiting)
            wait_until_ready([turn.process for turn in waiting], left_s)
            for turn in waiting:
                turn.receive()
                if not turn.is_over and turn.deadline.left_s() <= 0.0:
                    turn.expire()
    except BaseException:
        for turn in turns:
            if not turn.is_over:
                turn.process.end()
        raise


def wait_until_ready(processes: Iterable[PolicyProcess], most_s: float) -> None:
    """Wait until one of the processes has sent something or has ended, at most so long."""
    poller = select.poll()  # not `select`, which cannot watch descriptors from 1024 on
    for process in processes:
        for descriptor in process.descriptors():
            poller.register(descriptor, select.POLLIN)
    poller.poll(1000.0 * max(0.0, min(most_s, _LONGEST_WAIT_S)))
