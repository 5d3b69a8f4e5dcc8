"""Paired tests on matched instances: entrants, conditions and modes against each other."""

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
    """McNemar's test of every two entrants, or conditions of one, on the instances that both have played, and of the
    two modes of a mission. Each of the two families is corrected for its number of tests. Entrants that were shown the
    truth, or have open episodes, are left out."""
    competing = [row for row in rows if not row.privileged and not is_out_of_competition(row.entrant)]
    entrants = grouped(competing, lambda row: (row.entrant, row.condition))
    pairs = [
        (_called(first), _called(second), mcnemar(*(_won(some) for some in (own, others))))
        for (first, own), (second, others) in combinations(entrants.items(), 2)
        if first[0] == second[0] or first[1] == second[1]  # one thing differs
    ]
    modes = []
    for (entrant, condition, mission), own in grouped(
        competing, lambda row: (row.entrant, row.condition, row.mission)
    ).items():
        both = [_won((row for row in own if row.mode == mode), by_seed=True) for mode in ("star", "broadcast")]
        names = [f"{_called((entrant, condition))}, {mission.upper()} {mode}" for mode in ("star", "broadcast")]
        modes.append((names[0], names[1], mcnemar(*both)))
    lines = (*_tested("Entrants and conditions", pairs), *_tested("Modes", modes))
    heads = ("Instances", "Only first won", "Only second won", "p", "p (Holm)")
    note = "McNemar's exact test over instances that both have played; Holm corrects for the tests under a heading"
    yield ResultTable("paired", titled(title, "paired tests"), ("First", "Second"), heads, lines, (note,))


def _won(rows: Iterable[SuiteRow], *, by_seed: bool = False) -> dict[tuple[str, int], bool]:
    """Who won which instance; a seed is the same one in both modes of a mission."""
    return {("" if by_seed else row.column, row.seed): row.report.success for row in rows}


def _tested(group: str, found: Iterable[tuple[str, str, PairedTest]]) -> list[ResultLine]:
    matched = [one for one in found if one[2].pairs]
    corrected = holm([test.p for _, _, test in matched])
    return [
        ResultLine(group, (first, second), (*_counts(test), probability(test.p), probability(p)))
        for (first, second, test), p in zip(matched, corrected, strict=True)
    ]


def _counts(test: PairedTest) -> Iterable[ResultCell]:
    return (ResultCell(str(number), number) for number in (test.pairs, test.only_first, test.only_second))


def _called(key: tuple[str, str]) -> str:
    entrant, condition = key
    return f"{entrant} ({condition})" if condition else entrant


__all__ = ["paired_tests"]
