"""The side of the fork in `tools.python_forks`: what an interpreter does between its start and its end.

A fork does the same with another process's modules: it takes its descriptors, its environment and its search path, runs
a module or a code as `__main__`, and ends as an interpreter ends.
"""

from __future__ import annotations

import atexit
import fcntl
import os
import random
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from importlib.abc import InspectLoader
from importlib.util import find_spec
from types import CodeType, ModuleType
from typing import NoReturn

import msgspec

ABOVE = 300
"""The least number of a descriptor that must not take a number of a start. Chosen: starts have less than 100."""


class PythonStart(msgspec.Struct, frozen=True):
    """The start of an interpreter. Texts are bytes, because they may be invalid UTF-8."""

    arguments: tuple[bytes, ...]
    """The command line without the interpreter: `-m`, a module and its arguments, or `-c`, a code and its arguments."""
    folder: bytes
    """The working folder."""
    environment: dict[bytes, bytes]
    """The whole environment."""
    places: tuple[bytes, ...]
    """The search path of an interpreter without variables."""
    numbers: tuple[int, ...] = (0, 1, 2)
    """The numbers that its descriptors get."""
    is_safe: bool = False
    """True for `-P`: the working folder is not in the search path."""
    is_worker: bool = False
    """True for a process that checks its parent: the process id of the parent follows `--parent` in the arguments."""


def run_start(start: PythonStart, descriptors: Sequence[int]) -> NoReturn:
    """Run the module or the code of a start and end this process with its exit code. `descriptors`: see `numbers`."""
    os.chdir(start.folder)
    _renumber(descriptors, start.numbers)
    _replace_environment(start.environment)
    _open_streams()
    kind, what, *arguments = map(os.fsdecode, start.arguments)
    if start.is_worker:
        at = arguments.index("--parent") + 1
        arguments[at] = str(os.getppid())
    _set_search_path(start, "" if kind == "-c" else os.fsdecode(start.folder))
    _draw_anew()
    _end(_exit_code(lambda: _run(kind, what, arguments)))


def _renumber(descriptors: Sequence[int], numbers: Sequence[int]) -> None:
    """Give the descriptors their numbers. Those of the start may be numbers of others now."""
    moved = [fcntl.fcntl(descriptor, fcntl.F_DUPFD, ABOVE) for descriptor in descriptors]
    for descriptor in {*descriptors} - {0, 1, 2}:
        os.close(descriptor)
    for high, number in zip(moved, numbers, strict=True):
        os.dup2(high, number)
        os.close(high)


def _replace_environment(wanted: dict[bytes, bytes]) -> None:
    for name in dict(os.environb).keys() - wanted.keys():
        del os.environb[name]
    os.environb.update(wanted)


def _open_streams() -> None:
    """Open the standard streams as an interpreter does: lines of standard error are written at once."""
    unbuffered = bool(os.environ.get("PYTHONUNBUFFERED"))
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        first = getattr(sys, f"__{name}__")
        stream = open(  # noqa: SIM115 - for the process's life
            number, "w" if number else "r", encoding=first.encoding, errors=first.errors, closefd=False
        )
        if number:
            stream.reconfigure(line_buffering=name == "stderr", write_through=unbuffered)
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)


def _set_search_path(start: PythonStart, first: str) -> None:
    named = [place for place in os.environ.get("PYTHONPATH", "").split(os.pathsep) if place]
    own = [os.fsdecode(place) for place in start.places]
    sys.path[:] = [*([] if start.is_safe else [first]), *named, *own]


def _draw_anew() -> None:
    random.seed()
    if "numpy.random" in sys.modules:
        sys.modules["numpy.random"].seed()  # a fork would go on with the stream of its original


def _run(kind: str, what: str, arguments: Sequence[str]) -> None:
    module = ModuleType("__main__")
    sys.argv = [kind, *arguments]
    code: CodeType = compile(what, "<string>", "exec") if kind == "-c" else _load(what, module)
    sys.modules["__main__"] = module
    exec(code, module.__dict__)


def _load(name: str, module: ModuleType) -> CodeType:
    """Return the code of a module, and give `module` its attributes. `runpy` would warn that it is imported already."""
    spec = find_spec(name)
    if spec is not None and spec.submodule_search_locations is not None:
        spec = find_spec(f"{name}.__main__")
    if spec is None or not isinstance(spec.loader, InspectLoader) or (code := spec.loader.get_code(spec.name)) is None:
        sys.exit(f"{sys.executable}: No module named {name}")
    module.__spec__, module.__loader__, module.__package__ = spec, spec.loader, spec.parent
    sys.argv[0] = module.__file__ = str(spec.origin)
    return code


def _exit_code(work: Callable[[], None]) -> int:
    """Return the exit code that an interpreter has after `work`. An interrupt ends this process by its signal."""
    try:
        work()
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            return (end.code or 0) & 0xFF
        print(end.code, file=sys.stderr)
        return 1
    except KeyboardInterrupt as error:
        _print_error(error)
        sys.stderr.flush()
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGINT)
    except BaseException as error:  # noqa: BLE001 - as the interpreter does
        _print_error(error)
        return 1
    return 0


def _print_error(error: BaseException) -> None:
    """Print an error with its traceback, without the frames of this module."""
    trace = error.__traceback__
    while trace is not None and trace.tb_frame.f_code.co_filename == __file__:
        trace = trace.tb_next
    sys.excepthook(type(error), error.with_traceback(trace), trace)


def _end(code: int) -> NoReturn:
    """End this process as an interpreter ends, except that modules are not torn down."""
    flushed = 120  # the code of an interpreter that cannot write its last output
    try:
        threading._shutdown()  # type: ignore[attr-defined]
        atexit._run_exitfuncs()
        if not sys.stdout.closed:
            sys.stdout.flush()
        flushed = code
    except BaseException as error:  # noqa: BLE001 - as the interpreter does
        _print_error(error)
    finally:
        os._exit(flushed)


__all__ = ["ABOVE", "PythonStart", "run_start"]
