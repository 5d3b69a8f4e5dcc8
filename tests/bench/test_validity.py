"""The program of the studies: its form, its rounds, its command, its record and the tables."""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from lingjing.bench.validity.pages import readme_rows, tables
from lingjing.bench.validity.program import read_program
from lingjing.bench.validity.record import (
    ValidityRecord,
    encode_record,
    make_record,
    ranges,
    read_record,
    reading_studies,
    seeds_of,
)
from lingjing.bench.validity.studies import PlannedPart, plan_program
from lingjing.decoding import converted
from lingjing.errors import ExitCode, UsageError
from lingjing.testing import PluginHost, run_command
from tests.bench.suite_kit import TRIP, AnsweringExecutor, EpisodeTask, answered, encode_rows, read_results, row_sha256
from tools.python_forks import PipedFork, run_python

Capture = pytest.CaptureFixture[str]

TIERED = TRIP.replace("  scene bay", "  param wide = false\n  tier 1 { wide }\n  scene bay")
"""A mission with a tier 1 that changes nothing."""

PROGRAM = """
validity = 1
name = "tiny"
missions = ["trip.ljs"]
rounds = [1, 2]
[[parts]]
name = "reference"
seeds = 3
entrants = [{ policy = "oracle", sees = "truth" }, { policy = "idle", sees = "nothing" }]
[[parts]]
name = "redrawn"
tiers = [1]
seeds = 2
policy_seed = 7
compares = "redrawn"
entrants = [{ policy = "oracle", sees = "truth" }]
"""


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder with a program and its mission."""
    (tmp_path / "trip.ljs").write_text(TIERED)
    (tmp_path / "tiny.toml").write_text(PROGRAM)
    return tmp_path


Answer = Callable[[EpisodeTask], object]


@pytest.fixture
def tasks(monkeypatch: pytest.MonkeyPatch) -> AnsweringExecutor:
    """Episodes are answered instead of played: the oracle wins, others lose."""

    def answer(task: EpisodeTask) -> object:
        won = task.options.policy == "oracle"
        return answered(task, success=won, reason="success" if won else "budget", scr=float(won))

    executor = AnsweringExecutor(answer)
    monkeypatch.setattr("lingjing.bench.executors.LocalExecutor", lambda jobs: executor)
    return executor


def command(place: Path, *more: str) -> list[str]:
    return ["bench", "validity", "--program", str(place / "tiny.toml"), "-o", str(place / "out"), *more]


def order(executor: AnsweringExecutor) -> list[tuple[str, int]]:
    """The studies and seeds in the order of the episodes, each once in a row."""
    played = [(task.folder.parents[1].name, task.options.seed) for task in executor.tasks]
    return [each for at, each in enumerate(played) if at == 0 or played[at - 1] != each]


# -- the program


def test_the_shipped_program_has_the_planned_studies_columns_and_tiers() -> None:
    file = read_program()
    planned = plan_program(file, PluginHost())
    studies = {plan.name: plan for plan in planned}
    assert list(studies) == [
        "reference-tier0", "reference-tier1", "players-tier0", "players-tier1", "modes-tier1", "redrawn-tier1",
        "adversaries",
    ]  # fmt: skip
    columns = {f"{cell.column.mission}-{cell.column.mode}" for cell in studies["reference-tier0"].plan.cells}
    assert columns == set(file.program.seconds) and len(columns) == 12
    for name, plan in studies.items():
        own = {f"{cell.column.mission}-{cell.column.mode}" for cell in plan.plan.cells}
        assert own == (
            columns if name != "modes-tier1" else {each for each in columns if each[:3] in ("ssr", "ufr", "cd-")}
        )
        assert {cell.column.tier for cell in plan.plan.cells} == {plan.tier}
    modes = studies["modes-tier1"]
    assert isinstance(modes, PlannedPart)
    assert (modes.part.seeds, modes.part.policy_seed) == (tuple(range(3000, 3100)), 0), "as the plan was written"
    players = {player.name: player for plan in planned for player in plan.plan.players}
    assert {"oracle", "heuristic", "sighted-reader", "reader", "sweep", "learned", "random"} <= set(players)
    for plan in planned:
        for player in plan.plan.players if isinstance(plan, PlannedPart) else ():
            assert (plan.sees[player.name] == "truth") == player.privileged, player.name
            assert not player.blank_pictures or plan.sees[player.name] == "nothing"


def test_all_errors_of_a_program_are_reported_at_once(place: Path, capsys: Capture) -> None:
    text = PROGRAM.replace("rounds = [1, 2]", "rounds = [2, 1]").replace("seeds = 3", "seeds = 0")
    text = text.replace('policy = "idle", sees = "nothing"', 'policy = "idel", sees = "nothin", speed = 1')
    (place / "tiny.toml").write_text(text.replace('[[parts]]\nname = "redrawn"', '[[parts]]\nname = "adversaries"'))
    assert run_command(command(place, "--check")) == ExitCode.USAGE
    errors = capsys.readouterr().err
    assert "tuple should have" not in errors, "a part with an error is not reported as missing"
    for part in (
        "rounds: must grow", "parts[0].seeds: is 0", "parts[0].entrants[1].sees: ", "did you mean `nothing`?",
        "parts[0].entrants[1].speed: ", "parts[1].name: `adversaries` is the name of the study",
    ):  # fmt: skip
        assert part in errors, errors
    assert not (place / "out").exists()


def test_wrong_policies_tiers_and_modes_of_a_program_are_reported(place: Path, capsys: Capture) -> None:
    (place / "trip.ljs").write_text(TRIP)
    text = PROGRAM.replace('policy = "idle"', 'policy = "idel"').replace('compares = "redrawn"', 'compares = "modes"')
    (place / "tiny.toml").write_text(text)
    assert run_command(command(place, "--check")) == ExitCode.USAGE
    errors = capsys.readouterr().err
    for part in (
        "parts[0].entrants[1].policy: no policy is called `idel`", "parts[0].tiers: `trip` declares no tier 1",
        "parts[1].tiers: `trip` declares no tier 1",
    ):  # fmt: skip
        assert part in errors, errors
    (place / "trip.ljs").write_text(TIERED)
    assert run_command(command(place, "--check")) == ExitCode.USAGE
    assert "parts[1].compares: `trip` is not played in the modes star and broadcast" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--parts", "referense"), "--parts referense: the program has no such part"),
        (("--parts", "reference-tier2"), "--parts reference-tier2: the program has no such part"),
        (("--entrants", "orakle"), "--entrants orakle: the program has no such entrant"),
        (("--parts", "redrawn", "--entrants", "idle"), "--entrants idle: no part of --parts has them"),
        (("--hours", "0"), "--hours 0: must be a number of hours above 0"),
        (("--hours", "nan"), "--hours nan: must be a number of hours above 0"),
        (("--limit", "0"), "--limit 0: must be at least 1"),
        (("-j", "0"), "-j 0: must be at least 1"),
        (("-o", "/proc/studies"), "cannot write to `/proc/studies`"),
    ],
)
def test_wrong_options_are_usage_errors(place: Path, more: tuple[str, ...], message: str, capsys: Capture) -> None:
    assert run_command(command(place, *more)) == ExitCode.USAGE
    assert message in capsys.readouterr().err
    assert not (place / "out").exists()


def test_a_model_that_costs_money_is_refused(place: Path, capsys: Capture) -> None:
    text = PROGRAM.replace('policy = "idle", sees = "nothing"', 'model = "gpt-5.5", sees = "pictures"')
    (place / "tiny.toml").write_text(text)
    assert run_command(command(place, "--check")) == ExitCode.USAGE
    assert "parts[0].entrants[1]: its model calls cost money" in capsys.readouterr().err


# -- the rounds


def test_a_round_is_over_in_every_study_before_the_next_begins(place: Path, tasks: AnsweringExecutor) -> None:
    assert run_command(command(place)) == ExitCode.OK
    assert order(tasks) == [
        ("reference-tier0", 0), ("reference-tier1", 0), ("redrawn-tier1", 0),
        ("reference-tier0", 1), ("reference-tier1", 1), ("redrawn-tier1", 1),
        ("reference-tier0", 2), ("reference-tier1", 2),
    ]  # fmt: skip
    assert {task.options.policy_seed for task in tasks.tasks if "redrawn" in str(task.folder)} == {7}
    assert all(bool(task.options.salt) == ("redrawn" in str(task.folder)) for task in tasks.tasks)
    assert all(task.options.tier == int(task.folder.parents[1].name[-1]) for task in tasks.tasks)
    assert run_command(command(place)) == ExitCode.OK
    assert len(tasks.tasks) == 14, "the same command plays nothing twice"


def test_the_options_limit_and_parts_select_episodes(place: Path, tasks: AnsweringExecutor, capsys: Capture) -> None:
    assert run_command(command(place, "--limit", "2", "--parts", "redrawn")) == ExitCode.OK
    assert order(tasks) == [("redrawn-tier1", 0), ("redrawn-tier1", 1)]
    assert run_command(command(place, "--limit", "1")) == ExitCode.OK
    assert order(tasks)[2:] == [("reference-tier0", 0), ("reference-tier1", 0)]
    record = read_record(place / "out" / "validity.json")
    assert {(cell.study, cell.seeds, cell.planned) for cell in record.cells} == {
        ("redrawn-tier1", "0-1", 2), ("reference-tier0", "0", 3), ("reference-tier1", "0", 3),
    }  # fmt: skip


def test_selected_entrants_and_studies_are_played_first(place: Path, tasks: AnsweringExecutor, capsys: Capture) -> None:
    chosen = ("--entrants", "oracle", "--parts", "reference-tier1")
    assert run_command(command(place, "--check", *chosen)) == ExitCode.OK
    assert "reference-tier1: 1 entrant in 1 column: 3 episodes, 3 to play" in capsys.readouterr().err
    assert run_command(command(place, *chosen)) == ExitCode.OK
    assert order(tasks) == [("reference-tier1", 0), ("reference-tier1", 1), ("reference-tier1", 2)]
    record = read_record(place / "out" / "validity.json")
    assert {(cell.entrant, cell.seeds) for cell in record.cells if cell.seeds} == {("oracle", "0-2")}
    capsys.readouterr()
    assert run_command(command(place)) == ExitCode.OK
    assert capsys.readouterr().err.startswith("11 episodes to play"), "the others follow, none is played twice"
    assert len(tasks.tasks) == 14 == len({task.folder for task in tasks.tasks})


def test_no_episode_begins_after_the_time_limit(
    place: Path, tasks: AnsweringExecutor, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    now = [0.0]
    answer = tasks.answer

    def slow(task: EpisodeTask) -> object:
        now[0] += 600.0
        return answer(task)

    tasks.answer = slow  # type: ignore[assignment]
    monkeypatch.setattr("lingjing.bench.validity.rounds.time", SimpleNamespace(monotonic=lambda: now[0]))
    assert run_command(command(place, "--hours", "0.5")) == ExitCode.OK
    assert len(tasks.tasks) == 3
    errors = capsys.readouterr().err
    assert re.search(r"^14 episodes to play, about [\d.]+ h with -j 1; results in ", errors, re.M)
    assert re.search(r"^3 episodes played, 11 left, about [\d.]+ h; the same command continues$", errors, re.M)
    assert (place / "out" / "validity.md").is_file()
    assert run_command(command(place)) == ExitCode.OK
    assert len(tasks.tasks) == 14
    assert "11 episodes played, none is left" in capsys.readouterr().err


def test_a_check_estimates_hours_and_corrects_them_from_played_rows(
    place: Path, tasks: AnsweringExecutor, capsys: Capture
) -> None:
    (place / "tiny.toml").write_text(PROGRAM.replace("[[parts]]", '[seconds]\n"trip-broadcast" = 3600\n[[parts]]', 1))
    assert run_command(command(place, "--check", "-j", "2")) == ExitCode.OK
    errors = capsys.readouterr().err
    assert "reference-tier0: 2 entrants in 1 column: 6 episodes, 6 to play, about 3.0 h" in errors
    assert "14 episodes to play, about 7.0 h with -j 2" in errors
    assert not (place / "out").exists() and not tasks.tasks
    assert run_command(command(place, "--limit", "1")) == ExitCode.OK
    capsys.readouterr()
    assert run_command(command(place, "--check")) == ExitCode.OK
    assert "9 episodes to play, about 0.0 h with -j 1" in capsys.readouterr().err


def test_runs_of_policies_with_free_calls_are_not_kept(place: Path, tasks: AnsweringExecutor) -> None:
    """A suite keeps the runs of all policies with calls, which would fill the disk in these studies."""
    (place / "tiny.toml").write_text(PROGRAM.replace('"idle", sees = "nothing"', '"reader", sees = "pictures"'))
    runs = place / "out" / "reference-tier0" / "runs"
    assert run_command(command(place, "--limit", "1", "--parts", "reference")) == ExitCode.OK
    assert list(runs.iterdir()) == []
    assert run_command(command(place, "--limit", "2", "--parts", "reference", "--keep")) == ExitCode.OK
    assert sorted(path.name for path in runs.iterdir()) == ["oracle-trip-broadcast-1", "reader-trip-broadcast-1"]


# -- stops


def test_an_interrupt_keeps_the_played_episodes(place: Path, tasks: AnsweringExecutor, capsys: Capture) -> None:
    answer = tasks.answer

    def interrupted(task: EpisodeTask) -> object:
        if len(tasks.tasks) == 4:
            raise KeyboardInterrupt
        return answer(task)

    tasks.answer = interrupted  # type: ignore[assignment]
    assert run_command(command(place)) == ExitCode.INTERRUPTED
    assert "interrupted after 3 of 14 episodes; the same command continues" in capsys.readouterr().err
    record = read_record(place / "out" / "validity.json")
    assert sum(len(seeds_of(cell.seeds)) for cell in record.cells) == 3
    tasks.answer = answer
    assert run_command(command(place)) == ExitCode.OK
    record = read_record(place / "out" / "validity.json")
    assert sum(len(seeds_of(cell.seeds)) for cell in record.cells) == 14


def test_a_full_disk_gives_one_message_and_the_same_command_continues(
    place: Path, tasks: AnsweringExecutor, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    def full(file: Path, content: bytes) -> None:
        if file.parent.name == "parts" and len(tasks.tasks) > 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        file.write_bytes(content)

    with monkeypatch.context() as patched:
        patched.setattr("lingjing.bench.folder.write_whole", full)
        assert run_command(command(place)) == ExitCode.USAGE
    errors = capsys.readouterr().err
    assert "No space left on device" in errors and "the same command continues" in errors and "Traceback" not in errors
    assert run_command(command(place)) == ExitCode.OK
    assert "12 episodes played, none is left" in capsys.readouterr().err


def test_a_lost_episode_is_in_no_rate_and_sets_the_exit_code(
    place: Path, tasks: AnsweringExecutor, capsys: Capture
) -> None:
    answer = tasks.answer

    def failing(task: EpisodeTask) -> object:
        if task.options.seed == 1 and task.options.policy == "idle" and task.options.tier == 1:
            return answered(task, success=False, reason="infrastructure-abort", detail="the camera died", scr=0.0)
        return answer(task)

    tasks.answer = failing  # type: ignore[assignment]
    assert run_command(command(place)) == ExitCode.INFRASTRUCTURE
    assert "1 episode is lost" in capsys.readouterr().err
    (cell,) = [cell for cell in read_record(place / "out" / "validity.json").cells if cell.lost]
    assert (cell.entrant, cell.tier, cell.seeds, cell.lost) == ("idle", 1, "0,2", "1")


def test_rows_of_another_benchmark_or_code_are_refused_before_anything_is_played(
    place: Path, tasks: AnsweringExecutor, capsys: Capture
) -> None:
    assert run_command(command(place, "--limit", "1")) == ExitCode.OK
    rows, file = read_results(place / "out" / "redrawn-tier1"), place / "out" / "redrawn-tier1" / "results.parquet"
    file.write_bytes(encode_rows([msgspec.structs.replace(row, code="0" * 64) for row in rows]))
    capsys.readouterr()
    assert run_command(command(place)) == ExitCode.USAGE
    assert "were played with other code or missions" in capsys.readouterr().err
    assert len(tasks.tasks) == 5
    file.write_bytes(encode_rows([msgspec.structs.replace(row, benchmark="0" * 64) for row in rows]))
    assert run_command(command(place, "--other-code")) == ExitCode.USAGE
    assert "are of another version of the benchmark" in capsys.readouterr().err
    file.write_bytes(encode_rows([msgspec.structs.replace(row, mission_sha256="0" * 64) for row in rows]))
    assert run_command(command(place, "--other-code")) == ExitCode.USAGE
    assert "are of another version of the mission" in capsys.readouterr().err
    file.write_bytes(encode_rows([msgspec.structs.replace(row, split_sha256="") for row in rows]))
    assert run_command(command(place)) == ExitCode.USAGE
    assert "were drawn with public seeds" in capsys.readouterr().err


def test_rows_of_a_changed_mission_are_put_aside_and_played_again(
    place: Path, tasks: AnsweringExecutor, capsys: Capture
) -> None:
    (place / "way.ljs").write_text(TIERED.replace("trip", "way"))
    (place / "tiny.toml").write_text(PROGRAM.replace('["trip.ljs"]', '["trip.ljs", "way.ljs"]'))
    assert run_command(command(place)) == ExitCode.OK
    first = {study: read_results(place / "out" / study) for study in ("reference-tier0", "redrawn-tier1")}
    played = len(tasks.tasks)
    (place / "trip.ljs").write_text(f"{TIERED}# changed\n")
    capsys.readouterr()
    assert run_command(command(place, "--other-code")) == ExitCode.USAGE
    assert "(6) are of another version of the mission" in (text := capsys.readouterr().err) and "`trip`" in text
    assert run_command(command(place, "--replay-changed")) == ExitCode.USAGE, "the rows of `way` are of other code"
    assert read_results(place / "out" / "reference-tier0") == first["reference-tier0"], "nothing was moved"
    capsys.readouterr()
    assert run_command(command(place, "--replay-changed", "--other-code")) == ExitCode.OK
    assert capsys.readouterr().err.count("has the rows of an old version of a mission") == 3
    assert len(tasks.tasks) == played + 14 and all(
        str(task.options.mission).endswith("trip.ljs") for task in tasks.tasks[played:]
    )
    for study, before in first.items():
        (aside,) = (place / "out" / study).glob("results-trip-*.parquet")
        old = [row for row in before if row.mission == "trip"]
        assert sorted(read_results(aside), key=lambda row: row.key) == sorted(old, key=lambda row: row.key)
        now = read_results(place / "out" / study)
        assert len(now) == len(before)
        assert [row for row in now if row.mission == "way"] == [row for row in before if row.mission == "way"]
        assert len({row.mission_sha256 for row in now}) == 2 and not {row.key for row in now} ^ {r.key for r in before}
        assert not {row.mission_sha256 for row in now if row.mission == "trip"} & {row.mission_sha256 for row in old}


def test_rows_that_lie_aside_are_never_replaced(place: Path, tasks: AnsweringExecutor) -> None:
    """The mission changes, changes back, and changes again: the rows of each time are kept."""
    line = command(place, "--limit", "1", "--parts", "redrawn", "--replay-changed", "--other-code")
    ended: list[float] = []
    for change in ("", "# changed\n", "", "# changed\n"):
        (place / "trip.ljs").write_text(f"{TIERED}{change}")
        assert run_command(line) == ExitCode.OK
        (row,) = read_results(place / "out" / "redrawn-tier1")
        ended.append(row.ended_unix_s + len(ended))
        marked = msgspec.structs.replace(row, ended_unix_s=ended[-1])
        (place / "out" / "redrawn-tier1" / "results.parquet").write_bytes(encode_rows([marked]))
    aside = sorted((place / "out" / "redrawn-tier1").glob("results-trip-*.parquet"))
    assert sorted(row.ended_unix_s for file in aside for row in read_results(file)) == ended[:3]


def test_the_check_counts_the_episodes_of_changed_missions(
    place: Path, tasks: AnsweringExecutor, capsys: Capture
) -> None:
    assert run_command(command(place)) == ExitCode.OK
    capsys.readouterr()
    assert run_command(command(place, "--check")) == ExitCode.OK and "\n0 episodes to play" in capsys.readouterr().err
    (place / "trip.ljs").write_text(f"{TIERED}# changed\n")
    assert run_command(command(place, "--check")) == ExitCode.OK
    assert f"\n{len(tasks.tasks)} episodes to play" in capsys.readouterr().err


def test_studies_of_two_versions_of_a_mission_give_no_record(
    place: Path, tasks: AnsweringExecutor, capsys: Capture
) -> None:
    assert run_command(command(place, "--parts", "redrawn")) == ExitCode.OK
    file = place / "out" / "redrawn-tier1" / "results.parquet"
    rows = read_results(file)
    assert run_command(command(place)) == ExitCode.OK
    file.write_bytes(encode_rows([msgspec.structs.replace(row, mission_sha256="0" * 64) for row in rows]))
    with (
        reading_studies(read_program(place / "tiny.toml"), place / "out", PluginHost()) as studies,
        pytest.raises(UsageError, match="the rows are of several versions of the mission `trip`"),
    ):
        make_record("tiny", studies)


def test_kept_runs_of_a_changed_mission_move_with_their_rows(place: Path, tasks: AnsweringExecutor) -> None:
    """Also after a kill between the moves and the file of the rows."""
    line = command(place, "--limit", "1", "--parts", "redrawn", "--replay-changed", "--other-code")
    assert run_command(line) == ExitCode.OK
    study = place / "out" / "redrawn-tier1"
    (row,) = read_results(study)

    def with_trace(trace: str) -> Any:
        return msgspec.structs.replace(row, report=msgspec.structs.replace(row.report, trace=trace))

    name = f"results-trip-{row.mission_sha256[:12]}"
    for is_killed in (False, True):
        (study / "results.parquet").write_bytes(encode_rows([with_trace("runs/a/trace.mcap")]))
        shutil.rmtree(study / name, ignore_errors=True)
        (study / f"{name}.parquet").unlink(missing_ok=True)
        run = study / (f"{name}/a" if is_killed else "runs/a")
        run.mkdir(parents=True)
        (run / "trace.mcap").write_text("a trace")
        (study / f"{name}.audit.json").unlink(missing_ok=True)
        (study / "audit.json").write_text(
            json.dumps({"rows": {row_sha256(with_trace("runs/a/trace.mcap")): "checked"}})
        )
        (place / "trip.ljs").write_text(f"{TIERED}# changed {is_killed}\n")
        assert run_command(line) == ExitCode.OK
        assert read_results(study / f"{name}.parquet") == [with_trace(f"{name}/a/trace.mcap")]
        assert (study / name / "a" / "trace.mcap").read_text() == "a trace" and not (study / "runs" / "a").exists()
        marks = json.loads((study / f"{name}.audit.json").read_text())["rows"]
        assert marks == {row_sha256(with_trace(f"{name}/a/trace.mcap")): "checked"}


def test_a_trace_outside_of_the_runs_is_never_moved(place: Path, tasks: AnsweringExecutor) -> None:
    line = command(place, "--limit", "1", "--parts", "redrawn", "--replay-changed", "--other-code")
    assert run_command(line) == ExitCode.OK
    study = place / "out" / "redrawn-tier1"
    (row,) = read_results(study)
    (place / "trip.ljs").write_text(f"{TIERED}# changed\n")
    foreign = msgspec.structs.replace(row, report=msgspec.structs.replace(row.report, trace="runs/../../mine/t.mcap"))
    (study / "results.parquet").write_bytes(encode_rows([foreign]))
    (place / "out" / "mine").mkdir()
    (study / "runs").mkdir(exist_ok=True)
    assert run_command(line) == ExitCode.OK
    assert (place / "out" / "mine").is_dir()
    (aside,) = study.glob("results-trip-*.parquet")
    assert read_results(aside) == [foreign]


@pytest.mark.slow
def test_a_killed_command_continues(place: Path) -> None:
    """Real episodes, a SIGKILL after the first row, and the same command again."""
    line = [sys.executable, "-m", "lingjing.cli.main", *command(place, "--limit", "1", "--parts", "reference")]
    first = PipedFork(line)
    parts = place / "out" / "reference-tier0" / "parts"
    deadline = time.monotonic() + 120.0
    while not list(parts.glob("*.parquet")) and first.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    first.kill()
    assert first.wait() == -signal.SIGKILL, "the command was killed before its end"
    again = run_python(line)
    assert again.returncode == 0, again.stderr
    done = int(re.search(r"^(\d+) episodes to play", again.stderr, re.M)[1])  # type: ignore[index]
    assert 1 <= done < 4
    record = read_record(place / "out" / "validity.json")
    reference = [cell for cell in record.cells if cell.study.startswith("reference")]
    assert [(cell.entrant, cell.tier, cell.seeds, cell.won) for cell in reference] == [
        ("idle", 0, "0", ""), ("oracle", 0, "0", "0"), ("idle", 1, "0", ""), ("oracle", 1, "0", "0"),
    ]  # fmt: skip


# -- adversaries


ADVERSARIES = """
[[parts]]
name = "reference"
missions = ["upr"]
tiers = [1]
seeds = 1
entrants = [{ policy = "heuristic", sees = "pictures" }]
[adversaries]
columns = ["upr-star"]
selection = 2
fresh = 3
"""


def test_the_worst_adversary_is_chosen_first_and_plays_fresh_seeds(
    place: Path, tasks: AnsweringExecutor, capsys: Capture
) -> None:
    (place / "tiny.toml").write_text(PROGRAM.partition("[[parts]]")[0] + ADVERSARIES)
    tasks.answer = lambda task: answered(
        task, success=False, scr=0.5 if task.options.policy.endswith(":Flooder") else 0.0
    )
    assert run_command(command(place, "--limit", "1")) == ExitCode.OK
    assert all(task.options.seed == 0 for task in tasks.tasks)
    record = read_record(place / "out" / "validity.json")
    assert [(each.worst, each.seeds) for each in record.adversaries] == [("", "")]
    assert "not chosen yet" in (place / "out" / "validity.md").read_text()
    tasks.tasks.clear()
    assert run_command(command(place)) == ExitCode.OK
    fresh = [task for task in tasks.tasks if task.options.seed >= 1000]
    assert [task.options.seed for task in fresh] == [1000, 1001, 1002]
    assert all(task.options.policy.endswith(":Flooder") and task.options.isolate == "yes" for task in fresh)
    assert all(task.options.salt for task in fresh)
    (worst,) = read_record(place / "out" / "validity.json").adversaries
    assert (worst.worst, worst.sees, worst.seeds, worst.won, worst.verdict) == (
        "flooder", "nothing", "1000-1002", "", "undecided",
    )  # fmt: skip
    page = (place / "out" / "validity.md").read_text()
    assert "| worst adversary: flooder | nothing | – | 0 [0, 56] (0/3) |" in page
    assert "| `upr-star` | 1 | heuristic 0/1 | adversary flooder 0/3 |" in page


# -- the record and the tables


def test_seeds_are_written_as_ranges() -> None:
    for seeds in ((), (5,), (0, 1, 2), (0, 1, 2, 5, 7, 8), (3000, 3001)):
        assert seeds_of(ranges(seeds)) == seeds
    assert ranges([8, 7, 0, 1, 2, 5, 5]) == "0-2,5,7-8"
    for text in ("2-1", "x", "0-999999999999", "1,,2"):
        with pytest.raises(ValueError):
            seeds_of(text)


def test_a_record_has_a_line_for_each_cell_in_order(place: Path, tasks: AnsweringExecutor) -> None:
    assert run_command(command(place)) == ExitCode.OK
    content = (place / "out" / "validity.json").read_bytes()
    record = read_record(place / "out" / "validity.json")
    assert encode_record(record) == content
    lines = [json.loads(line.rstrip(",")) for line in content.decode().splitlines() if line.startswith('{"study')]
    assert len(lines) == 3 + 5
    keys = [(cell.study, cell.column, cell.tier, cell.entrant) for cell in record.cells]
    assert keys == sorted(keys)
    assert all(study.benchmark and len(study.code) == 1 for study in record.studies)
    assert all(study.missions and all(map(bool, study.missions.values())) for study in record.studies)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("lingjing-validity/1", "lingjing-validity/2"), "has the format lingjing-validity/2"),
        (lambda text: text.replace('"won":"0-2"', '"won":"0-5"', 1), "seeds were won that were not played"),
        (lambda text: text[:-9], "is not a record of the studies"),
        (lambda text: "[]", "is not a record of the studies"),
    ],
)
def test_a_wrong_record_gives_one_error_message(
    place: Path, tasks: AnsweringExecutor, change: Callable[[str], str], message: str
) -> None:
    assert run_command(command(place)) == ExitCode.OK
    file = place / "out" / "validity.json"
    file.write_text(change(file.read_text()))
    with pytest.raises(UsageError, match=re.escape(message)):
        read_record(file)
    with pytest.raises(UsageError, match="cannot read"):
        read_record(place / "absent.json")


def made_record(**changes: object) -> ValidityRecord:
    """A record of two columns, three players, a comparison of modes and an adversary."""
    cells = [
        {"study": "reference-tier0", "column": "a-star", "tier": 0, "entrant": "oracle", "sees": "truth",
         "planned": 20, "seeds": "0-19", "won": "0-19"},
        {"study": "reference-tier0", "column": "b-single", "tier": 0, "entrant": "oracle", "sees": "truth",
         "planned": 20, "seeds": "0-19", "won": "0-9"},
        {"study": "reference-tier0", "column": "a-star", "tier": 0, "entrant": "rules", "sees": "pictures",
         "planned": 20, "seeds": "0-9", "won": "0-6", "lost": "10"},
        {"study": "reference-tier0", "column": "b-single", "tier": 0, "entrant": "rules", "sees": "pictures",
         "planned": 20},
        {"study": "reference-tier0", "column": "a-star", "tier": 0, "entrant": "black", "sees": "nothing",
         "planned": 20, "seeds": "0-4,15", "won": "15"},
        *({"study": "modes-tier1", "column": f"m-{mode}", "tier": 1, "entrant": "rules", "sees": "pictures",
           "planned": 10, "seeds": "0-8" if mode == "star" else "0-9", "won": won, "lost": lost}
          for mode, won, lost in (("star", "0-7", "9"), ("broadcast", "0", ""))),
    ]  # fmt: skip
    plain = {
        "format": "lingjing-validity/1", "program": "p", "cells": cells, "adversaries": [],
        "studies": [{"study": "reference-tier0"}, {"study": "modes-tier1", "compares": "modes"}],
    }  # fmt: skip
    return converted({**plain, **changes}, ValidityRecord)


def test_tables_show_both_tiers_intervals_and_unplayed_columns() -> None:
    text = tables(made_record())
    assert "No row of a real model is here yet" in text
    assert "Tier 0 is comparable with the paper by protocol and never by number" in text
    assert "| oracle † | truth | 100 [84, 100] (20/20) | – |" in text
    assert "| rules | pictures | 70 [40, 89] (7/10, 20 planned) | – |" in text
    assert "| rules | pictures | not played | – |" in text
    assert "| reference-tier0 | 56 | 100 | 1 | – | – | public seeds | 0 |" in text


def test_averages_need_every_column() -> None:
    text = tables(made_record())
    assert re.search(r"^\| oracle † \| truth \| 75 \[\d+, \d+\] \|", text, re.M)
    assert "| rules | pictures | not all columns played (1 of 2) | – |" in text


def test_a_difference_is_taken_on_common_seeds() -> None:
    """`black` won seed 15, which `rules` did not play: on the common seeds it won none."""
    text = tables(made_record())
    assert re.search(r"^\| `a-star` \| 0 \| rules 5/5 \| black 0/5 \| \+100 \[", text, re.M), text
    assert "| `b-single` | 0 | not played | not played | – |" in text


def test_modes_are_tested_when_all_pairs_are_played_and_lost_episodes_are_failures() -> None:
    text = tables(made_record())
    # 7 pairs that star alone has won: p = 2 / 2**7
    assert "| M | 10 | 8 | 1 | 7 | 0 | 0.016 | 0.016 |" in text
    cells = [msgspec.to_builtins(cell) for cell in made_record().cells]
    for cell in cells:
        cell["planned"] = 100
    text = tables(made_record(cells=cells))
    assert "| M | 10 of 100 | 8 | 1 | 7 | 0 | not tested yet | – |" in text


def test_the_rows_of_the_readme_have_no_spaces() -> None:
    assert readme_rows(made_record(), ("oracle", "rules")) == ["|a-star|20/20|–|7/10|–|", "|b-single|10/20|–|–|–|"]


def test_each_episode_counts_once(place: Path, tasks: AnsweringExecutor) -> None:
    """The record agrees with the rows that `lingjing bench table` reads."""
    assert run_command(command(place)) == ExitCode.OK
    record = read_record(place / "out" / "validity.json")
    for study in ("reference-tier0", "reference-tier1", "redrawn-tier1"):
        rows = read_results(place / "out" / study)
        won = Counter(row.entrant for row in rows if row.report.success)
        cells = [cell for cell in record.cells if cell.study == study]
        assert {cell.entrant: len(seeds_of(cell.won)) for cell in cells} == {
            cell.entrant: won[cell.entrant] for cell in cells
        }


@pytest.mark.slow
def test_audited_rows_are_counted(place: Path, capsys: Capture) -> None:
    """A real episode with a kept trace, and its audit."""
    line = command(place, "--limit", "1", "--parts", "redrawn", "--keep")
    assert run_command(line) == ExitCode.OK
    assert "| redrawn-tier1 | 1 | 2 | 0 |" in (place / "out" / "validity.md").read_text()
    assert run_command(["bench", "audit", str(place / "out" / "redrawn-tier1")]) == ExitCode.OK
    assert run_command(line) == ExitCode.OK
    (study,) = [study for study in read_record(place / "out" / "validity.json").studies if study.split]
    assert (study.study, study.audited) == ("redrawn-tier1", 1)
