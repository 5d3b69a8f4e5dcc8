"""A suite in one call of Python: the same plan, rows, folder and tables as `lingjing bench`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lingjing.bench.attribution import is_attribution_suite
from lingjing.bench.executors import LocalExecutor
from lingjing.bench.exports import EXPORTS, SUFFIXES, html_page
from lingjing.bench.folder import ResultsFolder, open_results, with_attention
from lingjing.bench.money import check_ready, is_paid
from lingjing.bench.planning import Isolation, SuiteCell, SuitePlan, read_plan
from lingjing.bench.rows import SuiteRow, code_sha256
from lingjing.bench.running import SuiteRun
from lingjing.bench.suite import find_suite
from lingjing.bench.table_cells import ResultTable
from lingjing.bench.tables import TABLES, make_tables
from lingjing.errors import UsageError
from lingjing.installed_plugins.discovery import trusting
from lingjing.play.folders import RUNS
from lingjing.plugins.host import PluginHost
from lingjing.suggest import did_you_mean, nearest_or

if TYPE_CHECKING:
    from lingjing.trace.tables import FrameLibrary


@dataclass(frozen=True, slots=True, repr=False)
class SuiteResults:
    """The results of a suite: what `lingjing.bench` returns.

    >>> results = lingjing.bench("first.toml", out="runs/bench/first")
    >>> print(*(line for line in results.tables("success").splitlines() if line.startswith("| random")))
    | random | 0 | 0 |
    >>> [(row.entrant, row.seed, row.report.metrics["success"]) for row in results.rows]
    [('random', 0, False)]
    """

    folder: Path
    """The results folder; the same call continues there after an interrupt."""
    title: str
    """The suite's title."""
    kinds: tuple[str, ...] = field(repr=False)
    """The kinds of the suite's tables."""
    rows: tuple[SuiteRow, ...] = field(repr=False)
    """One row for each stored episode, aborted tries included."""

    def tables(self, *kinds: str, format: str = "markdown") -> str:  # noqa: A002 - the option of the command
        """Return tables as text, by default those of the suite: kinds and formats are those of `lingjing bench table`.

        Raises `UsageError` for an unknown format or kind.
        """
        if format not in EXPORTS:
            raise UsageError(f"no format is called `{format}`", hint=f"there are: {', '.join(EXPORTS)}")
        unknown = [kind for kind in kinds if kind not in TABLES]
        if unknown:
            hint = nearest_or(unknown[0], TABLES, f"there are: {', '.join(TABLES)}")
            raise UsageError(f"no kind of table is called `{unknown[0]}`", hint=hint)
        return "\n".join(map(EXPORTS[format], make_tables(list(self.rows), kinds or self.kinds, self.title)))

    def __repr__(self) -> str:
        """One line."""
        return f"<SuiteResults {self.title!r}: {len(self.rows)} rows, {self.folder}>"

    def _repr_html_(self) -> str:
        """Return the suite's tables, for notebooks."""
        return self.tables(format="html")

    def to_frame(self, library: FrameLibrary = "pandas") -> Any:
        """Return the rows as a data frame with the columns of `results.parquet`, one for each metric."""
        from lingjing.bench.parquet import rows_frame

        return rows_frame(self.rows, library)


def bench(
    suite: str | PathLike[str],
    *,
    out: str | PathLike[str] | None = None,
    jobs: int = 1,
    missions: Collection[str] = (),
    modes: Collection[str] = (),
    entrants: Collection[str] = (),
    policies: Sequence[str] = (),
    seeds: Sequence[int] = (),
    max_cost: float | None = None,
    keep: bool = False,
    other_code: bool = False,
    replay_changed: bool = False,
    isolate: Isolation = "foreign",
    trust: Sequence[str] = (),
    salt: str | PathLike[str] = "",
    progress: Callable[[SuiteRow], None] | None = None,
) -> SuiteResults:
    """Play the missing episodes of a suite, `jobs` at a time, and return all its results.

    `suite` is a TOML file or the name of a shipped suite. `out` is the results folder; an existing one is continued.
    `missions`, `modes` and `entrants` select parts of the suite; `policies` replace its entrants, `seeds` its seeds.
    `keep` keeps every trace, `max_cost` limits the cost of model calls (US dollars), `other_code` accepts rows of
    another version of the code, `replay_changed` puts rows of missions that have changed aside. `isolate` puts walls
    around policies: around none (`no`), around those that are not this project's (`foreign`), around all (`yes`), or
    around all and none may be missing (`strict`). Foreign plug-ins then run in this process only if `trust` names them.
    `salt` is the secret file of a sealed split (`docs/trust.md`). `progress` receives each new row.

    >>> results = lingjing.bench("first.toml", out="runs/bench/first", policies=["random"], seeds=[0])
    >>> results.rows[0].standing
    'counted'

    Raises `UsageError` for a faulty suite or argument, and the errors of `lingjing bench`.
    """
    path = find_suite(fspath(suite))
    if is_attribution_suite(path):
        raise UsageError(f"`{path}` measures attribution methods", hint="play it with `lingjing bench`")
    if jobs < 1:
        raise UsageError(f"jobs={jobs}: must be 1 or more")
    with trusting(None if isolate == "no" else trust):
        return _benched(
            path, out, jobs, missions, modes, entrants, policies, seeds, max_cost, progress,
            keep=keep, other_code=other_code, replay_changed=replay_changed, isolate=isolate, salt=fspath(salt),
        )  # fmt: skip


def _benched(
    path: Path,
    out: str | PathLike[str] | None,
    jobs: int,
    missions: Collection[str],
    modes: Collection[str],
    entrants: Collection[str],
    policies: Sequence[str],
    seeds: Sequence[int],
    max_cost: float | None,
    progress: Callable[[SuiteRow], None] | None,
    *,
    keep: bool,
    other_code: bool,
    replay_changed: bool,
    isolate: Isolation,
    salt: str,
) -> SuiteResults:
    plan = read_plan(path, PluginHost(), policies, isolate=isolate)
    cells = chosen_cells(plan, missions, modes, entrants)
    players = tuple({cell.player.name: cell.player for cell in cells}.values())
    check_ready(players, max_cost)
    if max_cost is None and any(map(is_paid, players)):
        raise UsageError("the model calls of this suite cost money", hint="set a limit with `max_cost`, US dollars")
    code = code_sha256(plan.files)
    with open_results(default_folder(plan, code) if out is None else Path(out)) as results:
        run = SuiteRun(
            plan, results, code, LocalExecutor(jobs), keep=keep, max_cost=max_cost, isolate=isolate, salt=salt
        )
        run.check_split(cells)
        run.check_resumable(other_code=other_code, replay_changed=replay_changed)
        results.write("suite.toml", path.read_text(encoding="utf-8"))
        if progress is not None:
            run.tell = lambda row, _: progress(row)
        run.play(run.due(seeds or plan.suite.seeds, cells))
        results.compact()
        write_tables(plan, results)
        if run.is_out_of_money:
            raise UsageError(
                f"the rest of ${max_cost:g} may not pay for another call (${run.spent():.2f} spent)",
                hint="the same call with a higher `max_cost` continues",
            )
        rows = tuple(with_attention(results.rows, results.folder))
        return SuiteResults(results.folder, plan.suite.title, tuple(plan.suite.tables), rows)


def write_tables(plan: SuitePlan, results: ResultsFolder) -> tuple[ResultTable, ...]:
    """Write the suite's tables into the results folder in every format, and return them."""
    tables = make_tables(with_attention(results.rows, results.folder), plan.suite.tables, plan.suite.title)
    for name, export in EXPORTS.items():
        text = "\n".join(map(export, tables))
        whole = html_page(plan.suite.title or plan.suite.name, text) if name == "html" else text
        results.write(f"tables.{SUFFIXES[name]}", whole)
    return tables


def default_folder(plan: SuitePlan, code: str, part: str = "") -> Path:
    """Return the results folder of a suite by its name, its code and the shard in words."""
    return RUNS / "bench" / f"{plan.suite.name}-{code[:12]}{part}"


def chosen_cells(
    plan: SuitePlan,
    missions: Collection[str] = (),
    modes: Collection[str] = (),
    entrants: Collection[str] = (),
    prefix: str = "",
) -> tuple[SuiteCell, ...]:
    """Return the cells with these missions, modes and entrants; an empty collection selects all.

    `prefix` stands before the name of an argument in messages. Raises `UsageError` for a name that the suite does not
    have.
    """
    players = [player.name for player in plan.players]
    for option, names, known in (("missions", missions, list(plan.missions)), ("entrants", entrants, players)):
        for name in names:
            if name not in known:
                hint = did_you_mean(name, known, option)
                raise UsageError(f"{prefix}{option} {name}: the suite has no such name", hint=hint)
    chosen = tuple(
        cell
        for cell in plan.cells
        if cell.column.mission in (missions or plan.missions)
        and (not modes or cell.column.mode in modes)
        and cell.player.name in (entrants or players)
    )
    if not chosen:
        raise UsageError(
            f"nothing to play: no chosen mission of the suite has a mode of {prefix}modes", hint=f"remove {prefix}modes"
        )
    return chosen


__all__ = ["SuiteResults", "bench", "chosen_cells", "default_folder", "write_tables"]
