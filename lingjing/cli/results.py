"""Printed results of a run: one JSON object, or a table for people."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from lingjing.analysis.played_city import credit
from lingjing.cli.process import say
from lingjing.cli.scorecard import plain, scorecard
from lingjing.errors import ExitCode, InfrastructureError, LingjingError, hint_of
from lingjing.play.report import ABORTED, INTERRUPTED, POLICY_FAILED, EpisodeError, EpisodeReport, SeedsReport
from lingjing.terminal import visible

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text


_LOOK = "the trace holds the episode up to this error; `lingjing doctor` checks this machine"
_GONE = "its trace was removed; if a program clears the folder, choose another with -o; see also `lingjing doctor`"
_CORRECT = "correct the policy, or choose another with --policy"
NARROWEST = 60
"""Columns of a terminal; in a narrower terminal lines are easier to read than a table. Chosen."""


def exit_code(episodes: Sequence[EpisodeReport]) -> ExitCode:
    """Return the exit code of a run: 0 for any score, 2 if a policy prevented an episode from starting, 3 if the
    infrastructure aborted one, 130 if one was interrupted.
    """
    reasons = {episode.reason for episode in episodes}
    if INTERRUPTED in reasons:
        return ExitCode.INTERRUPTED
    if ABORTED in reasons:
        return ExitCode.INFRASTRUCTURE
    return ExitCode.USAGE if POLICY_FAILED in reasons else ExitCode.OK


def explain(episodes: Sequence[EpisodeReport]) -> None:
    """Print warnings and errors of the episodes on standard error, with hints; print nothing if there are none."""
    for episode in episodes:
        for warning in episode.warnings:
            say(f"warning: seed {episode.seed}: {warning}")
        if episode.reason == INTERRUPTED:
            say(f"interrupted: seed {episode.seed} at tick {episode.ticks}; the partial trace is {episode.trace}")
        if episode.reason == ABORTED:
            say(f"error: seed {episode.seed} was aborted: {episode.detail}")
        if episode.reason == POLICY_FAILED:
            say(f"error: seed {episode.seed} did not begin: {episode.detail}")
    for hint in dict.fromkeys(_hint(episode) for episode in episodes if episode.reason in (ABORTED, POLICY_FAILED)):
        say(f"hint: {hint}")


def _hint(cut_short: EpisodeReport) -> str:
    if cut_short.reason == POLICY_FAILED:
        return cut_short.hint or _CORRECT
    return cut_short.hint or (_LOOK if Path(cut_short.trace).exists() else _GONE)


def print_json(report: EpisodeReport | SeedsReport) -> None:
    """Print one object and a newline on standard output, nothing else."""
    try:
        text = msgspec.json.encode(report).decode()
    except UnicodeEncodeError:  # a folder name that is not valid text: its bytes are written as Python's escapes
        text = json.dumps(msgspec.to_builtins(report))
    sys.stdout.write(text + "\n")


def print_error_json(error: LingjingError) -> None:
    """Print an `EpisodeError` and a newline on standard output."""
    cause = error.cause if isinstance(error, InfrastructureError) else ""
    printed = EpisodeError(message=str(error), hint=hint_of(error), cause=cause)
    with suppress(OSError, ValueError):  # closed or full: the message on standard error remains
        sys.stdout.write(json.dumps(msgspec.to_builtins(printed)) + "\n")
        sys.stdout.flush()


def print_episode(report: EpisodeReport) -> None:
    """Print a grouped table on a terminal; in a pipe `name: value unit` lines under `[group]` headings.

    `grep` and INI parsers read these lines. The map's attribution and the path of the run come last, each on its own
    line.
    """
    on_terminal = sys.stdout.isatty() and _width() >= NARROWEST
    if on_terminal:
        _print_table(_card(report))
    else:
        for group, rows in plain(report):
            print(f"[{group}]", *(f"{name}: {value}" for name, value in rows), "", sep="\n")
        print("[files]", f"digest: {report.digest[:16]}", sep="\n")
    if credit(report.attribution):
        print(credit(report.attribution))
    overview = Path(report.trace).with_name("overview.png")
    if overview.is_file():
        print(f"overview: {overview}")
    print(f"trace: {report.trace}")


def print_seeds(report: SeedsReport) -> None:
    """Print one line per episode, then TSR and mean SCR, and the folder of the traces."""
    head = ("seed", "success", "reason", "SCR", "ticks", "run")
    rows = [
        (str(e.seed), "yes" if e.success else "no", e.reason, f"{e.scr:.2f}", str(e.ticks), _run_name(e, report.trace))
        for e in report.episodes
    ]
    if sys.stdout.isatty():
        _print_table(_table(head, rows))
    else:
        for row in (head, *rows):
            print("\t".join(row))
    print(f"{report.mission} seeds {report.seed} {report.mode} {report.policy}: {_tsr(report)}")
    for credited in dict.fromkeys(credit(episode.attribution) for episode in report.episodes):
        if credited:
            print(credited)
    print(f"traces: {report.trace}")


def _tsr(report: SeedsReport) -> str:
    """Return the rates as text: `TSR 0.50 (2 of 4), SCR 0.75`. Aborted and interrupted episodes do not count."""
    counted = [episode for episode in report.episodes if episode.reason not in (ABORTED, INTERRUPTED)]
    if report.tsr is None:
        return "TSR N/A (no episode ended by itself), SCR N/A"
    won = sum(episode.success for episode in counted)
    return f"TSR {report.tsr:.2f} ({won} of {len(counted)}), SCR {report.scr:.2f}"


def _run_name(episode: EpisodeReport, root: str) -> str:
    """Return the trace's path inside the suite's folder; "-" if there is none."""
    if not episode.trace:
        return "-"
    path = Path(episode.trace)
    return str(path.relative_to(root)) if path.is_relative_to(root) else str(path)


def _card(report: EpisodeReport) -> Table:
    from rich import box
    from rich.table import Table
    from rich.text import Text  # values are text, not markup: a path may hold brackets

    title = Text(visible(f"{report.mission} · seed {report.seed} · {report.mode} · {report.policy}"))
    table = Table(title=title, title_justify="left", show_header=False, box=box.SIMPLE, pad_edge=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(style="dim", overflow="fold")
    table.add_column(overflow="fold")
    for group, rows in scorecard(report):
        for number, (name, value) in enumerate(rows):
            last = number == len(rows) - 1
            table.add_row(
                "" if number else group, name, _coloured(name, Text(visible(value)), report), end_section=last
            )
    return table


def _coloured(name: str, value: Text, report: EpisodeReport) -> Text:
    if name == "success":
        value.stylize("bold green" if report.success else "bold red")
    return value


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(*head, box=box.SIMPLE, pad_edge=False)
    for column in table.columns:
        column.overflow = "fold"
    for row in rows:
        table.add_row(*(Text(visible(cell)) for cell in row))
    return table


def _width() -> int:
    from lingjing.cli.console import console

    return console().width


def _print_table(table: Table) -> None:
    from lingjing.cli.console import console

    console().print(table)
