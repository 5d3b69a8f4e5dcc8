"""Playing of the episodes that a suite's folder lacks: seed by seed, aborted ones again. Results are stored at once.

An episode aborted by the infrastructure is played again with its seed, and never counts for or against an entrant.
After the third abort it is stored as lost, so that tables report it; `retry_lost` makes it due again. While the service
of an entrant is down, no episode of the entrant begins (`services`). An error of the policy itself is no abort: if it
prevents an episode from starting, that is a failure (`POLICY_FAILED`). An entrant with lost episodes is not ranked
(`unresolved`).
"""

from __future__ import annotations

import hashlib
import shutil
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Literal

import msgspec

from lingjing.bench.countdown import Countdown
from lingjing.bench.evidence import check_rows, seal_of
from lingjing.bench.executors import Executor
from lingjing.bench.folder import RUNS, ResultsFolder, fingerprint, policy_seed
from lingjing.bench.planning import Isolation, SuiteCell, SuitePlan, options_of_cell
from lingjing.bench.rows import (
    RowStanding,
    SuiteRow,
    code_sha256,
    comparable,
)
from lingjing.bench.services import EntrantServices, probe_entrant
from lingjing.bench.version import benchmark_version, mission_version
from lingjing.errors import LingjingError, UsageError
from lingjing.file_names import plain_name
from lingjing.mission.salts import read_salt
from lingjing.play.options import PlayOptions, without_folder, without_places
from lingjing.play.parallel import EpisodeTask
from lingjing.play.report import ABORTED, INTERRUPTED, EpisodeReport
from lingjing.play.spending import SpendingLimits
from lingjing.trace.call_store import CALLS_NAME, CallReader

TRIES = 3
"""The number of tries of an episode before it is lost. Chosen."""

LINGERS_S = 60.0
"""Seconds in which an episode ends after its suite was killed, at most. Chosen."""

OUT_OF_LIMITS = ("money:", "tokens:")
"""First words of the detail of an abort that a limit of the suite has caused."""


@dataclass(frozen=True, slots=True)
class Shard:
    """The `number`-th of `count` parts of a suite, from 1. Episodes are distributed by hash, so all parts have similar
    work.
    """

    number: int = 1
    count: int = 1

    def has(self, cell: SuiteCell, seed: int) -> bool:
        """Return whether the episode belongs to this part."""
        key = "/".join((*cell.key, str(seed))).encode()
        return int.from_bytes(hashlib.sha256(key).digest()[:8]) % self.count == self.number - 1


WHOLE = Shard()
"""The complete suite as one part."""


@dataclass(frozen=True, slots=True)
class SuiteEpisode:
    """One episode to play."""

    cell: SuiteCell
    seed: int
    tries: int = 1
    """The number of the try, from 1."""


@dataclass
class SuiteRun:
    """The run of a suite into a folder."""

    plan: SuitePlan
    results: ResultsFolder
    code: str
    """SHA-256 of the code and missions."""
    executor: Executor
    keep: bool = False
    """True if all traces are kept."""
    max_cost: float | None = None
    """Limit of the cost of all model calls, US dollars, including earlier commands; None: no limit."""
    calls: Literal["record", "replay", "live"] = "record"
    """The handling of model calls (see `PlayOptions`)."""
    calls_from: Path | None = None
    """The suite's folder with the record to replay."""
    isolate: Isolation = "no"
    """The walls around the policies."""
    salt: str = ""
    """The file of a sealed split's salt; "" for instances of public seeds."""
    policy_seed: int | None = None
    """The seed of the policies in every episode; None: drawn for each from the folder's salt."""
    keeps_calls: bool = True
    """True if the runs of policies that call models are kept, because such calls are paid for."""
    may_begin: Callable[[], bool] = field(default=lambda: True)
    """Returns whether another episode may begin."""
    tell: Callable[[SuiteRow, Countdown], None] = field(default=lambda row, countdown: None)
    """Receives each row, and the estimate of the rest."""
    services: EntrantServices = field(default_factory=lambda: EntrantServices(probe_entrant))
    """The services of the entrants that are down."""
    is_out_of_money: bool = False
    """True after the limit was reached."""
    is_out_of_time: bool = False
    """True after `may_begin` has prevented an episode from beginning."""
    _held: list[SuiteEpisode] = field(default_factory=list)
    """Episodes of the round that were not begun, because their service is down."""

    def due(self, seeds: Iterable[int], cells: Sequence[SuiteCell], shard: Shard = WHOLE) -> list[SuiteEpisode]:
        """Return the episodes still to be played, seed by seed, so that the cells of an unfinished suite are
        matched.
        """
        over = {(row.cell, row.report.seed) for row in self.results.rows if row.standing != "aborted"}
        tried = Counter((row.cell, row.report.seed) for row in self.results.rows if row.standing == "aborted")
        return [
            SuiteEpisode(cell, seed, 1 + tried[cell.key, seed])
            for seed in seeds
            for cell in cells
            if (cell.key, seed) not in over and shard.has(cell, seed)
        ]

    def check_resumable(self, *, other_code: bool = False, replay_changed: bool = False) -> tuple[Path, ...]:
        """Raise `UsageError` if the folder holds rows that may not stand beside new ones.

        `other_code`: rows of other code may. `replay_changed`: rows of missions that have changed are put aside, as the
        last step, and their files are returned.
        """
        rows = self.results.rows
        folder, suite = self.results.folder, self.plan.suite.name
        others = sorted({row.suite for row in rows} - {suite})
        if others:
            raise UsageError(
                f"`{folder}` holds results of the suite `{others[0]}`, this is `{suite}`",
                hint="choose another folder with -o",
            )
        if any(not row.mission_sha256 for row in rows):
            raise UsageError(
                f"the rows in `{folder}` are from before missions had versions",
                hint="choose another folder with -o",
            )
        if any(row.benchmark != self.benchmark for row in rows):
            raise UsageError(
                f"the rows in `{folder}` are of another version of the benchmark: prompts, looks or adjudication have "
                "changed since",
                hint="choose another folder with -o",
            )
        renewed = self._changed_missions(replay_changed=replay_changed)
        rows = [row for row in rows if row.mission not in renewed]
        other_versions = {row.code[:12] for row in rows if row.code != self.code}
        if other_versions and not other_code:
            counted = sum(row.code != self.code for row in rows)
            raise UsageError(
                f"{counted} of the {len(rows)} rows in `{folder}` were played with other code or missions "
                f"({', '.join(sorted(other_versions))}; now {self.code[:12]})",
                hint="choose another folder with -o, or continue anyway with --other-code",
            )
        now = {cell.key: comparable(self._options(cell, 0)) for cell in self.plan.cells}
        changed = [row for row in rows if row.cell in now and comparable(row.options) != now[row.cell]]
        if changed:
            first = changed[0]
            raise UsageError(
                f"{len(changed)} of the rows in `{folder}` were played with options that differ from the suite's; the "
                f"first is {first.entrant}, {first.column}{first.condition and f', {first.condition}'}, seed "
                f"{first.seed}: {_difference(first.options, now[first.cell])}",
                hint="choose another folder with -o, or restore the suite file",
            )
        return tuple(map(self.results.put_aside, renewed))

    def _changed_missions(self, *, replay_changed: bool) -> list[str]:
        """Return the missions with rows of another version. Raises `UsageError` if they may not be put aside."""
        folder, known = self.results.folder, self.missions
        old = [row for row in self.results.rows if row.mission_sha256 != known.get(row.mission, row.mission_sha256)]
        if old and not replay_changed:
            raise UsageError(
                f"the rows of {_listed(old)} in `{folder}` ({len(old)}) are of another version of the mission: its "
                "text, a library, a map or a look has changed since",
                hint="choose another folder with -o, or put them aside and play again with --replay-changed "
                "--other-code",
            )
        return sorted({row.mission for row in old})

    @cached_property
    def split_sha256(self) -> str:
        """The hash of the salt; "" without one. Raises `UsageError` for a file that is no secret salt."""
        return read_salt(self.salt).sha256 if self.salt else ""

    @property
    def benchmark(self) -> str:
        """The version of the benchmark."""
        return benchmark_version()

    @cached_property
    def missions(self) -> dict[str, str]:
        """The version of each mission of the suite, by its name."""
        files = {cell.column.mission: cell.column.path for cell in self.plan.cells}
        return {name: mission_version(file) for name, file in files.items()}

    @cached_property
    def harness(self) -> str:
        """The hash of the code without the missions."""
        return code_sha256(())

    def check_split(self, cells: Sequence[SuiteCell]) -> None:
        """Raise `UsageError` if the salt is not usable, or if a foreign policy could read it."""
        if self.salt and self.split_sha256 and self.isolate == "no" and any(cell.player.foreign for cell in cells):
            raise UsageError("a policy that is not isolated can read the salt", hint="remove --no-isolate")
        others = sorted({row.split_sha256 for row in self.results.rows} - {self.split_sha256})
        if others:
            salts = " and ".join(f"the salt {other[:16]}…" if other else "public seeds" for other in others)
            raise UsageError(
                f"the rows in `{self.results.folder}` were drawn with {salts}, and these episodes with "
                f"{f'the salt {self.split_sha256[:16]}…' if self.split_sha256 else 'public seeds'}",
                hint="choose another folder with -o, or name the same salt with --salt",
            )

    def check_recorded(self, episodes: Sequence[SuiteEpisode]) -> None:
        """Raise `UsageError` if calls are replayed and some episodes have no record of calls."""
        if self.calls_from is None:
            return
        with_calls = [self._name(episode) for episode in episodes if episode.cell.player.declared.calls]
        missing = [name for name in with_calls if not (self.calls_from / RUNS / name / CALLS_NAME).is_file()]
        if missing:
            raise UsageError(
                f"{len(missing)} of {len(with_calls)} episodes have no record of model calls in `{self.calls_from}`; "
                f"the first is {missing[0]}",
                hint="exclude them with --seeds, --limit, --missions, --modes or --entrants",
            )

    def play(self, episodes: Sequence[SuiteEpisode]) -> None:
        """Play all episodes. After an interrupt or an error that all episodes would share, finished rows are stored
        and the error is raised.
        """
        countdown = Countdown(self.executor.jobs, (episode.cell.key for episode in episodes))
        for row in self.results.rows:
            countdown.learn(row.cell, row.wall_s, cost_of(row))
        waiting = list(episodes)
        while waiting and not (self.is_out_of_money or self.is_out_of_time):
            waiting = self._round(waiting, countdown)
            held, self._held = self._held, []
            if held and not self.is_out_of_time:
                waiting += held
                self.services.wait(len(waiting))

    def retry_lost(self) -> int:
        """Make the lost episodes due again, and return their number."""
        lost = [row for row in self.results.rows if row.standing == "lost"]
        for row in lost:
            self.results.replace(msgspec.structs.replace(row, standing="aborted"))
        return len(lost)

    def _round(self, episodes: Sequence[SuiteEpisode], countdown: Countdown) -> list[SuiteEpisode]:
        """Play each episode once and return those to play again."""
        of = {self._folder(episode): episode for episode in episodes}
        started: dict[Path, float] = {}
        again: list[SuiteEpisode] = []
        for task, report in self.executor.play(self._tasks(of, started)):
            episode, wall_s = of[task.folder], time.monotonic() - started.pop(task.folder)
            if report.reason == INTERRUPTED:  # unfinished: the next command plays it again
                continue
            if report.reason == ABORTED and report.detail.startswith("calls:"):
                raise UsageError(f"{task.folder.name}: {report.detail}", hint=report.hint)
            if report.reason == ABORTED and report.detail.startswith(OUT_OF_LIMITS):
                self.is_out_of_money = True
                continue
            if self.calls != "replay":
                self.services.note(episode.cell, report)
            self._check_unchanged(episode.cell)
            row = self._row(episode, task.options, report, wall_s)
            check_rows([row])
            if not self._keeps(episode.cell):  # before the row is stored: a kill in between would leave the run forever
                remove_run(task.folder)
            self._tell_change(row)
            self.results.add(row)
            if row.standing == "aborted":
                again.append(SuiteEpisode(episode.cell, episode.seed, episode.tries + 1))
                countdown.learn(row.cell, row.wall_s, cost_of(row))
            else:
                countdown.done(row.cell, row.wall_s, cost_of(row))
            self.tell(row, countdown)
        return again

    def _check_unchanged(self, cell: SuiteCell) -> None:
        """Raise `UsageError` if the mission is no longer the one that the run began with: nothing says which of the two
        was played.
        """
        path, name = cell.column.path, cell.column.mission
        try:
            version = mission_version(path)
        except LingjingError:
            version = ""
        if version != self.missions[name]:
            raise UsageError(
                f"`{path}`, its libraries, maps or looks changed while the suite was played; episodes that ended "
                "afterwards are not stored",
                hint="continue with --replay-changed --other-code, or restore the mission",
            )

    def _tell_change(self, row: SuiteRow) -> None:
        """Tell that a service names another model than before for the same entrant."""
        before = dict.fromkeys(old.served for old in self.results.rows if old.entrant == row.entrant and old.served)
        if row.served and before and row.served not in before:
            self.services.tell(
                f"warning: the service of {row.entrant} names `{row.served}` now, and before `{[*before][-1]}`: "
                "the rows of both are kept, and tables say so"
            )

    def _tasks(self, of: dict[Path, SuiteEpisode], started: dict[Path, float]) -> Iterator[EpisodeTask]:
        """Yield the tasks until the money is spent; the remains of an unfinished try are removed first."""
        played_on = Counter(_played_on(episode) for episode in of.values())
        for folder, episode in of.items():
            self.is_out_of_money |= self.max_cost is not None and self.spent() >= self.max_cost
            self.is_out_of_time |= not self.may_begin()
            if self.is_out_of_money or self.is_out_of_time:
                return
            if self.services.is_down(episode.cell):
                self._held.append(episode)
                continue
            remove_run(folder)
            started[folder] = time.monotonic()
            options = self._counted(self._options(episode.cell, episode.seed), episode)
            repeated = played_on[_played_on(episode)] > 1
            yield EpisodeTask(options, folder, repeated=repeated, reports_failure=True)

    def spent(self) -> float:
        """Return the cost of all model calls of the folder, US dollars, including aborted and unfinished episodes.

        The ledger alone counts for policies behind walls: their calls go through a broker, and what they report beside
        is their own claim.
        """
        rows = sum(cost_of(row) for row in self.results.rows if row.options.isolate == "no")
        return max(rows, SpendingLimits(None, None, self._ledger).spent().usd if self._ledger.is_file() else 0.0)

    @property
    def _ledger(self) -> Path:
        return self.results.folder / "money"

    def _counted(self, options: PlayOptions, episode: SuiteEpisode) -> PlayOptions:
        """Return the options with the handling of calls and the ledger, if the policy calls models."""
        if not episode.cell.player.declared.calls:
            return options
        record = self._name(episode)
        return msgspec.structs.replace(
            options,
            calls=self.calls,
            calls_from=str(self.calls_from / RUNS / record) if self.calls_from is not None else "",
            max_cost=self.max_cost,
            ledger=str(self._ledger),
        )

    def _options(self, cell: SuiteCell, seed: int) -> PlayOptions:
        seeded = policy_seed(self.results.salt(), cell.key, seed) if self.policy_seed is None else self.policy_seed
        options = options_of_cell(cell, seed, seeded, self.plan.suite.evaluators, self.isolate)
        return msgspec.structs.replace(options, salt=self.salt)

    def _folder(self, episode: SuiteEpisode) -> Path:
        return self.results.folder / RUNS / self._name(episode)

    def _name(self, episode: SuiteEpisode) -> str:
        """Return the name of the run's folder, which is the same in the folder of any suite."""
        cell = episode.cell
        whole = "-".join((*filter(None, cell.key), str(episode.seed)))
        plain = plain_name(whole, 100)
        unique = "" if plain == whole else f"-{hashlib.sha256(whole.encode()).hexdigest()[:8]}"
        return f"{plain}{unique}"

    def _keeps(self, cell: SuiteCell) -> bool:
        """Return whether the cell's runs are kept. Recorded model calls are, because they were paid for."""
        return self.keep or (self.keeps_calls and cell.player.declared.calls)

    def _row(self, episode: SuiteEpisode, options: PlayOptions, report: EpisodeReport, wall_s: float) -> SuiteRow:
        cell = episode.cell
        standing: RowStanding = "counted"
        if report.reason == ABORTED:
            standing = "lost" if episode.tries % TRIES == 0 else "aborted"  # lost ones may be tried three times more
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
            served=_served(self._folder(episode) / CALLS_NAME),
            privileged=cell.player.privileged or report.privileged,
            foreign=cell.player.foreign,
            policy_seed=options.policy_seed,
            salt_sha256=fingerprint(self.results.salt()),
            split_sha256=self.split_sha256,
            seal=seal_of(Path(report.trace)) if report.trace else "",
            benchmark=self.benchmark,
            mission_sha256=self.missions[cell.column.mission],
            code=self.code,
            harness=self.harness,
            wall_s=wall_s,
            ended_unix_s=round(time.time(), 1),
            options=without_places(msgspec.structs.replace(options, mission=cell.column.mission)),
            report=msgspec.structs.replace(report, trace=kept, policy=without_folder(report.policy)),
        )


def _listed(rows: Iterable[SuiteRow]) -> str:
    """Return the missions of rows for a message."""
    return ", ".join(f"`{name}`" for name in sorted({row.mission for row in rows}))


def _served(record: Path) -> str:
    """Return the models that the answers of a record name, with commas; "" without a record that can be read."""
    if not record.is_file():
        return ""
    with suppress(UsageError), closing(CallReader(record)) as reader:
        return ", ".join(reader.served())
    return ""


def _played_on(episode: SuiteEpisode) -> tuple[object, ...]:
    """Return the key of the instance; episodes with one key share a placed world."""
    column = episode.cell.column
    return (
        str(column.path),
        column.mode,
        column.tier,
        column.language,
        tuple(sorted(column.settings.items())),
        episode.seed,
    )


def cost_of(row: SuiteRow) -> float:
    """Return the cost of the row's model calls, US dollars."""
    return row.report.metrics.cost_usd if row.report.metrics is not None else 0.0


def remove_run(folder: Path) -> None:
    """Remove a run. An episode of a killed suite may still write into it until it ends."""
    deadline = time.monotonic() + LINGERS_S
    while folder.exists():
        try:
            shutil.rmtree(folder)
        except OSError as error:
            if time.monotonic() > deadline:
                raise UsageError(f"cannot remove `{folder}`: {error.strerror}") from error
            time.sleep(0.2)


def _difference(then: PlayOptions, now: PlayOptions) -> str:
    """Return the first option that differs, with its old and new value."""
    then = comparable(then)
    name = next(name for name in then.__struct_fields__ if getattr(then, name) != getattr(now, name))
    return f"`{name}` was {getattr(then, name)!r} and is {getattr(now, name)!r}"


__all__ = ["TRIES", "Shard", "SuiteEpisode", "SuiteRun", "cost_of", "remove_run"]
