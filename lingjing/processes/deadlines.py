"""Deadlines on the wall clock that a busy machine does not shorten.

A process's *own time* is wall-clock time without the time in which it was runnable and not scheduled. Sleeping, being
stopped and waiting for a lock are own time; waiting in a run queue is not. Linux counts for each thread the time on a
processor and the time in run queues (nanoseconds, `/proc/PID/task/TID/schedstat`; the kernel's
`Documentation/scheduler/sched-stats.rst`). On a kernel without these counters own time is wall-clock time.

Several threads of a process may wait in queues at the same time, so the sum of their waits may exceed the elapsed time.
Own time is therefore at least the processor time of the busiest thread.
"""

from __future__ import annotations

import io
import math
import os
import threading
import time
from pathlib import Path
from typing import NamedTuple, Protocol

_UNWATCHED_S = 0.01
"""Shorter waits are not measured, seconds. Chosen: most answers come sooner, and a measurement costs as much as a
trivial step."""

_UNREAD_S = 1e-4
"""The age up to which a thread's counter is used again, seconds. Chosen; a thread that waited longer reads it anew."""

_STALL_S = 0.05
"""The standstill after which a runnable thread is certainly in a queue, seconds. Chosen: a kernel tick is 10 ms at
most."""


class Deadline(Protocol):
    """A limit of a wait."""

    def left_s(self) -> float:
        """Return the seconds after which to call this again; 0 or less once the deadline has passed."""
        ...


class WallDeadline:
    """A deadline `allowed_s` seconds of wall clock from now."""

    def __init__(self, allowed_s: float) -> None:
        self._end = time.monotonic() + allowed_s

    def left_s(self) -> float:
        """Return the seconds until the deadline; negative after it."""
        return self._end - time.monotonic()


class _Thread(NamedTuple):
    """The counters of a thread: nanoseconds on a processor, and nanoseconds in run queues."""

    ran_ns: int
    waited_ns: int


class OwnDeadline:
    """A deadline `allowed_s` seconds of a process's own time from now."""

    def __init__(self, pid: int, allowed_s: float, *, already_s: float = 0.0, watched: bool = False) -> None:
        """`already_s` seconds of the allowed time are spent.

        `watched`: read the counters now. Otherwise they are first read after `_UNWATCHED_S`.
        """
        self.allowed_s = allowed_s
        self._already_s = already_s
        self._pid = pid
        self._started = time.monotonic()
        self._first: dict[str, _Thread] | None = _threads(pid) if watched else None
        self._last: dict[str, _Thread] = {}

    def left_s(self) -> float:
        """Return the seconds until the deadline if the process waits in no queue; 0 or less once it has passed."""
        if self._first is None:
            if time.monotonic() - self._started < _UNWATCHED_S:
                return min(self.allowed_s - self._already_s, _UNWATCHED_S)
            # The caller itself may have waited for a processor, so the process's own time until now is unknown.
            self._first, self._started = _threads(self._pid), time.monotonic() - _UNWATCHED_S
        # Own time is at most wall-clock time. Before that limit the counters need not be read.
        least = self.allowed_s - self._already_s - (time.monotonic() - self._started)
        if least > 0.0:
            return least
        left = self.allowed_s - self.spent_s()
        if left > 0.0:
            return left
        # The kernel counts a wait at its end. Two readings show one that continues.
        return _STALL_S if self._is_stalled() else self.allowed_s - self.spent_s()

    def spent_s(self) -> float:
        """Return the spent seconds of own time."""
        now = time.monotonic() - self._started
        if self._first is None:  # the answer came before the first reading
            return self._already_s + min(now, _UNWATCHED_S)
        self._last |= _threads(self._pid)
        since = [_since(thread, self._first.get(name)) for name, thread in self._last.items()]
        waited = sum(thread.waited_ns for thread in since)
        ran = max((thread.ran_ns for thread in since), default=0)
        return self._already_s + max(now - waited * 1e-9, ran * 1e-9)

    def _is_stalled(self) -> bool:
        """Return True if the process waits in a queue now: a thread is runnable, and none has run for `_STALL_S`."""
        before = _threads(self._pid)
        time.sleep(_STALL_S)
        return before == _threads(self._pid) and any(_is_runnable(self._pid, name) for name in before)


def is_counted() -> bool:
    """Return True if this kernel counts the time in run queues. Without `CONFIG_SCHED_INFO` its numbers are 0."""
    own = _threads(os.getpid())
    return any(thread.ran_ns for thread in own.values())


def own_now_s() -> float:
    """Return the calling thread's own time, seconds from an arbitrary origin, accurate to `_UNREAD_S`."""
    now = time.monotonic()
    try:
        waited = _own.counter.waited_ns(now)
    except (OSError, ValueError, IndexError):
        waited = 0
    return now - waited * 1e-9


def own_clock_of_s(pid: int) -> float:
    """Return the own time of the main thread of a process, on the clock of `own_now_s`."""
    thread = _threads(pid).get(str(pid))
    return time.monotonic() - (thread.waited_ns * 1e-9 if thread else 0.0)


# -- private


class _Counter:
    """The calling thread's counter. Its file stays open, because a read then takes 2 µs (measured)."""

    __slots__ = ("_file", "_latest_ns", "_read_at_s")

    def __init__(self) -> None:
        self._file: io.FileIO | None = None
        self._read_at_s = -math.inf
        self._latest_ns = 0

    def waited_ns(self, now_s: float) -> int:
        """Return the thread's total time in run queues, nanoseconds. Raises `OSError` without the kernel's counters."""
        if now_s - self._read_at_s < _UNREAD_S:
            return self._latest_ns
        if self._file is None:
            self._file = io.FileIO("/proc/thread-self/schedstat")
        self._latest_ns, self._read_at_s = int(os.pread(self._file.fileno(), 96, 0).split()[1]), now_s
        return self._latest_ns


class _PerThread(threading.local):
    """A counter for each thread."""

    def __init__(self) -> None:
        self.counter = _Counter()

    def forget(self) -> None:
        """Reset the counter after a fork: the child's thread has its own counters, and the open file is the
        parent's."""
        self.counter = _Counter()


_own = _PerThread()
os.register_at_fork(after_in_child=_own.forget)


def _threads(pid: int) -> dict[str, _Thread]:
    """Return the counters of a process's threads by id; an empty mapping if it has ended or the kernel does not
    count."""
    threads: dict[str, _Thread] = {}
    try:
        names = os.listdir(f"/proc/{pid}/task")  # noqa: PTH208 - names are wanted, and quickly
    except OSError:
        return threads
    for name in names:
        try:
            ran, waited = Path(f"/proc/{pid}/task/{name}/schedstat").read_bytes().split()[:2]
            threads[name] = _Thread(int(ran), int(waited))
        except (OSError, ValueError):
            continue
    return threads


def _since(thread: _Thread, first: _Thread | None) -> _Thread:
    """Return the counters since the first reading; all of them for a newer thread."""
    return thread if first is None else _Thread(thread.ran_ns - first.ran_ns, thread.waited_ns - first.waited_ns)


def _is_runnable(pid: int, thread: str) -> bool:
    """Return True if the thread is runnable or running."""
    try:
        return Path(f"/proc/{pid}/task/{thread}/stat").read_text().rpartition(")")[2].split()[0] == "R"
    except (OSError, IndexError):
        return False
