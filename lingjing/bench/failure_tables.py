"""The paper's tables of failure families and of drift, that is, of the change of agents' actions along an episode.

Shares of families are balanced as in the paper: computed within each entrant, mission, mode and condition, averaged
over a mission's modes, then over missions and entrants with equal weight. Rates by tercile are pooled over actions.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from statistics import fmean

from lingjing.analysis.families import FAMILIES, FailureFamily
from lingjing.bench.played import Played, columns_of, grouped
from lingjing.bench.rows import SuiteRow
from lingjing.bench.table_cells import ABSENT, PRIVILEGED, ResultCell, ResultLine, ResultTable, percent, plain, titled

FamilyShares = Mapping[FailureFamily, float]
"""Shares of lost episodes by family; they sum to 1."""

UNGROUPED = "All"
"""The heading of entrants without a group, if no entrant has one."""

OTHERS = "Others"
"""The heading of entrants without a group, if others have one."""

FAMILY_NAMES: Mapping[FailureFamily, str] = {
    "perception_miss": "Perception miss",
    "object_confusion": "Object confusion",
    "localisation_error": "Localization error",
    "context_drift": "Long-context drift",
    "coordination_deadlock": "Coordination deadlock",
    "handoff_break": "Handoff or dependency break",
    "unattributed": "Unattributed",
}
"""The paper's names, in its order; `unattributed` (no rule applies) is last."""

_NOTE = "one family per lost episode: that of the earliest breakdown in the trace (docs/traces.md)"


def failure_tables(rows: Sequence[SuiteRow], title: str) -> Iterable[ResultTable]:
    """Yield shares by group of entrants, balanced over missions and entrants; then shares by entrant and column."""
    lost = [row for row in rows if row.report.family is not None]
    competing = _by_tier([row for row in lost if not row.privileged])
    if competing:
        yield _balanced(competing, title)
    lines = []
    for (_, condition), own in grouped(lost, lambda row: (row.entrant, row.condition)).items():
        for column in columns_of(own):
            few = [row for row in own if (row.mission, row.mode) == column]
            shares = Played.of(few).families()
            cells = (ResultCell(str(len(few)), len(few)), *(percent(shares[family]) for family in FAMILY_NAMES))
            lines.append(ResultLine(own[0].group, (_label(own[0], condition), few[0].column), cells))
    yield ResultTable(
        "failures", titled(title, "failure families of each entrant (%)"), ("Entrant", "Column"),
        ("Lost", *FAMILY_NAMES.values()), tuple(lines), (_NOTE,),
    )  # fmt: skip


def _balanced(tiers: Mapping[str, Sequence[SuiteRow]], title: str) -> ResultTable:
    by_mission = {tier: _by_mission(own) for tier, own in tiers.items()}
    means = {tier: _mean(list(each.values())) for tier, each in by_mission.items()}
    lines = [
        ResultLine(
            "", (name,), (*(percent(means[tier][family]) for tier in tiers), _most_in(family, by_mission.values()))
        )
        for family, name in FAMILY_NAMES.items()
    ]
    heads = (*(f"{tier} (n = {len(own)})" for tier, own in tiers.items()), "Most in")
    note = (
        f"{_NOTE}; shares within each entrant, mission and mode, averaged over modes, then over missions and entrants"
    )
    return ResultTable(
        "failures", titled(title, "failure families (%)"), ("Failure family",), heads, tuple(lines), (note,)
    )


def _by_mission(rows: Sequence[SuiteRow]) -> dict[tuple[str, str, str], FamilyShares]:
    """Return the shares of every entrant, condition and mission: the mean over the modes with lost episodes."""
    cells = grouped(rows, lambda row: (row.entrant, row.condition, row.mission))
    return {key: _mean([Played.of(few).families() for few in grouped(own, lambda row: row.mode).values()])
            for key, own in cells.items()}  # fmt: skip


def _mean(shares: Sequence[FamilyShares]) -> FamilyShares:
    return {family: fmean(each[family] for each in shares) for family in FAMILIES}


def _most_in(family: FailureFamily, tiers: Iterable[Mapping[tuple[str, str, str], FamilyShares]]) -> ResultCell:
    """Return the two missions with the highest mean share of the family."""
    missions: dict[str, list[float]] = {}
    for each in tiers:
        for (_, _, mission), shares in each.items():
            missions.setdefault(mission, []).append(shares[family])
    ranked = sorted((-fmean(shares), name) for name, shares in missions.items() if any(shares))
    return ResultCell(", ".join(name.upper() for _, name in ranked[:2]) or ABSENT)


def drift_table(rows: Sequence[SuiteRow], title: str) -> Iterable[ResultTable]:
    """Yield adherence, repetition, out of bounds and forgotten subgoals by tercile of each agent's actions: for every
    group of entrants, then for every entrant.
    """
    reported = [row for row in rows if row.report.terciles]
    lines = []
    for tier, own in _by_tier([row for row in reported if not row.privileged]).items():
        lines += _thirds("", tier, own)
    for (_, condition), own in grouped(reported, lambda row: (row.entrant, row.condition)).items():
        lines += _thirds(own[0].group or OTHERS, _label(own[0], condition), own)
    heads = ("Actions", "Adher.", "Repeat", "OOB", "Forgot")
    note = (
        "each agent's actions of an episode in three equal parts, pooled; repetition is over actions with a predecessor"
    )
    yield ResultTable("drift", titled(title, "actions by tercile (%)"), ("", "Ctx."), heads, tuple(lines), (note,))


def _thirds(group: str, name: str, rows: Sequence[SuiteRow]) -> list[ResultLine]:
    lines = []
    for third, counts in Played.of(rows).terciles().items():
        rates = counts.rates()
        values = (rates.adherence, rates.repetition, rates.out_of_bounds, rates.forgotten)
        cells = (plain(counts.actions, ".0f"), *map(percent, values))
        lines.append(ResultLine(group, (name, third.capitalize()), cells))
    return lines


def _by_tier(rows: Sequence[SuiteRow]) -> dict[str, list[SuiteRow]]:
    none = OTHERS if any(row.group for row in rows) else UNGROUPED
    return grouped(rows, lambda row: row.group or none)


def _label(row: SuiteRow, condition: str) -> str:
    name = f"{row.entrant} {PRIVILEGED}" if row.privileged else row.entrant
    return f"{name} ({condition})" if condition else name


__all__ = ["FAMILY_NAMES", "drift_table", "failure_tables"]
