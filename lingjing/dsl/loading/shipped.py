"""The mission file that a word names, on the command line and in `lingjing.compile`."""

from __future__ import annotations

from pathlib import Path

from lingjing.data import data_path
from lingjing.errors import UsageError
from lingjing.suggest import nearest_or

LONGEST_SHOWN = 300
"""Most characters of a name in a message (chosen)."""


def find_mission(word: str) -> Path:
    """Return an existing file of that name, else the shipped mission (`ssr`, `scenarios/ssr.ljs`,
    `reset/ssr-001.json`).

    `-`, which means standard input, is returned unchanged. Raises `UsageError` if there is neither.
    """
    path = Path(word)
    if word == "-" or (word and _exists(path)):
        return path
    shipped = _shipped(path)
    if shipped is None:
        shown = word if len(word) <= LONGEST_SHOWN else f"{word[:LONGEST_SHOWN]}…"
        names = shipped_missions()
        hint = nearest_or(path.stem, names, f"shipped missions: {', '.join(names)}")
        raise UsageError(f"there is no mission `{shown}`", hint=hint)
    return shipped


def shipped_missions() -> tuple[str, ...]:
    """The names of the shipped missions, sorted."""
    return tuple(sorted(path.stem for path in data_path("scenarios").glob("*.ljs")))


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:  # the name is longer than the file system permits
        return False


def _shipped(path: Path) -> Path | None:
    if path.is_absolute() or ".." in path.parts:
        return None
    parts = path.parts[1:] if path.parts[:1] == ("scenarios",) else path.parts
    if not parts:
        return None
    candidate = data_path("scenarios", *parts)
    if not candidate.suffix:
        candidate = candidate.with_suffix(".ljs")
    return candidate if _exists(candidate) and candidate.is_file() else None
