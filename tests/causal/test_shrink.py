"""Tests of `lingjing shrink`: the result fails alike and is minimal, and unsuitable traces are rejected."""

import json
import shlex
from pathlib import Path

import msgspec
import pytest

import lingjing
from lingjing import PlayOptions, Trace, run
from lingjing import read as read_trace
from lingjing.causal.failure import FailureSignature, failure_of
from lingjing.causal.shrink import ShrinkOptions, shrink
from lingjing.cli import shrink as shrink_verb
from lingjing.errors import ExitCode, UsageError
from lingjing.testing import run_command

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent / "shrink"
HARBOUR = HERE / "harbour.ljs"
SKIPPERS = HERE / "skippers.py"
SETTINGS = {"people": 2.0}


def played(folder: Path, policy: str, **changes: object) -> Trace:
    report = run(HARBOUR, policy=policy, seed=3, settings=SETTINGS, out=folder, overview=False, **changes)
    return read_trace(report.trace)


@pytest.fixture(scope="module")
def lost(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    """Two skippers that approach no target; one of the two victims is saved because they pass it by chance."""
    return played(tmp_path_factory.mktemp("lost") / "episode", f"{SKIPPERS}:Timid")


@pytest.mark.thorough
def test_shrinking_continues_after_its_budget_and_the_smallest_mission_fails_alike(
    lost: Trace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    small = tmp_path / "small.ljs"
    call = ["shrink", str(lost.path), "-o", str(small), "--mission", str(HARBOUR), "--policy-file", str(SKIPPERS)]
    assert run_command([*call, "--budget", "3", "--output-format", "json"]) == ExitCode.OK
    first = json.loads(capsys.readouterr().out)
    assert not first["minimal"]
    assert small.is_file() and lingjing.compile(small).name == "harbour"
    log = small.with_name("small.ljs.tried.jsonl")
    verdicts = log.read_text()
    assert len(verdicts.splitlines()) >= 3
    log.write_text(verdicts.replace('"fails"', '"other"'))
    assert run_command(call) == ExitCode.USAGE, "a stored verdict stands, and nothing is played again"
    assert "fails differently when it is played again" in capsys.readouterr().err
    log.write_text(verdicts)
    assert run_command([*call, "-j", "2", "--output-format", "json"]) == ExitCode.OK, (
        "it continues with the smallest mission so far"
    )
    captured = capsys.readouterr()
    result = json.loads(captured.out)
    assert result["ticks"] < first["ticks"] or len(result["kept"]) < len(first["kept"])
    assert "fail alike" in captured.err
    assert result["minimal"] and result["control"] == "oracle"
    assert len([part for part in result["kept"] if part.startswith("target")]) == 1
    assert {"event squall", "message hail", "message state_of"} <= set(result["removed"])
    assert result["ticks"] < result["ticks_before"] == 24
    words = shlex.split(shrink_verb.run_command(msgspec.convert(result["options"], PlayOptions)))
    assert run_command([*words[1:], "-o", str(tmp_path / "again"), "--no-overview"]) == ExitCode.OK
    again = read_trace(tmp_path / "again" / "trace.mcap")
    assert again.boundaries[-1].digest == result["digest"]
    assert failure_of(again) == failure_of(lost)
    assert run(small, policy="oracle", seed=3, out=tmp_path / "control", overview=False).success
    places = {entity.position for entity in lost.header.instance.entities}
    assert {entity.position for entity in again.header.instance.entities} <= places
    assert small.read_text().startswith("# Shrunk from the trace ")
    assert not log.exists()
    assert run_command(call) == ExitCode.USAGE
    assert "nothing is overwritten" in capsys.readouterr().err


def test_an_unwritable_output_is_reported_before_any_episode(
    lost: Trace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call = ["shrink", str(lost.path), "--mission", str(HARBOUR), "--policy-file", str(SKIPPERS)]
    assert run_command([*call, "-o", str(tmp_path / "no" / "small.ljs")]) == ExitCode.USAGE
    message = capsys.readouterr().err
    assert message.startswith("error: cannot write `") and "the complete mission fails" not in message


@pytest.mark.parametrize(("body", "words"), [("1 / 0", "ZeroDivisionError"), ("exit(3)", "SystemExit: 3")])
def test_an_error_in_a_user_predicate_is_reported_with_its_option(
    body: str, words: str, lost: Trace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "check.py").write_text(f"def failing(trace):\n    return {body}\n")
    predicate = f"{tmp_path / 'check.py'}:failing"
    call = ["shrink", str(lost.path), "--mission", str(HARBOUR), "--policy-file", str(SKIPPERS), "--same-if", predicate]
    assert run_command([*call, "-o", str(tmp_path / "small.ljs")]) == ExitCode.USAGE
    message = capsys.readouterr().err
    assert f"--same-if {predicate}: {words}" in message and not (tmp_path / "small.ljs").exists()


def test_an_exception_of_a_policy_is_part_of_the_failure_signature(tmp_path: Path) -> None:
    broken = played(tmp_path / "broken", f"{SKIPPERS}:Broken")
    signature = failure_of(broken)
    assert signature is not None
    assert signature.replaced == ("policy_error ZeroDivisionError",)
    assert signature.unmet == ("saved(p)",)


@pytest.mark.parametrize(
    ("outcome", "complaint"),
    [
        ({"success": True, "reason": "success"}, "was won"),
        ({"reason": "infrastructure-abort"}, "was cut short"),
        ({"reason": "interrupted"}, "was cut short"),
        (None, "has no outcome"),
    ],
)
def test_a_trace_without_a_failure_is_rejected(
    lost: Trace, tmp_path: Path, outcome: dict[str, object] | None, complaint: str
) -> None:
    assert lost.outcome is not None
    ended = None if outcome is None else msgspec.structs.replace(lost.outcome, **outcome)
    other = Trace(lost.path, lost.header, lost.boundaries, ended, True)
    with pytest.raises(UsageError, match=complaint):
        shrink(other, tmp_path / "small.ljs")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_mission_or_policy_file_and_a_false_predicate_are_reported(lost: Trace, tmp_path: Path) -> None:
    small = tmp_path / "small.ljs"
    with pytest.raises(UsageError, match="is not shipped") as missing:
        shrink(lost, small)
    assert "--mission FILE" in missing.value.hint
    with pytest.raises(UsageError, match="is not the mission"):
        shrink(lost, small, ShrinkOptions(mission="ssr"))
    with pytest.raises(UsageError, match=r"played by `skippers.py:Timid`, and this file was not found"):
        shrink(lost, small, ShrinkOptions(mission=str(HARBOUR)))
    with pytest.raises(UsageError, match="does not show the failure"):
        shrink(lost, small, ShrinkOptions(mission=str(HARBOUR), predicate=lambda trace: False))


def test_failure_signatures_are_compared_by_family_clauses_or_reason() -> None:
    signature = FailureSignature(reason="budget", unmet=("saved(p)",), family="handoff_break")
    other = msgspec.structs.replace(signature, family="perception_miss")
    assert signature.part("family") != other.part("family")
    assert signature.part("clauses") == other.part("clauses")
    lacking = msgspec.structs.replace(signature, unmet=("found(p)",))
    assert signature.part("clauses") != lacking.part("clauses")
    assert signature.part("reason") == lacking.part("reason")
