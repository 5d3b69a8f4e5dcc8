"""Whole episodes in one call, with the trace that they leave, and commands of the command line."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Unpack

from lingjing.play.episode import Session
from lingjing.play.options import Changes
from lingjing.play.report import EpisodeReport
from lingjing.plugins.host import PluginHost
from lingjing.testing.missions import MissionSource, compiled
from lingjing.trace.call_store import CALLS_NAME, CallReader
from lingjing.trace.calls import RecordedCall
from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import AdjudicatedEvent, Receipt


@dataclass(frozen=True, slots=True)
class PlayedEpisode:
    """An episode that was played to its end."""

    report: EpisodeReport
    """The score, the reason of the end and the metrics."""
    trace: Trace
    """The records of the episode."""

    @property
    def path(self) -> Path:
        """The file of the trace."""
        return Path(self.report.trace)

    @property
    def receipts(self) -> tuple[Receipt, ...]:
        """The receipts of all agents, in order."""
        return tuple(receipt for record in self.trace.boundaries for receipt in record.receipts)

    @property
    def events(self) -> tuple[AdjudicatedEvent, ...]:
        """The rules that came true, in order."""
        return tuple(event for record in self.trace.boundaries for event in record.events)


def play(
    source: MissionSource, folder: Path, *, plugins: Iterable[object] = (), **options: Unpack[Changes]
) -> PlayedEpisode:
    """Play one episode in this process and return its report and trace.

    Each episode has a new folder in `folder`: `episode-1`, then `episode-2` and so on.

    `options` are those of `lingjing.run`: `policy` (a name, a class or a function that makes a policy), `policies_for`,
    `evaluators`, `seed`, `mode`, `settings` and more. `plugins` are modules or objects with hooks, which need not be
    installed. Two differ from `lingjing.run`: engines run in this process (`world="inline"`), and no overview is drawn.
    Raises the errors of `lingjing.run`.
    """
    chosen: Changes = {"world": "inline", "overview": False, **options}
    with Session(PluginHost(extra=plugins)) as session:
        report = session.run(compiled(source), out=_next_folder(folder), **chosen)
    return PlayedEpisode(report, read_trace(report.trace))


def _next_folder(folder: Path) -> Path:
    places = (folder / f"episode-{number}" for number in itertools.count(1))
    return next(place for place in places if not place.exists())


def recorded_calls(folder: Path, tick: int | None = None) -> list[RecordedCall]:
    """Return the recorded calls to chat models of the episode in a folder, all or those of one tick, in order.

    Raises `UsageError` if the folder holds no record of calls.
    """
    return list(CallReader(folder / CALLS_NAME).calls(tick=tick))


def run_command(arguments: Sequence[str]) -> int:
    """Run `lingjing ARGUMENTS…` in this process and return its exit code; it prints to this process's streams.

    Raises `SystemExit` for `--help` (0) and for arguments that the command line does not accept (2).
    """
    from lingjing.cli.main import main

    return main(arguments)


__all__ = ["PlayedEpisode", "play", "recorded_calls", "run_command"]
