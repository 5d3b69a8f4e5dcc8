"""The processes below this one: their list, their continuation, and their end with all their descendants.

A process of a policy may leave its session and its parent. The kernel then makes it a child of the nearest ancestor
that adopts orphans (`linux.adopt_orphans`), which can find and end it. Linux only.
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
    """Adopt orphans below this process within the block. At its end, kill every new child and its descendants."""
    known, before = set(children()), adopts_orphans()
    adopt_orphans()
    try:
        yield
    finally:
        end_children(known)
        adopt_orphans(before)


def end_children(spared: set[int]) -> None:
    """Kill every child but those with a process id in `spared`, and repeat until there is none.

    The descendants of a killed child become children and are killed as well. Each is reaped.
    """
    while doomed := [pid for pid in children() if pid not in spared]:
        for pid in doomed:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(pid, signal.SIGKILL)
            with contextlib.suppress(ChildProcessError):  # another thread has waited for it
                os.waitpid(pid, 0)


def continue_stopped() -> None:
    """Continue every descendant that a signal has stopped (SIGSTOP). Without `/proc`, do nothing."""
    fresh, seen = children(), {os.getpid()}
    while fresh:
        pid = fresh.pop()
        seen.add(pid)
        with contextlib.suppress(OSError, IndexError):  # it has ended meanwhile
            state = Path(f"/proc/{pid}/stat").read_text(errors="replace").rpartition(")")[2].split()[0]
            if state == "T":
                os.kill(pid, signal.SIGCONT)
        with contextlib.suppress(OSError):
            fresh += [child for child in _listed_children(Path(f"/proc/{pid}")) if child not in seen]


def children() -> list[int]:
    """Return the process ids of this process's children, zombies included."""
    try:
        return _listed_children(Path("/proc/self"))
    except OSError:  # no CONFIG_PROC_CHILDREN, an ended thread, or no free descriptor
        with contextlib.suppress(OSError):
            return _children_by_parent()
        return []  # without `/proc`, children end with their parent (`linux.set_parent_death_signal`)


def _listed_children(process: Path) -> list[int]:
    lists = [(task / "children").read_text() for task in (process / "task").iterdir()]
    return [int(pid) for line in lists for pid in line.split()]


def _children_by_parent() -> list[int]:
    """Return the children: the processes of `/proc` that have this process as their parent."""
    own, pids = str(os.getpid()), []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError, IndexError):  # it has ended meanwhile
                if (entry / "stat").read_text(errors="replace").rpartition(")")[2].split()[1] == own:
                    pids.append(int(entry.name))
    return pids


__all__ = ["adopting", "children", "continue_stopped", "end_children"]
