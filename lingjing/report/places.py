"""What lies at the places that a reader names: results of suites, traces, searches for prompts, probes, frame sets."""

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
"""What a probe's folder holds."""

_TRACES = (".mcap", ".mcap.part")


@dataclass(slots=True)
class FoundPlaces:
    """Folders and files by what they hold; `named` are traces that were named themselves, not found in a folder."""

    results: list[Path] = field(default_factory=list)
    traces: list[Path] = field(default_factory=list)
    named: set[Path] = field(default_factory=set)
    searches: list[Path] = field(default_factory=list)
    probes: list[Path] = field(default_factory=list)
    twins: list[Path] = field(default_factory=list)
    frames: list[Path] = field(default_factory=list)

    def count(self) -> int:
        """How many of all kinds."""
        return sum(map(len, (self.results, self.traces, self.searches, self.probes, self.twins, self.frames)))


def find_places(places: Iterable[Path]) -> FoundPlaces:
    """Look through places; folders are gone through, but not what lies inside of results and searches.

    Raises `UsageError` for a place that is not there or holds nothing of use.
    """
    found = FoundPlaces()
    for place in places:
        before = found.count()
        if place.is_dir():
            _walk(place, found)
        elif not place.exists():
            raise UsageError(f"there is no `{place}`", hint="name traces, folders of runs, or results of suites")
        elif place.suffix == ".parquet":
            found.results.append(place)
        else:
            found.traces.append(place)
            found.named.add(place)
        if found.count() == before:
            raise UsageError(
                f"`{place}` holds no trace and no results",
                hint="`lingjing run` writes traces, `lingjing bench` results; name their folders",
            )
    for name in ("results", "traces", "searches", "probes", "twins", "frames"):
        setattr(found, name, _each_once(getattr(found, name)))
    return found


def _walk(top: Path, found: FoundPlaces) -> None:
    for root, folders, files in os.walk(top):
        here = Path(root)
        folders.sort()
        if RESULTS in files or any(here.joinpath(PARTS).glob("*.parquet")):
            found.results.append(here)
            folders.clear()  # what lies there is told by its rows
            continue
        if SEARCH in files and any(here.glob("candidate-*.txt")):
            found.searches.append(here)
            folders.clear()
            continue
        if ANSWERS in files:
            found.probes.append(here)
        if TWINS in files:
            found.twins.append(here)
        if any(here.glob(f"*/{FRAMES}")):
            found.frames.append(here)
        found.traces += (here / name for name in sorted(files) if name.endswith(_TRACES))


def _each_once(paths: Iterable[Path]) -> list[Path]:
    """Each file or folder once, whatever it is called, in order of names."""
    once: dict[Path, Path] = {}
    for path in paths:
        once.setdefault(path.resolve(), path)
    return sorted(once.values())


__all__ = ["ANSWERS", "FoundPlaces", "find_places"]
