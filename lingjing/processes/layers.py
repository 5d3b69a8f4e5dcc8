"""Layers: forks of a fork server that have imported more modules, and from which processes are forked in turn.

A fork copies the page tables of its original, so its cost grows with the memory of the original. A process with every
engine takes 17 ms of CPU time, one without engines 6 ms (measured with 80 and 40 MB of own memory). Processes of
episodes and policies need no engine and are forks of the server itself. Processes of engines are forks of a layer. A
layer receives its server's requests over a channel, and has templates and reused processes of its own.
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
"""Called in the process of a layer, with the channel of its requests, the server's process id, and its modules."""


@dataclass(slots=True)
class Layers:
    """The layers of a fork server."""

    forks: Forks
    modules: Mapping[str, Sequence[str]]
    """The modules of each layer, by its name."""
    serve: ServeLayer
    """Serves requests in the process of a layer."""
    channels: dict[str, Channel] = field(default_factory=dict)
    """The channels of the running layers, by name."""
    failed: set[str] = field(default_factory=set)
    """Layers that ended with an error, such as a failed import. The server starts their processes itself."""

    def begin_all(self) -> None:
        """Start the layers that do not run."""
        for name in self.modules:
            self._begin(name)

    def start(self, request: StartFunction, descriptors: Sequence[int]) -> bool:
        """Let the requested layer start the process. Returns False if there is none and none can be started."""
        name = request.layer
        self._begin(name)
        return self._send(name, request, descriptors)

    def call(self, request: CallFunction) -> None:
        """Send the request to the running layers, if it is for layers. Later ones are forked after it."""
        for name in tuple(self.channels) if request.in_layers else ():
            self._send(name, request, ())

    def _send(self, name: str, request: ForkRequest, descriptors: Sequence[int]) -> bool:
        channel = self.channels.get(name)
        if channel is None:
            return False
        try:
            send_request(channel, request, descriptors)
        except InfrastructureError:  # the layer has ended
            return False
        return True

    def _begin(self, name: str) -> None:
        """Start a layer of this name, unless it runs, has failed or does not exist."""
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
