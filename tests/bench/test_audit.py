"""Rows as evidence: seals, refused rows, the audit of kept traces, and the version of the benchmark."""

from __future__ import annotations

import dataclasses
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import msgspec
import pytest

import lingjing
from lingjing.bench.auditing import Audit, Auditor, _calls_fault
from lingjing.bench.merging import merge_rows
from lingjing.bench.version import _meaning, mission_version
from lingjing.errors import ExitCode, UsageError
from lingjing.plugins.calls import CallRequest, CallResult
from lingjing.testing import compiled, instantiate, run_command
from lingjing.trace.call_store import CallStore
from lingjing.trace.calls import CalledEpisode
from tests.bench.suite_kit import (
    RESULTS,
    TRIP,
    SuiteRow,
    audit_file,
    audit_marks,
    code_sha256,
    encode_rows,
    leaderboard,
    made_row,
    read_audit,
    read_results,
    row_faults,
    row_sha256,
    without_places,
)
from tests.play.report_kit import ABORTED, made_report
from tools.python_forks import run_python

SUITE = """
suite = 1
name = "trips"
missions = ["trip.ljs"]
seeds = 3
[[entrants]]
policy = "oracle"
[[entrants]]
policy = "idle"
"""


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A results folder with six kept traces."""
    folder = tmp_path_factory.mktemp("played")
    (folder / "trip.ljs").write_text(TRIP)
    (folder / "trips.toml").write_text(SUITE)
    (folder / "split.salt").write_text("5a" * 32)
    (folder / "split.salt").chmod(0o600)
    command = ["bench", str(folder / "trips.toml"), "-o", str(folder / "out"), "--keep", "-j", "2"]
    assert run_command([*command, "--salt", str(folder / "split.salt")]) == ExitCode.OK
    return folder


@pytest.fixture
def results(played: Path, tmp_path: Path) -> Path:
    """A copy of the results that a test may change."""
    return Path(shutil.copytree(played / "out", tmp_path / "out"))


def rewrite(folder: Path, change: Callable[[SuiteRow], SuiteRow]) -> None:
    (folder / RESULTS).write_bytes(encode_rows([change(row) for row in read_results(folder)]))


def of_idle(row: SuiteRow, **changes: object) -> SuiteRow:
    """Change the report of the rows of `idle`."""
    if row.entrant != "idle":
        return row
    return msgspec.structs.replace(row, report=msgspec.structs.replace(row.report, **changes))


def with_options(row: SuiteRow, **changes: object) -> SuiteRow:
    """Change the options of the rows of `idle`."""
    if row.entrant != "idle":
        return row
    return msgspec.structs.replace(row, options=msgspec.structs.replace(row.options, **changes))


def audited(folder: Path, capsys: pytest.CaptureFixture[str], *more: str) -> tuple[int, str]:
    code = run_command(["bench", "audit", str(folder), "--sample-seed", "1", *more])
    return code, capsys.readouterr().out


def test_honest_rows_are_confirmed(results: Path, played: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = read_results(results)
    assert len({row.seal for row in rows}) == 6 and all(len(row.seal) == 64 for row in rows)
    assert len({row.benchmark for row in rows}) == 1
    code, out = audited(results, capsys, "--share", "0.5")
    assert code == ExitCode.OK
    assert "audited: 6 of 6 rows, 3 of them replayed; 0 wrong" in out
    assert "not checked: 6 rows: its instance, without the published salt" in out
    code, out = audited(results, capsys, "--salt", str(played / "split.salt"))
    assert (code, out.count("not checked")) == (ExitCode.OK, 2), out
    assert "not checked: 6 rows: its rules, except against other rows: its mission is not shipped" in out
    assert "not checked: 6 rows: its versions of the mission and of the code" in out
    assert "6 of 6 rows, 1 of them replayed" in out
    code, out = audited(results, capsys, "--salt", str(played / "split.salt"), "--suite", str(played / "trips.toml"))
    assert (code, out.count("not checked")) == (ExitCode.OK, 0), out


def test_an_audit_keeps_earlier_marks_of_removed_traces_on_request(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["bench", "audit", str(results), "--keep-marks"]) == ExitCode.USAGE
    assert "there is no audit beside" in capsys.readouterr().err
    assert audited(results, capsys, "--share", "0.5")[0] == ExitCode.OK
    before = read_audit(results)
    assert before is not None
    removed, edited, *_ = (row for row in read_results(results) if row.entrant == "idle")
    for row in (removed, edited):
        (results / row.report.trace).unlink()
    rewrite(results, lambda row: msgspec.structs.replace(row, wall_s=1.0) if row.key == edited.key else row)
    code, out = audited(results, capsys, "--keep-marks")
    assert code == ExitCode.OK and "audited: 5 of 6 rows" in out, "an edited row has no earlier mark"
    assert "not checked: 1 row: its trace was removed after an earlier audit had confirmed it" in out
    assert "not checked: 1 row: its trace was removed\n" in out
    kept = read_audit(results)
    assert kept is not None and kept.rows[row_sha256(removed)] == before.rows[row_sha256(removed)]
    audit_file(results).write_bytes(
        msgspec.json.encode(
            msgspec.structs.replace(kept, rows={}, faults={row_sha256(removed): "its score is another"})
        )
    )
    code, out = audited(results, capsys, "--keep-marks")
    assert code == ExitCode.MISSION and "its score is another" in out, "nor is a fault forgotten"
    code, out = audited(results, capsys)
    assert "audited: 4 of 6 rows" in out, "without the option nothing of the earlier audit counts"


def test_a_sealed_split_draws_other_instances_and_names_its_salt(
    played: Path, results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = read_results(results)
    assert {row.seed for row in rows} == {0, 1, 2} and len({row.split_sha256 for row in rows}) == 1
    assert all(row.options.salt == "" for row in rows), "the place of a secret is no part of a row"
    trace, salt = str(results / rows[0].report.trace), played / "split.salt"
    assert run_command(["verify", "--salt", str(salt), trace]) == ExitCode.OK
    assert f"drawn by this salt for seed {rows[0].seed}" in capsys.readouterr().out
    other = results / "other.salt"
    other.write_text("5b" * 32)
    assert run_command(["verify", "--salt", str(other), trace]) == ExitCode.MISSION
    assert "it names another salt" in capsys.readouterr().out
    assert run_command(["verify", "--salt", str(salt)]) == ExitCode.OK
    assert rows[0].split_sha256 in capsys.readouterr().out
    assert run_command(["bench", str(played / "trips.toml"), "-o", str(results)]) == ExitCode.USAGE
    assert "and these episodes with public seeds" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda row: of_idle(row, success=True, reason="success", scr=0.5), "it counts as a success with a subtask"),
        (
            lambda row: of_idle(
                row, success=True, reason="success", scr=1.0,
                metrics=msgspec.structs.replace(row.report.metrics, success=True),
            ),
            "its success is not what its trace gives",
        ),
        (lambda row: of_idle(row, digest="0" * 64), "its digest is not what its trace gives"),
        (lambda row: msgspec.structs.replace(row, seal=row.seal[::-1]), "its seal is not that of its trace"),
        (lambda row: msgspec.structs.replace(row, seal=""), "it names no seal of its trace"),
        (lambda row: msgspec.structs.replace(row, policy="heuristic"), "its policy is not that of its trace"),
        (lambda row: msgspec.structs.replace(row, split_sha256=""), "its sealed split is not that of its trace"),
        (
            lambda row: msgspec.structs.replace(row, options=msgspec.structs.replace(row.options, isolate="yes")),
            "its walls is not that of its trace",
        ),
        (lambda row: with_options(row, seed=7), "its option seed is not that of its trace"),
        (lambda row: with_options(row, policy_seed=7), "its option policy_seed is not that of its trace"),
        (lambda row: with_options(row, mode="star"), "its option mode is not that of its trace"),
        (lambda row: with_options(row, policy="heuristic"), "its option policy is not that of its trace"),
        (lambda row: of_idle(row, policy="heuristic"), "its reported policy is not that of its trace"),
        (lambda row: with_options(row, blank_pictures=True), "its option `blank_pictures` is not that of its trace"),
        (lambda row: with_options(row, swap_pictures=True), "its option `swap_pictures` is not that of its trace"),
        (lambda row: with_options(row, settings={"way": 2.0}), "its option `settings` is not that of its trace"),
        (lambda row: with_options(row, engine_args={"camera.quality": 1}), "its option `engine_args` is not that of"),
        (lambda row: with_options(row, policies_for={"boat": "oracle"}), "its option `policies_for` is not that of"),
        (
            lambda row: of_idle(msgspec.structs.replace(row, standing="aborted"), reason=ABORTED),
            "it is aborted, and its trace ends with `budget`",
        ),
        (
            lambda row: msgspec.structs.replace(row, standing="aborted"),
            "it is aborted, and its reason is `budget`",
        ),
    ],
)  # fmt: skip
def test_an_edited_row_is_found(
    results: Path, capsys: pytest.CaptureFixture[str], change: Callable[[SuiteRow], SuiteRow], reason: str
) -> None:
    rewrite(results, change)
    code, out = audited(results, capsys)
    assert code == ExitCode.MISSION
    assert f"wrong: idle, trip-broadcast, seed 0: {reason}" in out, out


def test_a_swapped_trace_is_found(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The trace of a won episode stands in for a lost one, with the row of the won one."""
    rows = {(row.entrant, row.seed): row for row in read_results(results)}
    won, lost = rows["oracle", 0], rows["idle", 0]
    shutil.copy(results / won.report.trace, results / lost.report.trace)
    code, out = audited(results, capsys)
    assert code == ExitCode.MISSION and "idle, trip-broadcast, seed 0: its seal is not that of its trace" in out
    report = msgspec.structs.replace(won.report, trace=lost.report.trace, policy="idle")
    rewrite(results, lambda row: msgspec.structs.replace(row, report=report, seal=won.seal) if row == lost else row)
    code, out = audited(results, capsys)
    assert code == ExitCode.MISSION and "its trace is that of" in out


def test_a_damaged_and_a_removed_trace_are_reported(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = {(row.entrant, row.seed): row for row in read_results(results)}
    damaged = results / rows["oracle", 0].report.trace
    data = bytearray(damaged.read_bytes())
    data[len(data) // 2] ^= 1
    damaged.write_bytes(data)
    (results / rows["idle", 1].report.trace).unlink()
    code, out = audited(results, capsys)
    assert code == ExitCode.MISSION
    assert "wrong: oracle, trip-broadcast, seed 0: its trace is wrong" in out
    assert "not checked: 1 row: its trace was removed" in out


def test_rows_without_traces_are_named_as_unchecked(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rewrite(results, lambda row: of_idle(row, trace=""))
    code, out = audited(results, capsys)
    assert code == ExitCode.OK
    assert "not checked: 3 rows: its trace was not kept" in out and "audited: 3 of 6 rows" in out


def test_a_row_of_other_code_is_confirmed_by_its_own_replay_only(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rewrite(results, lambda row: msgspec.structs.replace(row, harness="e" * 64))
    code, out = audited(results, capsys)
    assert code == ExitCode.OK
    assert "audited: 1 of 6 rows, 1 of them replayed; 0 wrong" in out
    assert "not checked: 5 rows: it was played with other code" in out
    assert "audited: 6 of 6 rows, 6 of them replayed" in audited(results, capsys, "--share", "1")[1]


@pytest.mark.parametrize("tier", [0, 1])
def test_other_rules_than_those_of_the_shipped_mission_are_found(tier: int) -> None:
    played = instantiate(compiled("bi"), seed=3, tier=tier)
    row = made_row(mission="bi", mode=played.mode, harness="code")

    def fault(instance: object, row: SuiteRow = row) -> str:
        trace = SimpleNamespace(header=SimpleNamespace(instance=instance))
        return Auditor(Path(), "code")._rules_fault(row, trace, Audit())  # type: ignore[arg-type]

    assert fault(played, msgspec.structs.replace(row, harness="other")) == ""
    easy = msgspec.structs.replace(played.budget, ticks=played.budget.ticks + 1)
    assert fault(msgspec.structs.replace(played, budget=easy)) == (
        "its budget is not that of its mission, the shipped `bi` (--suite FILE names a suite with its own)"
    )
    assert "rules is not that" in fault(msgspec.structs.replace(played, rules=played.rules[:-1]))
    unknown = msgspec.structs.replace(row, options=msgspec.structs.replace(row.options, settings={"ease": 1.0}))
    assert fault(played, unknown).startswith("its mission gives no such instance: ")


def test_the_suite_of_other_rows_is_a_usage_error(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["bench", "audit", str(results), "--suite", "main"]) == ExitCode.USAGE
    assert "--suite main: the rows are of the suite `trips`" in capsys.readouterr().err
    wrong = results / "wrong.toml"
    wrong.write_text('suite = 1\nname = "trips"\nmissions = 5\n')
    assert run_command(["bench", "audit", str(results), "--suite", str(wrong)]) == ExitCode.USAGE
    assert "`missions` is no list of names" in capsys.readouterr().err


def test_the_hash_of_the_code_does_not_depend_on_the_folders_of_missions(tmp_path: Path) -> None:
    shipped = Path(lingjing.__file__).parents[1] / "scenarios" / "ssr.ljs"
    own = [tmp_path / name / "trip.ljs" for name in ("a", "z")]
    for file in own:
        file.parent.mkdir()
        file.write_text(TRIP)
    assert code_sha256([own[0], shipped]) == code_sha256([shipped, own[1]])


def test_other_rules_than_those_of_the_suites_own_mission_are_found(
    results: Path, played: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The rows of `idle` are of an easier mission of the same name."""
    easy = played / "easy"
    easy.mkdir()
    (easy / "trip.ljs").write_text(TRIP.replace("ticks <= 3", "ticks <= 4"))
    (easy / "trips.toml").write_text(SUITE)
    command = ["bench", str(easy / "trips.toml"), "-o", str(easy / "out"), "--keep", "--entrants", "idle"]
    assert run_command([*command, "--salt", str(played / "split.salt")]) == ExitCode.OK
    capsys.readouterr()
    code, out = audited(easy / "out", capsys)
    assert (code, out.count("wrong:")) == (ExitCode.OK, 0), "alone they agree with each other"
    code, out = audited(easy / "out", capsys, "--suite", str(played / "trips.toml"))
    assert code == ExitCode.MISSION
    assert "wrong: idle, trip-broadcast, seed 0: its version of the mission is not that of its suite" in out
    honest = {row.seed: row for row in read_results(results) if row.entrant == "oracle"}
    versions = {"mission_sha256": honest[0].mission_sha256, "code": honest[0].code}
    rows = [msgspec.structs.replace(row, **versions) for row in read_results(easy / "out")]
    for row in rows:
        shutil.copytree(
            (easy / "out" / row.report.trace).parent, (results / row.report.trace).parent, dirs_exist_ok=True
        )
    (results / RESULTS).write_bytes(encode_rows([*honest.values(), *rows]))
    code, out = audited(results, capsys)
    assert code == ExitCode.MISSION
    assert "audited: 0 of 6 rows" in out, "which of them are right is not known"
    assert "wrong: idle, trip-broadcast, seed 0: its budget is not that of oracle, trip-broadcast, seed 0" in out
    assert "wrong: oracle, trip-broadcast, seed 0: its budget is not that of idle, trip-broadcast, seed 0" in out
    code, out = audited(results, capsys, "--suite", str(played / "trips.toml"))
    assert "wrong: idle, trip-broadcast, seed 0: its budget is not that of its mission" in out
    assert "wrong: oracle" not in out


@pytest.mark.parametrize("field", ["weather", "budget", "entities"])
def test_each_part_of_an_instance_is_compared_with_its_mission(
    results: Path, played: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, field: str
) -> None:
    """Another instance of the mission of the suite: as if its file had been another one."""

    def changed(*arguments: object, **named: object) -> object:
        drawn = instantiate(*arguments, **named)
        value = getattr(drawn, field)
        if field == "entities":
            first, *others = value
            x, y, z = first.position
            value = (msgspec.structs.replace(first, position=(x, y + 5.0, z)), *others)
        elif field == "weather":
            value = msgspec.structs.replace(value, visibility_m=value.visibility_m + 1.0)
        else:
            value = msgspec.structs.replace(value, ticks=value.ticks + 1)
        return msgspec.structs.replace(drawn, **{field: value})

    monkeypatch.setattr("lingjing.bench.auditing.instantiate", changed)
    code, out = audited(results, capsys, "--suite", str(played / "trips.toml"))
    assert code == ExitCode.MISSION and out.count("wrong:") == 6
    assert f"its {field} {'are not those' if field == 'entities' else 'is not that'} of its mission" in out


def test_what_other_code_and_removed_aborts_leave_open_is_named(
    results: Path, played: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    aborted = made_row(seed=7, success=False, standing="aborted")
    rows = [msgspec.structs.replace(row, harness="0" * 64, benchmark="0" * 64) for row in read_results(results)]
    (results / RESULTS).write_bytes(encode_rows([*rows, aborted]))
    out = audited(results, capsys, "--suite", str(played / "trips.toml"), "--share", "1")[1]
    assert (
        "not checked: 6 rows: its versions of the benchmark, the mission and the code: it was played with other code"
        in out
    )
    assert "not checked: 6 rows: the places of its entities: it was played with other code" in out
    assert "not checked: 1 row: its abort, which has no complete trace" in out


def test_a_row_that_hides_the_truth_of_its_player_is_refused() -> None:
    honest = made_row()
    hidden = msgspec.structs.replace(honest, report=msgspec.structs.replace(honest.report, privileged=True))
    assert list(row_faults(hidden)) == ["its report is of a player with the truth, and the row does not say so"]
    assert list(row_faults(made_row(report=made_report(seed=0, digest="")))) == [
        "it counts as a success of an episode without a digest"
    ]


def test_a_path_that_no_file_can_have_is_a_removed_trace(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rewrite(results, lambda row: of_idle(row, trace="x" * 5000))
    assert "not checked: 3 rows: its trace was removed" in audited(results, capsys)[1]


@pytest.mark.parametrize(
    ("metrics", "served", "reason"),
    [
        ({"calls": 1, "tokens": 30, "cost_usd": 0.01}, "m-1", ""),
        ({"calls": 2, "tokens": 30, "cost_usd": 0.01}, "m-1", ""),  # one was given up at a deadline
        ({"calls": 0, "tokens": 0, "cost_usd": 0.0}, "m-1", "its record holds 2 model calls with 30 tokens"),
        ({"calls": 3, "tokens": 30, "cost_usd": 0.01}, "m-1", "its record holds 2 model calls with 30 tokens"),
        ({"calls": 1, "tokens": 30, "cost_usd": 0.0}, "m-1", "its record holds model calls for $0.010000, and the row"),
        ({"calls": 1, "tokens": 30, "cost_usd": 0.01}, "m-2", "its record names the model `m-1`, and the row `m-2`"),
    ],
)
def test_calls_tokens_cost_and_model_are_those_of_the_record(
    tmp_path: Path, metrics: dict[str, object], served: str, reason: str
) -> None:
    episode = CalledEpisode(mission="ssr", mode="star", seed=0)
    store = CallStore(tmp_path / "calls.sqlite", episode)
    answer = CallResult(text="a", prompt_tokens=20, completion_tokens=10, cost_usd=0.01, served="m-1")
    for number, result in enumerate((answer, CallResult(failure="late", fault="abandoned"))):
        request = CallRequest(tick=1, number=number, head=b"{}", messages=())
        store.begin("a", request, None)
        store.end("a", request, result)
    store.close()
    row = made_row(metrics=metrics, served=served)
    assert _calls_fault(row, tmp_path, Audit()).startswith(reason)
    assert bool(_calls_fault(row, tmp_path, Audit())) == bool(reason)


def test_a_trace_from_before_options_were_recorded_is_named(
    results: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def without_options(path: Path) -> object:
        trace = lingjing.read(path)
        return dataclasses.replace(trace, header=msgspec.structs.replace(trace.header, options=None))

    monkeypatch.setattr("lingjing.bench.auditing.read_trace", without_options)
    assert "not checked: 6 rows: its options such as `blank_pictures`" in audited(results, capsys)[1]


def test_a_column_of_the_file_that_differs_from_its_report_is_refused(results: Path) -> None:
    import pyarrow.compute as compute
    import pyarrow.parquet as parquet

    table = parquet.read_table(results / RESULTS)
    at = table.schema.get_field_index("success")
    edited = table.set_column(at, table.schema.field(at), compute.invert(table["success"]))
    parquet.write_table(edited, results / RESULTS)
    with pytest.raises(UsageError, match=r"row 0 of .* contradicts itself: its column `success` is not that of its"):
        read_results(results)


CHEAT = """
from lingjing.kernel.evaluation import MissionEvaluator
from lingjing.kernel.subtasks import Subtasks
from lingjing.plugins.evaluator import Evaluation
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.policy import Decision, PolicyPlugin

MissionEvaluator.evaluate = lambda self, at, events: Evaluation(1.0, at.time_s > 0.0, "success" * (at.time_s > 0.0))
Subtasks.share = lambda self, latched: 1.0


class Lazy:
    async def reset(self, brief):
        pass

    async def act(self, observation, inbox):
        return Decision()


@hookimpl
def lingjing_policies():
    return (PolicyPlugin(name="lazy", factory=Lazy),)
"""
"""A plug-in with a policy that does nothing, and a module that patches the evaluator."""


def test_walls_stop_a_plugin_that_patches_the_evaluator_and_an_audit_detects_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    site = tmp_path / "site"
    info = site / "lingjing_lazy-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lingjing-lazy\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[lingjing]\nlazy = lazy_policies\n")
    (site / "lazy_policies.py").write_text(CHEAT)
    (tmp_path / "trip.ljs").write_text(TRIP)
    (tmp_path / "trips.toml").write_text(SUITE.replace("seeds = 3", "seeds = 1"))
    reports = {}
    for name, more in (("walled", []), ("open", ["--no-isolate"])):
        command = ["bench", "trips.toml", "--policy", "lazy", "--keep", "-o", name, *more]
        line = [sys.executable, "-m", "lingjing.cli.main", *command]
        variables = {**os.environ, "PYTHONPATH": str(site)}
        if more:
            done = run_python(line, cwd=tmp_path, env=variables)
        else:  # walls need a fork server that an interpreter has started
            done = subprocess.run(line, cwd=tmp_path, env=variables, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        (row,) = read_results(tmp_path / name)
        reports[name] = (
            row.report.success,
            row.report.reason,
            row.options.isolate,
            "its code runs behind" in done.stderr,
        )
    assert reports["open"] == (True, "success", "no", False), "without walls the patch wins"
    assert reports["walled"] == (False, "budget", "yes", True)
    code, out = audited(tmp_path / "open", capsys)
    assert code == ExitCode.MISSION
    assert "wrong: lazy, trip-broadcast, seed 0: a replay differs from its trace" in out
    assert audited(tmp_path / "walled", capsys)[0] == ExitCode.OK


def test_audit_marks_survive_a_merge_and_edited_rows_lose_them(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert audited(results, capsys)[0] == ExitCode.OK
    assert len(audit_marks([results])) == 6
    merged = tmp_path / "all.parquet"
    assert run_command(["bench", "merge", str(results), "-o", str(merged)]) == ExitCode.OK
    assert "audited: 6 of 6 rows" in capsys.readouterr().err
    page = leaderboard(read_results(merged), audit_marks([merged]))
    assert "audited: 6 of 6 rows" in page and "idle §" not in page
    merged.write_bytes(encode_rows([of_idle(row, ticks=1) for row in read_results(merged)]))
    page = leaderboard(read_results(merged), audit_marks([merged]))
    assert "audited: 3 of 6 rows" in page and "idle §" in page


def test_a_damaged_audit_file_gives_one_error_message(results: Path) -> None:
    audit_file(results).write_text("{")
    with pytest.raises(UsageError, match="cannot read the audit"):
        read_audit(results)


@pytest.mark.parametrize("share", ["0.01", "0", "2"])
def test_a_share_below_a_twentieth_or_above_one_is_a_usage_error(
    results: Path, share: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["bench", "audit", str(results), "--share", share]) == ExitCode.USAGE
    assert "must be between 0.05 and 1" in capsys.readouterr().err


def test_the_sample_has_at_least_a_twentieth_of_the_rows_and_at_least_one_row() -> None:
    auditor = Auditor(Path(), "code", seed=3)
    for count, drawn in ((1, 1), (6, 1), (20, 1), (21, 2), (100, 5)):
        assert len(auditor._sample([made_row(seed=seed) for seed in range(count)])) == drawn


def test_a_success_without_all_subtasks_is_rejected_by_row_checks_and_by_merging() -> None:
    row = made_row(success=True, scr=0.5)
    assert list(row_faults(row)) == ["it counts as a success with a subtask completion rate of 0.50"]
    with pytest.raises(UsageError, match=r"the row of .* is refused: it counts as a success"):
        merge_rows([(Path("a"), row)])
    other = msgspec.structs.replace(row, options=msgspec.structs.replace(row.options, evaluators=("other",)))
    assert list(row_faults(other)) == [], "another evaluator may have its own idea of success"


def test_rows_of_two_benchmark_versions_cannot_be_merged() -> None:
    rows = [made_row(seed=0, benchmark="a"), made_row(seed=1, benchmark="b")]
    with pytest.raises(UsageError, match="the results have more than one version of the benchmark"):
        merge_rows([(Path("a"), row) for row in rows], other_code=True)


def test_rows_of_two_versions_of_one_mission_cannot_be_merged() -> None:
    rows = [made_row(mission="bi", mission_sha256="a"), made_row(mission="ld", mission_sha256="b")]
    assert len(merge_rows([(Path("a"), row) for row in rows])) == 2, "each mission has a version of its own"
    rows.append(made_row(mission="ld", seed=1, mission_sha256="c"))
    with pytest.raises(UsageError, match="the results have more than one version of the mission `ld`: `b` in `a`, `c`"):
        merge_rows([(Path("a"), row) for row in rows], other_code=True)


def test_the_version_of_a_mission_covers_its_text_and_its_libraries(tmp_path: Path) -> None:
    mission, moved = tmp_path / "trip.ljs", tmp_path / "copy" / "other.ljs"
    mission.write_text(TRIP)
    moved.parent.mkdir()
    moved.write_text(TRIP)
    first = mission_version(mission)
    assert mission_version(mission) == mission_version(moved) == first
    mission.write_text(TRIP.replace("51.5 m", "60 m"))
    assert mission_version(mission) != first
    library = tmp_path / "boats.ljs"
    used = TRIP.index("use ")
    library.write_text("ljs 2\ntarget wreck { engine = city }\n")
    mission.write_text(f"{TRIP[:used]}use .boats {{ wreck }}\n{TRIP[used:]}")
    before = mission_version(mission)
    library.write_text("ljs 2\ntarget wreck { engine = city, drift = 0.1 m/s }\n")
    assert mission_version(mission) != before


def test_exchanged_libraries_and_a_use_over_two_lines_change_the_version_of_a_mission(tmp_path: Path) -> None:
    first, second, mission = (tmp_path / name for name in ("near.ljs", "sub/far.ljs", "trip.ljs"))
    second.parent.mkdir()
    used = TRIP.index("use ")
    own = "use .near { wreck }\nuse .sub. # a folder\n  far { hulk }\n"
    mission.write_text(f"{TRIP[:used]}{own}{TRIP[used:]}")
    slow, fast = (
        f"ljs 2\ntarget wreck {{ engine = city, drift = {drift} m/s }}\ntarget hulk {{ engine = city }}\n"
        for drift in (0.1, 0.3)
    )
    versions = set()
    for near, far in ((slow, fast), (fast, slow), (slow, slow)):
        first.write_text(near)
        second.write_text(far)
        versions.add(mission_version(mission))
    assert len(versions) == 3


def test_the_version_of_a_mission_covers_its_map(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    mission, town = tmp_path / "trip.ljs", tmp_path / "town.osm"
    scene = TRIP[TRIP.index("  scene ") : TRIP.index("}", TRIP.index("  scene ")) + 1]
    mission.write_text(TRIP.replace(scene, '  scene map { file = "town.osm" }'))
    town.write_text("<osm/>")
    before = mission_version(mission)
    town.write_text("<osm></osm>")
    assert mission_version(mission) != before


def test_the_version_of_a_document_covers_the_templates_beside_it(tmp_path: Path) -> None:
    document = tmp_path / "search.json"
    shutil.copy(sorted((Path(lingjing.__file__).parents[1] / "scenarios" / "reset").glob("*.json"))[0], document)
    before = mission_version(document)
    (tmp_path / "other.ljs").write_text(TRIP)
    assert mission_version(document) != before


def test_rows_of_unchanged_missions_stay_right_after_another_one_has_changed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Their `code` covers all missions of the suite, and is another one now."""
    for name in ("trip", "way"):
        (tmp_path / f"{name}.ljs").write_text(TRIP.replace("mission trip", f"mission {name}"))
    suite = tmp_path / "two.toml"
    suite.write_text(SUITE.replace('["trip.ljs"]', '["trip.ljs", "way.ljs"]'))
    command = ["bench", str(suite), "-o", str(tmp_path / "out"), "--entrants", "oracle", "--limit", "1"]
    assert run_command([*command, "--missions", "way", "--keep"]) == run_command(command) == ExitCode.OK
    (tmp_path / "trip.ljs").write_text(f"{TRIP}# changed\n")
    capsys.readouterr()
    assert run_command([*command, "--replay-changed", "--other-code"]) == ExitCode.OK
    code, out = audited(tmp_path / "out", capsys, "--suite", str(suite))
    assert (code, out.count("wrong:")) == (ExitCode.OK, 0), out
    assert "not checked: 1 row: the hash of its code: another mission of its suite has changed since" in out


def test_comments_and_docstrings_do_not_change_the_benchmark_version() -> None:
    plain = b"def judge(a):\n    return a > 1\n"
    assert _meaning(plain) == _meaning(b'"""Text."""\n# why\ndef judge(a):\n    """Judge."""\n\n    return (a > 1)\n')
    assert _meaning(plain) != _meaning(b"def judge(a):\n    return a >= 1\n")


def test_the_page_shows_differing_options_and_endpoints() -> None:
    options = made_row().options
    service = {"base_url": "http://one.example/v1", "images": 4}
    rows = [
        made_row(entrant="near", options=msgspec.structs.replace(options, policy_args=service, isolate="yes")),
        made_row(entrant="far", options=msgspec.structs.replace(options, blank_pictures=True)),
    ]
    page = leaderboard(rows)
    assert "images=4, isolate: yes" in page and "http://one.example/v1" in page and "blank_pictures: True" in page


def test_the_options_of_a_row_name_no_folder() -> None:
    options = msgspec.structs.replace(
        made_row().options, policy="/home/ada/entry.py:Agent", policies_for={"pilot": "../pilot.py:P", "dog": "random"},
        salt="/secret/salt", ledger="/tmp/l", calls_from="/runs/1",
    )  # fmt: skip
    stored = without_places(options)
    assert stored.policy == "entry.py:Agent"
    assert stored.policies_for == {"pilot": "pilot.py:P", "dog": "random"}
    assert "/" not in stored.salt + stored.ledger + stored.calls_from


def test_an_edit_changes_the_hash_of_a_row() -> None:
    row = made_row()
    assert row_sha256(row) == row_sha256(msgspec.structs.replace(row, attention_iou=0.5))
    assert row_sha256(row) != row_sha256(msgspec.structs.replace(row, wall_s=row.wall_s + 1))


def test_the_hash_of_the_code_changes_with_each_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file is changed without another size, added, renamed and removed; compiled files and data do not count."""
    monkeypatch.setattr(lingjing, "__path__", [str(tmp_path)])
    (tmp_path / "part").mkdir()
    module = tmp_path / "part" / "a.py"
    module.write_text("a = 1")
    first = code_sha256(())
    assert code_sha256(()) == first
    module.write_text("a = 2")
    changed = code_sha256(())
    (tmp_path / "b.txt").write_text("")
    added = code_sha256(())
    (tmp_path / "b.txt").rename(tmp_path / "c.txt")
    renamed = code_sha256(())
    assert len({first, changed, added, renamed}) == 4
    (tmp_path / "c.txt").unlink()
    module.write_text("a = 1")
    for ignored in ("__pycache__", "_data"):
        (tmp_path / "part" / ignored).mkdir()
        (tmp_path / "part" / ignored / "a.pyc").write_text(ignored)
    (tmp_path / "loop").symlink_to(tmp_path)
    (tmp_path / "gone").symlink_to(tmp_path / "nothing")
    assert code_sha256(()) == first


def test_a_salt_for_rows_of_public_seeds_is_a_usage_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / RESULTS).write_bytes(encode_rows([made_row()]))
    (tmp_path / "split.salt").write_text("5a" * 32)
    command = ["bench", "audit", str(tmp_path), "--salt", str(tmp_path / "split.salt")]
    assert run_command(command) == ExitCode.USAGE
    assert "the rows are of public seeds" in capsys.readouterr().err


def test_the_result_is_printed_if_the_marks_cannot_be_stored(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    audit_file(results).mkdir()
    code, out = audited(results, capsys)
    assert code == ExitCode.USAGE and "audited: 6 of 6 rows" in out


@pytest.mark.parametrize("fault", ["twice", "text", "time"])
def test_a_column_that_no_suite_writes_is_one_message(results: Path, fault: str) -> None:
    import pyarrow as pa
    import pyarrow.parquet as parquet

    table = parquet.read_table(results / RESULTS)
    if fault == "twice":
        table = table.append_column(table.schema.field("seed"), table["seed"])
    else:
        text = pa.array([b"\xff"] * len(table)).view(pa.string())
        time = pa.array([2**62] * len(table), pa.timestamp("us"))
        name, column = ("model", text) if fault == "text" else ("detail", time)
        table = table.set_column(table.schema.get_field_index(name), name, column)
    parquet.write_table(table, results / RESULTS)
    with pytest.raises(UsageError, match=r"cannot be read|contradicts itself"):
        read_results(results)


def test_a_report_with_a_hundred_thousand_lists_in_each_other_is_one_message(results: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as parquet

    table = parquet.read_table(results / RESULTS)
    at, deep = table.schema.get_field_index("report"), "[" * 100_000
    edited = table.set_column(at, table.schema.field(at), pa.array([deep] * len(table)))
    parquet.write_table(edited, results / RESULTS)
    with pytest.raises(UsageError, match=r"row 0 of .* cannot be read"):
        read_results(results)
