"""The first messages that a user sees: a misspelt word, a file name in Python, an error, a printed value."""

from __future__ import annotations

import sys
import traceback
from pathlib import Path

import pytest

import lingjing
from lingjing.dsl.loading.shipped import shipped_missions
from lingjing.errors import ExitCode, MissionError, UsageError
from lingjing.testing import instantiate, run_command

EXAMPLE = Path(__file__).parents[2] / "docs" / "errors" / "example.ljs"


@pytest.mark.parametrize(
    ("arguments", "suggestion"),
    [
        (["rnu", "ssr"], "run"),
        (["valdate", "x.ljs"], "validate"),
        (["scene", "drwa", "city"], "draw"),
        (["compile", "--emit", "misson", "ssr"], "mission"),
        (["run", "ssr", "--sed", "3"], "--seed"),
        (["run", "--polcy=random", "ssr"], "--policy"),
        (["scene", "info", "ssr", "--sed", "3"], "--seed"),
        (["bench", "main", "--chek"], "--check"),
    ],
)
def test_a_misspelt_verb_or_option_gets_a_suggestion(
    arguments: list[str], suggestion: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        run_command(arguments)
    assert ended.value.code == ExitCode.USAGE
    assert capsys.readouterr().err.rstrip().endswith(f"did you mean {suggestion}?")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "srr"], "error: there is no mission `srr`\nhint: did you mean `ssr`?\n"),
        (["validate", "srr.ljs"], "error: there is no mission `srr.ljs`\nhint: did you mean `ssr`?\n"),
        (
            ["run", "zzzzzz"],
            f"error: there is no mission `zzzzzz`\nhint: shipped missions: {', '.join(shipped_missions())}\n",
        ),
        (
            ["run", "ssr", "--policy", "heuristc"],
            "error: no policy is called `heuristc`\nhint: did you mean `heuristic`?\n",
        ),
        (
            ["run", "ssr", "--evaluator", "mision"],
            "error: no evaluator is called `mision`\nhint: did you mean `mission`?\n",
        ),
        (
            ["run", "ssr", "--policy-for", "searchr=random"],
            "error: no role or agent is called `searchr` in broadcast mode\nhint: did you mean `searcher`?\n",
        ),
        (
            ["run", "ssr", "--mode", "brodcast"],
            "error: mission 'ssr' has no mode 'brodcast'\nhint: did you mean `broadcast`?\n",
        ),
        (
            ["graph", "ssr", "--mode", "strr"],
            "error: mission `ssr` has no mode `strr`\nhint: did you mean `star`?\n",
        ),
        (
            ["run", "ssr", "--world", "inlin"],
            "error: world: inline or process is due, this is the text 'inlin'\nhint: did you mean 'inline'?\n",
        ),
        (["bench", "mian"], "error: there is no suite `mian`\nhint: did you mean `main`?\n"),
    ],
)
def test_a_misspelt_name_gives_exactly_one_error_and_its_hint(
    arguments: list[str], message: str, capfd: pytest.CaptureFixture[str]
) -> None:
    assert run_command(arguments) == ExitCode.USAGE
    assert capfd.readouterr().err == message


def test_a_word_similar_to_no_verb_or_option_gets_no_suggestion(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        run_command(["zzzzzzzz"])
    with pytest.raises(SystemExit):
        run_command(["run", "ssr", "--zzzzzzzz"])
    assert "did you mean" not in capsys.readouterr().err


def test_validate_reports_valid_files_on_a_terminal_only(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["validate", str(EXAMPLE)]) == ExitCode.OK
    assert capsys.readouterr().out == ""
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert run_command(["validate", "ssr"]) == ExitCode.OK
    assert run_command(["validate", "ssr", str(EXAMPLE)]) == ExitCode.OK
    assert capsys.readouterr().out == "ssr is valid\n2 files are valid\n"


@pytest.mark.parametrize("as_path", [str, Path])
def test_the_python_api_runs_a_mission_file(tmp_path: Path, as_path: type[str | Path]) -> None:
    broken = tmp_path / "broken.ljs"
    broken.write_text(EXAMPLE.read_text().replace("  goal", "  gaol"))
    with pytest.raises(MissionError, match=r"broken\.ljs:7:3"):
        lingjing.run(as_path(broken))
    with pytest.raises(UsageError, match="no policy is called `nobody`"):  # so the mission was read
        lingjing.run(as_path(EXAMPLE), policy="nobody")


def test_the_python_api_refuses_to_run_a_value_that_is_no_mission() -> None:
    with pytest.raises(UsageError, match="expected a mission, not 'int'"):
        lingjing.run(3)  # type: ignore[arg-type]


def test_a_traceback_shows_the_hint() -> None:
    with pytest.raises(UsageError) as caught:
        lingjing.compile("nowhere.ljs")
    shown = "".join(traceback.format_exception(caught.value))
    assert f"\nhint: {caught.value.hint}" in shown and "shipped missions" in caught.value.hint
    assert not hasattr(UsageError("without"), "__notes__")


def test_missions_and_instances_have_a_short_repr() -> None:
    mission = lingjing.compile("ssr")
    assert repr(mission) == (
        "<Mission ssr 'Sea search and rescue': 15 parameters, 7 groups, 3 agents, 3 rules, star/broadcast>"
    )
    assert repr(instantiate(mission, seed=5)) == "<Instance ssr seed 5 broadcast: 7 entities, 4 agents>"
