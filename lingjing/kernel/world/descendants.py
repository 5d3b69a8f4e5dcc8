"""Processes below this one: adopted when their parents end, and ended when what started them is over.

A process that a policy starts may leave its session and its parent. The kernel then hands it to the nearest ancestor
that asked for such orphans (prctl(2), `PR_SET_CHILD_SUBREAPER`), so that it can be found and ended. Linux only.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
from collections.abc import Iterator
from pathlib import Path

_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36
_PR_GET_CHILD_SUBREAPER = 37


@contextlib.contextmanager
def adopting() -> Iterator[None]:
    """Adopt what loses its parent below this process; on leaving, end every child that is new and what it started."""
    known, before = set(children()), _adopts()
    adopt()
    try:
        yield
    finally:
        end_children(known)
        adopt(before)


def end_children(spared: set[int]) -> None:
    """Kill every child but those, and the children that they leave, until there are none; each is reaped."""
    while doomed := [pid for pid in children() if pid not in spared]:
        for pid in doomed:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(pid, signal.SIGKILL)
            with contextlib.suppress(ChildProcessError):  # somebody else has waited for it
                os.waitpid(pid, 0)


def children() -> list[int]:
    """The process ids of this process's children, also of those that have ended and were not waited for."""
    try:
        lists = [(task / "children").read_text() for task in Path("/proc/self/task").iterdir()]
        return [int(pid) for listed in lists for pid in listed.split()]
    except OSError:  # a kernel without CONFIG_PROC_CHILDREN, a thread that has just ended, or no descriptor is left
        with contextlib.suppress(OSError):
            return _children_by_parent()
        return []  # where `/proc` cannot be read, the children end with their parent (`be_told_of_the_end_of`)


def _children_by_parent() -> list[int]:
    mine, found = str(os.getpid()), []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError, IndexError):  # it has ended meanwhile
                if (entry / "stat").read_text(errors="replace").rpartition(")")[2].split()[1] == mine:
                    found.append(int(entry.name))
    return found


def be_told_of_the_end_of(parent: int, number: int) -> bool:
    """Have the kernel send this signal when the parent ends; False if it has ended already."""
    prctl = getattr(ctypes.CDLL(None), "prctl", None)
    if prctl is not None:
        prctl(_PR_SET_PDEATHSIG, number, 0, 0, 0)
    return os.getppid() == parent


def adopt(wanted: bool = True) -> None:
    """Have the kernel hand this process what loses its parent below it, or no longer."""
    ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, int(wanted), 0, 0, 0)


def _adopts() -> bool:
    value = ctypes.c_int()
    ctypes.CDLL(None).prctl(_PR_GET_CHILD_SUBREAPER, ctypes.byref(value), 0, 0, 0)
    return bool(value.value)
