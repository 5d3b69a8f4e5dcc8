"""The studies of a program: their plans, and their runs in folders.

Two kinds of study have one interface: `PartStudy` plays a part at one tier, `AdversaryStudy` plays the matrix of
adversaries. Both leave the playing to `SuiteRun`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

from lingjing.bench.adversaries import (
    FIRST_FRESH,
    SALT,
    AdversaryMatrix,
    AdversaryRun,
    chosen,
    make_salt,
    plan_of,
    read_matrix,
)
from lingjing.bench.executors import Executor
from lingjing.bench.folder import ResultsFolder, open_results
from lingjing.bench.money import is_paid
from lingjing.bench.planning import Isolation, SuiteCell, SuitePlan, plan_document
from lingjing.bench.rows import code_sha256
from lingjing.bench.running import SuiteEpisode, SuiteRun
from lingjing.bench.suite import NameOrFile, faults_error, find_suite
from lingjing.bench.validity.program import ADVERSARIES, ProgramAdversaries, ProgramFile, ProgramPart, Sees
from lingjing.errors import Fault, UsageError
from lingjing.mission.tiers import USUAL
from lingjing.plugins.host import PluginHost


@dataclass(frozen=True, slots=True)
class PlannedPart:
    """A part at one tier."""

    part: ProgramPart
    tier: int
    plan: SuitePlan

    @property
    def name(self) -> str:
        """The name of its folder and suite, such as `reference-tier1`."""
        return f"{self.part.name}-tier{self.tier}"

    @property
    def sees(self) -> dict[str, Sees]:
        """The source of each entrant's knowledge, by the entrant's name."""
        names = [player.name for player in self.plan.players]
        return dict(zip(names, (entrant.sees for entrant in self.part.entrants), strict=True))


@dataclass(frozen=True, slots=True)
class PlannedAdversaries:
    """The matrix of adversaries."""

    declared: ProgramAdversaries
    matrix: AdversaryMatrix
    plan: SuitePlan

    @property
    def name(self) -> str:
        """The name of its folder, in which `lingjing bench adversaries -o` continues the test."""
        return ADVERSARIES

    @property
    def tier(self) -> int:
        """The tier that adversaries play."""
        return USUAL


Planned = PlannedPart | PlannedAdversaries


def plan_program(file: ProgramFile, host: PluginHost, *, strict: bool = False) -> tuple[Planned, ...]:
    """Return the plans of all studies, in the order of the file. Raises `UsageError` with the path of every error."""
    faults: list[Fault] = []
    planned: list[Planned] = []
    isolate: Isolation = "strict" if strict else "foreign"
    for at, part in enumerate(file.program.parts):
        for tier in part.tiers:
            document = _suite_document(file, part, tier)
            try:
                study = PlannedPart(part, tier, plan_document(document, file.path, host, isolate=isolate))
            except UsageError as error:
                faults += _of_part(at, part, error)
                continue
            planned.append(study)
            faults += _faults_of_plan(at, study)
    if file.program.adversaries is not None:
        try:
            planned.append(_planned_adversaries(file.program.adversaries, file.path, host, strict=strict))
        except UsageError as error:
            faults.append(Fault(ADVERSARIES, str(error), error.hint))
    if faults:
        raise faults_error(file.path, tuple(dict.fromkeys(faults)))
    return tuple(planned)


def _suite_document(file: ProgramFile, part: ProgramPart, tier: int) -> dict[str, Any]:
    """Return the suite of a part at one tier, as a suite file would hold it."""
    missions: Sequence[NameOrFile] = part.missions or file.program.missions
    document: dict[str, Any] = {
        "suite": 1,
        "name": f"{part.name}-tier{tier}",
        "title": file.program.title,
        "about": part.about,
        "missions": list(missions),
        "tier": tier,
        "seeds": list(part.seeds),
        "entrants": [entrant.model_dump(exclude={"sees"}, exclude_defaults=True) for entrant in part.entrants],
    }
    return document if part.columns is None else {**document, "columns": list(part.columns)}


def _of_part(at: int, part: ProgramPart, error: UsageError) -> Iterator[Fault]:
    """Yield the errors of a part's suite, each with its path in the program."""
    if not error.faults:
        yield Fault(f"parts[{at}]", str(error), error.hint)
    for fault in error.faults:
        is_programs = fault.where.startswith("missions") and part.missions is None
        where = "tiers" if fault.where == "tier" else fault.where
        yield Fault(where if is_programs else f"parts[{at}].{where}", fault.message, fault.hint)


def _faults_of_plan(at: int, study: PlannedPart) -> Iterator[Fault]:
    for place, player in enumerate(study.plan.players):
        if is_paid(player):
            where = f"parts[{at}].entrants[{place}]"
            yield Fault(where, "its model calls cost money", "play it with `lingjing bench` and --max-cost")
    if study.part.compares == "modes":
        modes = {(cell.column.mission, cell.column.mode) for cell in study.plan.cells}
        for mission in study.plan.missions:
            if not {(mission, "star"), (mission, "broadcast")} <= modes:
                yield Fault(f"parts[{at}].compares", f"`{mission}` is not played in the modes star and broadcast")


def _planned_adversaries(
    declared: ProgramAdversaries, program: Path, host: PluginHost, *, strict: bool
) -> PlannedAdversaries:
    beside = program.parent / declared.matrix
    matrix = read_matrix(beside if beside.is_file() else find_suite(declared.matrix))
    matrix = chosen(matrix, declared.columns, ())
    return PlannedAdversaries(declared, matrix, plan_of(matrix, host, "strict" if strict else "yes", USUAL))


def planned_cells(
    planned: Planned, limit: int | None = None, entrants: Collection[str] = ()
) -> list[tuple[SuiteCell, int]]:
    """Return the cell and the seed of each episode of a study, `limit` seeds at most; of these entrants of a part
    alone, if some are named.

    The worst adversary of a column is not known beforehand: the first one of the column stands for it.
    """
    cells = planned.plan.cells
    if isinstance(planned, PlannedPart):
        cells = _of_entrants(cells, entrants)
        return [(cell, seed) for seed in planned.part.seeds[:limit] for cell in cells]
    declared = planned.declared
    choice = range(declared.selection)[:limit]
    fresh = range(FIRST_FRESH, FIRST_FRESH + declared.fresh)[: limit if len(choice) == declared.selection else 0]
    worst = {cell.column_name: cell for cell in reversed(cells)}.values()
    return [(cell, seed) for seed in choice for cell in cells] + [(cell, seed) for seed in fresh for cell in worst]


def _of_entrants(cells: Sequence[SuiteCell], entrants: Collection[str]) -> tuple[SuiteCell, ...]:
    return tuple(cell for cell in cells if not entrants or cell.player.name in entrants)


class Study(Protocol):
    """A study in its folder."""

    @property
    def planned(self) -> Planned:
        """The plan of the study."""

    @property
    def run(self) -> SuiteRun:
        """The run into its folder."""

    @property
    def size(self) -> int:
        """The number of its seeds."""

    def due(self, count: int) -> list[SuiteEpisode]:
        """Return the episodes of the first `count` seeds that are still to be played, as far as they are known."""

    def left(self, count: int) -> list[SuiteCell]:
        """Return the cell of each of these episodes. A cell stands for a worst adversary that is not chosen yet."""

    def play(self, count: int) -> None:
        """Play these episodes, until the run's time is over."""


@dataclass(frozen=True)
class PartStudy:
    """A part at one tier, in its folder."""

    planned: PlannedPart
    run: SuiteRun
    entrants: Collection[str] = ()
    """The names of the entrants to play; all if there are none."""

    @property
    def size(self) -> int:
        """The number of its seeds."""
        return len(self.planned.part.seeds)

    def due(self, count: int) -> list[SuiteEpisode]:
        """Return the episodes of the first `count` seeds that are still to be played."""
        return self.run.due(self.planned.part.seeds[:count], _of_entrants(self.planned.plan.cells, self.entrants))

    def left(self, count: int) -> list[SuiteCell]:
        """Return the cell of each of these episodes."""
        return [episode.cell for episode in self.due(count)]

    def play(self, count: int) -> None:
        """Play these episodes."""
        self.run.play(self.due(count))


@dataclass(frozen=True)
class AdversaryStudy:
    """The adversaries, in their folder. A round first completes the choice, then it plays fresh seeds."""

    planned: PlannedAdversaries
    run: SuiteRun

    @cached_property
    def whole(self) -> AdversaryRun:
        """The run of the matrix."""
        return AdversaryRun(self.run, self.planned.plan.cells, range(self.planned.declared.selection))

    @property
    def size(self) -> int:
        """The number of its fresh seeds."""
        return self.planned.declared.fresh

    def due(self, count: int) -> list[SuiteEpisode]:
        """Return the missing episodes of the choice, and the fresh ones of each adversary that is chosen."""
        worst = [cell for column in self.whole.columns if (cell := self.whole.worst(column)) is not None]
        return self._choosing(count) + self.run.due(range(FIRST_FRESH, FIRST_FRESH + min(count, self.size)), worst)

    def left(self, count: int) -> list[SuiteCell]:
        """Return the cell of each of these episodes; a column without a worst adversary has all fresh ones left."""
        cells = [episode.cell for episode in self.due(count)]
        for column in self.whole.columns if count >= len(self.whole.selection) else ():
            if self.whole.worst(column) is None:
                first = next(cell for cell in self.planned.plan.cells if cell.column_name == column)
                cells += [first] * min(count, self.size)
        return cells

    def play(self, count: int) -> None:
        """Choose the worst adversaries, and play their fresh seeds."""
        self.run.play(self._choosing(count))
        if not self.run.is_out_of_time:
            self.run.play(self.due(count))

    def _choosing(self, count: int) -> list[SuiteEpisode]:
        return self.run.due(self.whole.selection[:count], self.planned.plan.cells)


@contextmanager
def open_studies(
    planned: Sequence[Planned], folder: Path, executor: Executor, *, strict: bool = False, keep: bool = False,
    other_code: bool = False, replay_changed: bool = False, reading: bool = False, entrants: Collection[str] = (),
    tell_aside: Callable[[tuple[Path, ...]], None] = lambda files: None,
) -> Iterator[tuple[Study, ...]]:  # fmt: skip
    """Yield the studies in folders below `folder`, which are made and locked. `strict`: every wall must stand.
    `reading`: nothing will be played, so that rows of another version may stand there. `entrants`: only these entrants
    of the parts are due; all if none is named. `replay_changed`: rows of missions that have changed are put aside;
    `tell_aside` receives their files.

    Raises `UsageError` before anything is played if a folder cannot be written, or holds rows that may not stand beside
    new ones, as `lingjing bench` does.
    """
    with ExitStack() as stack:
        studies: list[Study] = []
        for plan in planned:
            results = stack.enter_context(open_results(folder / plan.name))
            code = code_sha256(plan.plan.files)
            run = SuiteRun(plan.plan, results, code, executor, keep=keep, keeps_calls=False)
            if isinstance(plan, PlannedAdversaries):
                run.isolate = "strict" if strict else "yes"
                run.salt = _salt_of(results, reading=reading)
                studies.append(AdversaryStudy(plan, run))
            else:
                run.isolate = "strict" if strict else "foreign"
                run.salt = _salt_of(results, reading=reading) if plan.part.compares == "redrawn" else ""
                run.policy_seed = plan.part.policy_seed
                studies.append(PartStudy(plan, run, entrants))
            if not reading:
                run.check_split(plan.plan.cells)
                tell_aside(run.check_resumable(other_code=other_code, replay_changed=replay_changed))
        yield tuple(studies)


def _salt_of(results: ResultsFolder, *, reading: bool) -> str:
    """Return the path of a folder's salt, which is made unless the folder is only read; "" without a salt."""
    if reading and not (results.folder / SALT).exists():
        return ""
    return str(make_salt(results.folder, results.rows).absolute())


__all__ = [
    "AdversaryStudy", "PartStudy", "Planned", "PlannedAdversaries", "PlannedPart", "Study", "open_studies",
    "plan_program", "planned_cells",
]  # fmt: skip
