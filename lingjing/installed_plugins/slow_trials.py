"""Trials without an answer, remembered in the cache folder (`$XDG_CACHE_HOME/lingjing/trials`).

A plug-in that never returns would delay every command by the whole deadline. So its fault is kept for `KEPT_S`, and the
next commands leave it out at once. A fault counts only while the plug-in's files are as they were. Faults of other
kinds are found in a moment and are not kept.

The cache affects time only: with a cache folder that is off, broken or not writable, each command tries the plug-in.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import time
from collections.abc import Iterable, Iterator
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path

import msgspec

from lingjing.data import cache_folder, cache_is_off
from lingjing.decoding import from_json
from lingjing.kept_files import prune, read_kept, write_kept

KEPT_S = 3600.0
"""Seconds for which a fault is kept. Chosen: what a plug-in waits for, such as a licence server, may come back."""

MOST_FILES = 1000
"""The most files of a plug-in that are compared. Chosen: it bounds the time for a large package."""

MOST_KEPT = 100
"""The most kept faults. Chosen."""

_FOLDER = "trials"


class _SlowTrial(msgspec.Struct, frozen=True):
    """The fault of a plug-in that gave no answer, kept for later commands."""

    reason: str
    ended_unix_s: float


def keep_slow_trial(point: EntryPoint, key: str, reason: str) -> None:
    """Keep the fault of a plug-in that gave no answer. `key` is the key of its trial."""
    if cache_is_off():
        return
    file = _file(point, key)
    with contextlib.suppress(OSError):
        write_kept(file, msgspec.json.encode(_SlowTrial(reason, time.time())))
        prune(os.path.dirname(file), most_bytes=1 << 20, most_files=MOST_KEPT)  # noqa: PTH120 - as `kept_files`


def find_slow_trial(point: EntryPoint, key: str) -> str:
    """Return the kept fault of a plug-in with these very files; "" if there is none."""
    if cache_is_off():
        return ""
    try:
        data = read_kept(_file(point, key))
        trial = from_json(data, _SlowTrial) if data is not None else None
    except (OSError, msgspec.DecodeError):
        return ""
    if trial is None or not 0.0 <= time.time() - trial.ended_unix_s < KEPT_S:
        return ""
    return trial.reason


def forget_slow_trials() -> None:
    """Forget all faults, so that this command tries every plug-in."""
    with contextlib.suppress(OSError):
        for item in os.scandir(os.path.join(cache_folder(), _FOLDER)):  # noqa: PTH118 - as `kept_files`
            with contextlib.suppress(OSError):
                os.unlink(item.path)  # noqa: PTH108


# -- private


def _file(point: EntryPoint, key: str) -> str:
    state = hashlib.sha256(key.encode())
    for path in _files_of(point):
        with contextlib.suppress(OSError):
            status = path.stat()
            state.update(f"\n{path}\n{status.st_ino} {status.st_size} {status.st_mtime_ns}".encode(errors="replace"))
    return os.path.join(cache_folder(), _FOLDER, state.hexdigest()[:32])  # noqa: PTH118 - as `kept_files`


def _files_of(point: EntryPoint) -> Iterator[Path]:
    """Yield the metadata of a plug-in and the files of its top package or module, without an import."""
    if point.dist is not None:
        for name in ("RECORD", "METADATA", "entry_points.txt", "direct_url.json"):
            yield Path(str(getattr(point.dist, "_path", point.dist.locate_file("")))) / name
    with contextlib.suppress(ImportError, ValueError, OSError):
        spec = find_spec(point.module.partition(".")[0])  # also of an editable installation
        if spec is not None:
            yield from [Path(spec.origin)] if spec.origin else []
            yield from _below(spec.submodule_search_locations or ())


def _below(folders: Iterable[str]) -> list[Path]:
    files: list[Path] = []
    for folder in folders:
        for place, below, names in os.walk(folder):
            below[:] = sorted(name for name in below if name != "__pycache__")
            files += [Path(place, name) for name in sorted(names)]
            if len(files) >= MOST_FILES:
                return files[:MOST_FILES]
    return files


__all__ = ["KEPT_S", "find_slow_trial", "forget_slow_trials", "keep_slow_trial"]
