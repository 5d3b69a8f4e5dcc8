"""Deadlines on the wall clock that a busy machine does not shorten.

A process's *own time* is wall-clock time less the time in which it was runnable and not scheduled. Sleeping, being
stopped and waiting for a lock are own time; standing in a run queue is not. Linux counts for each thread how long it
ran and how long it stood in a queue (nanoseconds, `/proc/PID/task/TID/schedstat`; the kernel's
`Documentation/scheduler/sched-stats.rst`). Where a kernel does not count, own time is wall-clock time.

Threads of one process may stand in queues at the same time, so the sum of their waits may be more than has passed: own
time is never less than what the busiest thread ran.
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
"""What is shorter is not looked into: most answers come sooner, and a look costs as much as a trivial step."""

_UNREAD_S = 1e-4
"""So old may a thread's counter be: whoever waited longer than that was away for longer, and it is read again."""

_STALL_S = 0.05
"""How long a runnable thread must have stood still to be in a queue for certain: a kernel's tick is 10 ms at most."""


class Deadline(Protocol):
    """Until when to wait for somebody."""

    def left_s(self) -> float:
        """Seconds after which to ask again; 0 or less when the deadline has passed."""
        ...


class WallDeadline:
    """So many seconds from now."""

    def __init__(self, allowed_s: float) -> None:
        self._end = time.monotonic() + allowed_s

    def left_s(self) -> float:
        """Seconds until then."""
        return self._end - time.monotonic()


class _Thread(NamedTuple):
    ran_ns: int
    waited_ns: int


class OwnDeadline:
    """So many seconds of a process's own time from now."""

    def __init__(self, pid: int, allowed_s: float, *, already_s: float = 0.0, watched: bool = False) -> None:
        """`already_s` of them are spent; `watched`: read its counters at once, because the next read is at the end."""
        self.allowed_s = allowed_s
        self._already_s = already_s
        self._pid = pid
        self._started = time.monotonic()
        self._first: dict[str, _Thread] | None = _threads(pid) if watched else None
        self._last: dict[str, _Thread] = {}

    def left_s(self) -> float:
        """Seconds until the deadline if the process stands in no queue from now on; 0 or less when it has passed."""
        if self._first is None:
            if time.monotonic() - self._started < _UNWATCHED_S:
                return min(self.allowed_s - self._already_s, _UNWATCHED_S)
            # The caller may have waited for a processor for long. The process's time until now is not known any more.
            self._first, self._started = _threads(self._pid), time.monotonic() - _UNWATCHED_S
        # Own time is no more than wall-clock time: until that has passed, the counters need not be read.
        least = self.allowed_s - self._already_s - (time.monotonic() - self._started)
        if least > 0.0:
            return least
        left = self.allowed_s - self.spent_s()
        if left > 0.0:
            return left
        # A wait is counted when it ends: one that goes on is seen by looking twice.
        return _STALL_S if self._is_stalled() else self.allowed_s - self.spent_s()

    def spent_s(self) -> float:
        """Seconds of own time that are spent."""
        now = time.monotonic() - self._started
        if self._first is None:  # the answer came before the first look, however late its reader comes
            return self._already_s + min(now, _UNWATCHED_S)
        self._last |= _threads(self._pid)
        since = [_since(thread, self._first.get(name)) for name, thread in self._last.items()]
        waited = sum(thread.waited_ns for thread in since)
        ran = max((thread.ran_ns for thread in since), default=0)
        return self._already_s + max(now - waited * 1e-9, ran * 1e-9)

    def _is_stalled(self) -> bool:
        """Whether the process stands in a queue now: a thread could run, and for a while none has."""
        before = _threads(self._pid)
        time.sleep(_STALL_S)
        return before == _threads(self._pid) and any(_is_runnable(self._pid, name) for name in before)


def is_counted() -> bool:
    """Whether this kernel counts the time in run queues. Without `CONFIG_SCHED_INFO` all its numbers are 0."""
    own = _threads(os.getpid())
    return any(thread.ran_ns for thread in own.values())


def own_now_s() -> float:
    """The calling thread's own time on a clock of its own: for differences, exact to `_UNREAD_S`."""
    now = time.monotonic()
    try:
        waited = _own.counter.waited_ns(now)
    except (OSError, ValueError, IndexError):
        waited = 0
    return now - waited * 1e-9


def own_clock_of_s(pid: int) -> float:
    """What `own_now_s` would say in the main thread of that process."""
    thread = _threads(pid).get(str(pid))
    return time.monotonic() - (thread.waited_ns * 1e-9 if thread else 0.0)


# -- private


class _Counter:
    """The calling thread's counter, kept open, because a read then takes 2 µs."""

    __slots__ = ("_file", "_latest_ns", "_read_at_s")

    def __init__(self) -> None:
        self._file: io.FileIO | None = None
        self._read_at_s = -math.inf
        self._latest_ns = 0

    def waited_ns(self, now_s: float) -> int:
        """How long the thread has stood in run queues in all. `OSError` where the kernel does not say."""
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
        """After a fork: the thread that goes on has counters of its own, and the file open here is its parent's."""
        self.counter = _Counter()


_own = _PerThread()
os.register_at_fork(after_in_child=_own.forget)


def _threads(pid: int) -> dict[str, _Thread]:
    """The threads of a process by id; none where it is gone or the kernel does not count."""
    found: dict[str, _Thread] = {}
    try:
        names = os.listdir(f"/proc/{pid}/task")  # noqa: PTH208 - names are wanted, and quickly
    except OSError:
        return found
    for name in names:
        try:
            ran, waited = Path(f"/proc/{pid}/task/{name}/schedstat").read_bytes().split()[:2]
            found[name] = _Thread(int(ran), int(waited))
        except (OSError, ValueError):
            continue
    return found


def _since(thread: _Thread, first: _Thread | None) -> _Thread:
    return thread if first is None else _Thread(thread.ran_ns - first.ran_ns, thread.waited_ns - first.waited_ns)


def _is_runnable(pid: int, thread: str) -> bool:
    try:
        return Path(f"/proc/{pid}/task/{thread}/stat").read_text().rpartition(")")[2].split()[0] == "R"
    except (OSError, IndexError):
        return False
