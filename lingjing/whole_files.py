"""Atomic writes: a file exists completely or not at all, even if its writer is killed."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

PARTIAL = ".partial"
"""The suffix of incomplete files, also of those that killed writers leave behind."""


@contextlib.contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Yield an empty file beside `path`, private to this process. It gets that name at the end, or is removed on an
    error.

    Raises `OSError` if it cannot be made or renamed.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}{PARTIAL}")
    try:
        partial.unlink(missing_ok=True)
        partial.touch(exist_ok=False)  # fails for an existing link, so no other file is overwritten
        yield partial
        partial.replace(path)
    finally:
        with contextlib.suppress(OSError):
            partial.unlink()
