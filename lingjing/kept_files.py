"""Files of the cache folder: a read returns exactly what was written, or nothing.

A file begins with the SHA-256 of the rest; one with a wrong checksum counts as missing. Files are written beside their
place and renamed, so that two concurrent writers leave one whole file. The least recently read files are removed first.
This module imports nothing slow, because a cold start imports it.
"""

from __future__ import annotations

import contextlib
import os
import time

LEFT_BEHIND_S = 3600.0
"""Age in seconds from which on an incomplete file has no writer any more. Chosen."""

READ_AGAIN_S = 3600.0
"""Seconds between two updates of a file's read time. Chosen."""

_CHECKSUM = 32
"""Bytes of a SHA-256."""
_HALF_WRITTEN = ".new-"
"""Prefix of incomplete files."""


def read_kept(path: str) -> memoryview | None:
    """Return the content of a file, or None if its checksum is wrong. Raises `OSError` if it cannot be read."""
    from hashlib import sha256

    with open(path, "rb") as file:  # noqa: PTH123 - a cold start
        data = memoryview(file.read())
        if sha256(data[_CHECKSUM:]).digest() != data[:_CHECKSUM]:
            return None
        if time.time() - os.fstat(file.fileno()).st_mtime > READ_AGAIN_S:
            with contextlib.suppress(OSError):
                os.utime(path)
    return data[_CHECKSUM:]


def write_kept(path: str, data: bytes) -> None:
    """Write a file atomically, and make its folder. Raises `OSError` if that fails."""
    import tempfile
    from hashlib import sha256

    folder = os.path.dirname(path)  # noqa: PTH120
    os.makedirs(folder, exist_ok=True)  # noqa: PTH103
    handle, temporary = tempfile.mkstemp(dir=folder, prefix=_HALF_WRITTEN)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(sha256(data).digest())
            file.write(data)
        os.replace(temporary, path)  # noqa: PTH105
    except BaseException:
        os.unlink(temporary)  # noqa: PTH108
        raise


def prune(folder: str, *, most_bytes: int, most_files: int) -> None:
    """Remove the least recently read files until the rest keeps both bounds, and incomplete files of killed writers.

    Another process may do the same at the same time.
    """
    now, complete = time.time(), []
    for item in os.scandir(folder):
        with contextlib.suppress(FileNotFoundError):
            status = item.stat()
            if not item.name.startswith(_HALF_WRITTEN):
                complete.append((status.st_mtime_ns, item.path, status.st_size))
            elif now - status.st_mtime > LEFT_BEHIND_S:
                os.unlink(item.path)  # noqa: PTH108
    room = most_bytes
    for place, (_, path, size) in enumerate(sorted(complete, reverse=True)):
        room -= size
        if room < 0 or place >= most_files:
            with contextlib.suppress(FileNotFoundError):
                os.unlink(path)  # noqa: PTH108
