"""What a run answers: one JSON object, or a table for people."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from lingjing.bench.report import ABORTED, INTERRUPTED, EpisodeReport, SuiteReport
from lingjing.errors import ExitCode

if TYPE_CHECKING:
    from rich.table import Table


def exit_code(episodes: Sequence[EpisodeReport]) -> ExitCode:
    """0 whatever the score; 3 if the infrastructure aborted any episode; 130 if one was interrupted."""
    reasons = {episode.reason for episode in episodes}
    if INTERRUPTED in reasons:
        return ExitCode.INTERRUPTED
    return ExitCode.INFRASTRUCTURE if ABORTED in reasons else ExitCode.OK


def explain_aborts(episodes: Sequence[EpisodeReport]) -> None:
    """On standard error: what aborted an episode and what to do; nothing if none was aborted."""
    aborted = [episode for episode in episodes if episode.reason == ABORTED]
    for episode in aborted:
        print(f"error: seed {episode.seed} was aborted: {episode.detail}", file=sys.stderr)
    if aborted:
        print("hint: the trace holds what happened before; `lingjing doctor` checks this machine", file=sys.stderr)


def print_json(report: EpisodeReport | SuiteReport) -> None:
    """One object and a newline on standard output, nothing else."""
    sys.stdout.write(msgspec.json.encode(report).decode() + "\n")


def print_episode(report: EpisodeReport) -> None:
    """A table on a terminal, `name: value` lines in a pipe; the path of the run last, whole and alone."""
    rows = [
        ("mission", f"{report.mission} (seed {report.seed}, {report.mode}, {report.policy})"),
        ("success", f"{'yes' if report.success else 'no'} ({report.reason})"),
        ("SCR", f"{report.scr:.2f}"),
        ("ticks", str(report.ticks)),
        *((name, _text(value)) for name, value in report.metrics.items() if _is_plain(name, value)),
        ("digest", report.digest[:16]),
    ]
    if sys.stdout.isatty():
        _print_table(_two_columns(rows))
    else:
        for name, value in rows:
            print(f"{name}: {value}")
    overview = Path(report.trace).with_name("overview.png")
    if overview.is_file():
        print(f"overview: {overview}")
    print(f"trace: {report.trace}")


def print_suite(report: SuiteReport) -> None:
    """One line an episode, then TSR and mean SCR."""
    head = ("seed", "success", "reason", "SCR", "ticks", "trace")
    rows = [
        (str(e.seed), "yes" if e.success else "no", e.reason, f"{e.scr:.2f}", str(e.ticks), e.trace)
        for e in report.episodes
    ]
    if sys.stdout.isatty():
        from rich.table import Table

        table = Table(*head)
        for row in rows:
            table.add_row(*row)
        _print_table(table)
    else:
        for row in (head, *rows):
            print("\t".join(row))
    tsr = "none counted" if report.tsr is None else f"{report.tsr:.2f}"
    print(f"{report.mission} seeds {report.seed} {report.mode} {report.policy}: TSR {tsr}, SCR {report.scr:.2f}")


def _two_columns(rows: Sequence[tuple[str, str]]) -> Table:
    from rich.table import Table

    table = Table(show_header=False)
    for row in rows:
        table.add_row(*row)
    return table


def _print_table(table: Table) -> None:
    from rich.console import Console

    Console().print(table)


def _is_plain(name: str, value: object) -> bool:
    """A single value that is defined and has no row of its own."""
    return isinstance(value, (bool, int, float, str)) and name not in {"success", "reason", "scr", "ticks"}


def _text(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
