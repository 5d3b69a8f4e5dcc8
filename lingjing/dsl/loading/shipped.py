"""Which mission file a word means, on the command line and in `lingjing.compile`."""

from __future__ import annotations

from pathlib import Path

from lingjing.data import data_path
from lingjing.errors import UsageError
from lingjing.suggest import nearest_or

LONGEST_SHOWN = 300
"""Characters of a name in a message."""


def find_mission(word: str) -> Path:
    """A file that is there wins; else a shipped mission by name (`ssr`, `scenarios/ssr.ljs`, `reset/ssr-001.json`).

    Raises `UsageError` if neither is there. `-` stays what it is: standard input.
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
    """The names of the missions that come with the package, sorted."""
    return tuple(sorted(path.stem for path in data_path("scenarios").glob("*.ljs")))


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except OSError:  # a name longer than any file system takes
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
