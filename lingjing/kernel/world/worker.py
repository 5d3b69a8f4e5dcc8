"""`python -m lingjing.kernel.world.worker`: a worker process, started by `lingjing.kernel.world.launch` alone.

It never outlives its caller: the kernel kills it when the thread that started it ends, it looks for its parent
whenever it has waited a while, and the end of its socket ends it. It ignores Ctrl-C, which is the caller's to handle.
"""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import gc
import os
import random
import signal
import socket
import sys
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from lingjing.errors import LingjingError
from lingjing.kernel.world.deadlines import WallDeadline
from lingjing.kernel.world.extra_plugins import host_with
from lingjing.kernel.world.forking import WorkerSettings
from lingjing.kernel.world.handlers import CameraHandler, RequestHandler, WorldHandler
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
from lingjing.kernel.world.packets import ChannelClosedError, Packet, PacketSocket
from lingjing.kernel.world.parent_death import die_with
from lingjing.kernel.world.placed_worlds import WorldStart
from lingjing.kernel.world.shared import CallMonitor
from lingjing.plugins.host import PluginHost
from lingjing.terminal import guard_streams

_PATROL_S = 1.0
_UNFORKABLE = ("cv2", "moderngl", "OpenGL", "glcontext", "glfw", "torch")


@dataclass(slots=True)
class WorkerContext:
    """Where this process stands: whom it answers, who started it, whom it started."""

    channel: PacketSocket
    progress: CallMonitor
    parent: int
    forks: set[int] = field(default_factory=set)

    def reply(self, message: WorkerMessage, descriptors: Sequence[int] = ()) -> None:
        """Send one reply."""
        self.channel.send(encoded(message), descriptors)

    def take(self, channel: int, progress: int) -> None:
        """Answer another caller from now on."""
        self.channel = PacketSocket(socket.socket(fileno=channel))
        self.progress.rebind(progress)
        os.close(progress)

    def reap(self, *_: object) -> None:
        """Take note of ended forks; the handler of SIGCHLD. Only those: an engine may have children of its own."""
        for pid in tuple(self.forks):
            if os.waitpid(pid, os.WNOHANG)[0]:
                self.forks.discard(pid)


def main() -> NoReturn:
    """Serve until told to close or left alone."""
    options = _options()
    die_with(options.parent)
    for descriptor in (options.fd, options.progress):
        os.set_inheritable(descriptor, False)
    settings = WorkerSettings(tuple(options.plugin), (), not options.bare)
    context = _new_context(options.fd, options.progress, options.parent)
    handler = _handler(options.place, settings, context.progress)
    _serve(handler, context, handler.close)
    _flush()
    # No interpreter shutdown: in a forked copy it would run handlers that belong to the original.
    os._exit(0)


def serve_as_world(settings: WorkerSettings, ends: tuple[int, int], parent: int) -> None:
    """In a fork of the server: serve one caller at these ends (channel, progress memory)."""
    context = _new_context(*ends, parent)
    handler = _handler("world", settings, context.progress)
    _serve(handler, context, handler.close)
    _flush()


def placed_handler(settings: WorkerSettings, start: WorldStart, progress: CallMonitor) -> WorldHandler:
    """The handler of a world process that stands at boundary 0; one that has yet to go there, and then reports why it
    cannot, if the engines fail."""

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


def serve_placed(handler: WorldHandler, progress: CallMonitor, ends: tuple[int, int], parent: int) -> None:
    """In a fork of a process that holds a placed world: serve one caller at these ends."""
    progress.rebind(ends[1])
    _serve(handler, _new_context(*ends, parent, progress), handler.close)
    _flush()


def serve_as_camera(settings: WorkerSettings, ends: tuple[int, int], control: int, parent: int) -> None:
    """In a fork of the server: serve one caller after another, until the server's end of `control` is closed.

    The engine and its graphics context stay. `control` is told when a caller has gone, and brings the next one's ends,
    the output's too.
    """
    server = socket.socket(fileno=control)
    context = _new_context(*ends, parent)
    handler = _handler("camera", settings, context.progress)

    def tell() -> tuple[str, ...]:
        server.send(b"i")
        return ()

    while True:
        told = _serve(handler, context, tell)  # before it is let go, so that who comes after it finds this process idle
        context.channel.close()
        _write_to(os.open(os.devnull, os.O_WRONLY))  # who waits for the end of what was written need not wait for us
        if not told:
            tell()
        _, given, _, _ = socket.recv_fds(server, 1, 3, socket.MSG_CMSG_CLOEXEC)
        if len(given) != 3:
            return
        _write_to(given[2])
        context.take(*given[:2])


def _new_context(channel: int, progress: int, parent: int, monitor: CallMonitor | None = None) -> WorkerContext:
    guard_streams()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    faulthandler.enable()
    faulthandler.register(signal.SIGUSR2)
    context = WorkerContext(PacketSocket(socket.socket(fileno=channel)), monitor or CallMonitor(progress), parent)
    os.close(progress)
    signal.signal(signal.SIGCHLD, context.reap)
    return context


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError):  # nobody may be left to read it
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


def _serve(handler: RequestHandler, context: WorkerContext, end: Callable[[], tuple[str, ...]]) -> bool:
    """Answer until the caller has enough, which is told of the problems of `end`, or is gone; whether it was told."""
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


def _attempt(handler: RequestHandler, context: WorkerContext, request: Request) -> None:
    try:
        for reply, descriptors in handler.answer(request):
            context.reply(reply, descriptors)
        context.progress.rest()
    except ChannelClosedError:
        raise
    except LingjingError as error:
        context.reply(Failed(message=str(error), hint=error.hint, traceback=traceback.format_exc()))
    except Exception as error:  # noqa: BLE001 - a fault of ours; it is reported to the caller, who raises it
        message = f"the worker failed: {type(error).__name__}: {error}"
        context.reply(Failed(message=message, traceback=traceback.format_exc()))


def _next(context: WorkerContext) -> Packet:
    while True:
        try:
            return context.channel.receive(WallDeadline(_PATROL_S))
        except TimeoutError:
            if os.getppid() != context.parent:
                os._exit(0)


def _fork(context: WorkerContext, packet: Packet) -> None:
    threads = len(list(Path("/proc/self/task").iterdir()))
    if threads != 1:
        packet.close()
        suspects = [name for name in _UNFORKABLE if name in sys.modules]
        also = f" (it has loaded {', '.join(suspects)})" if suspects else ""
        context.reply(Refused(message=f"the world process has {threads} threads and cannot be forked{also}"))
        return
    state = random.getstate()  # Python reseeds it in a forked child; a copy must not differ from its original
    original = os.getpid()
    pid = os.fork()
    if pid:
        packet.close()
        context.forks.add(pid)
        context.reap()  # it may have ended before it was in the set
        context.reply(Forked(pid=pid))
        return
    die_with(original)
    random.setstate(state)
    _take_post(context, packet, original)


def _take_post(context: WorkerContext, packet: Packet, parent: int) -> None:
    context.channel.close()
    context.take(*packet.descriptors)
    context.parent = parent
    context.forks.clear()


if __name__ == "__main__":
    main()
