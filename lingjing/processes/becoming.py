"""The first steps of a fork: it closes the descriptors of its original, and runs a function or a module.

Each `become_…` ends the process. The interpreter is not shut down, because most of its state belongs to the original.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import runpy
import signal
import sys
import traceback
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from typing import Any, NoReturn

from lingjing.errors import ExitCode, LingjingError
from lingjing.numerics import pins
from lingjing.processes.fork_client import HASH_SEED
from lingjing.processes.fork_requests import Function, RunModule, StartFunction, Surroundings
from lingjing.processes.forks import close_all
from lingjing.processes.linux import end_with_parent
from lingjing.refusals import refusal_of

_USUAL_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGCHLD", "SIGPIPE", "SIGUSR2")
"""Signals that a fork handles in the usual way again."""


def keep_only(kept: Iterable[int]) -> None:
    """Close every descriptor except the standard streams and these. The others belong to the original."""
    first = 3
    for descriptor in sorted(kept):
        os.closerange(first, descriptor)
        first = descriptor + 1
    os.closerange(first, os.sysconf("SC_OPEN_MAX"))


def begin(parent: int, number: signal.Signals, streams: Sequence[int]) -> None:
    """Set up the standard streams, the signal handlers and the process group, as `python -m` does.

    `number` is the signal that the process receives when its parent ends. `streams` are closed.
    """
    atexit._clear()
    for standard, (descriptor, name) in enumerate(zip(streams, ("stdin", "stdout", "stderr"), strict=True)):
        os.dup2(descriptor, standard)
        text = open(standard, "w" if standard else "r", closefd=False)  # noqa: SIM115 - for the process's life
        text.reconfigure(line_buffering=True, errors="backslashreplace" if name == "stderr" else None)
        setattr(sys, name, text)
    close_all({*streams} - {0, 1, 2})
    for name in _USUAL_SIGNALS:
        signal.signal(getattr(signal, name), signal.default_int_handler if name == "SIGINT" else signal.SIG_DFL)
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)  # as the interpreter has it from its start
    os.setpgid(0, 0)
    end_with_parent(parent, number)


def end_after(work: Callable[[], object]) -> NoReturn:
    """Call `work` and end the process. The exit code is 0, or 1 if `work` raises.

    An error of this project, or a refusal of the system, is printed as one line; any other with a traceback.
    """
    code = 1
    try:
        work()
        code = 0
    except Exception as error:  # noqa: BLE001 - as the interpreter does
        refusal = error if isinstance(error, LingjingError) else refusal_of(error)
        if refusal is None:
            traceback.print_exc()
        else:
            print(f"this process cannot go on: {refusal}", file=sys.stderr)  # noqa: T201
    finally:
        os._exit(code)


def named_function(name: str) -> Any:
    """Return the function `module:name`. Imports its module."""
    module, _, attribute = name.partition(":")
    return getattr(import_module(module), attribute)


def become_function(request: StartFunction, ends: Sequence[int], output: int, parent: int) -> NoReturn:
    """Call the function of a request with its argument and these descriptors, and end the process."""

    def work() -> None:
        begin(parent, signal.SIGKILL, (0, output, output))
        if request.surroundings is not None:
            _set_surroundings(request.surroundings)
        function: Function = named_function(request.function)
        function(request.argument, tuple(ends))

    end_after(work)


def become_module(request: RunModule, descriptors: Sequence[int], server: int, parent: int) -> NoReturn:
    """Run a module as `python -P -m` does, and end the process.

    The working folder is not on Python's path: it may hold files of an entrant, and one called `shapely.py` would be
    imported here, without walls, in the place of the installed package.

    `descriptors`: the standard streams, then those of `request.further`. `server`: the socket through which the module
    sends requests to the fork server.
    """
    code = 1
    try:
        begin(parent, signal.SIGTERM, descriptors[:3])
        _set_surroundings(request.surroundings)
        named = zip(("--fork-server", *request.further), (server, *descriptors[3:]), strict=True)
        sys.argv = [request.module, *request.arguments, *(str(word) for pair in named for word in pair)]
        if "numpy.random" in sys.modules:
            sys.modules["numpy.random"].seed()  # a fork would go on with the stream of its original
        code = _run(request.module)
    finally:
        os._exit(code)


def _set_surroundings(surroundings: Surroundings) -> None:
    """Set the working folder and the environment of the requesting process, and the fixed variables of every
    process."""
    os.chdir(surroundings.folder)
    fixed = {**{name: value for name, value in pins().items() if value}, "PYTHONHASHSEED": HASH_SEED}
    wanted = {**surroundings.environment, **{os.fsencode(name): os.fsencode(value) for name, value in fixed.items()}}
    present = dict(os.environb)
    for name in present.keys() - wanted.keys():
        del os.environb[name]
    # Most variables equal those of the server. Setting one would copy a memory page that both share.
    os.environb.update({name: value for name, value in wanted.items() if present.get(name) != value})


def _run(module: str) -> int:
    """Run a module as `__main__`, then its exit functions, and return the exit code."""
    code = 0
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    except SystemExit as left:
        code = left.code if isinstance(left.code, int) else int(left.code is not None)
    except KeyboardInterrupt:
        code = ExitCode.INTERRUPTED
    except BaseException:  # noqa: BLE001 - as the interpreter does
        sys.excepthook(*sys.exc_info())
        code = 1
    with contextlib.suppress(BaseException):
        atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(BaseException):
            stream.flush()
    return code


__all__ = ["become_function", "become_module", "begin", "end_after", "keep_only", "named_function"]
