"""The folders of runs. Each run creates a new folder; a folder with files in it is never used again."""

from __future__ import annotations

from itertools import count
from pathlib import Path

from lingjing.errors import UsageError

RUNS = Path("runs")
"""The folder of runs without `-o`, below the working folder."""


def claim_run_folder(mission: str, mode: str, seed: int, root: Path = RUNS) -> Path:
    """Create and return `<root>/<mission>-<mode>-<seed>-<n>` with the first free n from 1.

    `mkdir` is atomic, so two commands that run at the same time get two folders. Raises `UsageError` if it cannot be
    written.
    """
    for number in count(1):
        folder = root / f"{mission}-{mode}-{seed}-{number}"
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            if not root.is_dir():
                raise UsageError(f"`{root}` is not a folder", hint="choose another place with -o") from None
            continue
        except OSError as error:
            raise _unwritable(folder, error) from error
        return folder
    raise AssertionError("count() never ends")


def claim_folder(folder: Path) -> Path:
    """Create `folder`, or accept an empty one. Raises `UsageError` if it holds files, or cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        occupied = any(folder.iterdir())
    except FileExistsError:
        raise UsageError(f"`{folder}` is a file, not a folder", hint="choose another with -o") from None
    except OSError as error:
        raise _unwritable(folder, error) from error
    if occupied:
        raise UsageError(f"`{folder}` is not empty", hint="runs are never overwritten: name a new folder")
    return folder


def release_if_empty(folder: Path) -> None:
    """Remove a folder into which nothing was written."""
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()


def _unwritable(folder: Path, error: OSError) -> UsageError:
    return UsageError(f"cannot write the output folder `{folder}`: {error.strerror}", hint="choose another with -o")
