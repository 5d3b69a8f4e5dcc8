"""Adversaries: a declared matrix of pairs, the choice of the worst, and a sequential test of each column.

An *adversary* is a policy that takes a way past the task (`lingjing_agents.adversaries`). The matrix
(`suites/adversaries.toml`) names the columns in which each is plausible, and the guard that defeats it. A run has two
parts. First each pair plays a few seeds of a sealed split, and the *worst* adversary of each column is chosen: that
with the most wins, then the highest SCR. Then the worst one plays fresh seeds under the `PLAN`.

**The test.** A column *passes* if the worst adversary's rate is shown to be below 5 %: none won of the first 59
episodes, or at most 3 of the first 231. It *fails* with the fourth win. Two looks at one series of episodes err more
often than one look does: 0 of 59 alone errs with probability 4.85 % at a rate of 5 %, and 3 of 153 with 4.94 %, but
either of them with 7 %. The second look is therefore later: `pass_probability` computes the joint error by recursion
over the number of wins, and it is 5.00 % for this plan. To stop at the fourth win is no further look, because no later
episode could make such a column pass. Fresh seeds make the choice of the worst harmless. The error is that of each
column by itself.

An episode that the infrastructure lost three times counts as a win, the worst case.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import takewhile
from pathlib import Path
from statistics import fmean
from typing import Any, Literal

from pydantic import Field, ValidationError

from lingjing.bench.durations import SECONDS_AN_HOUR, USUAL_S, Durations
from lingjing.bench.planning import Isolation, SuiteCell, SuitePlan, plan_document
from lingjing.bench.rows import SuiteRow
from lingjing.bench.running import SuiteEpisode, SuiteRun
from lingjing.bench.suite import ShortText, SuitePart, find_suite, read_document
from lingjing.errors import UsageError
from lingjing.mission.tiers import USUAL
from lingjing.plugins.host import PluginHost
from lingjing.suggest import did_you_mean
from lingjing.whole_files import written_whole

SUITE = "adversaries"
"""The name of the shipped matrix."""
SELECTION = range(3)
"""Seeds of the sealed split on which the worst adversary is chosen."""
FIRST_FRESH = 1000
"""The first fresh seed."""
SALT = "split.salt"
"""The file of the sealed split in the results folder."""


@dataclass(frozen=True, slots=True)
class Look:
    """A time at which a column may pass."""

    played: int
    """Fresh episodes that must have been played."""
    wins: int
    """Wins with which the column passes, at most."""


PLAN = (Look(59, 0), Look(231, 3))
"""The looks, in order. 231 is the least number of episodes that keeps the joint error at 5 % with 3 wins."""
RATE = 0.05
"""The rate below which the worst adversary's must be shown to be."""


class Adversary(SuitePart):
    """A row of the matrix."""

    name: ShortText = Field(description="its name in tables")
    policy: str = Field(pattern=r"^[\w.]+:\w+$", description="its class, as package.module:Class")
    columns: tuple[ShortText, ...] = Field(min_length=1, strict=False, description="the columns where it is plausible")
    guard: str = Field(min_length=1, description="what defeats it")
    blank_pictures: bool = Field(False, description="true if it needs no pixel: it then receives black pictures")


class AdversaryMatrix(SuitePart):
    """The form of `suites/adversaries.toml`."""

    suite: Literal[1] = Field(description="the version of this form")
    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$", description="the name of its folder")
    title: str = Field("", max_length=200, description="the heading of its tables")
    about: str = Field("", max_length=4000, description="the question of the study")
    seconds: dict[str, float] = Field({}, description="measured seconds of an episode by column")
    adversaries: tuple[Adversary, ...] = Field(min_length=1, strict=False, description="the matrix")


class Verdict(StrEnum):
    """The state of a column."""

    PASSED = "passed"
    FAILED = "failed"
    OPEN = "undecided"


@dataclass(frozen=True, slots=True)
class ColumnResult:
    """The result of one column."""

    column: str
    worst: str
    """The worst adversary; "" before it is chosen."""
    won: int
    """Fresh episodes that it won; lost ones count as won."""
    played: int
    verdict: Verdict
    selection: tuple[tuple[str, int, int], ...]
    """Adversary, wins and episodes on the seeds of the selection."""


def pass_probability(plan: Sequence[Look], rate: float) -> float:
    """Return the exact probability that a column passes if its adversary wins at this rate.

    The state is the number of wins, which no early look has let pass; the recursion adds one episode at a time.
    """
    states, passed, played = {0: 1.0}, 0.0, 0
    for look in plan:
        for _ in range(look.played - played):
            following: dict[int, float] = {}
            for wins, probability in states.items():
                following[wins] = following.get(wins, 0.0) + probability * (1.0 - rate)
                following[wins + 1] = following.get(wins + 1, 0.0) + probability * rate
            states = following
        played = look.played
        passed += sum(probability for wins, probability in states.items() if wins <= look.wins)
        states = {wins: probability for wins, probability in states.items() if wins > look.wins}
    return passed


def verdict_of(wins: Sequence[bool], plan: Sequence[Look] = PLAN) -> Verdict:
    """Return the state of a column after its fresh episodes, in the order of their seeds.

    Only the looks of the plan let a column pass: 0 wins of 70 is the pass of the look at 59.
    """
    for look in plan:
        if len(wins) >= look.played and sum(wins[: look.played]) <= look.wins:
            return Verdict.PASSED
        if sum(wins[: look.played]) > plan[-1].wins:
            return Verdict.FAILED
    return Verdict.OPEN


def read_matrix(path: Path | None = None) -> AdversaryMatrix:
    """Return the matrix of a file, by default the shipped one. Raises `UsageError` for a wrong form."""
    path = path or find_suite(SUITE)
    try:
        return AdversaryMatrix.model_validate(read_document(path))
    except ValidationError as error:
        faults = "; ".join(f"{'.'.join(map(str, problem['loc']))}: {problem['msg']}" for problem in error.errors())
        raise UsageError(f"{path}: {faults}", hint="docs/adversaries.md describes the matrix") from error


def plan_of(matrix: AdversaryMatrix, host: PluginHost, isolate: Isolation, tier: int = USUAL) -> SuitePlan:
    """Return the plan of the matrix: one cell for each pair. Raises `UsageError` for an unknown column or class."""
    wanted = dict.fromkeys(column for each in matrix.adversaries for column in each.columns)
    document: dict[str, Any] = {
        "suite": 1,
        "name": matrix.name,
        "title": matrix.title,
        "about": matrix.about,
        "missions": list(dict.fromkeys(column.partition("-")[0] for column in wanted)),
        "columns": list(wanted),
        "tier": tier,
        "seeds": len(SELECTION),
        "entrants": [each.model_dump(include={"name", "policy", "blank_pictures"}) for each in matrix.adversaries],
    }
    plan = plan_document(document, find_suite(SUITE), host, isolate=isolate)
    pairs = {(each.name, column) for each in matrix.adversaries for column in each.columns}
    cells = tuple(cell for cell in plan.cells if (cell.player.name, cell.column_name) in pairs)
    return SuitePlan(plan.suite, plan.path, cells, plan.missions, plan.files)


def make_salt(folder: Path, rows: Iterable[SuiteRow] = ()) -> Path:
    """Return the salt file of a results folder, made at random and readable for its owner alone if there is none.

    `rows`: those of the folder. Raises `UsageError` if the file cannot be written, or has drawn rows and is gone.
    """
    file = folder / SALT
    if file.exists():
        return file
    if drawn := sum(bool(row.split_sha256) for row in rows):
        raise UsageError(
            f"the salt file `{file}` is missing: it has drawn {drawn} row{'s' * (drawn != 1)} there",
            hint="put it back, or choose another folder with -o",
        )
    try:
        with written_whole(file) as partial:
            partial.chmod(0o600)
            partial.write_text(f"{secrets.token_hex(32)}\n", encoding="ascii")
    except OSError as error:
        raise UsageError(f"cannot write `{file}`: {error.strerror}", hint="choose another folder with -o") from error
    return file


@dataclass
class AdversaryRun:
    """The run of a matrix into a folder. The same call continues it: only missing episodes are played."""

    run: SuiteRun
    cells: Sequence[SuiteCell]
    selection: Sequence[int] = SELECTION
    """Seeds of the selection."""
    plan: Sequence[Look] = PLAN
    tell: Callable[[str], None] = field(default=lambda line: None)
    """Receives a line for each chosen adversary and each verdict."""
    seconds: Mapping[str, float] = field(default_factory=dict)
    """Declared seconds of an episode by column, for columns without rows."""

    def select(self) -> None:
        """Play the pairs on the seeds of the selection."""
        self.run.play(self.run.due(self.selection, self.cells))

    def test(self) -> None:
        """Play fresh seeds with the worst adversary of each column until its verdict, the quickest columns first."""
        for column in self.columns:
            worst = self.worst(column)
            if worst is None:
                continue
            self.tell(f"{column}: {worst.player.name} is the worst")
            while self.result(column).verdict is Verdict.OPEN:
                due = self._next(worst)
                if not due or self.run.is_out_of_money:
                    break
                self.run.play(due)
            result = self.result(column)
            self.tell(f"{column}: {result.verdict}, {result.worst} won {result.won} of {result.played}")

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns, in the order of the matrix."""
        return tuple(dict.fromkeys(cell.column_name for cell in self.cells))

    def results(self) -> tuple[ColumnResult, ...]:
        """Return the state of every column."""
        return tuple(map(self.result, self.columns))

    def result(self, column: str) -> ColumnResult:
        """Return the state of a column."""
        worst = self.worst(column)
        selection = tuple(
            (cell.player.name, sum(map(_won, rows)), len(rows))
            for cell in self._of(column)
            if (rows := self._rows(cell, self.selection))
        )
        if worst is None:
            return ColumnResult(column, "", 0, 0, Verdict.OPEN, selection)
        won = [_won(row) for row in self._fresh_rows(worst)]
        verdict = verdict_of(won, self.plan)
        return ColumnResult(column, worst.player.name, sum(won), len(won), verdict, selection)

    def worst(self, column: str) -> SuiteCell | None:
        """Return the worst adversary of a column; None until every pair has played the selection."""
        scored = [(cell, self._rows(cell, self.selection)) for cell in self._of(column)]
        if not scored or any(len(rows) < len(self.selection) for _, rows in scored):
            return None
        return max(scored, key=lambda pair: (sum(map(_won, pair[1])), fmean(row.report.scr for row in pair[1])))[0]

    def _of(self, column: str) -> list[SuiteCell]:
        return [cell for cell in self.cells if cell.column_name == column]

    def left(self) -> list[SuiteCell]:
        """Return the cell of each episode that is left to the next look of every column. The first adversary of a
        column stands for the worst one before the choice.
        """
        cells = [episode.cell for episode in self.run.due(self.selection, self.cells)]
        for column in self.columns:
            result = self.result(column)
            if result.verdict is Verdict.OPEN:
                cells += [self.worst(column) or self._of(column)[0]] * self._to_look(result)
        return cells

    def left_s(self) -> float:
        """Return the estimated seconds of these episodes."""
        known = Durations(self.seconds, self.run.results.rows)
        return known.hours(self.left(), self.run.executor.jobs) * SECONDS_AN_HOUR

    def _next(self, cell: SuiteCell) -> list[SuiteEpisode]:
        """Return the next fresh episodes of a cell: as many as every path to a verdict has, and one for each job."""
        result = self.result(cell.column_name)
        to_failure = self.plan[-1].wins + 1 - result.won
        count = max(self.run.executor.jobs, min(self._to_look(result), to_failure))
        return self.run.due(self._fresh, [cell])[:count]

    def _to_look(self, result: ColumnResult) -> int:
        """Return the number of episodes to the next look; 0 after the last."""
        return next((look.played - result.played for look in self.plan if look.played > result.played), 0)

    @property
    def _fresh(self) -> range:
        return range(FIRST_FRESH, FIRST_FRESH + self.plan[-1].played)

    def _fresh_rows(self, cell: SuiteCell) -> list[SuiteRow]:
        """Return the rows of the fresh seeds up to the first one that was not played: looks are at whole beginnings."""
        rows = {row.report.seed: row for row in self._rows(cell, self._fresh)}
        return [rows[seed] for seed in takewhile(rows.__contains__, self._fresh)]

    def _rows(self, cell: SuiteCell, seeds: Iterable[int]) -> list[SuiteRow]:
        wanted = frozenset(seeds)
        return [
            row
            for row in self.run.results.rows
            if row.cell == cell.key and row.report.seed in wanted and row.standing != "aborted"
        ]


def _won(row: SuiteRow) -> bool:
    """True if the episode was won, or lost by the infrastructure three times: the worst case."""
    return row.standing == "lost" or row.report.success


def hours(matrix: AdversaryMatrix, plan: Sequence[Look], selection: int, jobs: int) -> tuple[float, float, float]:
    """Return the hours of the selection, and of the test if no adversary wins, and if each goes to the last look."""
    pairs = [column for each in matrix.adversaries for column in each.columns]
    seconds = {column: matrix.seconds.get(column, USUAL_S) for column in pairs}
    first = sum(seconds[column] for column in pairs) * selection
    least, most = (sum(seconds.values()) * look.played for look in (plan[0], plan[-1]))
    return first / 3600.0 / jobs, least / 3600.0 / jobs, most / 3600.0 / jobs


def chosen(matrix: AdversaryMatrix, columns: Sequence[str], adversaries: Sequence[str]) -> AdversaryMatrix:
    """Return the part of the matrix with some columns and adversaries; all without names. Raises `UsageError` for an
    unknown name, or if no pair is left.
    """
    known: Mapping[str, Sequence[str]] = {
        "columns": list(dict.fromkeys(column for each in matrix.adversaries for column in each.columns)),
        "adversaries": [each.name for each in matrix.adversaries],
    }
    for option, names in (("columns", columns), ("adversaries", adversaries)):
        for name in names:
            if name not in known[option]:
                of_mission = [each for each in known[option] if each.partition("-")[0] == name]
                usual = did_you_mean(name, known[option], option)
                hint = f"did you mean {' or '.join(of_mission)}?" if of_mission else usual
                raise UsageError(f"--{option} {name}: the matrix has no such name", hint=hint)
    kept = []
    for each in matrix.adversaries:
        left = tuple(column for column in each.columns if not columns or column in columns)
        if left and (not adversaries or each.name in adversaries):
            kept.append(each.model_copy(update={"columns": left}))
    if not kept:
        raise UsageError("no chosen adversary is plausible in a chosen column", hint="remove --adversaries")
    return matrix.model_copy(update={"adversaries": tuple(kept)})


def result_lines(results: Sequence[ColumnResult]) -> list[str]:
    """Return the results as a table in Markdown."""
    lines = ["| Column | Worst adversary | Fresh episodes won | Verdict | On the seeds of the selection |",
             "| --- | --- | ---: | --- | --- |"]  # fmt: skip
    for result in results:
        others = ", ".join(f"{name} {won}/{played}" for name, won, played in result.selection)
        fresh = f"{result.won} of {result.played}" if result.worst else "–"
        lines.append(f"| {result.column} | {result.worst or '–'} | {fresh} | {result.verdict} | {others or '–'} |")
    return lines


__all__ = [
    "PLAN", "AdversaryMatrix", "AdversaryRun", "ColumnResult", "Look", "Verdict", "chosen", "hours",
    "make_salt", "pass_probability", "plan_of", "read_matrix", "result_lines", "verdict_of",
]  # fmt: skip
