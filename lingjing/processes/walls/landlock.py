"""Landlock: rules of the kernel, from Linux 5.13, that a process puts upon itself (landlock(7)).

The rules allow reading below some paths and everything below others. The later versions of the interface add TCP
(4), device controls (5), abstract Unix sockets and signals to processes outside (6).
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterable

from lingjing.processes.walls.system_calls import call, prctl

_VERSION_FLAG = 1
"""`LANDLOCK_CREATE_RULESET_VERSION`."""
_PATH_BENEATH = 1
"""`LANDLOCK_RULE_PATH_BENEATH`."""

_EXECUTE, _WRITE_FILE, _READ_FILE, _READ_DIR = 1 << 0, 1 << 1, 1 << 2, 1 << 3
"""Rights of linux/landlock.h."""
_FILE_RIGHTS_BITS = {1: 13, 2: 14, 3: 15, 4: 15, 5: 16}
"""The number of rights to files by the version of the interface; later versions have those of version 5."""
_FOR_FILES = _EXECUTE | _WRITE_FILE | _READ_FILE | 1 << 14 | 1 << 15
"""The rights that a rule for a file may have: those, `TRUNCATE` and `IOCTL_DEV`."""
_TCP = 0b11
"""`LANDLOCK_ACCESS_NET_BIND_TCP | LANDLOCK_ACCESS_NET_CONNECT_TCP`, from version 4."""
_SCOPES = 0b11
"""`LANDLOCK_SCOPE_ABSTRACT_UNIX_SOCKET | LANDLOCK_SCOPE_SIGNAL`, from version 6."""
SCOPES_FROM = 6
"""The version of the interface with scopes."""

_PR_SET_NO_NEW_PRIVS = 38
"""From linux/prctl.h."""


class _Ruleset(ctypes.Structure):
    _fields_ = (("files", ctypes.c_uint64), ("network", ctypes.c_uint64), ("scoped", ctypes.c_uint64))


class _PathRule(ctypes.Structure):
    _pack_ = 1
    _fields_ = (("allowed", ctypes.c_uint64), ("parent", ctypes.c_int32))


def landlock_version() -> int:
    """Return the version of the interface; 0 if the kernel has none."""
    try:
        return call("landlock_create_ruleset", None, 0, _VERSION_FLAG)
    except OSError:
        return 0


def no_new_privileges() -> None:
    """Renounce privileges of programs with set-user-id bits or capabilities, for ever. Raises `OSError`."""
    prctl(_PR_SET_NO_NEW_PRIVS, 1)


def restrict(readable: Iterable[str], writable: Iterable[str]) -> int:
    """Allow reading below `readable`, everything below `writable`, and nothing else. Returns the version in force.

    `no_new_privileges` comes before. Paths that do not exist are left out. Raises `OSError` if there is no Landlock.
    """
    version = landlock_version()
    rights = (1 << _FILE_RIGHTS_BITS.get(version, 16)) - 1
    rules = _Ruleset(rights, _TCP if version >= 4 else 0, _SCOPES if version >= SCOPES_FROM else 0)
    size = 24 if version >= SCOPES_FROM else 16 if version >= 4 else 8
    ruleset = call("landlock_create_ruleset", ctypes.byref(rules), size, 0)
    try:
        for path in readable:
            _allow(ruleset, path, (_EXECUTE | _READ_FILE | _READ_DIR) & rights)
        for path in writable:
            _allow(ruleset, path, rights)
        call("landlock_restrict_self", ruleset, 0)
    finally:
        os.close(ruleset)
    return version


def _allow(ruleset: int, path: str, rights: int) -> None:
    try:
        parent = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except OSError:
        return
    try:
        is_folder = os.path.isdir(path)  # noqa: PTH112 - the path of a process that is about to lose its root
        rule = _PathRule(rights if is_folder else rights & _FOR_FILES, parent)
        call("landlock_add_rule", ruleset, _PATH_BENEATH, ctypes.byref(rule), 0)
    finally:
        os.close(parent)


__all__ = ["SCOPES_FROM", "landlock_version", "no_new_privileges", "restrict"]
