"""What a report is made of: rows of episodes by study, traces that can be opened, what other verbs measured."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from pathlib import Path
from typing import NamedTuple, TypeVar

import msgspec

from lingjing.bench.frame_sets.probe import ProbeCell
from lingjing.bench.played import grouped
from lingjing.bench.prompt_search import PromptCandidate
from lingjing.bench.rows import SuiteRow

KeyT = TypeVar("KeyT", bound=Hashable)


class ReportStudy(msgspec.Struct, frozen=True, kw_only=True):
    """The episodes of one suite, or of all traces that are no suite's; `name` and `title` are empty for these.

    `rows` are the counted ones by column in the paper's order, then as the suite lists who played and under what;
    `all_rows` are those of every standing.
    """

    name: str
    title: str
    rows: tuple[SuiteRow, ...]
    all_rows: tuple[SuiteRow, ...]

    def by(self, key: Callable[[SuiteRow], KeyT]) -> dict[KeyT, list[SuiteRow]]:
        """The counted rows by what a function says of each."""
        return grouped(self.rows, key)

    def numbers(self) -> Callable[[SuiteRow], int]:
        """What gives the place of a row's entrant, with its condition where that is no baseline, among the plain rows:
        by it all charts of the study tell it apart."""
        places = {_key(one): (one.entrant_place, one.condition_place) for one in self.plain}
        order = {key: at for at, key in enumerate(sorted(places, key=lambda key: (places[key], key)))}
        return lambda row: order[_key(row)]

    @property
    def plain(self) -> tuple[SuiteRow, ...]:
        """The counted rows without a condition and those of baselines; all where there are neither."""
        return tuple(row for row in self.rows if row.baseline or not row.condition) or self.rows


def _key(row: SuiteRow) -> tuple[str, str]:
    return row.entrant, "" if row.baseline else row.condition


class TracedEpisode(NamedTuple):
    """A row whose trace can be opened."""

    path: Path
    row: SuiteRow


class PromptTrial(NamedTuple):
    """A search for a better prompt: its folder's name, and its candidates in order."""

    name: str
    candidates: tuple[PromptCandidate, ...]


class FrameProbe(NamedTuple):
    """What detectors said of frames and of their twins: the folder's name, and the counts."""

    name: str
    cells: tuple[ProbeCell, ...]


class TwinFolders(NamedTuple):
    """A set of frames, and a folder of their twins."""

    frames: Path
    twins: Path


class ReportEvidence(msgspec.Struct, frozen=True, kw_only=True):
    """Everything that figures may show. `left_out` says, a line each, what was found and is in none of them."""

    studies: tuple[ReportStudy, ...] = ()
    traced: tuple[TracedEpisode, ...] = ()
    searches: tuple[PromptTrial, ...] = ()
    probes: tuple[FrameProbe, ...] = ()
    twins: tuple[TwinFolders, ...] = ()
    left_out: tuple[str, ...] = ()

    def played(self) -> Iterator[ReportStudy]:
        """The studies in which an episode counts."""
        return (study for study in self.studies if study.rows)

    @property
    def episodes(self) -> int:
        """How many count."""
        return sum(len(study.rows) for study in self.studies)


__all__ = [
    "FrameProbe", "PromptTrial", "ReportEvidence", "ReportStudy", "TracedEpisode", "TwinFolders",
]  # fmt: skip
