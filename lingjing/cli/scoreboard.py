"""What a run answers: one JSON object, or a table for people."""

from __future__ import annotations

import hashlib
import sys
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec

from lingjing.errors import ExitCode

if TYPE_CHECKING:
    from rich.table import Table

ABORTED = "infrastructure-abort"
INTERRUPTED = "interrupted"


class EpisodeReport(msgspec.Struct, frozen=True, kw_only=True):
    """One episode, as `lingjing run --json` prints it.

    `trace` is the path of the MCAP file (a `.part` if the episode was cut short), `detail` the cause of an abort.
    """

    mission: str
    seed: int
    mode: str
    policy: str
    success: bool
    reason: str
    scr: float
    ticks: int
    digest: str
    trace: str
    metrics: dict[str, object]
    detail: str = ""


class SuiteReport(msgspec.Struct, frozen=True, kw_only=True):
    """Several seeds of one mission, as `lingjing run --seeds A-B --json` prints them.

    `tsr` is the share of successes among the episodes that were not aborted by the infrastructure (None if all
    were); `success` says whether every episode succeeded; `scr` and the numbers in `metrics` are means over the
    same episodes, `ticks` is their sum, `digest` is the SHA-256 over the episodes' digests in order, `trace` the
    folder that holds them.
    """

    mission: str
    seed: str
    mode: str
    policy: str
    success: bool
    reason: str
    scr: float
    ticks: int
    digest: str
    trace: str
    metrics: dict[str, object]
    tsr: float | None
    episodes: tuple[EpisodeReport, ...]


def summarise(episodes: Sequence[EpisodeReport], *, seeds: str, folder: str) -> SuiteReport:
    """All episodes of one command as one report; there is at least one."""
    counted = [episode for episode in episodes if episode.reason != ABORTED]
    reasons = Counter(episode.reason for episode in episodes)
    return SuiteReport(
        mission=episodes[0].mission,
        seed=seeds,
        mode=episodes[0].mode,
        policy=episodes[0].policy,
        success=all(episode.success for episode in episodes),
        reason=", ".join(f"{reason} {number}" for reason, number in sorted(reasons.items())),
        scr=_mean([episode.scr for episode in counted]),
        ticks=sum(episode.ticks for episode in counted),
        digest=hashlib.sha256("".join(episode.digest for episode in episodes).encode()).hexdigest(),
        trace=folder,
        metrics=mean_metrics(counted),
        tsr=_mean([float(episode.success) for episode in counted]) if counted else None,
        episodes=tuple(episodes),
    )


def mean_metrics(episodes: Sequence[EpisodeReport]) -> dict[str, object]:
    """The mean of every metric that is a number; episodes in which it is not one are left out of its mean."""
    values: dict[str, list[float]] = {}
    for episode in episodes:
        for name, value in episode.metrics.items():
            if isinstance(value, (int, float)) and not isinstance(value, bool):
                values.setdefault(name, []).append(float(value))
    return {name: _mean(numbers) for name, numbers in values.items()}


def exit_code(episodes: Sequence[EpisodeReport]) -> ExitCode:
    """0 whatever the score; 3 if the infrastructure aborted any episode; 130 if one was interrupted."""
    reasons = {episode.reason for episode in episodes}
    if INTERRUPTED in reasons:
        return ExitCode.INTERRUPTED
    return ExitCode.INFRASTRUCTURE if ABORTED in reasons else ExitCode.OK


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
        *((name, _text(value)) for name, value in report.metrics.items() if not isinstance(value, (dict, list))),
        ("digest", report.digest[:16]),
    ]
    if sys.stdout.isatty():
        _print_table(_two_columns(rows))
    else:
        for name, value in rows:
            print(f"{name}: {value}")
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


def _text(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values) if values else 0.0
