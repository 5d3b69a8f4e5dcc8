"""Playing what a suite's folder does not have yet: seed by seed, aborts again, everything kept as soon as it is known.

An episode that the infrastructure aborted is played again with its seed, and never counts for or against an entrant;
the third abort of one is kept as lost, so that no table hides it. What a policy does to itself is no abort, and neither
is what it raises: where it keeps an episode from beginning, that is a failure (`POLICY_FAILED`). An entrant with lost
episodes is not ranked (`unresolved`).
"""

from __future__ import annotations

import hashlib
import re
import shutil
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import msgspec

from lingjing.bench.countdown import Countdown
from lingjing.bench.executors import Executor
from lingjing.bench.folder import ResultsFolder, fingerprint, policy_seed
from lingjing.bench.planning import SuiteCell, SuitePlan, options_of_cell
from lingjing.bench.rows import RowStanding, SuiteRow, comparable
from lingjing.errors import UsageError
from lingjing.play.options import PlayOptions
from lingjing.play.parallel import EpisodeTask
from lingjing.play.report import ABORTED, INTERRUPTED, EpisodeReport
from lingjing.play.spending import SpendingLimits
from lingjing.trace.call_store import CALLS_NAME

TRIES = 3
"""How often one episode is tried before it is lost."""

LINGERS_S = 60.0
"""How long an episode may take to end after its suite was killed."""

OUT_OF_LIMITS = ("money:", "tokens:")
"""How the detail of an abort begins that a limit of the suite itself has caused."""


@dataclass(frozen=True, slots=True)
class Shard:
    """The `number`-th of `count` parts of a suite, from 1. Episodes are dealt by hash, so that every part is alike."""

    number: int = 1
    count: int = 1

    def has(self, cell: SuiteCell, seed: int) -> bool:
        """Whether the episode is one of this part."""
        key = "/".join((*cell.key, str(seed))).encode()
        return int.from_bytes(hashlib.sha256(key).digest()[:8]) % self.count == self.number - 1


WHOLE = Shard()


@dataclass(frozen=True, slots=True)
class SuiteEpisode:
    """One episode to play, and which try it is."""

    cell: SuiteCell
    seed: int
    tries: int = 1


@dataclass(slots=True)
class SuiteRun:
    """A suite being played into a folder.

    `max_cost` is how many US dollars all its calls of models may cost together, those of earlier commands too. `calls`
    says what becomes of them (see `PlayOptions`); replayed ones are those of the suite's folder `calls_from`.
    """

    plan: SuitePlan
    results: ResultsFolder
    code: str
    executor: Executor
    keep: bool = False
    max_cost: float | None = None
    calls: Literal["record", "replay", "live"] = "record"
    calls_from: Path | None = None
    tell: Callable[[SuiteRow, Countdown], None] = field(default=lambda row, countdown: None)
    is_out_of_money: bool = False

    def due(self, seeds: Iterable[int], cells: Sequence[SuiteCell], shard: Shard = WHOLE) -> list[SuiteEpisode]:
        """What is still to be played, seed by seed, so that an unfinished suite is matched as well."""
        over = {(row.cell, row.report.seed) for row in self.results.rows if row.standing != "aborted"}
        tried = Counter((row.cell, row.report.seed) for row in self.results.rows if row.standing == "aborted")
        return [
            SuiteEpisode(cell, seed, 1 + tried[cell.key, seed])
            for seed in seeds
            for cell in cells
            if (cell.key, seed) not in over and shard.has(cell, seed)
        ]

    def check_resumable(self, *, other_code: bool = False) -> None:
        """Raise `UsageError` if the folder holds rows that may not stand beside those that would be played now."""
        rows = self.results.rows
        folder, suite = self.results.folder, self.plan.suite.name
        others = sorted({row.suite for row in rows} - {suite})
        if others:
            raise UsageError(
                f"`{folder}` holds results of the suite `{others[0]}`, this is `{suite}`", hint="choose another with -o"
            )
        strange = {row.code[:12] for row in rows if row.code != self.code}
        if strange and not other_code:
            counted = sum(row.code != self.code for row in rows)
            raise UsageError(
                f"{counted} of the {len(rows)} rows in `{folder}` were played by other code or missions "
                f"({', '.join(sorted(strange))}; now it is {self.code[:12]})",
                hint="choose another folder with -o, or go on all the same with --other-code",
            )
        now = {cell.key: comparable(self._options(cell, 0)) for cell in self.plan.cells}
        changed = [row for row in rows if row.cell in now and comparable(row.options) != now[row.cell]]
        if changed:
            first = changed[0]
            raise UsageError(
                f"{len(changed)} of the rows in `{folder}` were played with other options than the suite has now; the "
                f"first is {first.entrant}, {first.column}{first.condition and f', {first.condition}'}, seed "
                f"{first.seed}: {_difference(first.options, now[first.cell])}",
                hint="choose another folder with -o, or put the suite back as it was",
            )

    def check_recorded(self, episodes: Sequence[SuiteEpisode]) -> None:
        """Raise `UsageError` if calls are replayed and some episodes have no record of theirs."""
        if self.calls_from is None:
            return
        asking = [self._name(episode) for episode in episodes if episode.cell.player.declared.calls]
        missing = [name for name in asking if not (self.calls_from / "runs" / name / CALLS_NAME).is_file()]
        if missing:
            raise UsageError(
                f"{len(missing)} of {len(asking)} episodes have no record of model calls in `{self.calls_from}`; the "
                f"first is {missing[0]}",
                hint="leave them out with --seeds, --limit, --missions, --modes or --entrants",
            )

    def play(self, episodes: Sequence[SuiteEpisode]) -> None:
        """Play them all; an interrupt, or a fault that all episodes would have, is raised with what is done kept."""
        countdown = Countdown(self.executor.jobs, (episode.cell.key for episode in episodes))
        for row in self.results.rows:
            countdown.learn(row.cell, row.wall_s, cost_of(row))
        waiting = list(episodes)
        while waiting and not self.is_out_of_money:
            waiting = self._round(waiting, countdown)

    def _round(self, episodes: Sequence[SuiteEpisode], countdown: Countdown) -> list[SuiteEpisode]:
        """Play each once; those that are to be played again."""
        of = {self._folder(episode): episode for episode in episodes}
        started: dict[Path, float] = {}
        again: list[SuiteEpisode] = []
        for task, report in self.executor.play(self._tasks(of, started)):
            episode, wall_s = of[task.folder], time.monotonic() - started.pop(task.folder)
            if report.reason == INTERRUPTED:  # it is not over: it is played anew by the next command
                continue
            if report.reason == ABORTED and report.detail.startswith("calls:"):
                raise UsageError(f"{task.folder.name}: {report.detail}", hint=report.hint)
            if report.reason == ABORTED and report.detail.startswith(OUT_OF_LIMITS):
                self.is_out_of_money = True
                continue
            row = self._row(episode, task.options, report, wall_s)
            if not self._keeps(episode.cell):  # before the row is there: a kill in between would leave it for good
                take_away(task.folder)
            self.results.add(row)
            if row.standing == "aborted":
                again.append(SuiteEpisode(episode.cell, episode.seed, episode.tries + 1))
                countdown.learn(row.cell, row.wall_s, cost_of(row))
            else:
                countdown.done(row.cell, row.wall_s, cost_of(row))
            self.tell(row, countdown)
        return again

    def _tasks(self, of: dict[Path, SuiteEpisode], started: dict[Path, float]) -> Iterator[EpisodeTask]:
        """The tasks, each with what an earlier, unfinished try left taken away; no more once the money is used up."""
        played_on = Counter(_played_on(episode) for episode in of.values())
        for folder, episode in of.items():
            self.is_out_of_money |= self.max_cost is not None and self.spent() >= self.max_cost
            if self.is_out_of_money:
                return
            take_away(folder)
            started[folder] = time.monotonic()
            options = self._counted(self._options(episode.cell, episode.seed), episode)
            repeated = played_on[_played_on(episode)] > 1
            yield EpisodeTask(options, folder, repeated=repeated, reports_failure=True)

    def spent(self) -> float:
        """US dollars that the folder's calls of models have cost, those of aborted and of stopped episodes too."""
        rows = sum(cost_of(row) for row in self.results.rows)
        return max(rows, SpendingLimits(None, None, self._ledger).spent().usd if self._ledger.is_file() else 0.0)

    @property
    def _ledger(self) -> Path:
        return self.results.folder / "money"

    def _counted(self, options: PlayOptions, episode: SuiteEpisode) -> PlayOptions:
        """The options with what becomes of calls, where there are any, and where their money is counted."""
        if not episode.cell.player.declared.calls:
            return options
        record = self._name(episode)
        return msgspec.structs.replace(
            options,
            calls=self.calls,
            calls_from=str(self.calls_from / "runs" / record) if self.calls_from is not None else "",
            max_cost=self.max_cost,
            ledger=str(self._ledger),
        )

    def _options(self, cell: SuiteCell, seed: int) -> PlayOptions:
        salt = self.results.salt()
        return options_of_cell(cell, seed, policy_seed(salt, cell.key, seed), self.plan.suite.evaluators)

    def _folder(self, episode: SuiteEpisode) -> Path:
        return self.results.folder / "runs" / self._name(episode)

    def _name(self, episode: SuiteEpisode) -> str:
        """What the run's folder is called in the folder of any suite that plays it."""
        cell = episode.cell
        whole = "-".join((*filter(None, cell.key), str(episode.seed)))
        plain = re.sub(r"[^\w.=-]+", "_", whole)[:100]
        unique = "" if plain == whole else f"-{hashlib.sha256(whole.encode()).hexdigest()[:8]}"
        return f"{plain}{unique}"

    def _keeps(self, cell: SuiteCell) -> bool:
        """Whether its runs stay: what a model was asked and answered has been paid for."""
        return self.keep or cell.player.declared.calls

    def _row(self, episode: SuiteEpisode, options: PlayOptions, report: EpisodeReport, wall_s: float) -> SuiteRow:
        cell = episode.cell
        standing: RowStanding = "counted"
        if report.reason == ABORTED:
            standing = "aborted" if episode.tries < TRIES else "lost"
        kept = report.trace.removeprefix(f"{self.results.folder}/") if self._keeps(cell) else ""
        return SuiteRow(
            suite=self.plan.suite.name,
            entrant=cell.player.name,
            group=cell.player.group,
            mission=cell.column.mission,
            mode=cell.column.mode,
            condition=cell.condition,
            baseline=cell.baseline,
            entrant_place=cell.place[0],
            condition_place=cell.place[1],
            seed=episode.seed,
            tries=episode.tries,
            standing=standing,
            policy=cell.player.declared.name,
            model=cell.player.model.name if cell.player.model else "",
            privileged=cell.player.privileged or report.privileged,
            policy_seed=options.policy_seed,
            salt_sha256=fingerprint(self.results.salt()),
            code=self.code,
            wall_s=wall_s,
            ended_unix_s=round(time.time(), 1),
            options=msgspec.structs.replace(options, mission=cell.column.mission, ledger="", calls_from=""),
            report=msgspec.structs.replace(report, trace=kept),
        )


def _played_on(episode: SuiteEpisode) -> tuple[object, ...]:
    """What decides the instance: episodes of one are played on one placed world."""
    column = episode.cell.column
    return str(column.path), column.mode, tuple(sorted(column.settings.items())), episode.seed


def cost_of(row: SuiteRow) -> float:
    """US dollars that the row's policies spent on models."""
    return row.report.metrics.cost_usd if row.report.metrics is not None else 0.0


def take_away(folder: Path) -> None:
    """Remove a run. An episode whose suite was killed may write into it for a moment yet, until it has ended itself."""
    deadline = time.monotonic() + LINGERS_S
    while folder.exists():
        try:
            shutil.rmtree(folder)
        except OSError as error:
            if time.monotonic() > deadline:
                raise UsageError(f"cannot remove `{folder}`: {error.strerror}") from error
            time.sleep(0.2)


def _difference(then: PlayOptions, now: PlayOptions) -> str:
    """The first option that differs, as it was and as it is."""
    then = comparable(then)
    name = next(name for name in then.__struct_fields__ if getattr(then, name) != getattr(now, name))
    return f"`{name}` was {getattr(then, name)!r} and is {getattr(now, name)!r}"


__all__ = ["TRIES", "Shard", "SuiteEpisode", "SuiteRun", "cost_of", "take_away"]
