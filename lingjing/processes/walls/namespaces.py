"""The user and process-id namespaces of a fork server, and the process-id namespace of each of its forks.

The server enters both before it imports anything else. It then has all capabilities within its user namespace and none
outside. Each fork is the first process of a process-id namespace of its own: the kernel ends everything in it together
with the fork. Where the system refuses, the server goes on without, and the report of each fork says so.
"""

from __future__ import annotations

import os
import signal
import socket
from collections.abc import Mapping
from pathlib import Path
from typing import NoReturn

from lingjing.processes.linux import end_with_parent, fork
from lingjing.processes.walls.system_calls import call

NEW_USER, NEW_PID = 0x10000000, 0x20000000
"""`CLONE_NEWUSER` and `CLONE_NEWPID` of linux/sched.h."""

NOBODY = 65534
"""The user and group of a policy's process if the server runs as root: the kernel limits no threads of root."""

AS_NOBODY = 1
"""The number inside of the server's user namespace of the user 65534."""


class PidNamespaces:
    """Makes a process-id namespace for each fork of this process, which must be in one of its own user namespace."""

    def __init__(self) -> None:
        self._own = os.open("/proc/self/ns/pid", os.O_RDONLY | os.O_CLOEXEC)

    def begin(self) -> None:
        """Let the next fork begin a namespace. Raises `OSError`."""
        call("unshare", NEW_PID)

    def end(self) -> None:
        """Let later forks stay in the namespace of this process."""
        call("setns", self._own, NEW_PID)


def enter_namespaces() -> PidNamespaces | None:
    """Continue in a fork inside of new user and process-id namespaces; the calling process waits for its end.

    Returns None in the calling process if the system refuses: then it goes on as it is. It must have one thread.
    """
    ours, theirs = socket.socketpair()
    child = fork()
    if child:
        theirs.close()
        with ours:
            if ours.recv(1) == _DONE:
                ours.send(_DONE if map_users(child) else _REFUSED)
            is_inside = ours.recv(1) == _DONE
        if is_inside:
            _follow(child)
        os.waitpid(child, 0)
        return None
    ours.close()
    with theirs:
        if not _is_inside(theirs):
            theirs.send(_REFUSED)
            os._exit(0)
        end_with_parent(os.getppid(), signal.SIGKILL)
        first = fork()
        if not first:
            end_with_parent(0, signal.SIGKILL)  # the parent is outside of the namespace and has no number in it
            return PidNamespaces()
        theirs.send(_DONE)
    return _follow(first)


_DONE, _REFUSED = b"1", b"0"
"""The messages between the processes of `enter_namespaces`."""


def _is_inside(parent: socket.socket) -> bool:
    """Enter the namespaces, with the help of the parent, which maps the users. Returns False if that is refused."""
    try:
        call("unshare", NEW_USER)
        parent.send(_DONE)
        if parent.recv(1) != _DONE:
            return False
        call("unshare", NEW_PID)
    except OSError:
        return False
    return True


def map_users(pid: int) -> bool:
    """Map user and group ids in the user namespace of a process. Returns False if a map cannot be written.

    The own user becomes root there. If this process is root, user 65534 gets a number there too.
    """
    maps = [{"uid_map": f"0 {os.geteuid()} 1\n", "gid_map": f"0 {os.getegid()} 1\n"}]
    if os.geteuid() == 0:
        both = f"0 0 1\n{AS_NOBODY} {NOBODY} 1\n"
        maps.insert(0, {"uid_map": both, "gid_map": both})
    return any(_written(Path(f"/proc/{pid}"), {"setgroups": "deny", **each}) for each in maps)


def _written(process: Path, texts: Mapping[str, str]) -> bool:
    try:
        for name, text in texts.items():
            (process / name).write_text(text)
    except OSError:
        return False
    return True


def _follow(first: int) -> NoReturn:
    """Wait for a child that goes on in the place of this process, and end as it ends."""
    signal.signal(signal.SIGTERM, lambda *_: os.kill(first, signal.SIGKILL))
    _, status = os.waitpid(first, 0)
    os._exit(max(0, os.waitstatus_to_exitcode(status)))


__all__ = ["AS_NOBODY", "NOBODY", "PidNamespaces", "enter_namespaces"]
