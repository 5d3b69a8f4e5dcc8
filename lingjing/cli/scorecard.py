"""The scorecard of one episode for people: groups of numbers with units, and N/A for an undefined number."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec

from lingjing.analysis.metrics import GROUPS, groups_and_units
from lingjing.play.report import EpisodeReport
from lingjing.trace.records import CUT_SHORT

ScoreRow = tuple[str, str]
"""A name and its value as text."""

ScoreGroup = tuple[str, tuple[ScoreRow, ...]]
"""The title of a group and its rows."""

UNDEFINED = "N/A"
"""Shown for a rate with the denominator 0, as in the paper's tables."""

MOST_ROWS = 8
"""The greatest number of incidents shown, and of events. Chosen."""

_REASONS = {
    "budget": "the budget of ticks ran out",
    "failure": "the mission's failure condition holds",
    "constraint": "a hard constraint was broken",
    "late": "a stage ran out of its own ticks",
    "infrastructure-abort": "aborted by the infrastructure",
    "interrupted": "interrupted",
}


def scorecard(report: EpisodeReport) -> tuple[ScoreGroup, ...]:
    """Return a few rows per group; incidents and events of the mission if there are any."""
    metrics = _values(report)
    return (
        ("Outcome", _outcome(report, metrics)),
        *(("Incidents", _few(rows)) for rows in (_incidents(report),) if rows),
        *(("Events", _few(rows)) for rows in (_events(report),) if rows),
        ("Perception", _perception(metrics)),
        ("Communication", _communication(metrics)),
        ("Behaviour", _behaviour(metrics)),
        ("Cost", _cost(metrics)),
    )


def plain(report: EpisodeReport) -> tuple[ScoreGroup, ...]:
    """Return the same groups for a pipe: a fixed set of short names, each with a bare number and its unit, or N/A.

    Rates run from 0 to 1. Every mission and every outcome gives the same names in the same order.
    """
    metrics = _values(report)
    episode = [(name, str(getattr(report, name))) for name in ("mission", "seed", "mode", "tier", "policy")]
    outcome = [
        ("success", f"{'yes' if report.success else 'no'} ({report.reason})"),
        ("detail", report.detail or UNDEFINED),
        ("SCR", f"{report.scr:.2f}"),
        ("score", f"{report.score:.2f}"),
        ("stages", _stages(metrics.get("stages"))),
        ("ticks", str(report.ticks)),
    ]
    outcome += [("incident_log", _log(_incidents(report))), ("event_log", _log(_events(report)))]
    written = {name for name, _ in outcome} | {"scr", "reason"}
    rows: dict[str, list[ScoreRow]] = {group: [] for group in GROUPS}
    rows["outcome"] = outcome
    for name, (group, unit) in groups_and_units().items():
        if name not in written:
            rows[group].append((name, _exact(metrics.get(name), unit)))
    return (("episode", tuple(episode)), *((group, tuple(rows_of_group)) for group, rows_of_group in rows.items()))


def verdict(report: EpisodeReport) -> str:
    """Return `yes`, or `no: the budget of ticks ran out`. An episode that ended by itself shows its own detail if it
    has one.
    """
    if report.success:
        return "yes"
    detail = "" if report.reason in CUT_SHORT else report.detail
    return f"no: {detail or _REASONS.get(report.reason, report.reason)}"


def _values(report: EpisodeReport) -> Mapping[str, object]:
    return {} if report.metrics is None else msgspec.structs.asdict(report.metrics)


def _outcome(report: EpisodeReport, metrics: Mapping[str, object]) -> tuple[ScoreRow, ...]:
    return (
        ("success", verdict(report)),
        ("subtasks done (SCR)", f"{report.scr:.2f}"),
        ("score, weights and penalties", f"{report.score:.2f}"),
        ("stages", _stages(metrics.get("stages"))),
        ("ticks", f"{report.ticks} = {_number(metrics.get('sim_s'))} s simulated in {_seconds(metrics.get('wall_s'))}"),
        ("area searched", _share(metrics.get("coverage"))),
    )


def _incidents(report: EpisodeReport) -> tuple[ScoreRow, ...]:
    return tuple((f"{incident.time_s:.1f} s, tick {incident.tick}", incident.line) for incident in report.incidents)


def _events(report: EpisodeReport) -> tuple[ScoreRow, ...]:
    return tuple((f"{event.time_s:.1f} s", event.line) for event in report.happened)


def _few(rows: tuple[ScoreRow, ...]) -> tuple[ScoreRow, ...]:
    """Return the first rows, and a row with the number of further ones."""
    more = len(rows) - MOST_ROWS
    return rows if more <= 0 else (*rows[:MOST_ROWS], ("", f"and {more} more (--json has all)"))


def _log(rows: tuple[ScoreRow, ...]) -> str:
    """Return rows as one line: `37.0 s, tick 4: uav[1] and uav[2] collided …; 60.0 s: …`."""
    return "; ".join(f"{when}: {text}".removeprefix(": ") for when, text in _few(rows)) or UNDEFINED


def _perception(metrics: Mapping[str, object]) -> tuple[ScoreRow, ...]:
    first = metrics.get("first_discovery_tick")
    when = "" if first is None else f", the first at tick {first}"
    late = f", {metrics['absent_frames']} absent" if metrics.get("absent_frames") else ""
    rates = " / ".join(_number(metrics.get(name)) for name in ("precision", "recall", "f1"))
    return (
        ("pictures", f"{_number(metrics.get('frames'))}{late}"),
        ("targets too faint to see", _number(metrics.get("faint_targets"))),
        ("targets found", f"{_number(metrics.get('targets_found'))}{when}"),
        ("reports", _of_them(metrics, "reports", "false_positives", "false")),
        ("precision / recall / F1", rates),
        ("localisation error", _with_unit(metrics.get("localisation_error_m"), "m")),
    )


def _communication(metrics: Mapping[str, object]) -> tuple[ScoreRow, ...]:
    return (
        ("messages", f"{_number(metrics.get('messages'))} in {_number(metrics.get('rounds'))} rounds"),
        ("payload", _with_unit(metrics.get("kilobytes"), "kB")),
        ("refused", _of_them(metrics, "rejections", "conflicts", "conflicts")),
        ("repeated targets", _share(metrics.get("rep"))),
    )


def _behaviour(metrics: Mapping[str, object]) -> tuple[ScoreRow, ...]:
    return (
        ("actions", f"{_number(metrics.get('actions'))}, {_share(metrics.get('adherence'))} within constraints"),
        ("repeated / out of bounds", f"{_share(metrics.get('repetition'))} / {_share(metrics.get('out_of_bounds'))}"),
        ("forgotten subgoals", _share(metrics.get("forgotten"))),
        ("redundant revisits", _share(metrics.get("redundant_revisits"))),
    )


def _cost(metrics: Mapping[str, object]) -> tuple[ScoreRow, ...]:
    dollars = metrics.get("cost_usd")
    return (
        ("model calls", f"{_number(metrics.get('calls'))}, {_number(metrics.get('tokens'))} tokens"),
        ("cost", f"${dollars:.4f}" if isinstance(dollars, int | float) else UNDEFINED),
        ("answers replaced", _number(metrics.get("substitutions"))),
        ("idle steps", _share(metrics.get("idle_fraction"))),
    )


def _of_them(metrics: Mapping[str, object], whole: str, part: str, kind: str) -> str:
    """Return a count and a part of it: `4, 1 of them false`, or `4`."""
    some = f", {metrics[part]} of them {kind}" if metrics.get(part) else ""
    return f"{_number(metrics.get(whole))}{some}"


def _stages(stages: object) -> str:
    """Return the stages as text: `detect 2/3, locate 1/3`."""
    if not isinstance(stages, Sequence) or not stages:
        return UNDEFINED
    return ", ".join(f"{stage.name} {stage.done}/{stage.required}" for stage in stages)


def _number(value: object) -> str:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return UNDEFINED if value is None else str(value)
    return f"{value:,}" if isinstance(value, int) else f"{value:.3g}" if abs(value) < 1000 else f"{value:,.0f}"


def _exact(value: object, unit: str) -> str:
    """Return a number for programs, without thousands separators: `12.5 m`, `0.25`, `N/A`."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return UNDEFINED if value is None else str(value)
    number = str(value) if isinstance(value, int) else f"{value:.6g}"
    return f"{number} {unit}".rstrip()


def _share(value: object) -> str:
    return f"{value:.0%}" if isinstance(value, int | float) else UNDEFINED


def _with_unit(value: object, unit: str) -> str:
    return UNDEFINED if value is None else f"{_number(value)} {unit}"


def _seconds(value: object) -> str:
    return f"{value:.1f} s" if isinstance(value, int | float) else UNDEFINED
