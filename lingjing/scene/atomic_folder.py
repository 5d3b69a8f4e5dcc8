"""Temporary folders beside a result's final place, so that the result appears there complete or not at all.

A killed writer leaves its folder behind. The next writer for the same place removes it.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

SUFFIX = ".part"


@contextlib.contextmanager
def folder_beside(target: Path) -> Iterator[Path]:
    """Create an empty folder `.NAME.PROCESS.….part` next to `target`, on the same file system; remove it at the end.

    Folders of processes that no longer exist are removed too. Raises `OSError` if no folder can be created.
    """
    for leftover in target.parent.glob(f".{target.name}.*{SUFFIX}"):
        if not _alive(leftover.name.removeprefix(f".{target.name}.").split(".")[0]):
            shutil.rmtree(leftover, ignore_errors=True)
    private = tempfile.mkdtemp(prefix=f".{target.name}.{os.getpid()}.", suffix=SUFFIX, dir=target.parent)
    folder = Path(private, "new")
    folder.mkdir()  # mkdtemp's folder has mode 700; this one, which is renamed into place, has the umask's
    try:
        yield folder
    finally:
        shutil.rmtree(private, ignore_errors=True)


def _alive(process: str) -> bool:
    if not process.isdigit():
        return False
    try:
        os.kill(int(process), 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
