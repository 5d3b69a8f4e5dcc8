"""Processes that hold a placed world: the world of an instance that comes again is a fork of its holder.

A holder is a fork of the fork server. It brings the engines to boundary 0, within the time that they have, and forks
itself for each world process that it is asked for (`placed_worlds` says what such a fork answers).
"""

from __future__ import annotations

import os
import signal
import socket
from dataclasses import dataclass, field
from typing import NoReturn

from lingjing.errors import InfrastructureError
from lingjing.kernel.world.becoming import add_paths, begin, end_after, keep_only
from lingjing.kernel.world.forking import StartWorker, WorkerSettings, send_request
from lingjing.kernel.world.forks import Forks, close_all, received
from lingjing.kernel.world.handlers import WorldHandler
from lingjing.kernel.world.placed_worlds import WorldStart, announced
from lingjing.kernel.world.shared import CallMonitor, progress_memory
from lingjing.kernel.world.worker import placed_handler, serve_placed

MOST_HOLDERS = 8
"""Holders of one fork server; the one that was not used for the longest time ends first."""


@dataclass(slots=True)
class WorldHolders:
    """The holders of a fork server, each with the socket that it is asked by, the one that was used last at the end."""

    forks: Forks
    holders: dict[tuple[bytes, WorkerSettings], socket.socket] = field(default_factory=dict)
    unplaceable: set[bytes] = field(default_factory=set)

    def start_worker(self, request: StartWorker, descriptors: list[int], server: int) -> bool:
        """Have the holder of a placed world start the worker; False if there is none and none can be made. `server` is
        the process id of the fork server."""
        start = announced(request.start) if request.start not in self.unplaceable else None
        if start is None:
            return False
        key = request.start, request.settings
        holder = self.holders.pop(key, None) or self._hold(request.settings, start, server)
        if holder is None:
            return False
        try:
            send_request(holder, request, descriptors)
        except InfrastructureError:  # it has just ended
            holder.close()
            return False
        self.holders[key] = holder
        return True

    def _hold(self, settings: WorkerSettings, start: WorldStart, server: int) -> socket.socket | None:
        """Fork a holder; returns the socket that it is asked by. The oldest ends when there are too many."""
        while len(self.holders) >= MOST_HOLDERS:
            self.holders.pop(next(iter(self.holders))).close()
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        unread, listener = socket.socketpair()
        with theirs, unread:
            pid = self.forks.fork(listener)
            if pid == 0:
                keep_only([theirs.fileno()])
                _become_holder(settings, start, theirs.fileno(), server)
        if pid is None:
            ours.close()
            return None
        self.forks.processes[pid].at_end = lambda status: self._note_end(start, status)
        return ours

    def _note_end(self, start: WorldStart, status: int) -> None:
        if status:  # the next worker says by itself what is wrong
            self.unplaceable.add(start.key)


@dataclass(slots=True)
class _Holder:
    """The far end: each worker that it is asked for is a fork of itself."""

    asking: socket.socket
    parent: int
    handler: WorldHandler
    progress: CallMonitor
    forks: Forks = field(default_factory=Forks)
    is_over: bool = False

    def run(self) -> None:
        """Serve until the server's end is closed, then until the last worker has ended."""
        self.forks.listen(self.asking, self._answer)
        while os.getppid() == self.parent and not (self.is_over and not self.forks.processes):
            self.forks.serve()

    def _answer(self, asking: socket.socket) -> None:
        """A worker is asked for."""
        try:
            request, descriptors = received(asking)
        except EOFError:
            self.forks.selector.unregister(asking)
            self.is_over = True
            return
        if isinstance(request, StartWorker) and len(descriptors) == 5:
            self._start_worker(descriptors)
        close_all(descriptors)

    def _start_worker(self, descriptors: list[int]) -> None:
        channel, progress, output, owner, told = descriptors
        listener = socket.socket(fileno=os.dup(told))
        holder = os.getpid()
        pid = self.forks.fork(listener)
        if pid == 0:
            listener.close()
            close_all([owner, told])
            end_after(lambda: self._serve_placed((channel, progress, output), holder))
        if pid is not None:
            self.forks.watch(self.forks.processes[pid], owner)

    def _serve_placed(self, ends: tuple[int, int, int], holder: int) -> None:
        """In a fork of the holder: be the world process."""
        self.forks.forget()
        self.asking.close()
        begin(holder, signal.SIGKILL, (0, ends[2], ends[2]))
        serve_placed(self.handler, self.progress, ends[:2], holder)


def _become_holder(settings: WorkerSettings, start: WorldStart, control: int, server: int) -> NoReturn:
    """Place a world, within the time that its engines have, and fork workers of it."""

    def work() -> None:
        empty = os.open(os.devnull, os.O_RDWR)
        begin(server, signal.SIGKILL, (empty, os.dup(empty), os.dup(empty)))
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        add_paths(settings.paths)
        progress = progress_memory()
        monitor = CallMonitor(progress)
        os.close(progress)
        signal.setitimer(signal.ITIMER_PROF, start.reset.instance.budget.engine_s)
        handler = placed_handler(settings, start, monitor)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        _Holder(socket.socket(fileno=control), server, handler, monitor).run()

    end_after(work)


__all__ = ["MOST_HOLDERS", "WorldHolders"]
