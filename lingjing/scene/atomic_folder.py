"""A place to write in, next to where a result belongs: so that it appears there whole or not at all.

Writers that were killed leave such a folder behind; the next one at the same place takes it away.
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
    """An empty folder `.NAME.PROCESS.….part` next to `target`, on its file system, gone at the end.

    Folders of processes that live no more go with it. `OSError` where none can be made.
    """
    for left in target.parent.glob(f".{target.name}.*{SUFFIX}"):
        if not _alive(left.name.removeprefix(f".{target.name}.").split(".")[0]):
            shutil.rmtree(left, ignore_errors=True)
    made = tempfile.mkdtemp(prefix=f".{target.name}.{os.getpid()}.", suffix=SUFFIX, dir=target.parent)
    folder = Path(made, "new")
    folder.mkdir()  # the one above is for its owner's eyes alone; what is renamed into place is as the umask has it
    try:
        yield folder
    finally:
        shutil.rmtree(made, ignore_errors=True)


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
