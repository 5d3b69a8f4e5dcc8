"""The matched study: the same seeds for every policy in every column (`python -m lingjing.bench.study`).

A column is a shipped mission in one of its modes, with `--sweeps` also at the values that it declares. Each episode is
a process of its own; its report is written down as soon as it ends, so a study that was stopped goes on where it was.
Results are kept apart by the code and the missions that made them, in a folder that one study at a time may use. An
episode that the infrastructure aborted is played again with the same seed; it never counts for or against a policy.
"""

from __future__ import annotations

import argparse
import fcntl
import hashlib
import secrets
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import msgspec

import lingjing
from lingjing.bench.columns import Column, columns, shipped
from lingjing.bench.countdown import Countdown
from lingjing.data import data_path
from lingjing.errors import ExitCode, LingjingError, UsageError
from lingjing.mission.faults import lines_of, schema_faults
from lingjing.mission.seeding import integer
from lingjing.play.folders import RUNS
from lingjing.play.options import PlayOptions
from lingjing.play.parallel import EpisodeTask, play_apart
from lingjing.play.report import ABORTED, INTERRUPTED, EpisodeReport
from lingjing.terminal import guard_streams

TRIES = 3
"""How often one episode is tried before the study gives it up as aborted."""

LINGERS_S = 60.0
"""How long an episode may take to end after its study was killed."""

MODES = ("single", "broadcast", "star")


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


class StudyRow(msgspec.Struct, frozen=True, kw_only=True):
    """One played episode of the study; `tries` counts the aborted ones before it too, `wall_s` is how long the last
    took, `code` which code and missions made it (see `code_sha256`), as far as it is known."""

    case: str
    column: str = ""
    tries: int = 1
    wall_s: float = 0.0
    code: str = ""
    report: EpisodeReport


def read_rows(file: Path) -> list[StudyRow]:
    """The rows of a study's `results.json`. Raises `UsageError` that tells everything that makes it none."""
    try:
        text = file.read_bytes()
        return msgspec.json.decode(text, type=list[StudyRow])
    except OSError as error:
        raise UsageError(f"cannot read {file}: {error.strerror}") from error
    except msgspec.ValidationError:
        said = lines_of(schema_faults(msgspec.json.decode(text), list[StudyRow]))
    except msgspec.DecodeError as error:
        said = str(error)
    raise UsageError(f"`{file}` holds no results of a study:\n{said}", hint="name another folder, or its results.json")


class Study:
    """The episodes of one study in one folder: `results.json` grows by a row at a time."""

    def __init__(self, folder: Path, code: str = "") -> None:
        self.folder = folder
        self.code = code
        self._file = folder / "results.json"
        self.rows = read_rows(self._file) if self._file.is_file() else []

    def strangers(self) -> int:
        """How many rows were made by other code or other missions than what plays now."""
        return sum(bool(row.code and self.code and row.code != self.code) for row in self.rows)

    def played(self) -> set[tuple[str, str, int]]:
        """(case, column, seed) of what need not be played again."""
        return {(row.case, row.column, row.report.seed) for row in self.rows}

    def policy_seed(self, case: str, column: str, seed: int) -> int:
        """What the policies of one row draw from. The study's own salt decides it, so that it tells a policy that has
        the code nothing about the instance; a row that is played again has the same one."""
        return integer(0, f"{self._salt()}/{case}/{column}/{seed}")

    def _salt(self) -> str:
        """The text in the folder's `salt`, made by chance where there is none yet."""
        file = self.folder / "salt"
        salt = file.read_text().strip() if file.is_file() else ""
        if not salt:
            salt = secrets.token_hex(16)
            _replace(file, f"{salt}\n".encode())
        return salt

    def add(self, row: StudyRow) -> None:
        """Keep a row; the file is replaced whole, so that a stop in between loses nothing."""
        self.rows.append(row)
        _replace(self._file, msgspec.json.format(msgspec.json.encode(self.rows), indent=1))


def _replace(file: Path, content: bytes) -> None:
    """Write a file whole or not at all."""
    partial = file.with_suffix(".part")
    partial.write_bytes(content)
    partial.replace(file)


@dataclass(frozen=True, slots=True)
class Episode:
    """One episode to play."""

    case: Case
    column: Column
    task: EpisodeTask

    @property
    def kind(self) -> tuple[str, str]:
        """What takes about equally long: the same policy in the same column."""
        return self.case.name, self.column.name


def play(
    study: Study,
    episodes: Sequence[Episode],
    jobs: int,
    *,
    keep: bool,
    tell: Callable[[StudyRow, float], None] = lambda row, left_s: None,
) -> None:
    """Play what is missing; `keep` keeps the runs, else only their reports are kept.

    `tell` is called after each episode with its row and how many seconds the rest will take about (nan: unknown yet).
    """
    of = {episode.task.folder: episode for episode in episodes}
    waiting = [episode.task for episode in episodes]
    countdown = Countdown(jobs, (episode.kind for episode in episodes))
    for row in study.rows:
        countdown.learn((row.case, row.column), row.wall_s)
    for attempt in range(1, TRIES + 1):
        aborted: list[EpisodeTask] = []
        started: dict[Path, float] = {}
        for task, report in play_apart(_cleared(waiting, started), jobs):
            if report.reason == INTERRUPTED:  # it is not over: the next study plays it anew
                continue
            episode, wall_s = of[task.folder], time.monotonic() - started[task.folder]
            if report.reason == ABORTED and attempt < TRIES:
                aborted.append(task)
                continue
            row = StudyRow(
                case=episode.case.name, column=episode.column.name, tries=attempt, wall_s=wall_s, code=study.code,
                report=report,
            )  # fmt: skip
            if not keep:  # before the row is there: a study killed in between would leave the run behind for good
                _take_away(task.folder)
            study.add(row)
            countdown.done(episode.kind, wall_s)
            tell(row, countdown.left_s)
        waiting = aborted


def missing(
    study: Study, cases: Sequence[Case], wanted: Sequence[Column], seeds: Iterable[int], *, overview: bool = False
) -> list[Episode]:
    """What has no row yet, seed by seed, so that an unfinished study is matched as well.

    `overview` has each run draw its picture, which is wanted only where runs are kept.
    """
    played = study.played()
    return [
        Episode(case, column, _task(study, case, column, seed, overview=overview))
        for seed in seeds
        for column in wanted
        for case in cases
        if (case.name, column.name, seed) not in played
    ]


def table(rows: Sequence[StudyRow]) -> str:
    """Markdown: successes, SCR, ticks and wall time of every case in every column; aborted ones are counted apart."""
    head = "| column | policy | success | SCR | ticks when won | aborted | wall s |"
    return "\n".join([head, "| --- | --- | --- | --- | --- | --- | --- |", *_lines(rows)])


def line(row: StudyRow) -> str:
    """One episode in one line."""
    report = row.report
    scored = f"{report.reason}, SCR {report.scr:.2f}, {report.ticks} ticks, {row.wall_s:.0f} s"
    return f"{row.case}, {row.column}, seed {report.seed}: {scored}"


def code_sha256(missions: Iterable[Path]) -> str:
    """SHA-256 over everything that decides an episode: the missions, the language's library, the core's and the agents'
    source."""
    from importlib.util import find_spec

    agents = find_spec("lingjing_agents")
    roots = [Path(lingjing.__file__).parent, *map(Path, (agents.submodule_search_locations or []) if agents else [])]
    library = sorted(data_path("std").glob("*.ljs"))
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in (*missions, *library)))
    for root in roots:
        for path in sorted(path for path in root.rglob("*") if path.suffix in {".py", ".xml", ".lark"}):
            digest.update(f"{path.relative_to(root)}\n".encode() + path.read_bytes())
    return digest.hexdigest()


def seeds_of(text: str) -> range:
    """`20` is the seeds 0 to 19, `3-7` those from 3 to 7. `UsageError` for anything else."""
    first, dash, last = text.partition("-")
    if first.isdigit() and (last.isdigit() if dash else True):
        found = range(int(first), int(last) + 1) if dash else range(int(first))
        if found:
            return found
    raise UsageError(f"`{text}` names no seeds", hint="write a number of seeds, as 20, or a range of them, as 0-19")


def main(argv: Sequence[str] | None = None) -> int:
    """Play the study and print its table; exit codes as everywhere."""
    if argv is None:
        guard_streams()
    parser = argparse.ArgumentParser(prog="python -m lingjing.bench.study", description=__doc__)
    parser.add_argument("--missions", nargs="+", help="names of shipped missions or .ljs files (default: all shipped)")
    parser.add_argument("--seeds", default="20", help="a number of seeds from 0, or a range A-B (default 20)")
    parser.add_argument("--modes", nargs="+", choices=MODES, help="only these modes (default: all a mission allows)")
    parser.add_argument(
        "--policy", "--cases", dest="cases", nargs="+", choices=[case.name for case in CASES],
        help="only these lines of the table (default: all)",
    )  # fmt: skip
    parser.add_argument("--sweeps", action="store_true", help="play the sweeps that the missions declare instead")
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
    paths, seeds = _paths(args.missions), seeds_of(args.seeds)
    if args.jobs < 1:
        raise UsageError(f"-j {args.jobs}: at least one")
    wanted = columns(paths, args.modes, sweeps=args.sweeps)
    if not wanted:
        raise UsageError("nothing to play: no mission has such a mode or sweep", hint="leave --modes or --sweeps out")
    code = code_sha256(paths)
    folder = args.output or RUNS / "study" / code[:12]
    with _alone(folder):
        return _play(args, Study(folder, code), wanted, seeds)


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Make the folder and keep other studies out of it as long as this one runs, however it ends."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / "lock").open("w")
    except OSError as error:
        raise UsageError(f"cannot write to `{folder}`: {error.strerror}", hint="choose another with -o") from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise UsageError(f"another study is writing to `{folder}`", hint="wait, or name another with -o") from None
        yield


def _play(args: argparse.Namespace, study: Study, wanted: Sequence[Column], seeds: Iterable[int]) -> int:
    folder = study.folder
    cases = [case for case in CASES if args.cases is None or case.name in args.cases]
    episodes = missing(study, cases, wanted, seeds, overview=args.keep)
    if study.strangers():
        print(f"warning: {study.strangers()} of the episodes there were played by other code", file=sys.stderr)
    print(f"{len(study.rows)} episodes are there, {len(episodes)} to play, results in {folder}", file=sys.stderr)
    before, whole = len(study.rows), len(episodes)

    def tell(row: StudyRow, left_s: float) -> None:
        print(f"{_bar(len(study.rows) - before, whole, left_s)} {line(row)}", file=sys.stderr, flush=True)

    play(study, episodes, args.jobs, keep=args.keep, tell=tell)
    print(table(study.rows))
    return ExitCode.OK


def _paths(names: Sequence[str] | None) -> tuple[Path, ...]:
    from lingjing.dsl.loading.shipped import find_mission

    return shipped() if names is None else tuple(find_mission(name) for name in names)


def _bar(done: int, whole: int, left_s: float) -> str:
    """`[#####.....] 10/20, 1 h 05 min left`."""
    filled = round(10 * done / max(whole, 1))
    return f"[{'#' * filled}{'.' * (10 - filled)}] {done}/{whole}, {_duration(left_s)} left:"


def _duration(seconds: float) -> str:
    """`1 h 05 min`, `12 min`, `40 s`; `?` for nan."""
    if seconds != seconds:
        return "?"
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes // 60} h {minutes % 60:02d} min" if minutes >= 60 else f"{minutes} min"


def _cleared(tasks: Sequence[EpisodeTask], started: dict[Path, float]) -> Iterator[EpisodeTask]:
    """The tasks, each with what an earlier, unfinished try left behind taken away; notes when each is begun."""
    for task in tasks:
        _take_away(task.folder)
        started[task.folder] = time.monotonic()
        yield task


def _take_away(folder: Path) -> None:
    """Remove a run. An episode whose study was killed may write into it for a moment yet, until it has ended itself."""
    deadline = time.monotonic() + LINGERS_S
    while folder.exists():
        try:
            shutil.rmtree(folder)
        except OSError as error:
            if time.monotonic() > deadline:
                raise UsageError(f"cannot remove `{folder}`: {error.strerror}") from error
            time.sleep(0.2)


def _task(study: Study, case: Case, column: Column, seed: int, *, overview: bool) -> EpisodeTask:
    options = PlayOptions(
        mission=str(column.path),
        policy=case.policy,
        seed=seed,
        mode=column.mode,
        settings=dict(column.settings),
        blank_pictures=case.blank_pictures,
        policy_seed=study.policy_seed(case.name, column.name, seed),
        overview=overview,
    )
    return EpisodeTask(options, study.folder / f"{case.name}-{column.name}-{seed}")


def _lines(rows: Sequence[StudyRow]) -> Iterator[str]:
    for name in dict.fromkeys(row.column for row in rows):
        for case in CASES:
            found = [row for row in rows if (row.case, row.column) == (case.name, name)]
            counted = [row for row in found if row.report.reason != ABORTED]
            if found:
                yield _line(name, case.name, counted, len(found) - len(counted))


def _line(column: str, case: str, counted: Sequence[StudyRow], aborted: int) -> str:
    won = [row.report for row in counted if row.report.success]
    scr = f"{sum(row.report.scr for row in counted) / len(counted):.2f}" if counted else "–"
    ticks = f"{sum(report.ticks for report in won) / len(won):.1f}" if won else "–"
    wall = f"{sum(row.wall_s for row in counted) / len(counted):.0f}" if counted else "–"
    return f"| {column} | {case} | {len(won)} of {len(counted)} | {scr} | {ticks} | {aborted} | {wall} |"


if __name__ == "__main__":
    sys.exit(main())
