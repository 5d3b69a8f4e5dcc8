"""The promises of walls, the guards that keep them, and the report of a process about its own walls."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal

import msgspec

Guard = Literal["user-namespace", "pid-namespace", "mounts", "network-namespace", "ipc-namespace", "landlock",
                "landlock-scopes", "seccomp", "own-user"]  # fmt: skip
"""The mechanisms of the kernel. `own-user`: threads are counted for each agent by itself."""

PROMISES: Mapping[str, tuple[tuple[Guard, ...], ...]] = {
    "no files but its own and the installed packages": (("mounts",), ("landlock",)),
    "no names and sizes of other files": (("mounts",),),
    "no network": (("network-namespace",), ("seccomp",)),
    "no sockets of this machine": (("seccomp",), ("network-namespace", "mounts")),
    "no signals to other processes": (("pid-namespace",), ("landlock-scopes",), ("seccomp",)),
    "no memory of other processes": (("pid-namespace",), ("landlock",), ("seccomp",)),
    "no names of other processes": (("pid-namespace", "mounts"), ("landlock",)),
    "no shared memory and no message queues": (("seccomp",), ("ipc-namespace", "mounts")),
    "no marks on files that other agents see": (("seccomp", "mounts"), ("seccomp", "landlock")),
    "no processes of its own": (("seccomp",),),
    "a limited number of threads": (("own-user",),),
}
"""Each promise with the sets of guards that keep it: one complete set is enough."""


class WallReport(msgspec.Struct, frozen=True, kw_only=True):
    """The walls of one process."""

    guards: tuple[Guard, ...] = ()
    """The guards that stand."""
    landlock: int = 0
    """The version of Landlock in force; 0 without it."""
    refused: dict[Guard, str] = {}
    """The guards that the system refuses, each with its error."""

    @property
    def broken(self) -> tuple[str, ...]:
        """The promises that no guard keeps."""
        return broken_promises(self.guards)

    def in_words(self) -> str:
        """Return the guards in one line: `mounts, landlock 7, seccomp`."""
        words = [f"landlock {self.landlock}" if guard == "landlock" else guard for guard in self.guards]
        return ", ".join(words) or "none"


def broken_promises(guards: Iterable[Guard]) -> tuple[str, ...]:
    """Return the promises that these guards do not keep."""
    there = set(guards)
    return tuple(promise for promise, ways in PROMISES.items() if not any(there.issuperset(way) for way in ways))


__all__ = ["PROMISES", "Guard", "WallReport", "broken_promises"]
