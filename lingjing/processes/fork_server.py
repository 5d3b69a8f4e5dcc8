"""`python -m lingjing.processes.fork_server`: the process from which the processes of one command are forked.

It has imported all modules and has one thread, which is checked before each fork (`forks`). It opens no OpenGL, loads
no OpenCV, executes no code of a policy, and plays nothing: its forks do (`becoming`). The imported modules are the only
state that a fork needs; the global random generators are seeded anew. A process that is used again outlives its user
(`idle_processes`). An object that several processes need is prepared once (`templates`).

It ends with its caller, or when the caller closes the channel, and ends its forks: functions by SIGKILL, modules by
SIGTERM. A function ends with its owner; one that is used again ends if it does not become idle then. Processes that a
fork leaves behind, in any session, become children of this process, which ends them.
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
from lingjing.processes.fork_requests import CallFunction, ForkRequest, KeepResult, RunModule, StartFunction
from lingjing.processes.forks import Forks, close_all, receive_request
from lingjing.processes.idle_processes import ProcessPool
from lingjing.processes.kept_results import keep_result
from lingjing.processes.layers import Layers
from lingjing.processes.linux import adopt_orphans, end_with_parent, keep_freed_memory
from lingjing.processes.templates import Templates
from lingjing.processes.walls.namespaces import enter_namespaces


@dataclass(slots=True)
class _Server:
    """The server, or one of its layers."""

    caller: Channel
    """The channel of its requests."""
    parent: int
    """The process id of its caller, with which it ends."""
    further: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """The modules of each of its layers, by name."""
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
        """Serve until the caller closes its end."""
        self.forks.listen(self.caller, self.answer_caller)
        while os.getppid() == self.parent and self.forks.serve():
            self.pool.end_lingerers()

    def answer_caller(self, caller: Channel) -> bool:
        """Handle a request of the caller. Returns False at the end of its channel."""
        try:
            request, descriptors = receive_request(caller)
        except EOFError:
            return False
        if isinstance(request, RunModule) and len(descriptors) == 4 + len(request.further):
            self.run_module(request, descriptors)
        elif isinstance(request, CallFunction):
            _call(request)
            self.layers.call(request)
        else:
            self.answer_client(request, descriptors)
        close_all(descriptors)
        return True

    def answer_module(self, module: Channel) -> None:
        """Handle a request of a running module."""
        try:
            request, descriptors = receive_request(module)
        except EOFError:
            self.forks.selector.unregister(module)
            module.close()
            return
        self.answer_client(request, descriptors)
        close_all(descriptors)

    def answer_client(self, request: ForkRequest | None, descriptors: tuple[int, ...]) -> None:
        """Handle a request of a `ForkServerClient`, which may start functions and keep results only."""
        if isinstance(request, KeepResult):
            keep_result(request.key, request.result)
        else:
            self.start(request, descriptors)

    def run_module(self, request: RunModule, descriptors: tuple[int, ...]) -> None:
        """Fork a process for a module."""
        ours, theirs = socket.socketpair()
        with theirs:
            pid = self.forks.fork(_listener(descriptors))
            if pid == 0:
                keep_only([*descriptors[:-1], theirs.fileno()])
                become_module(request, descriptors[:-1], theirs.fileno(), self.pid)
            if pid is not None:
                self.forks.processes[pid].is_module = True
        self.forks.listen(Channel(ours), self.answer_module)
        self.layers.begin_all()  # they import while the module begins

    def start(self, request: ForkRequest | None, descriptors: tuple[int, ...]) -> None:
        """Start a process for a function: from a layer, from a template, from an idle process, or as a new fork."""
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
    """The caller of this server has ended."""


def _end(number: int, frame: object) -> NoReturn:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a second signal would interrupt the handling of the first one
    raise _CallerEndedError


def main() -> NoReturn:
    """Serve until the caller has ended."""
    options = _options()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # during the imports there are no forks to end
    end_with_parent(options.parent, signal.SIGTERM)
    namespaces = enter_namespaces() if options.walls else None
    adopt_orphans()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    os.set_inheritable(options.fd, False)
    keep_freed_memory()
    for module in options.imports:
        import_module(module)
    pins()  # its result is cached for the forks
    gc.collect()
    gc.freeze()
    further = {name: modules.split(",") for name, _, modules in (text.partition("=") for text in options.layer)}
    server = _Server(Channel(socket.socket(fileno=options.fd)), options.parent, further)
    if namespaces is not None:  # its parent is outside of the namespace, as it is for its forks: they have the number 0
        server.forks.namespaces, server.parent, server.pid = namespaces, 0, 0
    try:
        # Handled, so that processes which the forks have started in other sessions end as well.
        signal.signal(signal.SIGTERM, _end)
        server.run()
        # The caller's end of the channel closes before the kernel sends the signal of its death.
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    except _CallerEndedError:
        pass
    except OSError as error:  # the caller reports the lost server; this line has the cause
        print(f"the process that starts others cannot go on: {error}", file=sys.stderr)  # noqa: T201
    except BaseException:  # noqa: BLE001 - the interpreter would wait for unexpected threads at its end
        traceback.print_exc()
    server.forks.end_all()
    os._exit(0)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="lingjing.processes.fork_server")
    parser.add_argument("--fd", type=int, required=True)
    parser.add_argument("--parent", type=int, required=True)
    parser.add_argument("--walls", action="store_true")
    parser.add_argument("--layer", action="append", default=[], metavar="NAME=MODULE,MODULE")
    parser.add_argument("imports", nargs="*")
    return parser.parse_args()


def _serve_as_layer(control: socket.socket, parent: int, modules: Sequence[str]) -> None:
    """Run a layer, in a fork of the server: import its modules, and start the processes that need them."""
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
    except OSError as error:  # the caller reports the lost server; this line has the cause
        sys.exit(f"the process that starts others cannot go on: {error}")
