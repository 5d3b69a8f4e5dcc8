"""`python -m lingjing.kernel.world.fork_server`: the process that the episodes of one command are forked from.

It has imported everything and has one thread, which is asserted before each fork (`forks`). It opens no OpenGL, loads
no OpenCV, runs nothing of a policy, and plays nothing: what happens in an episode happens in its forks (`becoming`). Of
the state that a fork takes along only what was imported counts; the global random streams are begun anew. A camera
process outlives its episode and is handed to the next one that asks (`idle_cameras`). The world of an instance that
comes again is forked from a holder, a fork that has placed it and serves this one world (`world_holders`).

It ends with the end of its caller's socket and with its caller, and its forks with it: workers by SIGKILL, modules by
SIGTERM. A world process or a function's ends with the process that asked for it, a camera process that does not become
idle as well. What a fork leaves behind, in whatever session, is handed to this process, which ends it.
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
from dataclasses import dataclass, field
from importlib import import_module
from typing import NoReturn

from lingjing.kernel.world.becoming import become_function, become_module, become_worker, keep_only
from lingjing.kernel.world.descendants import adopt
from lingjing.kernel.world.forking import CallFunction, ForkRequest, RunModule, StartFunction, StartWorker
from lingjing.kernel.world.forks import Forks, close_all, received
from lingjing.kernel.world.idle_cameras import CameraPool
from lingjing.kernel.world.parent_death import die_with
from lingjing.kernel.world.world_holders import WorldHolders


@dataclass(slots=True)
class _Server:
    """`asking`: the caller's requests. `parent` and `pid`: the process ids of the caller and of this process."""

    asking: socket.socket
    parent: int
    pid: int
    forks: Forks
    cameras: CameraPool = field(init=False)
    holders: WorldHolders = field(init=False)

    def __post_init__(self) -> None:
        self.cameras = CameraPool(self.forks)
        self.holders = WorldHolders(self.forks)

    def run(self) -> None:
        """Serve until the caller's end is closed."""
        self.forks.listen(self.asking, self.answer_caller)
        while os.getppid() == self.parent and self.forks.serve():
            self.cameras.end_lingerers()

    def answer_caller(self, asking: socket.socket) -> bool:
        """A request through the caller's socket; False at its end."""
        try:
            request, descriptors = received(asking)
        except EOFError:
            return False
        if isinstance(request, RunModule) and len(descriptors) == 4:
            self.run_module(request, descriptors)
        elif isinstance(request, CallFunction):
            _call(request)
        else:
            self.start(request, descriptors)
        close_all(descriptors)
        return True

    def answer_module(self, asking: socket.socket) -> None:
        """A request of a module that runs: it may ask for workers and functions alone."""
        try:
            request, descriptors = received(asking)
        except EOFError:
            self.forks.selector.unregister(asking)
            asking.close()
            return
        self.start(request, descriptors)
        close_all(descriptors)

    def start(self, request: ForkRequest | None, descriptors: list[int]) -> None:
        """Start a worker or a function."""
        if isinstance(request, StartWorker) and len(descriptors) == 5:
            self.start_worker(request, descriptors)
        elif isinstance(request, StartFunction) and len(descriptors) >= 3:
            self.start_function(request, descriptors)

    def run_module(self, request: RunModule, descriptors: list[int]) -> None:
        """Fork a process for a module."""
        listener = socket.socket(fileno=os.dup(descriptors[3]))
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            pid = self.forks.fork(listener)
            if pid == 0:
                keep_only([*descriptors[:3], theirs.fileno()])
                become_module(request, descriptors[:3], theirs.fileno(), self.pid)
            if pid is not None:
                self.forks.processes[pid].is_module = True
        self.forks.listen(ours, self.answer_module)

    def start_worker(self, request: StartWorker, descriptors: list[int]) -> None:
        """Start a world or camera process, of those that are held where there is one."""
        channel, progress, output, owner, told = descriptors
        if request.start and self.holders.start_worker(request, descriptors, self.pid):
            return
        ends, listener = (channel, progress, output), socket.socket(fileno=os.dup(told))
        if request.place == "camera":
            self.cameras.start(request, ends, listener, owner, self.pid)
            return
        pid = self.forks.fork(listener)
        if pid == 0:
            keep_only(ends)
            become_worker(request, ends, -1, self.pid)
        if pid is not None:
            self.forks.watch(self.forks.processes[pid], owner)

    def start_function(self, request: StartFunction, descriptors: list[int]) -> None:
        """Fork a process for a function."""
        *ends, output, owner, told = descriptors
        pid = self.forks.fork(socket.socket(fileno=os.dup(told)))
        if pid == 0:
            keep_only([*ends, output])
            become_function(request, ends, output, self.pid)
        if pid is not None:
            self.forks.watch(self.forks.processes[pid], owner)


class _CallerEndedError(BaseException):
    """The process that this server belongs to has ended."""


def _end(number: int, frame: object) -> NoReturn:
    raise _CallerEndedError


def main() -> NoReturn:
    """Serve until the caller is gone."""
    options = _options()
    # Not SIGKILL: what the forks have started in other sessions is to end as well.
    signal.signal(signal.SIGTERM, _end)
    die_with(options.parent, signal.SIGTERM)
    adopt()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    os.set_inheritable(options.fd, False)
    for module in options.imports:
        import_module(module)
    gc.collect()
    gc.freeze()
    forks = Forks()
    server = _Server(socket.socket(fileno=options.fd), options.parent, os.getpid(), forks)
    try:
        server.run()
    except _CallerEndedError:
        pass
    except OSError as refusal:  # the caller says what it lacks; this is what the system said
        print(f"the process that starts others cannot go on: {refusal}", file=sys.stderr)  # noqa: T201
    except BaseException:  # noqa: BLE001 - as the interpreter does, which would wait for threads that should not be
        traceback.print_exc()
    forks.end_all()
    os._exit(0)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="lingjing.kernel.world.fork_server")
    parser.add_argument("--fd", type=int, required=True)
    parser.add_argument("--parent", type=int, required=True)
    parser.add_argument("imports", nargs="*")
    return parser.parse_args()


def _call(request: CallFunction) -> None:
    module, _, name = request.function.partition(":")
    with contextlib.suppress(Exception):  # see `ForkServer.call`
        getattr(import_module(module), name)(request.argument)
    gc.collect()
    gc.freeze()


if __name__ == "__main__":
    try:
        main()
    except OSError as refusal:  # the caller says what it lacks; this is what the system said
        sys.exit(f"the process that starts others cannot go on: {refusal}")
