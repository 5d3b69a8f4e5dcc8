"""Processes that serve one user after another: an idle one serves the next equal request.

A camera process is an example: its graphics context takes seconds to make, and no picture depends on earlier ones. The
server keeps such processes in a `ProcessPool`; the function in the process has a `ReuseEnd`.
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
"""The longest time to become idle after the user's end, seconds of own time. Chosen: a picture takes a tenth of it."""

_IDLE = b"idle"
"""The message of a process that is idle."""
_NEXT = b"next"
"""The message that hands an idle process to its next user."""


class ReuseEnd:
    """The control channel in a process that is used again. `descriptor`: the last descriptor of its function."""

    def __init__(self, descriptor: int) -> None:
        self._channel = Channel(socket.socket(fileno=descriptor))

    def report_idle(self) -> None:
        """Report to the server that this process is idle."""
        self._channel.send(_IDLE)

    def wait_for_next(self) -> tuple[int, ...] | None:
        """Return the descriptors and the output of the next user; None if the server has ended."""
        try:
            return self._channel.receive().descriptors
        except ChannelClosedError:
            return None


@dataclass(slots=True)
class _Reusable:
    """A process that is used again."""

    process: ForkedChild
    control: Channel
    """The server's end: it sends the next user's descriptors, and receives reports of idleness."""
    request: StartFunction
    """The request that the process serves."""
    is_busy: bool = True
    """True while a user has the process."""
    orphaned: OwnDeadline | None = None
    """The limit of the time to become idle after the user's end; None while the user runs."""


@dataclass(slots=True)
class ProcessPool:
    """The processes of a fork server that are used again."""

    forks: Forks
    processes: dict[int, _Reusable] = field(default_factory=dict)

    def start(self, request: StartFunction, ends: Sequence[int], listener: Channel, owner: int, server: int) -> None:
        """Hand over an idle process, or fork one.

        `ends`: the descriptors of the function, then its output. `server`: the process id of the fork server.
        """
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
        """End processes that do not become idle after the end of their user. Another process may hold their channel."""
        for reusable in self.processes.values():
            if reusable.orphaned is not None and reusable.orphaned.left_s() <= 0.0:
                reusable.process.kill()

    def _hand_over(self, request: StartFunction, ends: Sequence[int], listener: Channel, owner: int) -> bool:
        """Hand an idle process to its next user. Returns False if there is none."""
        for reusable in self.processes.values():
            if reusable.request != request:
                continue
            self._note_idle(reusable)  # its report may be unread
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
        """Read a report of idleness, if there is one."""
        try:
            reusable.control.receive(WallDeadline(0.0))
        except (TimeoutError, ChannelClosedError):
            return
        reusable.is_busy, reusable.orphaned = False, None
        self.forks.unwatch(reusable.process)

    def _orphan(self, reusable: _Reusable) -> None:
        """Limit the time in which a process must become idle, after the end of its user."""
        if reusable.is_busy:
            reusable.orphaned = OwnDeadline(reusable.process.pid, _LINGERS_S, watched=True)

    def _forget(self, reusable: _Reusable) -> None:
        self.forks.selector.unregister(reusable.control)
        reusable.control.close()
        del self.processes[reusable.process.pid]


__all__ = ["ProcessPool", "ReuseEnd"]
