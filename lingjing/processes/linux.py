"""System calls of Linux that the standard library lacks, or that this project restricts: prctl(2) and fork(2).

On other systems the functions of prctl do nothing, because no process is forked there.
"""

from __future__ import annotations

import ctypes
import os
import random
import signal
from collections.abc import Callable
from pathlib import Path

_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36
_PR_GET_CHILD_SUBREAPER = 37
"""Options of prctl(2), from `linux/prctl.h`."""

_M_TRIM_THRESHOLD = -1
_M_MMAP_THRESHOLD = -3
"""Options of mallopt(3), from `malloc.h`."""

_MOST_KEPT_BYTES = 32 << 20
"""The largest block that glibc takes from its heap, bytes: `HEAP_MAX_SIZE / 2` on 64-bit systems (mallopt(3))."""


_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")
"""The unit of `/proc/PID/statm`, bytes."""


class SeveralThreadsError(Exception):
    """A process with several threads cannot be forked. `count`: the number of its threads.

    A fork has only a copy of the calling thread. Locks that other threads hold stay locked in it for ever.
    """

    def __init__(self, count: int) -> None:
        super().__init__(f"the process has {count} threads and cannot be forked")
        self.count = count


def fork(*, keep_random: bool = False, with_threads: bool = False) -> int:
    """Fork this process. Returns 0 in the copy, otherwise the copy's process id.

    With `keep_random` the copy continues the stream of `random`; without it Python seeds `random` anew. `with_threads`
    is for a copy that needs no lock which another thread may hold. Raises `SeveralThreadsError` for several threads
    without it, and `OSError` if the system refuses.
    """
    count = thread_count()
    if count != 1 and not with_threads:
        raise SeveralThreadsError(count)
    state = random.getstate() if keep_random else None
    pid = os.fork()  # this package alone forks (ADR 0031)
    if pid == 0 and state is not None:
        random.setstate(state)
    return pid


def run_in_fork(work: Callable[[], bytes]) -> bytes:
    """Return the bytes that `work` returns in a copy of this process; empty if it raises.

    This process may have several threads. `work` must not take a lock that another thread may hold.
    """
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.write(write, work())
        finally:
            os._exit(0)  # no shutdown: the interpreter's state belongs to the original
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        answer = pipe.read()
    os.waitpid(child, 0)
    return answer


def keep_freed_memory() -> None:
    """Let the C library keep freed blocks of up to 32 MB, in this process and its forks.

    By default it returns each block above 128 KB to the system until it has adapted to the sizes of the process. A fork
    adapts anew, and the system would clear every page of each picture again.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, _MOST_KEPT_BYTES)
        mallopt(_M_TRIM_THRESHOLD, 4 * _MOST_KEPT_BYTES)


def thread_count() -> int:
    """Return the number of threads of this process, those of compiled libraries included."""
    return len(list(Path("/proc/self/task").iterdir()))


def private_memory(pid: int) -> int:
    """Return the memory of a process that belongs to no file, bytes: `resident - shared` of `/proc/PID/statm`
    (proc_pid_statm(5)). 0 for a process that has ended.
    """
    try:
        _, resident, shared, *_ = Path(f"/proc/{pid}/statm").read_text().split()
    except (OSError, ValueError):
        return 0
    return (int(resident) - int(shared)) * _PAGE_BYTES


def set_parent_death_signal(parent: int, number: signal.Signals) -> bool:
    """Request a signal from the kernel for the end of the thread that has started this process.

    Returns False if the process `parent` has ended already: then no signal comes.
    """
    _prctl(_PR_SET_PDEATHSIG, number)
    return os.getppid() == parent  # after the call, because the parent may have ended before it


def end_with_parent(parent: int, number: signal.Signals = signal.SIGKILL) -> None:
    """Call `set_parent_death_signal`, and end this process at once if its parent has ended already."""
    if not set_parent_death_signal(parent, number):
        os._exit(0)


def adopt_orphans(wanted: bool = True) -> None:
    """Let the kernel make this process the parent of each orphan below it, or no longer if not `wanted`."""
    _prctl(_PR_SET_CHILD_SUBREAPER, int(wanted))


def adopts_orphans() -> bool:
    """True if `adopt_orphans` holds for this process."""
    value = ctypes.c_int()
    _prctl(_PR_GET_CHILD_SUBREAPER, ctypes.byref(value))
    return bool(value.value)


def _prctl(option: int, argument: object) -> None:
    prctl = getattr(ctypes.CDLL(None), "prctl", None)
    if prctl is not None:
        prctl(option, argument, 0, 0, 0)


__all__ = [
    "SeveralThreadsError", "adopt_orphans", "adopts_orphans", "end_with_parent", "fork", "keep_freed_memory",
    "run_in_fork", "set_parent_death_signal", "thread_count",
]  # fmt: skip
