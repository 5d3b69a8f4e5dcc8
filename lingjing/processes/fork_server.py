"""`python -m lingjing.processes.fork_server`: the process that the processes of one command are forked from.

It has imported everything and has one thread, which is checked before each fork (`forks`). It opens no OpenGL, loads
no OpenCV, runs nothing of a policy, and plays nothing: its forks do (`becoming`). Of the state that a fork takes along
only the imported modules count; the global random streams are seeded anew. A process that is reused outlives its user
(`idle_processes`). A thing that several processes need ready is made once (`templates`).

It ends with the end of its caller's channel and with its caller, and its forks with it: functions by SIGKILL, modules
by SIGTERM. A function ends with the process that asked for it; one that is reused ends if it does not become idle then.
Processes that a fork leaves behind, in whatever session, become children of this process, which ends them.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import os
import signal
import socket
import sys
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import NoReturn

from lingjing.numerics import pins
from lingjing.processes.becoming import become_function, become_module, keep_only, named_function
from lingjing.processes.channel import Channel
from lingjing.processes.fork_requests import CallFunction, ForkRequest, RunModule, StartFunction
from lingjing.processes.forks import Forks, close_all, receive_request
from lingjing.processes.idle_processes import ProcessPool
from lingjing.processes.layers import Layers
from lingjing.processes.linux import adopt_orphans, end_with_parent, keep_freed_memory
from lingjing.processes.templates import Templates


@dataclass(slots=True)
class _Server:
    """The server, or one of its layers. `caller`: the channel of its requests. `parent`: the process id of its caller,
    with which it ends. `further`: the modules of its layers."""

    caller: Channel
    parent: int
    further: Mapping[str, Sequence[str]] = field(default_factory=dict)
    pid: int = field(default_factory=os.getpid)
    forks: Forks = field(default_factory=Forks)
    pool: ProcessPool = field(init=False)
    templates: Templates = field(init=False)
    layers: Layers = field(init=False)

    def __post_init__(self) -> None:
        self.pool = ProcessPool(self.forks)
        self.templates = Templates(self.forks)
        self.layers = Layers(self.forks, self.further, _serve_as_layer)

    def run(self) -> None:
        """Serve until the caller's end is closed."""
        self.forks.listen(self.caller, self.answer_caller)
        while os.getppid() == self.parent and self.forks.serve():
            self.pool.end_lingerers()

    def answer_caller(self, caller: Channel) -> bool:
        """A request of the caller; False at the end of its channel."""
        try:
            request, descriptors = receive_request(caller)
        except EOFError:
            return False
        if isinstance(request, RunModule) and len(descriptors) == 4:
            self.run_module(request, descriptors)
        elif isinstance(request, CallFunction):
            _call(request)
            self.layers.call(request)
        else:
            self.start(request, descriptors)
        close_all(descriptors)
        return True

    def answer_module(self, module: Channel) -> None:
        """A request of a module that runs: it may ask for functions alone."""
        try:
            request, descriptors = receive_request(module)
        except EOFError:
            self.forks.selector.unregister(module)
            module.close()
            return
        self.start(request, descriptors)
        close_all(descriptors)

    def run_module(self, request: RunModule, descriptors: tuple[int, ...]) -> None:
        """Fork a process for a module."""
        ours, theirs = socket.socketpair()
        with theirs:
            pid = self.forks.fork(_listener(descriptors))
            if pid == 0:
                keep_only([*descriptors[:3], theirs.fileno()])
                become_module(request, descriptors[:3], theirs.fileno(), self.pid)
            if pid is not None:
                self.forks.processes[pid].is_module = True
        self.forks.listen(Channel(ours), self.answer_module)
        self.layers.begin_all()  # they import while the module begins

    def start(self, request: ForkRequest | None, descriptors: tuple[int, ...]) -> None:
        """Start a process for a function: of a template, one that is reused, or a new fork."""
        if not isinstance(request, StartFunction) or len(descriptors) < 3:
            return
        if self.layers.start(request, descriptors):
            return
        template = request.template
        if template is not None and self.templates.start(request, template, descriptors, self.pid):
            return
        *ends, owner, _ = descriptors
        listener = _listener(descriptors)
        if request.reuse:
            self.pool.start(request, ends, listener, owner, self.pid)
            return
        pid = self.forks.fork(listener)
        if pid == 0:
            keep_only(ends)
            become_function(request, ends[:-1], ends[-1], self.pid)
        if pid is not None:
            self.forks.watch(self.forks.processes[pid], owner)


class _CallerEndedError(BaseException):
    """The process that this server belongs to has ended."""


def _end(number: int, frame: object) -> NoReturn:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a second one would break off what the first one has begun
    raise _CallerEndedError


def main() -> NoReturn:
    """Serve until the caller has ended."""
    options = _options()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # during the imports there are no forks to end
    end_with_parent(options.parent, signal.SIGTERM)
    adopt_orphans()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    os.set_inheritable(options.fd, False)
    keep_freed_memory()
    for module in options.imports:
        import_module(module)
    pins()  # what it looks up is kept for the forks
    gc.collect()
    gc.freeze()
    further = {name: modules.split(",") for name, _, modules in (text.partition("=") for text in options.layer)}
    server = _Server(Channel(socket.socket(fileno=options.fd)), options.parent, further)
    try:
        # Not SIGKILL: processes that the forks have started in other sessions are to end as well.
        signal.signal(signal.SIGTERM, _end)
        server.run()
        # The caller's end of the channel closes before the kernel sends the signal of its death.
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    except _CallerEndedError:
        pass
    except OSError as error:  # the caller reports what it lacks; this is what the system reports
        print(f"the process that starts others cannot go on: {error}", file=sys.stderr)  # noqa: T201
    except BaseException:  # noqa: BLE001 - as the interpreter does, which would wait for threads that should not be
        traceback.print_exc()
    server.forks.end_all()
    os._exit(0)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="lingjing.processes.fork_server")
    parser.add_argument("--fd", type=int, required=True)
    parser.add_argument("--parent", type=int, required=True)
    parser.add_argument("--layer", action="append", default=[], metavar="NAME=MODULE,MODULE")
    parser.add_argument("imports", nargs="*")
    return parser.parse_args()


def _serve_as_layer(control: socket.socket, parent: int, modules: Sequence[str]) -> None:
    """In a fork of the server: import the modules of a layer, and start the processes that need them."""
    adopt_orphans()
    for module in modules:
        import_module(module)
    gc.collect()
    gc.freeze()
    server = _Server(Channel(control), parent)
    server.run()
    server.forks.end_all()


def _listener(descriptors: tuple[int, ...]) -> Channel:
    return Channel(socket.socket(fileno=os.dup(descriptors[-1])))


def _call(request: CallFunction) -> None:
    with contextlib.suppress(Exception):  # see `ForkServer.call`
        named_function(request.function)(request.argument)
    gc.collect()
    gc.freeze()


if __name__ == "__main__":
    try:
        main()
    except OSError as error:  # the caller reports what it lacks; this is what the system reports
        sys.exit(f"the process that starts others cannot go on: {error}")
