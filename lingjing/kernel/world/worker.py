"""`python -m lingjing.kernel.world.worker`: a worker process, started only by `lingjing.kernel.world.launch`.

It never outlives its caller. The operating system kills it when the thread that started it ends; it checks for its
parent after each second of waiting; and it ends at the end of its socket. It ignores Ctrl-C, which the caller handles.
"""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import gc
import os
import signal
import socket
import sys
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NoReturn

from lingjing.decoding import from_msgpack
from lingjing.errors import InfrastructureError, LingjingError, hint_of
from lingjing.kernel.world.extra_plugins import host_with
from lingjing.kernel.world.handlers import CameraHandler, RequestHandler, WorldHandler
from lingjing.kernel.world.launch import WorkerSettings
from lingjing.kernel.world.messages import (
    Close,
    Closed,
    Failed,
    Fork,
    Forked,
    Refused,
    Request,
    WorkerMessage,
    decoded_request,
    encoded,
)
from lingjing.kernel.world.placed_worlds import WorldStart, announced
from lingjing.kernel.world.shared import CallMonitor, progress_memory
from lingjing.plugins.host import PluginHost
from lingjing.processes.channel import Channel, ChannelClosedError, Packet
from lingjing.processes.deadlines import WallDeadline
from lingjing.processes.fork_requests import Function
from lingjing.processes.idle_processes import ReuseEnd
from lingjing.processes.linux import SeveralThreadsError, end_with_parent, fork
from lingjing.processes.signals import leave_interrupts_to_parent
from lingjing.terminal import guard_streams

_PATROL_S = 1.0
"""Seconds of waiting after which a worker checks for its parent. Chosen."""
_UNFORKABLE = ("cv2", "moderngl", "OpenGL", "glcontext", "glfw", "torch")
"""Modules that usually start threads, which make a process unforkable; the error message names those that are
loaded.
"""


@dataclass(slots=True)
class _WorkerContext:
    """The connections of this process."""

    channel: Channel
    """The channel to the caller."""
    progress: CallMonitor
    """The monitor of the current engine call."""
    parent: int
    """The process id of the parent."""
    forks: set[int] = field(default_factory=set)
    """Process ids of forks that have not been reaped."""

    def reply(self, message: WorkerMessage, descriptors: Sequence[int] = ()) -> None:
        """Send one reply."""
        self.channel.send(encoded(message), descriptors)

    def take(self, channel: int, progress: int) -> None:
        """Serve another caller from now on."""
        self.channel = Channel(socket.socket(fileno=channel))
        self.progress.rebind(progress)
        os.close(progress)

    def reap(self, *_: object) -> None:
        """Reap ended forks; the handler of SIGCHLD. Only forks are reaped: an engine may have children of its own."""
        for pid in tuple(self.forks):
            if os.waitpid(pid, os.WNOHANG)[0]:
                self.forks.discard(pid)


def main() -> NoReturn:
    """Serve until the caller closes the worker or disappears."""
    options = _options()
    end_with_parent(options.parent)
    for descriptor in (options.fd, options.progress):
        os.set_inheritable(descriptor, False)
    settings = WorkerSettings(tuple(options.plugin), (), not options.bare)
    context = _new_context(options.fd, options.progress, options.parent)
    handler = _handler(options.place, settings, context.progress)
    _serve(handler, context, handler.close)
    _flush()
    # No interpreter shutdown: a forked copy would run the exit handlers of its original.
    os._exit(0)


def serve_as_world(argument: bytes, ends: tuple[int, ...]) -> None:
    """In a fork of a fork server: serve one caller at these ends (channel, progress memory).

    `argument`: the `WorkerSettings` as MessagePack.
    """
    settings = _settings(argument)
    context = _new_context(ends[0], ends[1], os.getppid())
    handler = _handler("world", settings, context.progress)
    _serve(handler, context, handler.close)
    _flush()


def placed_template(argument: bytes, key: bytes) -> Callable[[], Function] | None:
    """Return the template of a placed world (`processes.templates`) if its start was announced, else None."""
    start = announced(key)
    return None if start is None else lambda: _placed(argument, start)


def _placed(argument: bytes, start: WorldStart) -> Function:
    """Bring a world to boundary 0 within the engines' time budget. Return a function that serves it in a fork."""
    settings = _settings(argument)
    progress = progress_memory()
    monitor = CallMonitor(progress)
    os.close(progress)
    signal.setitimer(signal.ITIMER_PROF, start.reset.instance.budget.engine_s)
    handler = _placed_handler(settings, start, monitor)
    signal.setitimer(signal.ITIMER_PROF, 0.0)

    def serve(_: bytes, ends: tuple[int, ...]) -> None:
        monitor.rebind(ends[1])
        _serve(handler, _new_context(ends[0], ends[1], os.getppid(), monitor), handler.close)
        _flush()

    return serve


def _placed_handler(settings: WorkerSettings, start: WorldStart, progress: CallMonitor) -> WorldHandler:
    """Return the handler of a world process at boundary 0.

    If the engines fail, the handler has yet to go there: each fork then meets and reports the failure.
    """

    def find_host() -> PluginHost:
        return host_with(settings.plugins, installed=settings.installed)

    handler = WorldHandler(find_host, progress)
    try:
        handler.place(start)
    except Exception:  # noqa: BLE001 - each fork meets and reports it
        handler = WorldHandler(find_host, progress)
    gc.collect()
    gc.freeze()
    return handler


def serve_as_camera(argument: bytes, ends: tuple[int, ...]) -> None:
    """In a fork of a fork server: serve one caller after another, until the server ends.

    The engine and its graphics context stay. `argument`: the `WorkerSettings` as MessagePack. `ends`: channel, progress
    memory, and the control of a process that is reused.
    """
    settings = _settings(argument)
    channel, progress, control = ends
    reuse = ReuseEnd(control)
    context = _new_context(channel, progress, os.getppid())
    handler = _handler("camera", settings, context.progress)

    def report_idle() -> tuple[str, ...]:
        reuse.report_idle()
        return ()

    while True:
        # Idle before the caller is answered, so that the next episode finds this process so.
        has_reported = _serve(handler, context, report_idle)
        context.channel.close()
        _write_to(os.open(os.devnull, os.O_WRONLY))  # closes the output, so that its reader reaches the end
        if not has_reported:
            report_idle()
        following = reuse.wait_for_next()
        if following is None or len(following) != 3:
            return
        _write_to(following[2])
        context.take(following[0], following[1])


def _settings(argument: bytes) -> WorkerSettings:
    """Return the settings of a forked worker and put their paths first in `sys.path`."""
    settings = from_msgpack(argument, WorkerSettings)
    sys.path[:0] = [path for path in settings.paths if path not in sys.path]
    return settings


def _new_context(channel: int, progress: int, parent: int, monitor: CallMonitor | None = None) -> _WorkerContext:
    guard_streams()
    leave_interrupts_to_parent()
    faulthandler.enable()
    faulthandler.register(signal.SIGUSR2)
    context = _WorkerContext(Channel(socket.socket(fileno=channel)), monitor or CallMonitor(progress), parent)
    os.close(progress)
    signal.signal(signal.SIGCHLD, context.reap)
    return context


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError):  # the reader may have closed the pipe
            stream.flush()


def _write_to(output: int) -> None:
    _flush()
    for number in (1, 2):
        os.dup2(output, number)
    os.close(output)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="lingjing.kernel.world.worker")
    parser.add_argument("--fd", type=int, required=True)
    parser.add_argument("--progress", type=int, required=True)
    parser.add_argument("--parent", type=int, required=True)
    parser.add_argument("--place", choices=("world", "camera"), required=True)
    parser.add_argument("--plugin", action="append", default=[])
    parser.add_argument("--bare", action="store_true")
    return parser.parse_args()


def _handler(place: str, settings: WorkerSettings, progress: CallMonitor) -> RequestHandler:
    def find_host() -> PluginHost:
        return host_with(settings.plugins, installed=settings.installed)

    if place == "camera":
        return CameraHandler(find_host, progress)
    return WorldHandler(find_host, progress)


def _serve(handler: RequestHandler, context: _WorkerContext, end: Callable[[], tuple[str, ...]]) -> bool:
    """Serve requests until the caller closes the worker or disappears.

    The reply to `Close` carries the problems that `end` returns. Returns whether the caller closed the worker.
    """
    try:
        while True:
            packet = _next(context)
            request = decoded_request(packet.payload)
            if isinstance(request, Fork):
                _fork(context, packet)
            elif isinstance(request, Close):
                problems = end()
                with contextlib.suppress(ChannelClosedError):
                    context.reply(Closed(problems=problems))
                return True
            else:
                _attempt(handler, context, request)
    except ChannelClosedError:
        return False


def _attempt(handler: RequestHandler, context: _WorkerContext, request: Request) -> None:
    try:
        for reply, descriptors in handler.answer(request):
            context.reply(reply, descriptors)
        context.progress.rest()
    except ChannelClosedError:
        raise
    except LingjingError as error:
        engine = error.engine if isinstance(error, InfrastructureError) else ""
        context.reply(Failed(message=str(error), hint=hint_of(error), engine=engine, traceback=traceback.format_exc()))
    except Exception as error:  # noqa: BLE001 - a bug of ours; the caller raises it
        message = f"the worker failed: {type(error).__name__}: {error}"
        context.reply(Failed(message=message, traceback=traceback.format_exc()))


def _next(context: _WorkerContext) -> Packet:
    while True:
        try:
            return context.channel.receive(WallDeadline(_PATROL_S))
        except TimeoutError:
            if os.getppid() != context.parent:
                os._exit(0)


def _fork(context: _WorkerContext, packet: Packet) -> None:
    original = os.getpid()
    try:
        pid = fork(keep_random=True)  # a copy must equal its original, random state included
    except SeveralThreadsError as error:
        packet.close()
        suspects = [name for name in _UNFORKABLE if name in sys.modules]
        also = f" (it has loaded {', '.join(suspects)})" if suspects else ""
        context.reply(Refused(message=f"the world process has {error.count} threads and cannot be forked{also}"))
        return
    if pid:
        packet.close()
        context.forks.add(pid)
        context.reap()  # it may have ended before it was in the set
        context.reply(Forked(pid=pid))
        return
    end_with_parent(original)
    _become_fork(context, packet, original)


def _become_fork(context: _WorkerContext, packet: Packet, parent: int) -> None:
    context.channel.close()
    context.take(*packet.descriptors)
    context.parent = parent
    context.forks.clear()


if __name__ == "__main__":
    main()
