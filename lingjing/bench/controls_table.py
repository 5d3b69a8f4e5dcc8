"""The table of control experiments, which shows whether the success of a player depends on what pictures show.

The *player* is the entrant with the true boxes of its requests (`sighted-reader`). Its *levels* are entrants of the
same policy from which a share of the boxes is withheld. All other entrants are *controls*: black pictures, those of
another seed, guesses. A column depends on perception if success falls with the withheld share, and if the player's TSR
is at least `REQUIRED` above that of the best control.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lingjing.bench.played import Played, columns_of, grouped
from lingjing.bench.rows import SuiteRow
from lingjing.bench.statistics import difference_bounds, trend
from lingjing.bench.table_cells import ABSENT, ResultCell, ResultLine, ResultTable, percent, plain, probability, ranged
from lingjing.dsl.loading.load import load_mission
from lingjing.dsl.loading.shipped import find_mission
from lingjing.errors import LingjingError

PLAYER = "sighted-reader"
"""The policy with the true boxes of its requests."""
SHARE = "withheld"
"""The option of `PLAYER`: the share of the true boxes that are withheld from it, 0 to 1."""
PERCEPTION = "perception"
"""The capability tag of missions that need visual perception."""
REQUIRED = 50.0
"""Percentage points by which the player's TSR is to be above that of the best control, where a mission has the tag."""


def controls_table(rows: Sequence[SuiteRow], title: str) -> Iterable[ResultTable]:
    """Yield the table: a line for each column; none without an entrant of the player with all boxes."""
    for condition, some in grouped(rows, lambda row: row.condition).items():
        levels = sorted({_share(row) for row in some if _is_player(row)})
        if not levels or levels[0] != 0.0:
            continue
        controls = tuple(dict.fromkeys(row.entrant for row in some if not _is_player(row)))
        shares = [f"{100 * level:.0f} % withheld" if level else "All boxes" for level in levels]
        heads = (*shares, "Trend p", *controls, "Above the best control", "Required", "Met")
        lines = [
            ResultLine("", (f"{mission}-{mode}",), tuple(_cells(own, mission, levels, controls)))
            for mission, mode in columns_of(some)
            if (own := [row for row in some if (row.mission, row.mode) == (mission, mode)])
        ]
        note = (
            "TSR in %; trend: exact one-sided permutation test within seeds over the withheld shares, on seeds with "
            "all shares; difference: percentage points with Newcombe's 95 % interval; required where the mission has "
            f"the capability tag `{PERCEPTION}`"
        )
        heading = title or "Controls"
        yield ResultTable(
            "controls", f"{heading}: {condition}" if condition else heading, ("Column",), heads, tuple(lines), (note,)
        )


def _cells(
    rows: Sequence[SuiteRow], mission: str, levels: Sequence[float], controls: Sequence[str]
) -> Iterable[ResultCell]:
    by_level = {level: [row for row in rows if _is_player(row) and _share(row) == level] for level in levels}
    yield from (percent(Played.of(own).rate()) for own in by_level.values())
    yield _trend_cell(by_level)
    by_control = {name: [row for row in rows if row.entrant == name] for name in controls}
    yield from (percent(Played.of(own).rate()) for own in by_control.values())
    counts = [_counts(own) for own in by_control.values() if own]
    player = _counts(by_level[0.0])
    if not counts or not player[1]:
        yield from (ResultCell(ABSENT),) * 3
        return
    best = max(counts, key=lambda pair: pair[0] / pair[1])
    difference = player[0] / player[1] - best[0] / best[1]
    yield ranged(difference, difference_bounds(player, best))
    if not _needs_perception(mission):
        yield from (ResultCell(ABSENT),) * 2
        return
    yield plain(REQUIRED, ".0f")
    yield ResultCell("yes" if 100.0 * difference >= REQUIRED else "no")


def _trend_cell(by_level: dict[float, list[SuiteRow]]) -> ResultCell:
    """Return the p value of the trend over the seeds that were played at all levels."""
    won = [{row.seed: row.report.success for row in own} for own in by_level.values()]
    seeds = sorted(set.intersection(*(set(each) for each in won)))
    if len(won) < 2 or not seeds:
        return ResultCell(ABSENT)
    return probability(trend([[each[seed] for each in won] for seed in seeds]))


def _counts(rows: Sequence[SuiteRow]) -> tuple[int, int]:
    return sum(row.report.success for row in rows), len(rows)


def _is_player(row: SuiteRow) -> bool:
    options = row.options
    return options.policy == PLAYER and not options.blank_pictures and not options.swap_pictures


def _share(row: SuiteRow) -> float:
    value = row.options.policy_args.get(SHARE, 0.0)
    return float(value) if isinstance(value, int | float) else 0.0


def _needs_perception(mission: str) -> bool:
    """True if the mission has the tag. A mission that is not there any more has none."""
    try:
        return PERCEPTION in load_mission(find_mission(mission)).capabilities
    except LingjingError:
        return False


__all__ = ["controls_table"]
