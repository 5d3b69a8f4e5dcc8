"""One planted fault: the n-th call of a kind, counted over all processes of a run, fails.

An interpreter that finds this folder in `PYTHONPATH` loads it at its start; forks inherit it. `LINGJING_FAULT` is the
fault as JSON (`PlantedFault`), `LINGJING_FAULT_COUNTS` a file with one counter for each kind, which all processes map.
Without the first variable calls are counted and none fails. Nothing of this ships with the product.
"""

from __future__ import annotations

import _io
import builtins
import errno
import fcntl
import io
import json
import mmap
import os
import sqlite3
import struct
import subprocess
import threading
import time

KINDS = ("open", "read", "write", "name", "look", "memory", "start", "wall", "steady", "record")
"""Opening a file; reading and writing one; making, renaming and removing names; looking at what is there; shared
memory; forks, programs and threads; readings of the two clocks; statements of the record of model calls."""

_SLOT = struct.Struct("<q")
SIZE = len(KINDS) * _SLOT.size
YEAR_2200_S = 7_258_118_400.0
LEAP_S = 86_400.0

_time, _time_ns, _monotonic, _monotonic_ns = time.time, time.time_ns, time.monotonic, time.monotonic_ns


class FaultCounts:
    """The counters of a run."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._descriptor = _real_open(path, os.O_RDWR | os.O_CLOEXEC)
        self._memory = _real_mmap(self._descriptor, SIZE)
        self._lock = threading.Lock()
        os.register_at_fork(after_in_child=self._after_fork)

    def _after_fork(self) -> None:
        self._lock = threading.Lock()

    def count(self, kind: str) -> int:
        """The number of this call of its kind, from 1."""
        at = KINDS.index(kind) * _SLOT.size
        with self._lock:
            try:
                fcntl.lockf(self._descriptor, fcntl.LOCK_EX)  # a lock of this process, whatever it was forked from
            except OSError:  # a fork closes what it does not know
                self._descriptor = _real_open(self._path, os.O_RDWR | os.O_CLOEXEC)
                fcntl.lockf(self._descriptor, fcntl.LOCK_EX)
            try:
                number: int = _SLOT.unpack_from(self._memory, at)[0] + 1
                _SLOT.pack_into(self._memory, at, number)
                return number
            finally:
                fcntl.lockf(self._descriptor, fcntl.LOCK_UN)

    def number_of(self, kind: str) -> int:
        """The calls of a kind so far."""
        number: int = _SLOT.unpack_from(self._memory, KINDS.index(kind) * _SLOT.size)[0]
        return number


class PlantedFault:
    """The call of `kind` with number `number` fails with the error `error`; with `lasting` all later ones too."""

    def __init__(self, text: str) -> None:
        given = json.loads(text) if text else {}
        self.kind: str = given.get("kind", "")
        self.number: int = given.get("number", 0)
        self.error: str = given.get("error", "EIO")
        self.lasting: bool = given.get("lasting", False)

    def hits(self, kind: str, number: int) -> bool:
        """True for the call that fails."""
        return kind == self.kind and (number == self.number or (self.lasting and number > self.number))


_counts: FaultCounts | None = None
_fault = PlantedFault("")
_inside = threading.local()


def arm(path: str, text: str) -> None:
    """Count in this file from now on, and plant this fault."""
    global _counts, _fault
    _counts, _fault = FaultCounts(path), PlantedFault(text)


def is_hit(kind: str) -> bool:
    """Count a call; True if it is the one that fails."""
    if _counts is None or getattr(_inside, "counting", False):
        return False
    _inside.counting = True
    try:
        return _fault.hits(kind, _counts.count(kind))
    finally:
        _inside.counting = False


def system_error(path: object = None, *, reading: bool = False) -> OSError:
    """The planted error; to open a file for reading needs no room."""
    number = getattr(errno, _fault.error, errno.EIO)
    if reading and number in (errno.ENOSPC, errno.EROFS):
        number = errno.EIO
    return OSError(number, os.strerror(number), path) if path is not None else OSError(number, os.strerror(number))


# -- files

_real_open, _real_mmap = os.open, mmap.mmap


class FaultyFile(_io.FileIO):
    """A file whose reads and writes are counted."""

    def write(self, data):
        if is_hit("write"):
            raise system_error()
        return super().write(data)

    def readinto(self, buffer):
        if is_hit("read"):
            raise system_error()
        return super().readinto(buffer)

    def read(self, size=-1):
        if is_hit("read"):
            raise system_error()
        return super().read(size)

    def readall(self):
        if is_hit("read"):
            raise system_error()
        return super().readall()


def _open(file, mode="r", buffering=-1, encoding=None, errors=None, newline=None, closefd=True, opener=None):
    if is_hit("open"):
        raise system_error(None if isinstance(file, int) else os.fspath(file), reading=mode in ("r", "rb", "rt"))
    if _counts is None:
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
        if is_hit(kind):
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
    """A mapping whose making is counted."""

    def __new__(cls, *arguments, **options):
        if is_hit("memory"):
            raise system_error()
        return super().__new__(cls, *arguments, **options)


# -- processes and threads

_real_start = threading.Thread.start


def _start(thread):
    if is_hit("start"):
        raise RuntimeError("can't start new thread")
    return _real_start(thread)


# -- clocks


def _shifted(real, kind, shift):
    leap = [False]

    def reading():
        if is_hit(kind):
            leap[0] = True
        value = real()
        return shift(value) if leap[0] or (_fault.kind == kind and _has_leapt(kind)) else value

    return reading


def _has_leapt(kind):
    """True in every process once the reading that leaps has been taken in one."""
    return _counts is not None and _counts.number_of(kind) >= _fault.number


# -- the record of model calls


class FaultyConnection(sqlite3.Connection):
    """A connection whose statements are counted."""

    def execute(self, *arguments):
        if is_hit("record"):
            raise sqlite3.OperationalError("disk I/O error")
        return super().execute(*arguments)


_real_connect = sqlite3.connect


def _connect(*arguments, **options):
    if is_hit("record"):
        raise sqlite3.OperationalError("unable to open database file")
    return _real_connect(*arguments, **{"factory": FaultyConnection, **options})


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


if "LINGJING_FAULT_COUNTS" in os.environ:
    install()
    arm(os.environ["LINGJING_FAULT_COUNTS"], os.environ.get("LINGJING_FAULT", ""))
