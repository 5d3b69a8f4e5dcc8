"""Hints for errors of the operating system. It imports nothing of this project, so that `errors` can import it."""

from __future__ import annotations

import errno

UNWRITABLE = {errno.EACCES, errno.EROFS, errno.ENOSPC, errno.EDQUOT, errno.EPERM, errno.EFBIG}

_DESCRIPTORS = "close other programs, or raise the limit: `ulimit -n`"
MEMORY = "close other programs, or play fewer episodes at a time with -j"
PROCESSES = "close other programs, or raise the limit: `ulimit -u`"
_DISK = "check the disk: `dmesg` shows the errors of its device"

LACKING = {
    errno.EMFILE: _DESCRIPTORS,
    errno.ENFILE: _DESCRIPTORS,
    errno.ENOMEM: MEMORY,
    errno.EAGAIN: PROCESSES,
    errno.EIO: _DISK,
    errno.ESTALE: _DISK,
}


ACCESS = "see who may use it: `ls -ld` shows that"
_ROOM = "choose another place, or make room"

_HINTS = {
    **dict.fromkeys(UNWRITABLE, _ROOM),
    errno.EACCES: ACCESS,
    errno.EPERM: ACCESS,
    **LACKING,
}


def hint_of_system(error: BaseException) -> str:
    """Return the hint for an error of the operating system; "" for any other."""
    if isinstance(error, MemoryError):
        return MEMORY
    return _HINTS.get(error.errno or 0, "") if isinstance(error, OSError) else ""


__all__ = ["ACCESS", "LACKING", "MEMORY", "PROCESSES", "UNWRITABLE", "hint_of_system"]
