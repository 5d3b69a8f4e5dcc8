"""Layers: forks of a fork server that have imported more, and of which in turn processes are forked.

A fork copies the page tables of its original, so its cost grows with all that the original holds: 17 ms CPU for a
process with every engine, 6 ms for one without (measured with 80 and 40 MB of own memory). The process of an episode
and those of its policies need no engine. They are forks of the server itself, and those of engines are forks of a
layer. A layer takes the requests of its server over a channel, and has templates and reused processes of its own.
"""

from __future__ import annotations

import os
import signal
import socket
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NoReturn

from lingjing.errors import InfrastructureError
from lingjing.processes.becoming import begin, end_after, keep_only
from lingjing.processes.channel import Channel
from lingjing.processes.fork_client import send_request
from lingjing.processes.fork_requests import CallFunction, ForkRequest, StartFunction
from lingjing.processes.forks import Forks

ServeLayer = Callable[[socket.socket, int, Sequence[str]], None]
"""Called in the process of a layer: with the channel of its requests, the server's process id, and the modules."""


@dataclass(slots=True)
class Layers:
    """The layers of a fork server. `modules`: what each imports, by its name."""

    forks: Forks
    modules: Mapping[str, Sequence[str]]
    serve: ServeLayer
    channels: dict[str, Channel] = field(default_factory=dict)
    """The channels of those that run."""
    failed: set[str] = field(default_factory=set)
    """Layers that ended with an error, as of a module that cannot be imported. The server starts their processes."""

    def begin_all(self) -> None:
        """Start the layers that do not run."""
        for name in self.modules:
            self._begin(name)

    def start(self, request: StartFunction, descriptors: Sequence[int]) -> bool:
        """Have the layer that the request names start the process; False if there is none and none can be started."""
        name = request.layer
        self._begin(name)
        return self._send(name, request, descriptors)

    def call(self, request: CallFunction) -> None:
        """Pass the request on to the layers that run, if it is for them too. Others are forked after it."""
        for name in tuple(self.channels) if request.in_layers else ():
            self._send(name, request, ())

    def _send(self, name: str, request: ForkRequest, descriptors: Sequence[int]) -> bool:
        channel = self.channels.get(name)
        if channel is None:
            return False
        try:
            send_request(channel, request, descriptors)
        except InfrastructureError:  # it has just ended
            return False
        return True

    def _begin(self, name: str) -> None:
        """Start a layer, if there is one of that name, it does not run and has not failed."""
        if name in self.channels or name in self.failed or name not in self.modules:
            return
        ours, theirs = socket.socketpair()
        with theirs:
            server = os.getpid()
            pid = self.forks.fork(None)
            if pid == 0:
                keep_only([theirs.fileno()])
                self._become(theirs, server, self.modules[name])
        if pid is None:
            ours.close()
            return
        self.channels[name] = Channel(ours)
        self.forks.processes[pid].at_end = lambda status: self._note_end(name, status)

    def _note_end(self, name: str, status: int) -> None:
        self.channels.pop(name).close()
        if os.waitstatus_to_exitcode(status) > 0:
            self.failed.add(name)

    def _become(self, control: socket.socket, server: int, modules: Sequence[str]) -> NoReturn:
        def work() -> None:
            empty = os.open(os.devnull, os.O_RDWR)
            begin(server, signal.SIGKILL, (empty, os.dup(empty), os.dup(2)))
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            self.serve(control, server, modules)

        end_after(work)


__all__ = ["Layers", "ServeLayer"]
