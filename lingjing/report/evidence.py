"""The evidence of a report: rows of episodes by study, traces, and measurements of other commands."""

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
    """The episodes of one suite, or those of all single traces."""

    name: str
    """Name of the suite; empty for single traces."""

    title: str
    """Title of the suite; empty for single traces."""

    rows: tuple[SuiteRow, ...]
    """The counted rows: by column in the paper's order, then by entrant, condition and seed as the suite lists them."""

    all_rows: tuple[SuiteRow, ...]
    """The rows of every standing, lost and aborted episodes among them."""

    def by(self, key: Callable[[SuiteRow], KeyT]) -> dict[KeyT, list[SuiteRow]]:
        """Return the counted rows grouped by the values of a function."""
        return grouped(self.rows, key)

    def numbers(self) -> Callable[[SuiteRow], int]:
        """Return a function that numbers the series of plain rows, the same in all charts of the study.

        A series is an entrant, together with its condition if that is no baseline.
        """
        places = {_key(row): (row.entrant_place, row.condition_place) for row in self.plain}
        order = {key: at for at, key in enumerate(sorted(places, key=lambda key: (places[key], key)))}
        return lambda row: order[_key(row)]

    @property
    def plain(self) -> tuple[SuiteRow, ...]:
        """The counted rows without a condition and those of baselines; all counted rows if there are neither."""
        return tuple(row for row in self.rows if row.baseline or not row.condition) or self.rows


def _key(row: SuiteRow) -> tuple[str, str]:
    return row.entrant, "" if row.baseline else row.condition


class TracedEpisode(NamedTuple):
    """An episode with a trace."""

    path: Path
    """Path of the trace."""

    row: SuiteRow
    """Row of the episode."""


class PromptTrial(NamedTuple):
    """A search for a better prompt."""

    name: str
    """Name of its folder."""

    candidates: tuple[PromptCandidate, ...]
    """Its candidates, in the order in which they were tried."""


class FrameProbe(NamedTuple):
    """The answers of detectors on frames and on their twins."""

    name: str
    """Name of the probe's folder."""

    cells: tuple[ProbeCell, ...]
    """Counts of each class and detector."""


class TwinFolders(NamedTuple):
    """A set of frames together with their twins."""

    frames: Path
    """Folder of the frames."""

    twins: Path
    """Folder of the twins."""


class ReportEvidence(msgspec.Struct, frozen=True, kw_only=True):
    """Everything that figures may show."""

    studies: tuple[ReportStudy, ...] = ()
    """Suites in the order of their folders, then the study of single traces."""

    traced: tuple[TracedEpisode, ...] = ()
    """Counted episodes with a trace."""

    searches: tuple[PromptTrial, ...] = ()
    """Searches for a prompt."""

    probes: tuple[FrameProbe, ...] = ()
    """Probes of detectors."""

    twins: tuple[TwinFolders, ...] = ()
    """Sets of frames with twins."""

    left_out: tuple[str, ...] = ()
    """One line for each kind of trace that is in no figure, with the reason."""

    def played(self) -> Iterator[ReportStudy]:
        """Return the studies with counted episodes."""
        return (study for study in self.studies if study.rows)

    @property
    def episodes(self) -> int:
        """The number of counted episodes."""
        return sum(len(study.rows) for study in self.studies)


__all__ = [
    "FrameProbe", "PromptTrial", "ReportEvidence", "ReportStudy", "TracedEpisode", "TwinFolders",
]  # fmt: skip
