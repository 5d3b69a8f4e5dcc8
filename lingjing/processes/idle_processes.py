"""Processes that serve one caller after another: an idle one is handed to the next request of its kind.

A camera process is such a process: its graphics context takes seconds to make, and a picture depends on nothing before
it. The server keeps them in a `ProcessPool`; the function that runs in one has a `ReuseEnd`.
"""

from __future__ import annotations

import selectors
import socket
from collections.abc import Sequence
from dataclasses import dataclass, field

from lingjing.processes.becoming import become_function, keep_only
from lingjing.processes.channel import Channel, ChannelClosedError
from lingjing.processes.deadlines import OwnDeadline, WallDeadline
from lingjing.processes.fork_requests import StartFunction
from lingjing.processes.forks import ForkedChild, Forks

_LINGERS_S = 2.0
"""The longest time that a process may take to become idle when its user has ended, in its own time. Chosen: a picture
takes a tenth of it."""

_IDLE = b"idle"
_NEXT = b"next"


class ReuseEnd:
    """The end of the control channel in a process that is reused. `descriptor`: the last end that its function gets."""

    def __init__(self, descriptor: int) -> None:
        self._channel = Channel(socket.socket(fileno=descriptor))

    def report_idle(self) -> None:
        """Let the server hand this process over."""
        self._channel.send(_IDLE)

    def wait_for_next(self) -> tuple[int, ...] | None:
        """The ends and the output for the next caller; None if the server has ended."""
        try:
            return self._channel.receive().descriptors
        except ChannelClosedError:
            return None


@dataclass(slots=True)
class _Reusable:
    """A process that is reused."""

    process: ForkedChild
    control: Channel
    """The server's end: it brings the next user's descriptors, and receives that the process is idle."""
    request: StartFunction
    is_busy: bool = True
    orphaned: OwnDeadline | None = None
    """The time that is left to become idle, since the user ended."""


@dataclass(slots=True)
class ProcessPool:
    """The processes of a fork server that are reused."""

    forks: Forks
    processes: dict[int, _Reusable] = field(default_factory=dict)

    def start(self, request: StartFunction, ends: Sequence[int], listener: Channel, owner: int, server: int) -> None:
        """Hand over an idle process, or fork one. `ends`: those of the function, then its output. `server`: the process
        id of the fork server."""
        if self._hand_over(request, ends, listener, owner):
            return
        ours, far = socket.socketpair()
        control = Channel(ours)
        with far:
            pid = self.forks.fork(listener)
            if pid == 0:
                keep_only([*ends, far.fileno()])
                become_function(request, (*ends[:-1], far.fileno()), ends[-1], server)
        if pid is None:
            control.close()
            return
        process = self.forks.processes[pid]
        self.forks.watch(process, owner)
        reusable = self.processes[pid] = _Reusable(process, control, request)
        process.at_end = lambda _: self._forget(reusable)
        process.at_end_of_owner = lambda: self._orphan(reusable)
        self.forks.selector.register(control, selectors.EVENT_READ, lambda _: self._note_idle(reusable))

    def end_lingerers(self) -> None:
        """End processes whose user has ended and that do not become idle: another process may hold their channel."""
        for reusable in self.processes.values():
            if reusable.orphaned is not None and reusable.orphaned.left_s() <= 0.0:
                reusable.process.kill()

    def _hand_over(self, request: StartFunction, ends: Sequence[int], listener: Channel, owner: int) -> bool:
        """Give an idle process its next user; False if there is none."""
        for reusable in self.processes.values():
            if reusable.request != request:
                continue
            self._note_idle(reusable)  # its report may not have been read yet
            if reusable.is_busy:
                continue
            try:
                reusable.control.send(_NEXT, ends, WallDeadline(0.0))
            except (ChannelClosedError, TimeoutError):  # it has just ended
                continue
            if reusable.process.listener is not None:
                reusable.process.listener.close()
            reusable.process.listener, reusable.is_busy, reusable.orphaned = listener, True, None
            reusable.process.announce()
            self.forks.watch(reusable.process, owner)
            return True
        return False

    def _note_idle(self, reusable: _Reusable) -> None:
        """Read the report of a process that it is idle, if there is one."""
        try:
            reusable.control.receive(WallDeadline(0.0))
        except (TimeoutError, ChannelClosedError):
            return
        reusable.is_busy, reusable.orphaned = False, None
        self.forks.unwatch(reusable.process)

    def _orphan(self, reusable: _Reusable) -> None:
        """The user has ended: limit the time in which the process must become idle."""
        if reusable.is_busy:
            reusable.orphaned = OwnDeadline(reusable.process.pid, _LINGERS_S, watched=True)

    def _forget(self, reusable: _Reusable) -> None:
        self.forks.selector.unregister(reusable.control)
        reusable.control.close()
        del self.processes[reusable.process.pid]


__all__ = ["ProcessPool", "ReuseEnd"]
