"""Templates: forks that have prepared an object, and from which further processes are forked.

A placed world is such an object: a template brings the engines to the first boundary once, and each world process of
that instance is a fork of the template. `fork_requests.Template` describes its functions.
"""

from __future__ import annotations

import os
import signal
import socket
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NoReturn

from lingjing.errors import InfrastructureError
from lingjing.processes.becoming import begin, end_after, keep_only, named_function
from lingjing.processes.channel import Channel
from lingjing.processes.fork_client import send_request
from lingjing.processes.fork_requests import Function, StartFunction, Template
from lingjing.processes.forks import Forks, close_all, receive_request

MOST_TEMPLATES = 8
"""The most templates of one fork server. Beyond it the least recently used one ends. Chosen: each takes 100 MB and
more."""

MakeReady = Callable[[], Function]
"""Called in the template's process to prepare the object; see `fork_requests.Template`."""


@dataclass(slots=True)
class Templates:
    """The templates of a fork server."""

    forks: Forks
    channels: dict[tuple[Template, bytes], Channel] = field(default_factory=dict)
    """The channels of their requests, the most recently used last."""
    failed: set[tuple[Template, bytes]] = field(default_factory=set)
    """Templates that ended with an error. Processes that name them are started without a template."""

    def start(self, request: StartFunction, template: Template, descriptors: Sequence[int], server: int) -> bool:
        """Let the template start the process. Returns False if there is none and none can be made.

        `server`: the process id of the fork server.
        """
        key = template, request.argument  # with the argument, because a template holds one placed world (ADR 0028)
        make: MakeReady | None = None
        if key not in self.failed:
            make = named_function(template.source)(request.argument, template.key)
        if make is None:
            return False
        channel = self.channels.pop(key, None) or self._make(key, make, server)
        if channel is None:
            return False
        try:
            send_request(channel, request, descriptors)
        except InfrastructureError:  # it has ended by an error; its status may arrive after further requests
            channel.close()
            self.failed.add(key)
            return False
        self.channels[key] = channel
        return True

    def _make(self, key: tuple[Template, bytes], make: MakeReady, server: int) -> Channel | None:
        """Fork a template and return the channel of its requests. Ends the least recently used one of too many."""
        while len(self.channels) >= MOST_TEMPLATES:
            self.channels.pop(next(iter(self.channels))).close()
        ours, theirs = socket.socketpair()
        with theirs:
            pid = self.forks.fork(None)
            if pid == 0:
                keep_only([theirs.fileno()])
                _become_template(make, theirs.fileno(), server)
        if pid is None:
            ours.close()
            return None
        self.forks.processes[pid].at_end = lambda status: self._note_end(key, status)
        return Channel(ours)

    def _note_end(self, key: tuple[Template, bytes], status: int) -> None:
        if status:
            self.failed.add(key)


@dataclass(slots=True)
class _TemplateProcess:
    """The template's side: each requested process is a fork of this process."""

    channel: Channel
    parent: int
    function: Function
    forks: Forks = field(default_factory=Forks)
    is_over: bool = False

    def run(self) -> None:
        """Serve until the server closes its end and the last fork has ended."""
        self.forks.listen(self.channel, self._answer)
        while os.getppid() == self.parent and not (self.is_over and not self.forks.processes):
            self.forks.serve()

    def _answer(self, channel: Channel) -> None:
        """Handle a request for a process."""
        try:
            request, descriptors = receive_request(channel)
        except EOFError:
            self.forks.selector.unregister(channel)
            self.is_over = True
            return
        if isinstance(request, StartFunction) and len(descriptors) >= 3:
            self._start(request, descriptors)
        close_all(descriptors)

    def _start(self, request: StartFunction, descriptors: tuple[int, ...]) -> None:
        *ends, output, owner, reports = descriptors
        listener = Channel(socket.socket(fileno=os.dup(reports)))
        template = os.getpid()
        pid = self.forks.fork(listener)
        if pid == 0:
            listener.close()
            close_all([owner, reports])
            end_after(lambda: self._serve(request, tuple(ends), output, template))
        if pid is not None:
            self.forks.watch(self.forks.processes[pid], owner)

    def _serve(self, request: StartFunction, ends: tuple[int, ...], output: int, template: int) -> None:
        """Call the template's function, in a fork of the template."""
        self.forks.forget()
        self.channel.close()
        begin(template, signal.SIGKILL, (0, output, output))
        self.function(request.argument, ends)


def _become_template(make: MakeReady, control: int, server: int) -> NoReturn:
    """Prepare the object, and fork the processes that need it."""

    def work() -> None:
        empty = os.open(os.devnull, os.O_RDWR)
        begin(server, signal.SIGKILL, (empty, os.dup(empty), os.dup(empty)))
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        _TemplateProcess(Channel(socket.socket(fileno=control)), server, make()).run()

    end_after(work)


__all__ = ["MOST_TEMPLATES", "MakeReady", "Templates"]
