"""Errors of the operating system that are no fault of the program, each with a hint.

An unwritable place is a wrong argument (`UsageError`). A machine without free descriptors, memory or processes, or with
a failing disk, is an `InfrastructureError`. Other errors, such as a missing file, are not covered here.
"""

from __future__ import annotations

import errno

from lingjing.errors import InfrastructureError, LingjingError, UsageError

_UNWRITABLE = {errno.EACCES, errno.EROFS, errno.ENOSPC, errno.EDQUOT, errno.EPERM, errno.EFBIG}

_DESCRIPTORS = "close other programs, or raise the limit: `ulimit -n`"
_MEMORY = "close other programs, or play fewer episodes at a time with -j"
_PROCESSES = "close other programs, or raise the limit: `ulimit -u`"
_DISK = "check the disk: `dmesg` shows the errors of its device"

_LACKING = {
    errno.EMFILE: _DESCRIPTORS,
    errno.ENFILE: _DESCRIPTORS,
    errno.ENOMEM: _MEMORY,
    errno.EAGAIN: _PROCESSES,
    errno.EIO: _DISK,
    errno.ESTALE: _DISK,
}


_ACCESS = "see who may use it: `ls -ld` shows that"
_ROOM = "choose another place, or make room"

_HINTS = {
    **dict.fromkeys(_UNWRITABLE, _ROOM),
    errno.EACCES: _ACCESS,
    errno.EPERM: _ACCESS,
    **_LACKING,
}


def hint_of(error: BaseException | None) -> str:
    """Return the hint for an error of the operating system; "" for any other."""
    if isinstance(error, MemoryError):
        return _MEMORY
    return _HINTS.get(error.errno or 0, "") if isinstance(error, OSError) else ""


def refusal_of(error: BaseException) -> LingjingError | None:
    """Return the error to report for an error of the operating system; None for any other."""
    if isinstance(error, MemoryError):
        return InfrastructureError("the system has not enough memory", hint=_MEMORY)
    if isinstance(error, RuntimeError) and "start new thread" in str(error):
        return InfrastructureError("the system starts no more threads", hint=_PROCESSES)
    if isinstance(error, FileNotFoundError) and "No usable temporary directory" in str(error):  # `tempfile`'s words
        return UsageError("no folder for temporary files can be written", hint="set TMPDIR to a folder with room")
    if not isinstance(error, OSError):
        return None
    name = f"`{error.filename}`" if error.filename else ""
    if name and error.errno in (errno.EACCES, errno.EPERM):  # reading may raise these too
        return UsageError(f"the system refuses {name}: {error.strerror}", hint=_ACCESS)
    if error.errno in _UNWRITABLE:
        hint = "choose another place with -o, or make room"
        return UsageError(f"cannot write {name or 'the output'}: {error.strerror}", hint=hint)
    if error.errno in _LACKING:
        message = f"the system refuses {name or 'what is needed'}: {error.strerror}"
        return InfrastructureError(message, hint=_LACKING[error.errno])
    return None


__all__ = ["hint_of", "refusal_of"]
