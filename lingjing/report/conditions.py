"""What the conditions of a study change: options of its policies by which ablations, prompts and interventions are told
apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from lingjing.bench.played import grouped
from lingjing.bench.rows import SuiteRow
from lingjing.report.evidence import ReportStudy

PROMPT, INTERVENTION = "prompt", "intervention"


class VariedColumn(NamedTuple):
    """The rows of one mission and mode, with the options of policies that differ among its conditions."""

    mission: str
    mode: str
    rows: tuple[SuiteRow, ...]
    options: frozenset[str]

    def conditions(self, *, of: str = "") -> dict[tuple[str, str], list[SuiteRow]]:
        """The rows by entrant and condition: those that were given the option `of`, or, without it, those that were
        given no prompt and no intervention where these differ."""
        apart = {PROMPT, INTERVENTION} & self.options
        kept = [
            row for row in self.rows
            if (of in row.options.policy_args if of else not apart & set(row.options.policy_args))
        ]  # fmt: skip
        return grouped(kept, lambda row: (row.entrant, row.condition))


def varied_columns(study: ReportStudy) -> Iterator[VariedColumn]:
    """Every mission and mode of a study in which options differ."""
    for (mission, mode), rows in study.by(lambda row: (row.mission, row.mode)).items():
        options = frozenset(name for own in grouped(rows, lambda row: row.entrant).values() for name in _differing(own))
        if options:
            yield VariedColumn(mission, mode, tuple(rows), options)


def _differing(rows: Sequence[SuiteRow]) -> Iterator[str]:
    """Names of options that change from condition to condition."""
    each = [own[0].options.policy_args for own in grouped(rows, lambda row: row.condition).values()]
    for name in sorted({name for one in each for name in one}):
        if len({repr(one.get(name)) for one in each}) > 1:
            yield name


__all__ = ["INTERVENTION", "PROMPT", "VariedColumn", "varied_columns"]
