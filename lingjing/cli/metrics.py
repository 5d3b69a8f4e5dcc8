"""`lingjing metrics TRACE...`: print the paper's metrics of traces as a table, JSON or CSV."""

from __future__ import annotations

import argparse
import csv
import io
import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any

from lingjing.errors import ExitCode

if TYPE_CHECKING:
    from lingjing.bench.played import Played
    from lingjing.play.report import EpisodeReport

UNDEFINED = "N/A"
"""Printed for a rate with the denominator 0, as in the paper's tables."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("traces", metavar="TRACE", nargs="+", help="a trace.mcap or trace.mcap.part")
    parser.add_argument(
        "--baseline", metavar="TRACE", nargs="+", default=[], help="report token cost relative to these traces"
    )
    parser.add_argument(
        "--real", metavar="TRACE", nargs="+", default=[], help="report F1 on these real-style traces less F1 on TRACE"
    )
    parser.add_argument("--attention", metavar="FILE", help="attention maps of one trace (.npz, one array per picture)")
    parser.add_argument("-j", "--jobs", metavar="N", type=int, default=1, help="read N traces at a time")
    parser.add_argument(
        "--output-format", choices=("text", "json", "csv"), default="text", help="output format (default: text)"
    )
    parser.add_argument("-o", "--output", metavar="FILE", help="the file to write (default: standard output)")


def handler(args: argparse.Namespace) -> int:
    """Print the metrics of one episode, or means and pooled rates of several."""
    from lingjing.cli.arguments import check_counts
    from lingjing.cli.files import check_output, write_output
    from lingjing.errors import UsageError

    if args.attention and len(args.traces) > 1:
        raise UsageError("--attention needs one trace", hint="picture ids repeat from trace to trace")
    check_counts(("-j", args.jobs))
    if args.output is not None:
        check_output(args.output, [path for path in (*args.traces, args.attention) if path])
    reports = _all_of(_once(args.traces), args.jobs)
    rows = [_row(report, complete) for report, complete in reports]
    played = _played(report for report, _ in reports)
    pooled = {"episodes": len(rows), **together(played), **_compared(played, args)}
    if args.output_format == "csv":
        text = as_csv(rows)
    elif args.output_format == "json":
        text = json.dumps({"episodes": rows, "together": pooled}, indent=2, ensure_ascii=False) + "\n"
    else:
        kept = [row for row, (report, _) in zip(rows, reports, strict=True) if retained(report)]
        text = _table(kept or rows, pooled)
    if args.output_format == "text" and args.output in (None, "-"):
        print(text, end="")  # names of others are spelled out on a terminal, which data is not
    else:
        write_output(text, args.output)
    return ExitCode.OK


def retained(report: EpisodeReport) -> bool:
    """Return whether the episode ended by itself. The paper excludes infrastructure failures from all its figures of
    models.
    """
    from lingjing.trace.records import CUT_SHORT

    return report.reason not in CUT_SHORT


def _played(reports: Iterable[EpisodeReport]) -> Played:
    from lingjing.bench.played import Played

    return Played(tuple(filter(retained, reports)))


def _once(paths: Sequence[str]) -> list[str]:
    """Return each file once, also if it has several names."""
    from lingjing.cli.process import say

    first_paths: dict[tuple[int, int] | str, str] = {}
    for path in paths:
        try:
            status = Path(path).stat()
        except OSError:  # reading it later reports the reason
            first_paths.setdefault(path, path)
            continue
        first = first_paths.setdefault((status.st_dev, status.st_ino), path)
        if first is not path:
            say(f"note: {path} is " + ("named twice" if first == path else f"the file {first}") + " and counts once")
    return list(first_paths.values())


def _all_of(paths: Sequence[str], jobs: int) -> list[tuple[EpisodeReport, bool]]:
    """Return the report of each trace and whether it is complete, in the order of `paths`. Each job holds one trace in
    memory.
    """
    if jobs == 1 or len(paths) == 1:
        return [_report_of(path) for path in paths]
    from concurrent.futures import ProcessPoolExecutor

    import lingjing.play.report  # noqa: F401 - loaded before the fork, so that the workers share it

    with ProcessPoolExecutor(min(jobs, len(paths))) as pool:
        return list(pool.map(_report_of, paths, chunksize=4))


def _report_of(path: str) -> tuple[EpisodeReport, bool]:
    from lingjing.collector import collector_at_rest

    with collector_at_rest():  # also while the trace is freed: a collection takes as long as reading it
        return _read(path)


def _read(path: str) -> tuple[EpisodeReport, bool]:
    from lingjing.cli.files import say_if_cut
    from lingjing.play.report import report_of
    from lingjing.trace.reader import read_trace

    trace = read_trace(path)
    say_if_cut(trace)
    policies = "+".join(dict.fromkeys(binding.policy for binding in trace.header.bindings))
    return report_of(trace, policies), trace.complete


def _row(report: EpisodeReport, complete: bool) -> dict[str, Any]:
    """Return the episode's identification and every metric."""
    import msgspec

    identity = {name: getattr(report, name) for name in ("trace", "mission", "mode", "seed", "policy")}
    return {**identity, "complete": complete, "family": report.family, **msgspec.to_builtins(report.metrics)}


def together(played: Played) -> dict[str, Any]:
    """Return the pooled figures. For rates over pictures and actions the counts are added before the division."""
    import msgspec

    from lingjing.bench.played import Played, grouped
    from lingjing.bench.statistics import macro_average

    columns = grouped(played.episodes, lambda report: (report.mission, report.mode))
    won = {column: dict(enumerate(float(report.success) for report in reports)) for column, reports in columns.items()}
    missions = grouped(played.episodes, lambda report: report.mission)
    return {
        "retained": len(played.episodes),
        "tsr": _defined(played.rate()),
        "macro_average": macro_average(won) if won else None,
        "f1": _defined(played.f1()),
        "repeated_target_rate": _defined(played.weighted("rep", "target_events")),
        "perception": _perception(played),
        "stages": {mission: Played(tuple(reports)).stages() for mission, reports in missions.items()},
        "families": played.families() or None,
        "terciles": {name: msgspec.to_builtins(counts.rates()) for name, counts in played.terciles().items()},
    }


def _compared(played: Played, args: argparse.Namespace) -> dict[str, Any]:
    """Return the figures that need further files."""
    figures: dict[str, Any] = {}
    if args.baseline:
        figures["relative_cost"] = _defined(
            played.cost_factor(_played(_report_of(path)[0] for path in _once(args.baseline)))
        )
    if args.real:
        figures["f1_domain_difference"] = domain_difference(
            played, _played(_report_of(path)[0] for path in _once(args.real))
        )
    if args.attention:
        from lingjing.analysis.attention import attention_iou, read_attention
        from lingjing.trace.reader import read_trace

        figures["attention_iou"] = attention_iou(read_trace(args.traces[0]), read_attention(args.attention))
    return figures


def _perception(played: Played) -> dict[str, float | None]:
    """Return the paper's perception figures over the aligned frames and reports of all episodes."""
    return {
        "precision": _defined(played.precision()),
        "recall": _defined(played.recall()),
        "f1": _defined(played.f1()),
        "miss_rate": _defined(played.perceived("missing")),
        "hallucination_rate": _defined(played.perceived("hallucinating")),
        "confusion_rate": _defined(played.perceived("confusing")),
        "localisation_error_m": _defined(played.location_error_m()),
        "calibration_error": _defined(played.calibration_error()),
    }


def domain_difference(simulated: Played, real: Played) -> float | None:
    """Return F1 on real-style pictures less F1 on the matched simulator's pictures; negative if real-style ones are
    harder.

    Raises `UsageError` if the two sets are not matched: the same missions, modes and seeds, equally often.
    """
    from collections import Counter

    from lingjing.errors import UsageError

    here, there = (
        Counter((report.mission, report.mode, report.seed) for report in played.episodes)
        for played in (simulated, real)
    )
    if here != there:
        mission, mode, seed = min((here - there) + (there - here))
        raise UsageError(f"the two sets are not matched: {mission} {mode} seed {seed} is not equally often in both")
    return _defined(real.f1() - simulated.f1())


def _defined(value: float) -> float | None:
    """Return None for nan, which JSON cannot express."""
    return None if math.isnan(value) else value


def as_csv(rows: Sequence[dict[str, Any]]) -> str:
    """Return one line per episode under a line of names; N/A is an empty cell, the stages are `name done/required`.

    A text that a spreadsheet would read as a formula gets an apostrophe before it.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(rows[0])
    for row in rows:
        writer.writerow([_cell(value) for value in row.values()])
    return out.getvalue()


def _cell(value: Any) -> Any:
    if isinstance(value, list | tuple):
        value = "; ".join(f"{stage['name']} {stage['done']}/{stage['required']}" for stage in value)
    if isinstance(value, str) and value[:1] in ("=", "+", "-", "@", "\t", "\r"):
        return f"'{value}"
    return value


def _table(rows: Sequence[dict[str, Any]], pooled: dict[str, Any]) -> str:
    """Return groups of `name: value unit`. Several episodes: the mean over those that have the value, and their
    number.
    """
    from lingjing.analysis.metrics import groups_and_units

    lines = [] if len(rows) > 1 else [f"{name}: {rows[0][name]}" for name in ("mission", "mode", "seed", "policy")]
    group = ""
    for name, (of, unit) in sorted(groups_and_units().items(), key=lambda item: _order(item[1][0])):
        if of != group:
            lines += ["", f"[{of}]"]
            group = of
        lines.append(f"{name}: {_value([row[name] for row in rows], unit)}")
    lines += ["", "[together]"]
    lines += [f"{name}: {_shown(value)}" for name, value in pooled.items() if not isinstance(value, dict)]
    lines += [f"{name}: {_shown(value)}" for name, value in pooled["perception"].items() if name != "f1"]
    for mission, stages in pooled["stages"].items():
        parts = ", ".join(f"{name} {_shown(value)}" for name, value in stages.items())
        lines.append(f"{mission} up to each stage: {parts}")
    lines += [f"family {name}: {_shown(value)}" for name, value in (pooled["families"] or {}).items()]
    for third, rates in pooled["terciles"].items():
        parts = ", ".join(f"{name} {_shown(value)}" for name, value in rates.items())
        lines.append(f"{third} third: {parts}")
    return "\n".join(lines).lstrip("\n") + "\n"


def _order(group: str) -> int:
    from lingjing.analysis.metrics import GROUPS

    return GROUPS.index(group)


def _value(values: Sequence[Any], unit: str) -> str:
    there = [value for value in values if value is not None]
    if not there:
        return UNDEFINED
    if not all(isinstance(value, int | float) for value in there):
        texts = [str(_cell(value)) for value in there]
        return (
            texts[0] if len(values) == 1 else ", ".join(f"{texts.count(text)} {text}" for text in dict.fromkeys(texts))
        )
    mean = fmean(there) if len(values) > 1 else there[0]
    of = f" (of {len(there)})" if len(there) < len(values) else ""
    return f"{_shown(mean)} {unit}".rstrip() + of


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    return UNDEFINED if value is None else str(value)
