"""`python -m lingjing.kernel.world.fork_server`: the process that the episodes of one command are forked from.

It has imported everything and has one thread, which is asserted before each fork: a fork of several threads would keep
the locks of those that are gone. It opens no OpenGL, loads no OpenCV, runs nothing of a policy, and plays nothing:
what happens in an episode happens in its forks. Of the state that a fork takes along only what was imported counts; the
global random streams are begun anew. A camera process outlives its episode and is handed to the next one that asks: it
keeps its graphics context, and a picture depends on nothing before it. The world of an instance that comes again is
forked from a holder, a fork that has placed it and serves this one world (`placed_worlds`).

It ends with the end of its caller's socket and with its caller, and its forks with it: workers by SIGKILL, modules by
SIGTERM. A world process or a function's ends with the process that asked for it, a camera process that does not become
idle as well. What a fork leaves behind, in whatever session, is handed to this process, which ends it.
"""

from __future__ import annotations

import argparse
import atexit
import contextlib
import gc
import os
import runpy
import selectors
import signal
import socket
import sys
import traceback
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import NoReturn

import msgspec

from lingjing.errors import InfrastructureError
from lingjing.kernel.world.deadlines import OwnDeadline
from lingjing.kernel.world.descendants import adopt, end_children
from lingjing.kernel.world.forking import (
    HASH_SEED,
    CallFunction,
    ForkRequest,
    RunModule,
    StartFunction,
    StartWorker,
    WorkerSettings,
    send_request,
)
from lingjing.kernel.world.handlers import WorldHandler
from lingjing.kernel.world.parent_death import die_with
from lingjing.kernel.world.placed_worlds import WorldStart, announced
from lingjing.kernel.world.shared import CallMonitor, progress_memory
from lingjing.kernel.world.worker import placed_handler, serve_as_camera, serve_as_world, serve_placed
from lingjing.numerics import pins

_PATROL_S = 1.0
_LINGERS_S = 2.0
"""How long a camera process may take to become idle when the process that it drew for has ended, in its own time."""
_MOST_DESCRIPTORS = 8
MOST_HOLDERS = 8
"""Processes that hold a placed world; the one that was not asked for the longest time ends first."""
_USUAL = ("SIGINT", "SIGTERM", "SIGHUP", "SIGCHLD", "SIGPIPE", "SIGUSR2")

_REQUESTS: msgspec.msgpack.Decoder[ForkRequest] = msgspec.msgpack.Decoder(ForkRequest)


@dataclass(slots=True)
class _Process:
    """A fork. `pidfd` shows its end, `told` is the connection that receives its exit status, `asker` a descriptor of
    the process that it ends with (-1: none, or that process has ended). A module is asked to end, not killed."""

    pid: int
    pidfd: int
    told: socket.socket
    is_module: bool = False
    asker: int = -1
    camera: _CameraUse | None = None
    holds: bytes = b""


@dataclass(slots=True)
class _CameraUse:
    """What the server keeps of a camera process: where it is handed over, and whether it is in use."""

    control: socket.socket
    settings: WorkerSettings
    busy: bool = True
    orphaned: OwnDeadline | None = None


@dataclass(slots=True)
class _Server:
    asking: socket.socket
    parent: int
    pid: int
    selector: selectors.BaseSelector = field(default_factory=selectors.DefaultSelector)
    processes: dict[int, _Process] = field(default_factory=dict)
    holders: dict[tuple[bytes, WorkerSettings], socket.socket] = field(default_factory=dict)
    unplaceable: set[bytes] = field(default_factory=set)

    def run(self) -> None:
        """Serve until the caller's end is closed."""
        self.selector.register(self.asking, selectors.EVENT_READ, self.asked_by_caller)
        while os.getppid() == self.parent:
            for key, _ in self.selector.select(_PATROL_S):
                # What was answered before in this round may have ended what this one is about.
                if self.selector.get_map().get(key.fd) == key and key.data(key.fileobj) is False:
                    return
            self.end_lingerers()

    # -- requests

    def asked_by_caller(self, asking: socket.socket) -> bool:
        """A request through the caller's socket; False at its end."""
        try:
            request, descriptors = _received(asking)
        except EOFError:
            return False
        if isinstance(request, RunModule) and len(descriptors) == 4:
            self.run_module(request, descriptors)
        elif isinstance(request, CallFunction):
            _call(request)
        else:
            self.start(request, descriptors)
        _close(descriptors)
        return True

    def asked_by_module(self, asking: socket.socket) -> None:
        """A request of a module that runs: it may ask for workers and functions alone."""
        try:
            request, descriptors = _received(asking)
        except EOFError:
            self.selector.unregister(asking)
            asking.close()
            return
        self.start(request, descriptors)
        _close(descriptors)

    def start(self, request: ForkRequest | None, descriptors: list[int]) -> None:
        """Start a worker or a function for who asks."""
        if isinstance(request, StartWorker) and len(descriptors) == 5:
            self.start_worker(request, descriptors)
        elif isinstance(request, StartFunction) and len(descriptors) >= 3:
            self.start_function(request, descriptors)

    def run_module(self, request: RunModule, descriptors: list[int]) -> None:
        """Fork a process for a module."""
        told = socket.socket(fileno=os.dup(descriptors[3]))
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            pid = self.fork(told)
            if pid == 0:
                _keep_only([*descriptors[:3], theirs.fileno()])
                _become_module(request, descriptors[:3], theirs.fileno(), self.pid)
            if pid is not None:
                self.processes[pid].is_module = True
        self.selector.register(ours, selectors.EVENT_READ, self.asked_by_module)

    def start_worker(self, request: StartWorker, descriptors: list[int]) -> None:
        """Hand over an idle camera process, or fork a worker."""
        channel, progress, output, asker, told = descriptors
        if request.start and self.start_placed(request, descriptors):
            return
        tells = socket.socket(fileno=os.dup(told))
        if request.place == "camera" and self.hand_over(request.settings, (channel, progress, output), tells, asker):
            return
        control, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with far:
            pid = self.fork(tells)
            if pid == 0:
                _keep_only([channel, progress, output, far.fileno()])
                _become_worker(request, (channel, progress, output), far.fileno(), self.pid)
        if pid is None or request.place == "world":
            control.close()
        if pid is not None:
            process = self.processes[pid]
            self.watch(process, asker)
            if request.place == "camera":
                process.camera = _CameraUse(control, request.settings)
                self.selector.register(control, selectors.EVENT_READ, lambda _: self.became_idle(process))

    def start_function(self, request: StartFunction, descriptors: list[int]) -> None:
        """Fork a process for a function."""
        *ends, output, asker, told = descriptors
        pid = self.fork(socket.socket(fileno=os.dup(told)))
        if pid == 0:
            _keep_only([*ends, output])
            _become_function(request, ends, output, self.pid)
        if pid is not None:
            self.watch(self.processes[pid], asker)

    def hand_over(self, settings: WorkerSettings, ends: tuple[int, int, int], tells: socket.socket, asker: int) -> bool:
        """Give an idle camera process its next user; False if there is none."""
        for process in self.processes.values():
            camera = process.camera
            if camera is None or camera.settings != settings:
                continue
            self.became_idle(process)  # if it has said so
            if camera.busy:
                continue
            try:
                socket.send_fds(camera.control, [b"n"], ends)
            except OSError:  # it has just ended
                continue
            process.told.close()
            process.told, camera.busy, camera.orphaned = tells, True, None
            _tell_start(process)
            self.watch(process, asker)
            return True
        return False

    def start_placed(self, request: StartWorker, descriptors: list[int]) -> bool:
        """Have the holder of a placed world start the worker; False if there is none and none can be made."""
        start = announced(request.start) if request.start not in self.unplaceable else None
        if start is None:
            return False
        key = request.start, request.settings
        holder = self.holders.pop(key, None) or self.hold(request.settings, start)
        if holder is None:
            return False
        try:
            send_request(holder, request, descriptors)
        except InfrastructureError:  # it has just ended
            holder.close()
            return False
        self.holders[key] = holder  # the one that was used last is the last to go
        return True

    def hold(self, settings: WorkerSettings, start: WorldStart) -> socket.socket | None:
        """Fork a process that places a world; what it is asked through. The oldest ends when there are too many."""
        while len(self.holders) >= MOST_HOLDERS:
            self.holders.pop(next(iter(self.holders))).close()
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        unread, told = socket.socketpair()
        with theirs, unread:
            pid = self.fork(told)
            if pid == 0:
                _keep_only([theirs.fileno()])
                _become_holder(settings, start, theirs.fileno(), self.pid)
        if pid is None:
            ours.close()
            return None
        self.processes[pid].holds = start.key
        return ours

    # -- processes

    def fork(self, told: socket.socket) -> int | None:
        """Fork: 0 in the copy, else its process id, of which `told` has been told; None where it cannot be done."""
        try:
            if len(list(Path("/proc/self/task").iterdir())) != 1:
                told.close()
                raise AssertionError("the process that episodes are forked from has more than one thread")
            pid = os.fork()
        except OSError:
            told.close()  # who asked reads the end of it
            return None
        if pid:
            try:
                pidfd = os.pidfd_open(pid)
            except OSError:
                os.kill(pid, signal.SIGKILL)
                os.waitpid(pid, 0)
                raise
            process = self.processes[pid] = _Process(pid, pidfd, told)
            self.selector.register(process.pidfd, selectors.EVENT_READ, lambda _: self.ended(process))
            _tell_start(process)
        return pid

    def ended(self, process: _Process) -> None:
        """Reap a fork and tell its status."""
        _, status = os.waitpid(process.pid, 0)
        self.selector.unregister(process.pidfd)
        os.close(process.pidfd)
        self.unwatch(process)
        with process.told, contextlib.suppress(OSError):
            process.told.sendall(status.to_bytes(4, "little"))
        if process.holds and status:  # the next worker says by itself what is wrong
            self.unplaceable.add(process.holds)
        if process.camera is not None:
            self.selector.unregister(process.camera.control)
            process.camera.control.close()
        del self.processes[process.pid]
        end_children(set(self.processes))  # what it left behind

    def watch(self, process: _Process, asker: int) -> None:
        """Have a worker end with the process that asked for it."""
        process.asker = os.dup(asker)
        self.selector.register(process.asker, selectors.EVENT_READ, lambda _: self.asker_ended(process))

    def unwatch(self, process: _Process) -> None:
        """Who asked is of no more interest."""
        if process.asker >= 0:
            self.selector.unregister(process.asker)
            os.close(process.asker)
            process.asker = -1

    def asker_ended(self, process: _Process) -> None:
        """The process that a worker works for is gone."""
        self.unwatch(process)
        if process.camera is None:
            os.kill(process.pid, signal.SIGKILL)  # it has not been reaped, so the number is its own
        elif process.camera.busy:
            process.camera.orphaned = OwnDeadline(process.pid, _LINGERS_S, watched=True)

    def became_idle(self, process: _Process) -> None:
        """A camera process has no user any more."""
        camera = process.camera
        if camera is not None and _read(camera.control):
            camera.busy, camera.orphaned = False, None
            self.unwatch(process)

    def end_lingerers(self) -> None:
        """End camera processes whose channel somebody holds open, or that draw for ever."""
        for process in self.processes.values():
            orphaned = process.camera.orphaned if process.camera is not None else None
            if orphaned is not None and orphaned.left_s() <= 0.0:
                os.kill(process.pid, signal.SIGKILL)

    def end_all(self) -> None:
        """End what is left: modules are asked to, workers are not, and are waited for."""
        modules = {pid for pid, process in self.processes.items() if process.is_module}
        for pid in modules:
            os.kill(pid, signal.SIGTERM)
        end_children(modules)


@dataclass(slots=True, kw_only=True)
class _Holder(_Server):
    """The server of one placed world: each worker that it is asked for is a fork of itself."""

    handler: WorldHandler
    progress: CallMonitor
    is_over: bool = False

    def run(self) -> None:
        """Serve until the server's end is closed, then until the last worker has ended."""
        self.selector.register(self.asking, selectors.EVENT_READ, self.asked_by_caller)
        while os.getppid() == self.parent and not (self.is_over and not self.processes):
            for key, _ in self.selector.select(_PATROL_S):
                if self.selector.get_map().get(key.fd) == key:
                    key.data(key.fileobj)

    def asked_by_caller(self, asking: socket.socket) -> bool:
        """A worker is asked for."""
        try:
            request, descriptors = _received(asking)
        except EOFError:
            self.selector.unregister(asking)
            self.is_over = True
            return False
        if isinstance(request, StartWorker) and len(descriptors) == 5:
            self.start_worker(request, descriptors)
        _close(descriptors)
        return True

    def start_worker(self, request: StartWorker, descriptors: list[int]) -> None:
        """Fork a worker."""
        channel, progress, output, asker, told = descriptors
        tells = socket.socket(fileno=os.dup(told))
        pid = self.fork(tells)
        if pid == 0:
            tells.close()
            _close([asker, told])
            _become_placed(self, (channel, progress, output))
        if pid is not None:
            self.watch(self.processes[pid], asker)

    def forget(self) -> None:
        """In a fork: let go of what is the holder's."""
        self.selector.close()
        self.asking.close()
        for process in self.processes.values():
            process.told.close()
            _close([one for one in (process.pidfd, process.asker) if one >= 0])


class _CallerEndedError(BaseException):
    """The process that this server belongs to has ended."""


def _end(number: int, frame: object) -> NoReturn:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # a second one would break off what the first one has begun
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
    server = _Server(socket.socket(fileno=options.fd), options.parent, os.getpid())
    try:
        server.run()
        # The caller's end of the socket closes before the kernel sends the signal of its death.
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    except _CallerEndedError:
        pass
    except OSError as refusal:  # the caller says what it lacks; this is what the system said
        print(f"the process that starts others cannot go on: {refusal}", file=sys.stderr)  # noqa: T201
    except BaseException:  # noqa: BLE001 - as the interpreter does, which would wait for threads that should not be
        traceback.print_exc()
    server.end_all()
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


def _received(asking: socket.socket) -> tuple[ForkRequest | None, list[int]]:
    """A request and what came with it, None for nonsense; `EOFError` at the end of the socket."""
    try:
        data, descriptors, _, _ = socket.recv_fds(asking, 1, _MOST_DESCRIPTORS, socket.MSG_CMSG_CLOEXEC)
    except OSError as error:
        raise EOFError from error
    if not data:
        raise EOFError
    try:
        with open(descriptors[0], "rb") as letter:  # noqa: PTH123 - a descriptor
            letter.seek(0)
            return _REQUESTS.decode(letter.read()), descriptors[1:]
    except (OSError, IndexError, msgspec.DecodeError):
        return None, descriptors[1:]


def _tell_start(process: _Process) -> None:
    with contextlib.suppress(OSError):  # nobody may be left to be told
        socket.send_fds(process.told, [process.pid.to_bytes(4, "little")], [process.pidfd])


def _read(control: socket.socket) -> bytes:
    """What is there: it may have been taken in before its turn."""
    try:
        return control.recv(1, socket.MSG_DONTWAIT)
    except OSError:
        return b""


def _close(descriptors: Iterable[int]) -> None:
    for descriptor in descriptors:
        os.close(descriptor)


# -- in a fork


def _keep_only(kept: Iterable[int]) -> None:
    """Close every descriptor but the standard streams and these: what the server holds is not the fork's."""
    first = 3
    for descriptor in sorted(kept):
        os.closerange(first, descriptor)
        first = descriptor + 1
    os.closerange(first, os.sysconf("SC_OPEN_MAX"))


def _begin(parent: int, number: signal.Signals, streams: Sequence[int]) -> None:
    """Take what `python -m` would have given: standard streams, the usual signals, a process group."""
    atexit._clear()
    for standard, (descriptor, name) in enumerate(zip(streams, ("stdin", "stdout", "stderr"), strict=True)):
        os.dup2(descriptor, standard)
        text = open(standard, "w" if standard else "r", closefd=False)  # noqa: SIM115 - for the process's life
        text.reconfigure(line_buffering=True, errors="backslashreplace" if name == "stderr" else None)
        setattr(sys, name, text)
    _close({*streams} - {0, 1, 2})
    for name in _USUAL:
        signal.signal(getattr(signal, name), signal.default_int_handler if name == "SIGINT" else signal.SIG_DFL)
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)  # as the interpreter has it from its start
    os.setpgid(0, 0)
    die_with(parent, number)


def _become_worker(request: StartWorker, ends: tuple[int, int, int], control: int, parent: int) -> NoReturn:
    code = 1
    try:
        _begin(parent, signal.SIGKILL, (0, ends[2], ends[2]))
        sys.path[:0] = [path for path in request.settings.paths if path not in sys.path]
        if request.place == "camera":
            serve_as_camera(request.settings, ends[:2], control, parent)
        else:
            serve_as_world(request.settings, ends[:2], parent)
        code = 0
    except Exception:  # noqa: BLE001 - as the interpreter does
        traceback.print_exc()
    finally:
        os._exit(code)


def _become_function(request: StartFunction, ends: Sequence[int], output: int, parent: int) -> NoReturn:
    """Call a function. What it leaves of the interpreter is not shut down, for most of it is the server's."""
    code = 1
    try:
        _begin(parent, signal.SIGKILL, (0, output, output))
        os.chdir(request.folder)
        _take_environment(request.environment)
        module, _, name = request.function.partition(":")
        getattr(import_module(module), name)(tuple(ends))
        code = 0
    except Exception:  # noqa: BLE001 - as the interpreter does
        traceback.print_exc()
    finally:
        os._exit(code)


def _become_holder(settings: WorkerSettings, start: WorldStart, control: int, parent: int) -> NoReturn:
    """Place a world, within the time that its engines have, and fork workers of it."""
    code = 1
    try:
        empty = os.open(os.devnull, os.O_RDWR)
        _begin(parent, signal.SIGKILL, (empty, os.dup(empty), os.dup(empty)))
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        sys.path[:0] = [path for path in settings.paths if path not in sys.path]
        progress = progress_memory()
        monitor = CallMonitor(progress)
        os.close(progress)
        signal.setitimer(signal.ITIMER_PROF, start.reset.instance.budget.engine_s)
        handler = placed_handler(settings, start, monitor)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        _Holder(socket.socket(fileno=control), parent, os.getpid(), handler=handler, progress=monitor).run()
        code = 0
    except Exception:  # noqa: BLE001 - as the interpreter does
        traceback.print_exc()
    finally:
        os._exit(code)


def _become_placed(holder: _Holder, ends: tuple[int, int, int]) -> NoReturn:
    code = 1
    try:
        holder.forget()
        _begin(holder.pid, signal.SIGKILL, (0, ends[2], ends[2]))
        serve_placed(holder.handler, holder.progress, ends[:2], holder.pid)
        code = 0
    except Exception:  # noqa: BLE001 - as the interpreter does
        traceback.print_exc()
    finally:
        os._exit(code)


def _become_module(request: RunModule, streams: list[int], asking: int, parent: int) -> NoReturn:
    """Be what `python -m` would have started. The interpreter is not shut down, for most of it is the server's."""
    code = 1
    try:
        _begin(parent, signal.SIGTERM, streams)
        os.chdir(request.folder)
        _take_environment(request.environment)
        sys.argv = [request.module, *request.arguments, "--fork-server", str(asking)]
        sys.path.insert(0, os.fsdecode(request.folder))  # as `python -m` has it
        if "numpy.random" in sys.modules:
            sys.modules["numpy.random"].seed()  # a fork would go on with the stream of its original
        code = _run(request.module)
    finally:
        os._exit(code)


def _take_environment(given: Mapping[bytes, bytes]) -> None:
    """The environment of the process that asked, with what holds in this process already."""
    os.environ.clear()
    os.environb.update(given)
    os.environ.update({name: value for name, value in pins().items() if value})
    os.environ["PYTHONHASHSEED"] = HASH_SEED


def _run(module: str) -> int:
    code = 0
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    except SystemExit as left:
        code = left.code if isinstance(left.code, int) else int(left.code is not None)
    except KeyboardInterrupt:
        code = 130
    except BaseException:  # noqa: BLE001 - as the interpreter does
        sys.excepthook(*sys.exc_info())
        code = 1
    with contextlib.suppress(BaseException):
        atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(BaseException):
            stream.flush()
    return code


if __name__ == "__main__":
    try:
        main()
    except OSError as refusal:  # the caller says what it lacks; this is what the system said
        sys.exit(f"the process that starts others cannot go on: {refusal}")
