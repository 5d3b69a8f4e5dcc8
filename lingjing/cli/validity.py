"""`lingjing bench validity`: play the studies of the project over several sittings, and make their record."""

from __future__ import annotations

import argparse
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.cli.arguments import check_counts
from lingjing.cli.files import tell_aside
from lingjing.cli.parser import ArgumentParser
from lingjing.cli.process import ending_at_second_interrupt, say
from lingjing.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from lingjing.bench.planning import SuiteCell
    from lingjing.bench.rows import SuiteRow
    from lingjing.bench.validity.program import ProgramFile
    from lingjing.bench.validity.rounds import Rounds
    from lingjing.bench.validity.studies import Planned, Study

MOST_HOURS = 1e5
"""The greatest number of hours of a sitting; a larger one is a typing error."""


def add_validity(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "-o", "--output", metavar="DIR", type=Path, help="the results folder; an existing one is continued"
    )
    parser.add_argument("-j", "--jobs", metavar="N", type=int, default=1, help="play N episodes at a time (default 1)")
    parser.add_argument("--limit", metavar="N", type=int, help="only the first N seeds of each study")
    parser.add_argument("--hours", metavar="H", type=float, help="begin no episode after H hours")
    parser.add_argument("--parts", metavar="NAME", nargs="+", help="play only these parts or studies")
    parser.add_argument(
        "--entrants", metavar="NAME", nargs="+", default=(), help="play only these entrants of the parts"
    )
    parser.add_argument("--program", metavar="FILE", type=Path, help="a program of your own (default: the shipped one)")
    parser.add_argument("--strict", action="store_true", help="walls around all policies, and none may be missing")
    parser.add_argument("--keep", action="store_true", help="keep every trace, for `lingjing bench audit`")
    parser.add_argument("--other-code", action="store_true", help="continue folders of another version of the code")
    parser.add_argument(
        "--replay-changed", action="store_true", help="put rows of changed missions aside, and play them again"
    )
    parser.add_argument("--check", action="store_true", help="print the studies and the hours, and stop")
    parser.set_defaults(handler=play_validity)


def play_validity(args: argparse.Namespace) -> int:
    """Play the studies of the program in rounds of seeds: the first three seeds of every study, then the next ones of
    every study. Each study is a suite in a folder of its own. The same command continues. After each step the record
    (`validity.json`) and its tables (`validity.md`) are written. With --hours the command ends by itself, exit code 0.
    """
    from lingjing.bench.folder import check_folder, lock_folder
    from lingjing.bench.rows import code_sha256
    from lingjing.bench.validity.program import read_program
    from lingjing.bench.validity.studies import plan_program
    from lingjing.cli.installed import warn_of_broken_plugins
    from lingjing.installed_plugins.discovery import trusting
    from lingjing.play.folders import RUNS
    from lingjing.plugins.host import PluginHost

    check_counts(("-j", args.jobs), ("--limit", args.limit))
    if args.hours is not None and not 0.0 < args.hours < MOST_HOURS:
        raise UsageError(f"--hours {args.hours:g}: must be a number of hours above 0")
    warn_of_broken_plugins()
    file = read_program(args.program)
    with trusting(()):
        planned = plan_program(file, PluginHost(), strict=args.strict)
        chosen = _chosen(planned, args.parts or (), args.entrants)
        code = code_sha256(path for plan in planned for path in plan.plan.files)
        folder: Path = args.output or RUNS / "bench" / f"{file.program.name}-{code[:12]}"
        if args.check:
            check_folder(folder)
            _say_size(file, planned, chosen, folder, args)
            return ExitCode.OK
        with lock_folder(folder, "study"):
            return _open_and_play(file, planned, chosen, folder, args)


def _chosen(planned: Sequence[Planned], names: Sequence[str], entrants: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the studies to play: those of these parts with these entrants; all without names.

    Raises `UsageError` for an unknown part or entrant, and if none of the parts has these entrants.
    """
    from lingjing.bench.validity.studies import PlannedPart

    _check_names("--parts", names, (name for plan in planned for name in (_part_of(plan), plan.name)), "parts")
    parts = [plan for plan in planned if isinstance(plan, PlannedPart)]
    _check_names("--entrants", entrants, (name for part in parts for name in part.sees), "entrants")
    chosen = [plan for plan in planned if not names or {_part_of(plan), plan.name} & set(names)]
    if entrants:
        chosen = [plan for plan in chosen if isinstance(plan, PlannedPart) and set(plan.sees) & set(entrants)]
    if not chosen:
        raise UsageError(
            f"--entrants {' '.join(entrants)}: no part of --parts has them",
            hint="leave --parts out to play them in every part that has them",
        )
    return tuple(plan.name for plan in chosen)


def _check_names(option: str, names: Sequence[str], known: Iterable[str], kind: str) -> None:
    """Raise `UsageError` for a name that the program does not have."""
    from lingjing.suggest import did_you_mean

    all_known = dict.fromkeys(known)
    for name in names:
        if name not in all_known:
            hint = did_you_mean(name, all_known, kind)
            raise UsageError(f"{option} {name}: the program has no such {kind.removesuffix('s')}", hint=hint)


def _part_of(plan: Planned) -> str:
    from lingjing.bench.validity.studies import PlannedPart

    return plan.part.name if isinstance(plan, PlannedPart) else plan.name


def _say_size(
    file: ProgramFile, planned: Sequence[Planned], chosen: Sequence[str], folder: Path, args: argparse.Namespace
) -> None:
    """Print the size and the hours of each study. Nothing is written: rows are read from the folder if it exists."""
    from lingjing.bench.durations import Durations
    from lingjing.bench.folder import read_results
    from lingjing.bench.validity.studies import planned_cells
    from lingjing.bench.version import mission_version

    rows: list[SuiteRow] = []
    for plan in planned:
        with suppress(UsageError):  # a folder without results
            rows += read_results(folder / plan.name)
    durations = Durations(file.program.seconds, rows)
    files = {cell.column.mission: cell.column.path for plan in planned for cell in plan.plan.cells}
    versions = {name: mission_version(mission) for name, mission in files.items()}
    valid = [row for row in rows if row.standing != "aborted" and row.mission_sha256 == versions.get(row.mission)]
    done = {key for row in valid for key in _keys(row)}
    whole, whole_h = 0, 0.0
    for plan in planned:
        if plan.name not in chosen:
            continue
        episodes = planned_cells(plan, args.limit, args.entrants)
        left = [cell for cell, seed in episodes if _key(plan, cell, seed) not in done]
        hours = durations.hours(left, args.jobs)
        whole, whole_h = whole + len(left), whole_h + hours
        columns = len({(cell.column.mission, cell.column.mode) for cell, _ in episodes})
        say(
            f"{plan.name}: {_counted(len({cell.player.name for cell, _ in episodes}), 'entrant')} in "
            f"{_counted(columns, 'column')}: "
            f"{_counted(len(episodes), 'episode')}, {len(left):,} to play, about {hours:.1f} h"
        )
    say(f"{_counted(whole, 'episode')} to play, about {whole_h:.1f} h with -j {args.jobs}; results in {folder}")


def _counted(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'s' * (number != 1)}"


def _keys(row: SuiteRow) -> Iterator[tuple[object, ...]]:
    """Yield the keys under which a row counts as done: of its cell, and of its column for fresh seeds."""
    yield row.suite, row.cell, row.seed
    yield row.suite, row.mission, row.mode, row.seed


def _key(plan: Planned, cell: SuiteCell, seed: int) -> tuple[object, ...]:
    """Return the key of an episode. Before it is chosen, the worst adversary is known by its column alone."""
    from lingjing.bench.adversaries import FIRST_FRESH
    from lingjing.bench.validity.studies import PlannedAdversaries

    if isinstance(plan, PlannedAdversaries) and seed >= FIRST_FRESH:
        return plan.plan.suite.name, cell.column.mission, cell.column.mode, seed
    return plan.plan.suite.name, cell.key, seed


def _open_and_play(
    file: ProgramFile, planned: Sequence[Planned], names: Sequence[str], folder: Path, args: argparse.Namespace
) -> int:
    from lingjing.bench.durations import Durations
    from lingjing.bench.executors import LocalExecutor
    from lingjing.bench.validity.rounds import Rounds
    from lingjing.bench.validity.studies import open_studies

    executor = LocalExecutor(args.jobs)
    with open_studies(
        planned, folder, executor, strict=args.strict, keep=args.keep, other_code=args.other_code,
        replay_changed=args.replay_changed, entrants=args.entrants, tell_aside=tell_aside,
    ) as studies:  # fmt: skip
        rows = [row for study in studies for row in study.run.results.rows]
        rounds = Rounds(
            [study for study in studies if study.planned.name in names],
            file.program.rounds,
            Durations(file.program.seconds, rows),
            args.jobs,
            args.limit,
            args.hours,
        )
        with ending_at_second_interrupt():
            return _play(file, studies, rounds, folder)


def _play(file: ProgramFile, studies: Sequence[Study], rounds: Rounds, folder: Path) -> int:
    """Play the rounds, write the record after each step, print what is left, and return the exit code."""
    from lingjing.cli.bench import duration, episode_line, report_lost

    done = 0
    left = rounds.left()
    hours = rounds.durations.hours(left, rounds.jobs)
    say(f"{_counted(len(left), 'episode')} to play, about {hours:.1f} h with -j {rounds.jobs}; results in {folder}")

    def tell(row: SuiteRow, left_h: float) -> None:
        nonlocal done
        done += row.standing != "aborted"
        say(f"{done}/{len(left)}, {duration(3600.0 * left_h)} left: {row.suite}: {episode_line(row)}")

    rounds.tell = tell
    for study in studies:
        study.run.services.tell = say
    try:
        for study in rounds.play():
            study.run.results.compact()
            _write_record(file, studies, folder)
    except KeyboardInterrupt:
        _write_record(file, studies, folder)
        say(f"interrupted after {done} of {len(left)} episodes; the same command continues from here")
        raise
    _write_record(file, studies, folder)
    rest = rounds.left()
    hours = rounds.durations.hours(rest, rounds.jobs)
    if rest:
        say(f"{_counted(done, 'episode')} played, {len(rest):,} left, about {hours:.1f} h; the same command continues")
    else:
        say(f"{_counted(done, 'episode')} played, none is left; {folder / 'validity.md'} has the tables")
    return report_lost([row for study in studies for row in study.run.results.rows if row.standing == "lost"])


def _write_record(file: ProgramFile, studies: Sequence[Study], folder: Path) -> None:
    """Write the record and its tables. Raises `UsageError` if they cannot be written."""
    from lingjing.bench.folder import write_whole
    from lingjing.bench.validity.pages import page
    from lingjing.bench.validity.record import RECORD, encode_record, make_record

    record = make_record(file.program.name, studies)
    texts = {
        file.path.name if file.path.suffix == ".toml" else "validity.toml": file.path.read_bytes(),
        RECORD: encode_record(record),
        "validity.md": page(record, file.program.title).encode(),
    }
    try:
        for name, content in texts.items():
            write_whole(folder / name, content)
    except OSError as error:
        raise UsageError(
            f"cannot write to `{folder}`: {error.strerror}; the rows are stored",
            hint="make room; the same command continues from here",
        ) from error
