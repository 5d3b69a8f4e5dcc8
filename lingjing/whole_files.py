"""Files that are there whole or not at all, whatever moment their writer is stopped at."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

PARTIAL = ".partial"
"""How the name of a half-written file ends; what a writer that was killed leaves behind has it too."""


@contextlib.contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """An empty file beside `path`, this process's own: it takes that name at the end, or is gone if anything is raised.

    Raises `OSError` where it cannot be made, or cannot take the name.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}{PARTIAL}")
    try:
        partial.unlink(missing_ok=True)
        partial.touch(exist_ok=False)  # and never through a link that lies there
        yield partial
        partial.replace(path)
    finally:
        with contextlib.suppress(OSError):
            partial.unlink()
