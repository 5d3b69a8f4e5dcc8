"""The first steps of a fork: it closes the descriptors of its original, and becomes a function or a module.

Each `become_…` ends the process. The interpreter is not shut down, for most of it is the original's.
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


def keep_only(kept: Iterable[int]) -> None:
    """Close every descriptor but the standard streams and these: the others belong to the original."""
    first = 3
    for descriptor in sorted(kept):
        os.closerange(first, descriptor)
        first = descriptor + 1
    os.closerange(first, os.sysconf("SC_OPEN_MAX"))


def begin(parent: int, number: signal.Signals, streams: Sequence[int]) -> None:
    """Set up what `python -m` gives a process: standard streams, the usual signals, a process group.

    `number` is the signal that the process gets when its parent ends. `streams` are closed.
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
    """Do the work of this process and end it. If it raises, the code is 1, after a line that says what the system
    refuses, or a traceback."""
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
    """The function `module:name`; its module is imported."""
    module, _, attribute = name.partition(":")
    return getattr(import_module(module), attribute)


def become_function(request: StartFunction, ends: Sequence[int], output: int, parent: int) -> NoReturn:
    """Call the function of a request with its argument and these descriptors."""

    def work() -> None:
        begin(parent, signal.SIGKILL, (0, output, output))
        if request.surroundings is not None:
            _take(request.surroundings)
        function: Function = named_function(request.function)
        function(request.argument, tuple(ends))

    end_after(work)


def become_module(request: RunModule, streams: Sequence[int], server: int, parent: int) -> NoReturn:
    """Be the process that `python -m` would have started. `server`: a socket by which it asks the fork server."""
    code = 1
    try:
        begin(parent, signal.SIGTERM, streams)
        _take(request.surroundings)
        sys.argv = [request.module, *request.arguments, "--fork-server", str(server)]
        sys.path.insert(0, os.fsdecode(request.surroundings.folder))  # as `python -m` has it
        if "numpy.random" in sys.modules:
            sys.modules["numpy.random"].seed()  # a fork would go on with the stream of its original
        code = _run(request.module)
    finally:
        os._exit(code)


def _take(surroundings: Surroundings) -> None:
    """The working folder and the variables of the process that asked, with what is fixed in every process here."""
    os.chdir(surroundings.folder)
    fixed = {**{name: value for name, value in pins().items() if value}, "PYTHONHASHSEED": HASH_SEED}
    wanted = {**surroundings.environment, **{os.fsencode(name): os.fsencode(value) for name, value in fixed.items()}}
    present = dict(os.environb)
    for name in present.keys() - wanted.keys():
        del os.environb[name]
    # Most variables are those of the server. Setting one writes to a page that the fork then needs for itself.
    os.environb.update({name: value for name, value in wanted.items() if present.get(name) != value})


def _run(module: str) -> int:
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
