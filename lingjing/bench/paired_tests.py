"""Paired tests on matched instances, between entrants, conditions and modes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations

from lingjing.bench.played import grouped
from lingjing.bench.rows import SuiteRow
from lingjing.bench.statistics import PairedTest, holm, mcnemar
from lingjing.bench.table_cells import (
    ResultCell,
    ResultLine,
    ResultTable,
    is_out_of_competition,
    probability,
    titled,
)


def paired_tests(rows: Sequence[SuiteRow], title: str) -> Iterable[ResultTable]:
    """Yield McNemar's test of every pair of entrants, or of conditions of one entrant, on common instances, and of the
    two modes of a mission. Each of the two families is corrected for its number of tests. Privileged entrants and
    entrants with open episodes are excluded.
    """
    competing = [row for row in rows if not row.privileged and not is_out_of_competition(row.entrant)]
    entrants = grouped(competing, lambda row: (row.entrant, row.condition))
    pairs = [
        (_label(first), _label(second), mcnemar(*(_won(some) for some in (own, others))))
        for (first, own), (second, others) in combinations(entrants.items(), 2)
        if first[0] == second[0] or first[1] == second[1]  # compare either entrants or conditions
    ]
    modes = []
    for (entrant, condition, mission), own in grouped(
        competing, lambda row: (row.entrant, row.condition, row.mission)
    ).items():
        both = [_won((row for row in own if row.mode == mode), by_seed=True) for mode in ("star", "broadcast")]
        names = [f"{_label((entrant, condition))}, {mission.upper()} {mode}" for mode in ("star", "broadcast")]
        modes.append((names[0], names[1], mcnemar(*both)))
    lines = (*_tested("Entrants and conditions", pairs), *_tested("Modes", modes))
    heads = ("Instances", "Only first won", "Only second won", "p", "p (Holm)")
    note = "McNemar's exact test over instances that both have played; Holm corrects for the tests under a heading"
    yield ResultTable("paired", titled(title, "paired tests"), ("First", "Second"), heads, lines, (note,))


def _won(rows: Iterable[SuiteRow], *, by_seed: bool = False) -> dict[tuple[str, int], bool]:
    """Return the success of each instance by column and seed. A seed is the same instance in both modes of a mission
    (`by_seed`).
    """
    return {("" if by_seed else row.column, row.seed): row.report.success for row in rows}


def _tested(group: str, tests: Iterable[tuple[str, str, PairedTest]]) -> list[ResultLine]:
    matched = [item for item in tests if item[2].pairs]
    corrected = holm([test.p for _, _, test in matched])
    return [
        ResultLine(group, (first, second), (*_counts(test), probability(test.p), probability(p)))
        for (first, second, test), p in zip(matched, corrected, strict=True)
    ]


def _counts(test: PairedTest) -> Iterable[ResultCell]:
    return (ResultCell(str(number), number) for number in (test.pairs, test.only_first, test.only_second))


def _label(key: tuple[str, str]) -> str:
    entrant, condition = key
    return f"{entrant} ({condition})" if condition else entrant


__all__ = ["paired_tests"]
