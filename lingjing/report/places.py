"""The contents of places, by kind: results of suites, traces, searches for prompts, probes, frames and twins."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from lingjing.bench.folder import PARTS, RESULTS
from lingjing.bench.frame_sets.folder import FRAMES
from lingjing.bench.frame_sets.twins import TWINS
from lingjing.bench.prompt_search import RESULTS as SEARCH
from lingjing.errors import UsageError

ANSWERS = "answers.jsonl"
"""File by which the folder of a probe is recognised."""

_TRACES = (".mcap", ".mcap.part")


@dataclass(slots=True)
class PlaceContents:
    """Folders and files by kind, each once and in the order of their paths."""

    results: list[Path] = field(default_factory=list)
    """Folders of suites, and single Parquet files of rows."""

    traces: list[Path] = field(default_factory=list)
    """Traces outside of suites."""

    named: set[Path] = field(default_factory=set)
    """Traces that the user named directly, not as a part of a folder."""

    searches: list[Path] = field(default_factory=list)
    """Folders of searches for a prompt."""

    probes: list[Path] = field(default_factory=list)
    """Folders of probes."""

    twins: list[Path] = field(default_factory=list)
    """Folders of twins."""

    frames: list[Path] = field(default_factory=list)
    """Folders of sets of frames."""

    def count(self) -> int:
        """Return the number of entries of all kinds."""
        return sum(map(len, (self.results, self.traces, self.searches, self.probes, self.twins, self.frames)))


def find_places(places: Iterable[Path]) -> PlaceContents:
    """Search places, folders with all their subfolders except those of results and searches.

    Raises `UsageError` for a place that does not exist or holds nothing of use.
    """
    contents = PlaceContents()
    for place in places:
        before = contents.count()
        if place.is_dir():
            _walk(place, contents)
        elif not place.exists():
            raise UsageError(f"there is no `{place}`", hint="name traces, folders of runs, or results of suites")
        elif place.suffix == ".parquet":
            contents.results.append(place)
        else:
            contents.traces.append(place)
            contents.named.add(place)
        if contents.count() == before:
            raise UsageError(
                f"`{place}` holds no trace and no results",
                hint="`lingjing run` writes traces, `lingjing bench` results; name their folders",
            )
    for name in ("results", "traces", "searches", "probes", "twins", "frames"):
        setattr(contents, name, _each_once(getattr(contents, name)))
    return contents


def _walk(top: Path, contents: PlaceContents) -> None:
    for root, folders, files in os.walk(top):
        here = Path(root)
        folders.sort()
        if RESULTS in files or any(here.joinpath(PARTS).glob("*.parquet")):
            contents.results.append(here)
            folders.clear()  # its rows count, and its traces belong to these rows
            continue
        if SEARCH in files and any(here.glob("candidate-*.txt")):
            contents.searches.append(here)
            folders.clear()
            continue
        if ANSWERS in files:
            contents.probes.append(here)
        if TWINS in files:
            contents.twins.append(here)
        if any(here.glob(f"*/{FRAMES}")):
            contents.frames.append(here)
        contents.traces += (here / name for name in sorted(files) if name.endswith(_TRACES))


def _each_once(paths: Iterable[Path]) -> list[Path]:
    """Return each file or folder once, though it was reached by several paths, in the order of names."""
    once: dict[Path, Path] = {}
    for path in paths:
        once.setdefault(path.resolve(), path)
    return sorted(once.values())


__all__ = ["ANSWERS", "PlaceContents", "find_places"]
