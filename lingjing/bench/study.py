"""The matched study: the same seeds, in every mode, with every reference policy (`python -m lingjing.bench.study`).

Each episode is a process of its own; its report is written down as soon as it ends, so a study that was stopped goes
on where it was. Results are kept apart by the code and the mission that made them. An episode that the
infrastructure aborted is played again with the same seed; it never counts for or against a policy.
"""

from __future__ import annotations

import argparse
import hashlib
import shutil
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec

import lingjing
from lingjing.bench.fleet import RunOptions, Task, play_apart
from lingjing.bench.folders import RUNS
from lingjing.bench.report import ABORTED, EpisodeReport
from lingjing.data import data_path
from lingjing.errors import ExitCode, LingjingError

TRIES = 3
"""How often one episode is tried before the study gives it up as aborted."""


@dataclass(frozen=True, slots=True)
class Case:
    """A line of the table: a policy, perhaps with its pictures blanked."""

    name: str
    policy: str
    blank_pictures: bool = False


CASES = (
    Case("oracle", "oracle"),
    Case("heuristic", "heuristic"),
    Case("heuristic-blanked", "heuristic", blank_pictures=True),
    Case("random", "random"),
)
MODES = ("broadcast", "star")


class Row(msgspec.Struct, frozen=True, kw_only=True):
    """One played episode of the study; `tries` counts aborted ones before it."""

    case: str
    tries: int = 1
    report: EpisodeReport


class Study:
    """The episodes of one study in one folder: `results.json` grows by a row at a time."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._file = folder / "results.json"
        stored = self._file.read_bytes() if self._file.is_file() else b"[]"
        self.rows = msgspec.json.decode(stored, type=list[Row])

    def played(self) -> set[tuple[str, str, int]]:
        """(case, mode, seed) of what need not be played again."""
        return {(row.case, row.report.mode, row.report.seed) for row in self.rows}

    def add(self, row: Row) -> None:
        """Keep a row; the file is replaced whole, so that a stop in between loses nothing."""
        self.rows.append(row)
        partial = self._file.with_suffix(".part")
        partial.write_bytes(msgspec.json.format(msgspec.json.encode(self.rows), indent=1))
        partial.replace(self._file)


def play(study: Study, tasks: Sequence[tuple[Case, Task]], jobs: int, *, keep: bool) -> None:
    """Play what is missing; `keep` keeps the runs, else only their reports are kept."""
    names = {task.folder: case.name for case, task in tasks}
    waiting = [task for _, task in tasks]
    for attempt in range(1, TRIES + 1):
        aborted: list[Task] = []
        for task, report in play_apart(_cleared(waiting), jobs):
            if report.reason == ABORTED and attempt < TRIES:
                aborted.append(task)
                continue
            study.add(Row(case=names[task.folder], tries=attempt, report=report))
            print(line(study.rows[-1]), file=sys.stderr, flush=True)
            if not keep:
                shutil.rmtree(task.folder)
        waiting = aborted


def _cleared(tasks: Sequence[Task]) -> Iterator[Task]:
    """The tasks, each with what an earlier, unfinished try left behind taken away."""
    for task in tasks:
        if task.folder.exists():
            shutil.rmtree(task.folder)
        yield task


def missing(
    study: Study, mission: Path, cases: Sequence[Case], modes: Sequence[str], seeds: range
) -> list[tuple[Case, Task]]:
    """What has no row yet, seed by seed, so that an unfinished study is matched as well."""
    played = study.played()
    return [
        (case, _task(study.folder, mission, case, mode, seed))
        for seed in seeds
        for mode in modes
        for case in cases
        if (case.name, mode, seed) not in played
    ]


def _task(folder: Path, mission: Path, case: Case, mode: str, seed: int) -> Task:
    options = RunOptions(path=mission, policy=case.policy, mode=mode, blank_pictures=case.blank_pictures)
    return Task(options, seed, folder / f"{case.name}-{mode}-{seed}")


def table(rows: Sequence[Row]) -> str:
    """Markdown: successes, SCR and ticks of every case and mode; aborted episodes are counted apart."""
    head = "| policy | mode | success | SCR | ticks when won | aborted |\n| --- | --- | --- | --- | --- | --- |"
    return "\n".join([head, *_lines(rows)])


def line(row: Row) -> str:
    """One episode in one line."""
    report = row.report
    return f"{row.case}, {report.mode}, seed {report.seed}: {report.reason}, SCR {report.scr:.2f}, {report.ticks} ticks"


def code_sha256(mission: Path) -> str:
    """SHA-256 over everything that decides an episode: the mission, the core's and the agents' source."""
    from importlib.util import find_spec

    agents = find_spec("lingjing_agents")
    roots = [Path(lingjing.__file__).parent, *map(Path, (agents.submodule_search_locations or []) if agents else [])]
    digest = hashlib.sha256(mission.read_bytes())
    for root in roots:
        for path in sorted(path for path in root.rglob("*") if path.suffix in {".py", ".xml", ".lark"}):
            digest.update(f"{path.relative_to(root)}\n".encode() + path.read_bytes())
    return digest.hexdigest()


def main(argv: Sequence[str] | None = None) -> int:
    """Play the study and print its table; exit codes as everywhere."""
    parser = argparse.ArgumentParser(prog="python -m lingjing.bench.study", description=__doc__)
    parser.add_argument("--mission", type=Path, default=data_path("scenarios", "ssr.ljs"))
    parser.add_argument("--seeds", type=int, default=20, help="seeds 0 to N-1 (default 20)")
    parser.add_argument("--modes", nargs="+", choices=MODES, default=MODES)
    parser.add_argument("--cases", nargs="+", choices=[case.name for case in CASES], default=None)
    parser.add_argument("-j", "--jobs", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path, help="folder of the results (default: one for this code)")
    parser.add_argument("--keep", action="store_true", help="keep every trace, not only the reports")
    args = parser.parse_args(argv)
    try:
        return _main(args)
    except KeyboardInterrupt:
        print("interrupted; the same command goes on from here", file=sys.stderr)
        return ExitCode.INTERRUPTED
    except LingjingError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code


def _main(args: argparse.Namespace) -> int:
    folder = args.output or RUNS / "study" / code_sha256(args.mission)[:12]
    folder.mkdir(parents=True, exist_ok=True)
    study = Study(folder)
    cases = [case for case in CASES if args.cases is None or case.name in args.cases]
    tasks = missing(study, args.mission, cases, args.modes, range(args.seeds))
    print(f"{len(study.rows)} episodes are there, {len(tasks)} to play, results in {folder}", file=sys.stderr)
    play(study, tasks, args.jobs, keep=args.keep)
    print(table(study.rows))
    return ExitCode.OK


def _lines(rows: Sequence[Row]) -> Iterator[str]:
    for case in CASES:
        for mode in MODES:
            reports = [row.report for row in rows if (row.case, row.report.mode) == (case.name, mode)]
            counted = [report for report in reports if report.reason != ABORTED]
            if reports:
                yield _line(case.name, mode, counted, len(reports) - len(counted))


def _line(case: str, mode: str, counted: Sequence[EpisodeReport], aborted: int) -> str:
    won = [report for report in counted if report.success]
    scr = f"{sum(report.scr for report in counted) / len(counted):.2f}" if counted else "–"
    ticks = f"{sum(report.ticks for report in won) / len(won):.1f}" if won else "–"
    return f"| {case} | {mode} | {len(won)} of {len(counted)} | {scr} | {ticks} | {aborted} |"


if __name__ == "__main__":
    sys.exit(main())
