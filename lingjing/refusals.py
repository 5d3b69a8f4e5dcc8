"""Errors of the operating system that are no fault of the program, each with a hint.

An unwritable place is a wrong argument (`UsageError`). A machine without free descriptors, memory or processes, or with
a failing disk, is an `InfrastructureError`. Other errors, such as a missing file, are not covered here.
"""

from __future__ import annotations

import errno

from lingjing.errors import InfrastructureError, LingjingError, UsageError
from lingjing.system_hints import ACCESS, LACKING, MEMORY, PROCESSES, UNWRITABLE


def refusal_of(error: BaseException) -> LingjingError | None:
    """Return the error to report for an error of the operating system; None for any other."""
    if isinstance(error, MemoryError):
        return InfrastructureError("the system does not have enough memory", hint=MEMORY)
    if isinstance(error, RuntimeError) and "start new thread" in str(error):
        return InfrastructureError("the system cannot start more threads", hint=PROCESSES)
    if isinstance(error, FileNotFoundError) and "No usable temporary directory" in str(error):  # `tempfile`'s words
        return UsageError("no folder for temporary files can be written", hint="set TMPDIR to a folder with room")
    if not isinstance(error, OSError):
        return None
    name = f"`{error.filename}`" if error.filename else ""
    if name and error.errno in (errno.EACCES, errno.EPERM):  # reading may raise these too
        return UsageError(f"the system refuses {name}: {error.strerror}", hint=ACCESS)
    if error.errno in UNWRITABLE:
        hint = "choose another place with -o, or make room"
        return UsageError(f"cannot write {name or 'the output'}: {error.strerror}", hint=hint)
    if error.errno in LACKING:
        message = f"the system refuses {name or 'what is needed'}: {error.strerror}"
        return InfrastructureError(message, hint=LACKING[error.errno])
    return None


__all__ = ["refusal_of"]
