"""The paper's tables from a suite's rows, with marks for the best and the second best value.

`TABLES` holds the kinds of tables; each is a function of rows. Aborted tries are in no table. Lost episodes are in no
rate; a note lists them, and the rates of their entrant are followed by the worst and the best case. Entrants with lost
episodes and privileged entrants are never marked. Shares are in per cent. A dash stands for a cell without episodes,
N/A for an undefined number.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from lingjing.analysis.behaviour import ActionCounts
from lingjing.analysis.shares import ConfidenceBounds, wilson
from lingjing.bench.controls_table import controls_table
from lingjing.bench.failure_tables import drift_table, failure_tables
from lingjing.bench.paired_tests import paired_tests
from lingjing.bench.played import Played, columns_of, grouped, mean_of
from lingjing.bench.rows import NEVER_BY_NUMBER, RowKey, SuiteRow, tiers_in_words
from lingjing.bench.statistics import (
    bootstrap,
    macro_average,
    macro_bounds,
)
from lingjing.bench.table_cells import (
    ABSENT,
    PRIVILEGED,
    UNRESOLVED,
    ResultCell,
    ResultLine,
    ResultTable,
    best_of,
    is_out_of_competition,
    marked,
    measure,
    percent,
    plain,
    ranged,
    titled,
    with_cases,
)
from lingjing.bench.unresolved import open_rows, unresolved_entrants, with_marked_names
from lingjing.play.report import POLICY_FAILED

FEWEST = 10
"""The smallest number of seeds per column for the interval of a macro average. Chosen: fewer seeds do not show the
variation.
"""


def make_tables(rows: Sequence[SuiteRow], kinds: Iterable[str], title: str = "") -> tuple[ResultTable, ...]:
    """Return the tables of these kinds, without empty ones. Raises `KeyError` for an unknown kind."""
    left_open = open_rows(rows)
    unresolved = frozenset(row.entrant for row in left_open)
    counted = [row for row in rows if row.standing == "counted"]
    listed = sorted(with_marked_names([*counted, *left_open], unresolved), key=_place)
    named = [row for row in listed if row.standing == "counted"]
    made = (table for kind in kinds for table in TABLES[kind](listed if kind in _WITH_CASES else named, title))
    notes = standing_notes(rows)
    return tuple(table._replace(notes=(*table.notes, *notes)) for table in made if table.lines)


def _place(row: SuiteRow) -> tuple[int, int, int]:
    return row.entrant_place, row.condition_place, row.seed


def standing_notes(rows: Sequence[SuiteRow]) -> tuple[str, ...]:
    """Return the notes below every table: numbers of counted, aborted and lost episodes, and the meaning of marks."""
    counted = [row for row in rows if row.standing == "counted"]
    over = {(*row.cell, row.seed) for row in rows if row.standing != "aborted"}
    tries = [row for row in rows if row.standing == "aborted"]
    aborted = sum((*row.cell, row.seed) in over for row in tries)
    lost = sorted(row.key for row in rows if row.standing == "lost")
    aborts = "abort was played again with its seed" if aborted == 1 else "aborts were played again with their seeds"
    again = f"; {aborted} infrastructure {aborts}" if aborted else ""
    again += f"; {len(tries) - aborted} aborted without a later result" if len(tries) > aborted else ""
    notes = [f"{len(counted)} {'episode is' if len(counted) == 1 else 'episodes are'} counted{again}"]
    if lost:
        notes.append(f"{len(lost)} are lost (aborted {lost[0][5]} times) and in no rate: {_named(lost)}")
    failed = sorted(row.key for row in counted if row.report.reason == POLICY_FAILED)
    if failed:
        notes.append(f"{len(failed)} did not begin, because a policy failed, and count as failures: {_named(failed)}")
    if replaced := _replaced_answers(counted):
        notes.append(f"answers of policies replaced by doing nothing: {replaced}")
    notes.extend(_changed_models(counted))
    notes.extend(_tier_notes(counted))
    codes = {row.code for row in rows}
    if len(codes) > 1:
        notes.append(f"the rows were played by {len(codes)} versions of the code")
    if any(row.privileged for row in rows):
        notes.append(f"{PRIVILEGED} observes the ground truth and is never marked as best")
    if unresolved_entrants(rows):
        notes.append(
            f"{UNRESOLVED} has episodes that were lost, or aborted without a later result, or played again after an "
            "abort that it may have caused (its own service, a process or a file of the episode failed): it is not "
            "ranked, and the worst and the best case follow its rates"
        )
    return tuple(notes)


def _changed_models(rows: Iterable[SuiteRow]) -> Iterator[str]:
    """Yield a note for each entrant with a service that named several models."""
    served: dict[str, Counter[str]] = {}
    for row in rows:
        if row.served:
            served.setdefault(row.entrant, Counter())[row.served] += 1
    for entrant, names in served.items():
        if len(names) > 1:
            listed = ", ".join(f"{name} in {number}" for name, number in names.items())
            yield f"the service of {entrant} changed its model: it named {listed} episodes"


def _tier_notes(rows: Iterable[SuiteRow]) -> Iterator[str]:
    """Yield the tier of each mission, if any is above 0, and how tier 0 compares with the paper."""
    missions = sorted({(row.tier, row.mission) for row in rows})
    if any(tier for tier, _ in missions):
        yield f"{tiers_in_words(missions)} (other tiers are harder than tier 0 and are never compared with it)"
    if any(tier == 0 for tier, _ in missions):
        yield NEVER_BY_NUMBER


def _named(keys: Sequence[RowKey]) -> str:
    """Return the names of the first episodes, and the number of the others."""
    named = ", ".join(f"{key[0]} {key[1]}-{key[2]}{key[3] and f' ({key[3]})'} seed {key[4]}" for key in keys[:8])
    return f"{named} and {len(keys) - 8} more" if len(keys) > 8 else named


def _replaced_answers(counted: Sequence[SuiteRow]) -> str:
    """Return the entrants with replaced answers, each with the number in all its counted episodes."""
    numbers: Counter[str] = Counter()
    for row in counted:
        if row.report.metrics is not None:
            numbers[row.entrant] += row.report.metrics.substitutions
    return ", ".join(f"{entrant} {number}" for entrant, number in numbers.items() if number)


# -- the kinds


def _success(rows: Sequence[SuiteRow], title: str) -> Iterable[ResultTable]:
    """Yield the paper's main table: TSR of every entrant in every column, and the macro average."""
    for condition, some in grouped(rows, lambda row: row.condition).items():
        columns = columns_of(some)
        lines = []
        for entrant, own in grouped(some, lambda row: row.entrant).items():
            cells = [rate_cell(_played(own, column)) for column in columns]
            lines.append(_line(own[0], (entrant,), (*cells, average_cell(own, columns))))
        heads = (*(column_head(mission, mode, columns) for mission, mode in columns), "Avg")
        named = titled(title or "Task success rate (TSR, %)", condition)
        whole = (*marked(lines, by_column=True), *_beside_rates(some, columns))
        yield ResultTable("success", named, ("Entrant",), heads, whole, _chance_notes(some))


def _beside_rates(rows: Sequence[SuiteRow], columns: Sequence[tuple[str, str]]) -> Iterator[ResultLine]:
    """Yield the lines beside the rates above tier 0: the precision of each entrant's reports, and the chance level.

    The chance level of a column is the best rate of an entrant with black pictures.
    """
    if not any(row.tier for row in rows):
        return
    hard = [row for row in rows if row.tier]
    for entrant, own in grouped(hard, lambda row: row.entrant).items():
        cells = [percent(_played(own, column).precision()) for column in columns]
        name = f"{entrant} {PRIVILEGED}" if own[0].privileged else entrant
        yield ResultLine(_PRECISION, (name,), (*cells, ResultCell(ABSENT)))
    blind = grouped([row for row in hard if row.options.blank_pictures], lambda row: row.entrant).values()
    rates = [[rate_cell(_played(own, column)) for own in blind] for column in columns]
    best = [max(cells, key=lambda cell: _finite(cell.value), default=ResultCell(ABSENT)) for cells in rates]
    yield ResultLine(_CHANCE, ("best with black pictures",), (*best, ResultCell(ABSENT)))


def _chance_notes(rows: Sequence[SuiteRow]) -> tuple[str, ...]:
    """Return a note if the chance level was not measured above tier 0."""
    hard = [row for row in rows if row.tier]
    if not hard or any(row.options.blank_pictures for row in hard):
        return ()
    return ("the chance level was not measured: no entrant with `blank_pictures` was played",)


_PRECISION = "Precision of reports (%)"
_CHANCE = "Chance level (TSR, %)"
"""Headings of the lines beside the rates above tier 0."""


def _intervals(rows: Sequence[SuiteRow], title: str) -> Iterable[ResultTable]:
    """Yield the main table with the counts and Wilson's interval of each rate, and a bootstrap interval of the
    average.
    """
    for condition, some in grouped(rows, lambda row: row.condition).items():
        columns = columns_of(some)
        lines = []
        for entrant, own in grouped(some, lambda row: row.entrant).items():
            cells = [_wilson_cell(_played(own, column)) for column in columns]
            cells.append(average_cell(own, columns, with_range=True))
            lines.append(_line(own[0], (entrant,), cells))
        heads = (*(column_head(mission, mode, columns) for mission, mode in columns), "Avg")
        named = titled(f"{title or 'Task success rate (TSR, %)'} with 95 % intervals", condition)
        note = (
            f"rates: Wilson's interval; Avg: bootstrap over {FEWEST} or more seeds, the same in all modes of a mission"
        )
        yield ResultTable("intervals", named, ("Entrant",), heads, tuple(lines), (note,))


def _modes(rows: Sequence[SuiteRow], title: str) -> Iterable[ResultTable]:
    """Yield the paper's table of communication modes on the same instances."""
    lines: list[ResultLine] = []
    entrants = grouped(rows, lambda row: (row.entrant, row.condition))
    for (entrant, condition), own in entrants.items():
        for mission, some in grouped(own, lambda row: row.mission).items():
            both = [Played.of(row for row in some if row.mode == mode) for mode in ("star", "broadcast")]
            if not all(played.episodes for played in both):
                continue
            group = "" if len(entrants) == 1 else f"{entrant}{condition and f', {condition}'}"
            for name, of, text, lower in _MODE_MEASURES:
                cells = [text(of(played)) for played in both]
                if not is_out_of_competition(entrant):
                    cells = list(best_of(cells, lower=lower, second=False))
                lines.append(ResultLine(group, (mission.upper(), name), tuple(cells)))
    named = titled(title, "communication modes")
    note = "bold marks the better mode; Gap is the mean over episodes in which it is defined, Rep is pooled over events"
    yield ResultTable("modes", named, ("Mission", "Metric"), ("Star", "Broadcast"), tuple(lines), (note,))


def _conditions(rows: Sequence[SuiteRow], title: str) -> Iterable[ResultTable]:
    """Yield ablations, sweeps, prompts and interventions: every condition of a mission for each entrant."""
    for (mission, mode), some in grouped(rows, lambda row: (row.mission, row.mode)).items():
        lines: list[ResultLine] = []
        stages = tuple(Played.of(some).steps())
        heads = ("n", "TSR", "TSR 95 %", "SCR", "SCR 95 %", "LocErr m", "Coverage", "JSON", "Cost x", *stages)
        for entrant, own in grouped(some, lambda row: row.entrant).items():
            group = entrant
            base = Played.of(row for row in own if row.baseline)
            each = grouped(own, lambda row: row.condition)
            measured = []
            for condition, few in each.items():
                played = Played.of(few)
                done = played.steps()
                measured.append((condition or "default", (
                    ResultCell(str(len(played.episodes)), len(played.episodes)), rate_cell(played),
                    _wilson_ends(played), percent(played.scr()), _bootstrap_ends(played),
                    plain(played.location_error_m(), ".1f"),
                    percent(played.mean("coverage")), percent(played.weighted("json_compliance", "answers")),
                    plain(played.cost_factor(base), ".2f"),
                    *(percent(done.get(stage, math.nan)) for stage in stages),
                )))  # fmt: skip
            lines += marked([ResultLine(group, (name,), cells) for name, cells in measured], only=(1, 3))
        named = f"{title or 'Conditions'}: {mission.upper()} ({mode})"
        note = (
            "TSR: Wilson's interval, SCR: bootstrap; stages are cumulative; LocErr is the median over "
            "all matched reports; JSON is pooled over all answers; Cost x compares tokens with the baseline"
        )
        if len({row.condition for row in some}) > 1 or len({row.condition for row in rows}) > 1:
            yield ResultTable("conditions", named, ("Condition",), heads, tuple(lines), (note,))


def _stages(rows: Sequence[SuiteRow], title: str) -> Iterable[ResultTable]:
    """Yield the cumulative success of stages, with the perception figures behind them."""
    for condition, some in grouped(rows, lambda row: row.condition).items():
        missions = grouped(some, lambda row: (row.entrant, row.mission, row.mode))
        names = tuple(dict.fromkeys(name for own in missions.values() for name in Played.of(own).stages()))
        farthest = max((_finite(Played.of(own).location_error_m()) for own in missions.values()), default=0.0)
        lines = []
        for (entrant, mission, mode), own in missions.items():
            played, done = Played.of(own), Played.of(own).stages()
            error = played.location_error_m()
            cells = (
                *(percent(done.get(name, math.nan)) for name in names),
                plain(1 - played.f1(), ".2f"), percent(played.perceived("missing")),
                plain(error, ".1f"), plain(error / farthest if farthest else math.nan, ".2f"),
                plain(played.calibration_error(), ".2f"),
            )  # fmt: skip
            lines.append(ResultLine(entrant, (f"{mission.upper()} ({mode})",), cells))
        heads = (*names, "1-F1", "Miss", "LocErr m", "LocErr norm.", "ECE")
        note = (
            "stages are cumulative; F1, Miss and ECE are pooled over pictures and reports, LocErr is the median over "
            "all matched reports, normalised by the largest"
        )
        yield ResultTable(
            "stages",
            titled(titled(title, "cumulative stage success"), condition),
            ("Mission",),
            heads,
            tuple(lines),
            (note,),
        )


def _behaviour(rows: Sequence[SuiteRow], title: str) -> Iterable[ResultTable]:
    """Yield the paper's behavioural signatures, as means over episodes, and rates of actions, pooled."""
    for condition, some in grouped(rows, lambda row: row.condition).items():
        lines = []
        for entrant, own in grouped(some, lambda row: row.entrant).items():
            played = Played.of(own)
            rates = sum(played.terciles().values(), ActionCounts()).rates()
            cells = (
                percent(played.mean("coverage")),
                plain(played.mean("first_discovery_tick"), ".1f"),
                percent(played.mean("redundant_revisits")),
                plain(played.mean("idle_fraction"), ".2f"),
                percent(played.mean("discovery_messages")),
                *map(percent, (rates.adherence, rates.repetition, rates.out_of_bounds, rates.forgotten)),
            )
            lines.append(_line(own[0], (entrant,), cells))
        heads = (
            "Coverage",
            "First discovery",
            "Revisits",
            "Idle",
            "Comm. at discovery",
            "Adher.",
            "Repeat",
            "OOB",
            "Forgot",
        )
        named = titled(titled(title, "behaviour"), condition)
        note = "first discovery is a tick, over episodes with one; actions of all episodes are pooled"
        yield ResultTable("behaviour", named, ("Entrant",), heads, marked(lines, lower=(1, 2, 3, 6, 7, 8)), (note,))


def _perception(rows: Sequence[SuiteRow], title: str) -> Iterable[ResultTable]:
    """Yield the paper's perception table by entrant: missed, hallucinated and confused targets, and attention."""
    lines = []
    for entrant, own in grouped(rows, lambda row: row.entrant).items():
        played = Played.of(own)
        cells = (
            percent(played.perceived("missing")),
            percent(played.perceived("hallucinating")),
            percent(played.perceived("confusing")),
            plain(mean_of([row.attention_iou for row in own if row.attention_iou is not None]), ".2f"),
            plain(played.f1(), ".2f"),
            plain(played.calibration_error(), ".2f"),
        )
        lines.append(_line(own[0], (entrant,), cells))
    compared = marked(lines, by_column=True, lower=(0, 1, 2, 5))
    heads = ("Miss", "Halluc.", "Confus.", "Attn-IoU", "F1", "ECE")
    note = "Attn-IoU: N/A without attention.npz beside a trace (docs/metrics.md)"
    yield ResultTable("perception", titled(title, "perception"), ("Entrant",), heads, compared, (note,))


def _cost(rows: Sequence[SuiteRow], title: str) -> Iterable[ResultTable]:
    """Yield the cost of an episode: calls, tokens, dollars, seconds."""
    lines = []
    for entrant, own in grouped(rows, lambda row: row.entrant).items():
        played = Played.of(own)
        total = sum(metrics.cost_usd for metrics in played.metrics())
        cells = (
            ResultCell(str(len(own)), len(own)),
            plain(played.mean("calls"), ".0f"),
            plain(played.mean("tokens"), ".0f"),
            plain(played.mean("cost_usd"), ".4f"),
            plain(total, ".2f"),
            plain(played.mean("substitutions"), ".1f"),
            plain(played.mean("ticks"), ".1f"),
            plain(mean_of([row.wall_s for row in own]), ".0f"),
        )
        lines.append(_line(own[0], (entrant,), cells))
    heads = ("n", "Calls", "Tokens", "USD", "USD in all", "Replaced answers", "Ticks", "Wall s")
    yield ResultTable("cost", titled(title, "means of an episode"), ("Entrant",), heads, tuple(lines))


TABLES: Mapping[str, Callable[[Sequence[SuiteRow], str], Iterable[ResultTable]]] = {
    "success": _success,
    "intervals": _intervals,
    "modes": _modes,
    "conditions": _conditions,
    "stages": _stages,
    "behaviour": _behaviour,
    "perception": _perception,
    "controls": controls_table,
    "failures": failure_tables,
    "drift": drift_table,
    "paired": paired_tests,
    "cost": _cost,
}
"""The functions of all kinds of tables, by their names in a suite."""

_WITH_CASES = frozenset({"success", "intervals", "conditions"})
"""The kinds that also receive the open rows and show the worst and the best case."""


# -- values and marks


def column_head(mission: str, mode: str, columns: Iterable[tuple[str, str]]) -> str:
    """Return `VDN`, or `UFR^s` and `UFR^b` for a mission in both modes, as in the paper."""
    both = len({other for name, other in columns if name == mission}) > 1
    return f"{mission.upper()}^{mode[0]}" if both else mission.upper()


def average_of(rows: Sequence[SuiteRow], columns: Sequence[tuple[str, str]]) -> float:
    """Return the macro average of TSR over the columns; nan unless each has counted episodes."""
    return _average([row for row in rows if row.standing == "counted"], columns)


def rate_cell(played: Played) -> ResultCell:
    """Return the share of successes, with the worst and the best case if episodes are open."""
    return with_cases(played.rate(), *played.cases()) if played.is_open else percent(played.rate())


def average_cell(
    rows: Sequence[SuiteRow], columns: Sequence[tuple[str, str]], *, with_range: bool = False
) -> ResultCell:
    """Return the macro average, with its cases if episodes are open, else with its interval on request.

    `rows` are the counted and the open ones.
    """
    average = average_of(rows, columns)
    worst, best = (_average(rows, columns, lost_as=value) for value in (0.0, 1.0))
    if any(row.standing != "counted" for row in rows) and not math.isnan(worst):
        return with_cases(average, worst, best)
    return ranged(average, _average_range(rows, columns)) if with_range else percent(average)


def _average_range(rows: Sequence[SuiteRow], columns: Sequence[tuple[str, str]]) -> ConfidenceBounds:
    """Return the interval of the macro average; nan if a column has too few seeds."""
    values = _seeded(rows, columns)
    enough = all(len(each) >= FEWEST for each in values.values())
    return macro_bounds(values) if enough and values else ConfidenceBounds(math.nan, math.nan)


def _played(rows: Iterable[SuiteRow], column: tuple[str, str]) -> Played:
    return Played.of(row for row in rows if (row.mission, row.mode) == column)


def _seeded(
    rows: Sequence[SuiteRow], columns: Sequence[tuple[str, str]], lost_as: float | None = None
) -> dict[tuple[str, str], dict[int, float]]:
    """Return successes by column and seed: of counted rows, and with `lost_as` also of open ones (0: the worst
    case).
    """
    by_column: dict[tuple[str, str], dict[int, float]] = {column: {} for column in columns}
    for row in rows:
        if row.standing == "counted" and (row.mission, row.mode) in by_column:
            by_column[row.mission, row.mode][row.seed] = float(row.report.success)
    for row in rows if lost_as is not None else ():
        is_doubtful = row.standing == "lost" or (row.standing == "aborted" and lost_as == 0.0)
        if is_doubtful and (row.mission, row.mode) in by_column:
            by_column[row.mission, row.mode][row.seed] = lost_as or 0.0
    return by_column


def _average(rows: Sequence[SuiteRow], columns: Sequence[tuple[str, str]], lost_as: float | None = None) -> float:
    values = _seeded(rows, columns, lost_as)
    return macro_average(values) if all(values.values()) else math.nan


def _line(row: SuiteRow, label: tuple[str, ...], cells: Iterable[ResultCell]) -> ResultLine:
    named = (f"{label[0]} {PRIVILEGED}", *label[1:]) if row.privileged else label
    return ResultLine(row.group, named, tuple(cells))


_MODE_MEASURES: tuple[tuple[str, Callable[[Played], float], Callable[[float], ResultCell], bool], ...] = (
    ("TSR", Played.rate, percent, False),
    ("Msg", lambda played: played.mean("messages"), measure(".1f"), True),
    ("KB", lambda played: played.mean("kilobytes"), measure(".1f"), True),
    ("Rnd", lambda played: played.mean("rounds"), measure(".1f"), True),
    ("Gap", lambda played: played.mean("gap"), measure(".0f"), True),
    ("Rep", lambda played: played.weighted("rep", "target_events"), measure(".0f", 100.0), True),
)
"""The paper's measures of communication: name, value, text, and True if less is better."""


def _wilson_cell(played: Played) -> ResultCell:
    if played.is_open:
        return rate_cell(played)
    won, count = sum(played.won().values()), len(played.episodes)
    return ranged(played.rate(), wilson(won, count), f" ({won}/{count})")


def _wilson_ends(played: Played) -> ResultCell:
    return _ends(wilson(sum(played.won().values()), len(played.episodes)))


def _bootstrap_ends(played: Played) -> ResultCell:
    return _ends(bootstrap([episode.scr for episode in played.episodes]))


def _ends(bounds: ConfidenceBounds) -> ResultCell:
    known = not math.isnan(bounds.low)
    return ResultCell(f"{100 * bounds.low:.0f}..{100 * bounds.high:.0f}") if known else ResultCell(ABSENT)


def _finite(value: float) -> float:
    return 0.0 if math.isnan(value) else value


__all__ = [
    "TABLES", "average_cell", "average_of", "column_head", "make_tables", "rate_cell",
    "standing_notes",
]  # fmt: skip
