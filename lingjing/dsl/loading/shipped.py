"""The mission file that a word names, on the command line and in `lingjing.compile`."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from lingjing.data import data_folder, data_path
from lingjing.errors import UsageError
from lingjing.suggest import nearest_or

if TYPE_CHECKING:
    from pathlib import Path  # it takes 4 ms of a cold start

# ruff: noqa: PTH110, PTH113, PTH117, PTH118, PTH122

LONGEST_SHOWN = 300
"""Most characters of a name in a message (chosen)."""


def find_mission(word: str) -> Path:
    """`mission_file` as a path."""
    from pathlib import Path

    return Path(mission_file(word))


def mission_file(word: str) -> str:
    """Return an existing file of that name, else the shipped mission (`ssr`, `scenarios/ssr.ljs`,
    `reset/ssr-001.json`).

    `-`, which means standard input, is returned unchanged. Raises `UsageError` if there is neither.
    """
    path = _plain(word)
    if word == "-" or (word and os.path.exists(path)):
        return path
    shipped = _shipped(path)
    if not shipped:
        shown = word if len(word) <= LONGEST_SHOWN else f"{word[:LONGEST_SHOWN]}…"
        names = shipped_missions()
        stem = os.path.splitext(path.rpartition("/")[2])[0]
        hint = nearest_or(stem, names, f"shipped missions: {', '.join(names)}")
        raise UsageError(f"there is no mission `{shown}`", hint=hint)
    return shipped


def shipped_missions() -> tuple[str, ...]:
    """The names of the shipped missions, sorted."""
    return tuple(sorted(path.stem for path in data_path("scenarios").glob("*.ljs")))


def _plain(word: str) -> str:
    """The path without empty parts and parts `.`."""
    root = "/" if word.startswith("/") else ""
    return root + "/".join(part for part in word.split("/") if part not in ("", ".")) or "."


def _shipped(path: str) -> str:
    """The shipped file of a path; "" if there is none."""
    parts = path.split("/")
    if path == "." or os.path.isabs(path) or ".." in parts:
        return ""
    parts = parts[1:] if parts[0] == "scenarios" else parts
    if not parts:
        return ""
    candidate = os.path.join(data_folder("scenarios"), *parts)
    if not os.path.splitext(candidate)[1]:
        candidate += ".ljs"
    return candidate if os.path.isfile(candidate) else ""
