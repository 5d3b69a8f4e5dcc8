"""Turns: requests to the processes of policies, which the player waits for at once with a deadline each."""

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
"""The longest time for a cancelled call to end, seconds of the process's own time. Chosen."""

_LONGEST_WAIT_S = 0.5
"""The longest wait before deadlines are read again, seconds: own time may have extended them. Chosen."""

RequestList = list[tuple[PolicyRequest, Sequence[int]]]
"""Requests with their descriptors, in order."""


@dataclass(slots=True)
class Turn:
    """Requests to one process that are answered one after the other."""

    process: PolicyProcess
    requests: RequestList
    """The requests that are not sent yet."""
    deadline: Deadline
    """The end of the waiting."""
    started: float = field(default_factory=time.monotonic)
    """The start of the turn on the monotonic clock, seconds."""
    wall_s: float = 0.0
    """The duration of the turn, seconds of wall clock; 0 before its end."""
    answer: PolicyAnswerMessage | None = None
    """The answer to the last request, or the first failure; None before it."""
    ended: str = ""
    """The reason for which the process has ended; "" if it has not."""
    is_late: bool = False
    """True if the deadline has passed."""

    @property
    def is_over(self) -> bool:
        """True if no further answer is expected."""
        return self.answer is not None or bool(self.ended)

    def send_next(self) -> None:
        """Send the next request."""
        request, slots = self.requests.pop(0)
        self.process.send(request, slots)

    def receive(self) -> None:
        """Receive an answer, if it has arrived, and send the next request."""
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
        """Handle a passed deadline: cancel the call, or end the process if the call was cancelled before."""
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
    """Serve the processes until each turn is over. A late call is cancelled; if it goes on, its process is ended.

    An exception during the waiting ends every process without an answer.
    """
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
    """Wait until a process has sent a message or has ended, at most `most_s` seconds."""
    poller = select.poll()  # not `select`, which cannot watch descriptors from 1024 on
    for process in processes:
        for descriptor in process.descriptors():
            poller.register(descriptor, select.POLLIN)
    poller.poll(1000.0 * max(0.0, min(most_s, _LONGEST_WAIT_S)))
