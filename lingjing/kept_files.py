"""Files of the cache folder: what is read is what was written, or nothing.

A file begins with the SHA-256 of the rest; one with a wrong checksum counts as missing. Files are written beside and
renamed, so that two writers at once leave one whole file. Those that were not read for longest go first. Nothing here
is loaded that a cold start would notice.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import time

LEFT_BEHIND_S = 3600.0
"""A half-written file this old has no writer any more."""

READ_AGAIN_S = 3600.0
"""A file that is read is marked as read at most this often."""

_CHECKSUM = 32
_HALF_WRITTEN = ".new-"


def read_kept(path: str) -> memoryview | None:
    """What was written to a file; None if its checksum is wrong. `OSError` where it cannot be read."""
    with open(path, "rb") as file:  # noqa: PTH123 - a cold start
        data = memoryview(file.read())
        if hashlib.sha256(data[_CHECKSUM:]).digest() != data[:_CHECKSUM]:
            return None
        if time.time() - os.fstat(file.fileno()).st_mtime > READ_AGAIN_S:
            with contextlib.suppress(OSError):
                os.utime(path)
    return data[_CHECKSUM:]


def write_kept(path: str, data: bytes) -> None:
    """Write a file whole or not at all, and its folder where there is none. `OSError` where that cannot be done."""
    import tempfile

    folder = os.path.dirname(path)  # noqa: PTH120
    os.makedirs(folder, exist_ok=True)  # noqa: PTH103
    handle, temporary = tempfile.mkstemp(dir=folder, prefix=_HALF_WRITTEN)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(hashlib.sha256(data).digest())
            file.write(data)
        os.replace(temporary, path)  # noqa: PTH105
    except BaseException:
        os.unlink(temporary)  # noqa: PTH108
        raise


def prune(folder: str, *, most_bytes: int, most_files: int) -> None:
    """Remove the files that were not read for longest until the rest are few and small enough, and what writers that
    were killed left behind. Another process may be doing the same."""
    now, found = time.time(), []
    for item in os.scandir(folder):
        with contextlib.suppress(FileNotFoundError):
            status = item.stat()
            if not item.name.startswith(_HALF_WRITTEN):
                found.append((status.st_mtime_ns, item.path, status.st_size))
            elif now - status.st_mtime > LEFT_BEHIND_S:
                os.unlink(item.path)  # noqa: PTH108
    room = most_bytes
    for place, (_, path, size) in enumerate(sorted(found, reverse=True)):
        room -= size
        if room < 0 or place >= most_files:
            with contextlib.suppress(FileNotFoundError):
                os.unlink(path)  # noqa: PTH108
