"""One planted fault: at one place of the code, in one process of a run, the n-th call of a kind fails (ADR 0027).

An interpreter that finds this folder in `PYTHONPATH` loads it at its start; forks inherit it. `LINGJING_FAULT` is the
fault as JSON (`PlantedFault`), `LINGJING_FAULT_COUNT` a file with the number of calls at its place, which all processes
map, and `LINGJING_FAULT_LOG` a file with a line for each call that failed. Without the first variable no call fails and
the log has a line for each call. Nothing of this ships with the product.

A place is a process and a function, such as `world1/kernel.world.worker:_serve`: the process by what it is for and by
the order in which its fork server started it, the function as the innermost one of the product on the stack. Threads
and scheduling change the order of all calls of a run, but not the order of the calls of one place.
"""

from __future__ import annotations

import _io
import builtins
import datetime as dt
import errno
import fcntl
import io
import json
import mmap
import os
import sqlite3
import struct
import subprocess
import sys
import threading
import time
from collections import Counter

KINDS = ("open", "read", "write", "name", "look", "memory", "start", "wall", "steady", "record")
"""Opening a file; reading and writing one; making, renaming and removing names; looking at what is there; shared
memory; forks, programs and threads; readings of the two clocks; statements of the record of model calls."""

SLOT = struct.Struct("<q")
YEAR_2200_S = 7_258_118_400.0
LEAP_S = 86_400.0

_ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__)))))
_PRODUCT = (os.path.join(_ROOT, "lingjing", ""), os.path.join(_ROOT, "agents", ""))

_time, _time_ns, _monotonic, _monotonic_ns = time.time, time.time_ns, time.monotonic, time.monotonic_ns
_real_open, _real_mmap, _real_write, _real_close = os.open, mmap.mmap, os.write, os.close
real_fork = os.fork


# -- places


class Role:
    """The part of a run that this process is: `command`, `server`, `player1`, `world1`, `policy2` and so on."""

    FUNCTIONS = {"serve": "policy", "serve_as_world": "world", "serve_as_camera": "camera"}

    def __init__(self) -> None:
        self.name = self._at_start(sys.orig_argv)
        self._next = ""
        self._started: Counter[str] = Counter()
        os.register_at_fork(before=self._before_fork, after_in_child=self._after_fork)

    @staticmethod
    def _at_start(line: list[str]) -> str:
        if "--place" in line:
            return line[line.index("--place") + 1] + "1"
        return "server" if "lingjing.processes.fork_server" in line else "command"

    def _before_fork(self) -> None:
        """A fork is named after what the fork server starts, with its number there."""
        frame, name = sys._getframe(1), ""
        while frame is not None and not name:
            request = frame.f_locals.get("request")
            if frame.f_code.co_name == "_make":
                name = "template"
            elif hasattr(request, "function"):
                function = request.function.rpartition(":")[2]
                name = self.FUNCTIONS.get(function, function)
            elif hasattr(request, "module"):
                name = "player"
            frame = frame.f_back
        name = name or "fork"
        self._started[name] += 1
        self._next = f"{name}{self._started[name]}"

    def _after_fork(self) -> None:
        self.become(self._next if self.name == "server" else f"{self.name}.{self._next}")

    def become(self, name: str) -> None:
        """Take a name, with nothing started yet."""
        self.name = name
        self._started = Counter()


_role = Role()
_modules: dict[str, str] = {}


def _module(path: str) -> str:
    """The module of the product that a file is, without the name of the package; "" for any other file."""
    module = _modules.get(path)
    if module is None:
        inside = [path.removeprefix(folder) for folder in _PRODUCT if path.startswith(folder)]
        module = inside[0].removesuffix(".py").replace(os.sep, ".") if inside else ""
        _modules[path] = module
    return module


def _place() -> str:
    frame = sys._getframe(1)
    while frame is not None:
        code = frame.f_code
        if code.co_name[0] != "<" and (module := _module(code.co_filename)):
            return f"{_role.name}/{module}:{code.co_name}"
        frame = frame.f_back
    return f"{_role.name}/-"


# -- the fault


class PlantedFault:
    """At `place` the call of `kind` with number `number` fails with the error `error`; with `lasting` all later ones
    there too. Number 0: a clock that is wrong from the start."""

    def __init__(self, text: str) -> None:
        settings = json.loads(text) if text else {}
        self.kind: str = settings.get("kind", "")
        self.place: str = settings.get("place", "")
        self.number: int = settings.get("number", 0)
        self.error: str = settings.get("error", "EIO")
        self.lasting: bool = settings.get("lasting", False)

    def is_at(self, kind: str, place: str) -> bool:
        """True for the calls that are counted."""
        return kind == self.kind and place == self.place

    def hits(self, number: int) -> bool:
        """True for the call that fails."""
        return number == self.number or (self.lasting and number > self.number)


class FaultCount:
    """The number of calls at the place of the fault, in all processes of a run."""

    def __init__(self, path: str) -> None:
        self._path = path
        descriptor = _real_open(path, os.O_RDWR | os.O_CLOEXEC)
        self._memory = _real_mmap(descriptor, SLOT.size)
        _real_close(descriptor)
        self._lock = threading.Lock()
        os.register_at_fork(after_in_child=self._after_fork)

    def _after_fork(self) -> None:
        self._lock = threading.Lock()

    def add(self) -> int:
        """Count a call: its number, from 1."""
        with self._lock:
            descriptor = _real_open(self._path, os.O_RDWR | os.O_CLOEXEC)
            try:
                fcntl.lockf(descriptor, fcntl.LOCK_EX)
                number = self.value + 1
                SLOT.pack_into(self._memory, 0, number)
                return number
            finally:
                _real_close(descriptor)

    @property
    def value(self) -> int:
        """The calls so far."""
        number: int = SLOT.unpack_from(self._memory)[0]
        return number


_count: FaultCount | None = None
_fault = PlantedFault("")
_log = ""
_inside = threading.local()


def arm(variables: dict[str, str]) -> None:
    """Count from now on, and plant the fault of these environment variables."""
    global _count, _fault, _log
    _fault, _log = PlantedFault(variables["LINGJING_FAULT"]), variables["LINGJING_FAULT_LOG"]
    _count = FaultCount(variables["LINGJING_FAULT_COUNT"])
    if _fault.kind == "wall":
        dt.datetime = ShiftedMoment


def become(role: str) -> None:
    """Be this part of a run from now on."""
    _role.become(role)


def is_hit(kind: str, about: object = None) -> bool:
    """Count a call; True if it is the one that fails."""
    if _count is None or getattr(_inside, "counting", False):
        return False
    _inside.counting = True
    try:
        if _fault.kind not in ("", kind):
            return False
        place = _place()
        if not _fault.kind:
            _note(f"{kind} {place}")
            return False
        if not _fault.is_at(kind, place):
            return False
        number = _count.add()
        if is_failing := _fault.hits(number):
            _note(f"{kind} {place} {number} {about!r}")
        return is_failing
    finally:
        _inside.counting = False


def _note(line: str) -> None:
    descriptor = _real_open(_log, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        _real_write(descriptor, line.encode(errors="replace") + b"\n")
    finally:
        _real_close(descriptor)


def system_error(path: object = None, *, reading: bool = False) -> OSError:
    """The planted error; to open a file for reading needs no room."""
    number = getattr(errno, _fault.error, errno.EIO)
    if reading and number in (errno.ENOSPC, errno.EROFS):
        number = errno.EIO
    return OSError(number, os.strerror(number), path) if path is not None else OSError(number, os.strerror(number))


# -- files


class FaultyFile(_io.FileIO):
    """A file that counts its reads and writes."""

    def write(self, data):
        if is_hit("write", self.name):
            raise system_error()
        return super().write(data)

    def readinto(self, buffer):
        if is_hit("read", self.name):
            raise system_error()
        return super().readinto(buffer)

    def read(self, size=-1):
        if is_hit("read", self.name):
            raise system_error()
        return super().read(size)

    def readall(self):
        if is_hit("read", self.name):
            raise system_error()
        return super().readall()


def _open(file, mode="r", buffering=-1, encoding=None, errors=None, newline=None, closefd=True, opener=None):
    if is_hit("open", file):
        raise system_error(None if isinstance(file, int) else os.fspath(file), reading=mode in ("r", "rb", "rt"))
    if _count is None:
        return _io.open(file, mode, buffering, encoding, errors, newline, closefd, opener)
    plain = mode.replace("b", "").replace("t", "").replace("U", "") or "r"
    raw = FaultyFile(file, plain, closefd, opener)
    try:
        if buffering == 0:
            return raw
        size = buffering if buffering > 1 else io.DEFAULT_BUFFER_SIZE
        kind = _io.BufferedRandom if "+" in plain else _io.BufferedReader if plain == "r" else _io.BufferedWriter
        buffered = kind(raw, size)
        if "b" in mode:
            return buffered
        text = _io.TextIOWrapper(
            buffered, encoding, errors, newline, buffering == 1 or (buffering < 0 and raw.isatty())
        )
        text.mode = mode
        return text
    except BaseException:
        raw.close()
        raise


def _failing(module, name, kind):
    """Replace a function by one that counts its calls."""
    real = getattr(module, name, None)
    if real is None:
        return

    def counted(*arguments, **options):
        if is_hit(kind, arguments[:1]):
            named = arguments[0] if arguments and isinstance(arguments[0], (str, bytes, os.PathLike)) else None
            raise system_error(None if named is None else os.fspath(named))
        return real(*arguments, **options)

    counted.__name__ = name
    counted.__wrapped__ = real
    setattr(module, name, counted)
    for table in (os.supports_dir_fd, os.supports_fd, os.supports_follow_symlinks, os.supports_effective_ids):
        if module is os and real in table:
            table.add(counted)


class FaultyMemory(mmap.mmap):
    """A mapping that counts its creation."""

    def __new__(cls, *arguments, **options):
        if is_hit("memory"):
            raise system_error()
        return super().__new__(cls, *arguments, **options)


# -- processes and threads

_real_start = threading.Thread.start


def _start(thread):
    if is_hit("start", "a thread"):
        raise RuntimeError("can't start new thread")
    return _real_start(thread)


# -- clocks


def _shifted(real, kind, shift):
    leap = [False]

    def reading():
        if is_hit(kind):
            leap[0] = True
        value = real()
        return shift(value) if leap[0] or (_fault.kind == kind and _has_leapt()) else value

    return reading


def _has_leapt():
    """True in every process once the reading that leaps has been taken in one."""
    return _count is not None and _count.value >= _fault.number


# -- the record of model calls


class FaultyConnection(sqlite3.Connection):
    """A connection that counts its statements."""

    def execute(self, *arguments):
        if is_hit("record", arguments[:1]):
            raise sqlite3.OperationalError("disk I/O error")
        return super().execute(*arguments)


_real_connect = sqlite3.connect


def _connect(*arguments, **options):
    if is_hit("record", arguments[:1]):
        raise sqlite3.OperationalError("unable to open database file")
    return _real_connect(*arguments, **{"factory": FaultyConnection, **options})


class ShiftedMoment(dt.datetime):
    """A moment that is read from the clock that may leap."""

    @classmethod
    def now(cls, tz=None):
        return cls.fromtimestamp(time.time(), tz)


def install() -> None:
    """Replace what is counted, once in each interpreter."""
    builtins.open = io.open = _open
    for kind, names in {
        "open": ("open",),
        "read": ("read", "pread", "readv"),
        "write": ("write", "pwrite", "fsync", "fdatasync", "truncate", "ftruncate", "posix_fallocate", "sendfile"),
        "name": ("replace", "rename", "mkdir", "unlink", "remove", "rmdir", "link", "symlink", "utime", "chmod"),
        "look": ("stat", "lstat", "fstat", "scandir", "listdir", "access", "readlink"),
        "memory": ("memfd_create",),
        "start": ("fork", "pidfd_open", "pipe", "pipe2"),
    }.items():
        for name in names:
            _failing(os, name, kind)
    _failing(subprocess, "_fork_exec", "start")
    mmap.mmap = FaultyMemory
    threading.Thread.start = _start
    time.time = _shifted(_time, "wall", lambda value: value % LEAP_S + YEAR_2200_S)
    time.time_ns = _shifted(_time_ns, "wall", lambda value: value + int(YEAR_2200_S * 1e9) - int(_time() * 1e9))
    time.monotonic = _shifted(_monotonic, "steady", lambda value: value + LEAP_S)
    time.monotonic_ns = _shifted(_monotonic_ns, "steady", lambda value: value + int(LEAP_S * 1e9))
    sqlite3.connect = _connect


if "LINGJING_FAULT_COUNT" in os.environ:
    install()
    arm(dict(os.environ))
