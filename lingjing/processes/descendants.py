"""The processes below this one: listed, and ended with everything that they have started.

A process that a policy starts may leave its session and its parent. The kernel then makes it a child of the nearest
ancestor that adopts orphans (`linux.adopt_orphans`), so that it can be found and ended. Linux only.
"""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Iterator
from pathlib import Path

from lingjing.processes.linux import adopt_orphans, adopts_orphans


@contextlib.contextmanager
def adopting() -> Iterator[None]:
    """Adopt orphans below this process within the block; at its end, kill every child that is new, and its children."""
    known, before = set(children()), adopts_orphans()
    adopt_orphans()
    try:
        yield
    finally:
        end_children(known)
        adopt_orphans(before)


def end_children(spared: set[int]) -> None:
    """Kill every child whose process id is not in `spared`, then the children that these leave, until none is left.

    Each is reaped.
    """
    while doomed := [pid for pid in children() if pid not in spared]:
        for pid in doomed:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(pid, signal.SIGKILL)
            with contextlib.suppress(ChildProcessError):  # another thread has waited for it
                os.waitpid(pid, 0)


def children() -> list[int]:
    """The process ids of this process's children, also of those that have ended and were not waited for."""
    try:
        lists = [(task / "children").read_text() for task in Path("/proc/self/task").iterdir()]
        return [int(pid) for line in lists for pid in line.split()]
    except OSError:  # a kernel without CONFIG_PROC_CHILDREN, a thread that has just ended, or no descriptor is left
        with contextlib.suppress(OSError):
            return _children_by_parent()
        return []  # where `/proc` cannot be read, the children end with their parent (`linux.set_parent_death_signal`)


def _children_by_parent() -> list[int]:
    own, pids = str(os.getpid()), []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError, IndexError):  # it has ended meanwhile
                if (entry / "stat").read_text(errors="replace").rpartition(")")[2].split()[1] == own:
                    pids.append(int(entry.name))
    return pids


__all__ = ["adopting", "children", "end_children"]
