"""Options of policies that differ among the conditions of a study: ablations, prompts and interventions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from lingjing.bench.played import grouped
from lingjing.bench.rows import SuiteRow
from lingjing.report.evidence import ReportStudy

PROMPT, INTERVENTION = "prompt", "intervention"
"""Options that have figures of their own, apart from ablations."""


class VariedColumn(NamedTuple):
    """The rows of one mission and mode in which options of policies differ."""

    mission: str
    """Name of the mission."""

    mode: str
    """The communication mode."""

    rows: tuple[SuiteRow, ...]
    """All counted rows of that mission and mode."""

    options: frozenset[str]
    """Names of the options that differ."""

    def conditions(self, *, of: str = "") -> dict[tuple[str, str], list[SuiteRow]]:
        """Return the rows by entrant and condition.

        With `of`, only rows that set this option; without it, only rows that set neither a prompt nor an intervention,
        as far as these differ.
        """
        apart = {PROMPT, INTERVENTION} & self.options
        kept = [
            row for row in self.rows
            if (of in row.options.policy_args if of else not apart & set(row.options.policy_args))
        ]  # fmt: skip
        return grouped(kept, lambda row: (row.entrant, row.condition))


def varied_columns(study: ReportStudy) -> Iterator[VariedColumn]:
    """Yield every mission and mode of a study in which options differ."""
    for (mission, mode), rows in study.by(lambda row: (row.mission, row.mode)).items():
        options = frozenset(name for own in grouped(rows, lambda row: row.entrant).values() for name in _differing(own))
        if options:
            yield VariedColumn(mission, mode, tuple(rows), options)


def _differing(rows: Sequence[SuiteRow]) -> Iterator[str]:
    """Yield the names of options that change from condition to condition."""
    settings = [own[0].options.policy_args for own in grouped(rows, lambda row: row.condition).values()]
    for name in sorted({name for options in settings for name in options}):
        if len({repr(options.get(name)) for options in settings}) > 1:
            yield name


__all__ = ["INTERVENTION", "PROMPT", "VariedColumn", "varied_columns"]
