"""The first steps of a fork: it lets go of what the server holds and becomes a worker, a function or a module.

Each `become_…` ends the process. The interpreter is not shut down, for most of it is the server's.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import runpy
import signal
import sys
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib import import_module
from typing import NoReturn

from lingjing.kernel.world.forking import HASH_SEED, RunModule, StartFunction, StartWorker
from lingjing.kernel.world.forks import close_all
from lingjing.kernel.world.parent_death import die_with
from lingjing.kernel.world.worker import serve_as_camera, serve_as_world
from lingjing.numerics import pins

_USUAL = ("SIGINT", "SIGTERM", "SIGHUP", "SIGCHLD", "SIGPIPE", "SIGUSR2")


def keep_only(kept: Iterable[int]) -> None:
    """Close every descriptor but the standard streams and these: what the server holds is not the fork's."""
    first = 3
    for descriptor in sorted(kept):
        os.closerange(first, descriptor)
        first = descriptor + 1
    os.closerange(first, os.sysconf("SC_OPEN_MAX"))


def begin(parent: int, number: signal.Signals, streams: Sequence[int]) -> None:
    """Take what `python -m` would have given: standard streams, the usual signals, a process group. `number` is the
    signal that the process gets when its parent ends."""
    atexit._clear()
    for standard, (descriptor, name) in enumerate(zip(streams, ("stdin", "stdout", "stderr"), strict=True)):
        os.dup2(descriptor, standard)
        text = open(standard, "w" if standard else "r", closefd=False)  # noqa: SIM115 - for the process's life
        text.reconfigure(line_buffering=True, errors="backslashreplace" if name == "stderr" else None)
        setattr(sys, name, text)
    close_all({*streams} - {0, 1, 2})
    for name in _USUAL:
        signal.signal(getattr(signal, name), signal.default_int_handler if name == "SIGINT" else signal.SIG_DFL)
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)  # as the interpreter has it from its start
    os.setpgid(0, 0)
    die_with(parent, number)


def end_after(work: Callable[[], object]) -> NoReturn:
    """Do the work of this process and end it: with code 1 and a traceback if it raises."""
    code = 1
    try:
        work()
        code = 0
    except Exception:  # noqa: BLE001 - as the interpreter does
        traceback.print_exc()
    finally:
        os._exit(code)


def become_worker(request: StartWorker, ends: tuple[int, int, int], control: int, parent: int) -> NoReturn:
    """Serve as a world or camera process. `ends` are its channel, its progress memory and its output."""

    def work() -> None:
        begin(parent, signal.SIGKILL, (0, ends[2], ends[2]))
        add_paths(request.settings.paths)
        if request.place == "camera":
            serve_as_camera(request.settings, ends[:2], control, parent)
        else:
            serve_as_world(request.settings, ends[:2], parent)

    end_after(work)


def become_function(request: StartFunction, ends: Sequence[int], output: int, parent: int) -> NoReturn:
    """Call a function with its ends."""

    def work() -> None:
        begin(parent, signal.SIGKILL, (0, output, output))
        os.chdir(request.folder)
        _take_environment(request.environment)
        module, _, name = request.function.partition(":")
        getattr(import_module(module), name)(tuple(ends))

    end_after(work)


def become_module(request: RunModule, streams: list[int], asking: int, parent: int) -> NoReturn:
    """Be the process that `python -m` would have started."""
    code = 1
    try:
        begin(parent, signal.SIGTERM, streams)
        os.chdir(request.folder)
        _take_environment(request.environment)
        sys.argv = [request.module, *request.arguments, "--fork-server", str(asking)]
        sys.path.insert(0, os.fsdecode(request.folder))  # as `python -m` has it
        if "numpy.random" in sys.modules:
            sys.modules["numpy.random"].seed()  # a fork would go on with the stream of its original
        code = _run(request.module)
    finally:
        os._exit(code)


def add_paths(paths: Iterable[str]) -> None:
    """Have modules found in these folders first."""
    sys.path[:0] = [path for path in paths if path not in sys.path]


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


__all__ = ["add_paths", "become_function", "become_module", "become_worker", "begin", "end_after", "keep_only"]
