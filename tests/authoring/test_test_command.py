"""`lingjing test`: results, selection, exit codes and JUnit XML, with episodes of a boat and policies in files."""

from __future__ import annotations

import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from lingjing.errors import ExitCode
from lingjing.testing import run_command

Capture = pytest.CaptureFixture[str]

MISSION = """ljs 2
use std.sea { lifeboat }

mission m "M" {
  goal "Go north."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 1 s }
  budget { ticks <= 4 }
  mode broadcast in { star, broadcast }
  param far = 40 m in 20 m..4000 m
  region start = box((0 m, -1400 m), (80 m, -1300 m))
  asset boat : lifeboat { position ~ sites(start) }
  agent skipper as rescuer controls boat { observes boat.*, events }
  comms { hub = skipper when mode == star }
  success when used(moves) >= 1
  limit moves <= 9 counts boat.moveTo
  expect {
    BLOCK
  }
}
"""

POLICIES = """
from lingjing.plugins.policy import Action, Decision


class Mover:
    async def reset(self, brief):
        self.resource = brief.resources[0].id

    async def act(self, observation, inbox):
        return Decision(command=Action(verb="moveTo", arguments={"x": 40.0, "y": -1300.0}, resource=self.resource))


class Broken:
    def __init__(self):
        raise RuntimeError("no plan")

    async def reset(self, brief): ...

    async def act(self, observation, inbox):
        return Decision()
"""


class Run:
    """A call of `lingjing test` on one mission."""

    def __init__(self, folder: Path, capsys: Capture) -> None:
        self.folder = folder
        self.capsys = capsys
        self.file = folder / "m.ljs"
        (folder / "policies.py").write_text(POLICIES)

    def __call__(self, block: str, *options: str) -> tuple[int, list[str], str]:
        """Exit code, lines of standard output, and standard error."""
        self.file.write_text(MISSION.replace("BLOCK", textwrap.indent(block, "    ").strip()))
        code = run_command(["test", str(self.file), *options])
        captured = self.capsys.readouterr()
        return code, captured.out.replace(f"{self.folder}/", "").splitlines(), captured.err


@pytest.fixture
def run(tmp_path: Path, capsys: Capture) -> Run:
    return Run(tmp_path, capsys)


def test_expectations_that_hold_pass(run: Run) -> None:
    block = """
        "policies.py:Mover" wins within 2 ticks for seeds 0..1
        idle loses at least 1 of 2
        draws spread over start
    """
    code, lines, _ = run(block, "-j", "2")
    assert code == ExitCode.OK
    assert [line.split("  (")[0] for line in lines[:3]] == [
        'PASSED  m.ljs::"policies.py:Mover" wins within 2 ticks for seeds 0..1',
        "PASSED  m.ljs::idle loses at least 1 of 2",
        "PASSED  m.ljs::draws spread over start",
    ]
    assert "1 of 1 episodes were lost; 1 not needed" in lines[1]
    assert lines[3].startswith("3 passed in ") and len(lines) == 4


def test_a_failed_expectation_reports_the_episode_and_the_command_to_watch_it(run: Run) -> None:
    code, lines, _ = run("idle wins for seeds 3..4 with far = 60 m, mode = star\nidle loses for seeds 0", "-x")
    assert code == ExitCode.MISSION
    assert lines[0].startswith("FAILED  m.ljs::idle wins for seeds 3..4 with far = 60 m, mode = star  (0 of 1 episodes")
    at = lines.index("m.ljs::idle wins for seeds 3..4 with far = 60 m, mode = star")
    assert lines[at + 1] == "  failed: 0 of 1 episodes were won; 1 not needed"
    assert lines[at + 2].startswith("  seed 3: lost (budget) at tick 4, SCR 0.00")
    assert lines[at + 3] == "    watch it: lingjing run m.ljs --seed 3 --policy idle --mode star --set far=60 --watch"
    assert lines[-1].startswith("1 failed in ")  # `-x`: the second was not run


def test_an_expectation_that_cannot_be_evaluated_gives_one_clear_error(run: Run) -> None:
    block = (
        'orakel wins\n"absent.py:A" wins for seeds 0\ndraws spread over start for seeds 0..2\ninfeasible when far < 1 m'
    )
    code, lines, _ = run(block, "-q")
    assert code == ExitCode.MISSION
    assert "  error: no policy is called `orakel`" in lines
    assert any("hint: did you mean `oracle`?" in line for line in lines)
    assert "  error: the seeds draw 3 positions, and at least 8 are needed" in lines
    assert any(line.startswith("  error: there is no policy file") for line in lines)
    assert lines[-1].startswith("3 errors, 1 passed in ")


def test_a_broken_policy_is_an_infrastructure_failure(run: Run) -> None:
    code, lines, _ = run('"policies.py:Broken" wins for seeds 0..1')
    assert code == ExitCode.INFRASTRUCTURE
    assert lines[0].startswith("ABORTED") and "seed 0 did not begin" in lines[0] and "no plan" in lines[0]
    assert lines[-1].startswith("1 aborted in ")


def test_settings_that_are_not_proved_infeasible_fail_the_expectation(run: Run) -> None:
    code, lines, _ = run("infeasible when far == 60 m")
    assert code == ExitCode.MISSION
    assert "2 of 2 such settings are not proved to be infeasible" in lines[0]
    assert "  it may be won: lingjing run m.ljs --mode star --set far=60 --policy oracle" in lines


def test_an_expression_selects_the_checks_to_list_or_to_run(run: Run) -> None:
    block = "idle loses for seeds 0\noracle wins\ndraws spread over start"
    code, lines, _ = run(block, "--list", "-k", "(idle or draws) and not ORACLE")
    assert (code, lines) == (ExitCode.OK, ["m.ljs::idle loses for seeds 0", "m.ljs::draws spread over start"])
    code, lines, _ = run(block, "-k", "draws")
    assert code == ExitCode.OK and lines[-1].startswith("1 passed, 2 deselected in ")


@pytest.mark.parametrize("words", ["(idle", "and", "idle or", "not", "idle)", "idle draws", "a " * 200])
def test_a_wrong_selection_is_a_usage_error(run: Run, words: str) -> None:
    code, lines, error = run("idle loses", "-k", words)
    assert (code, lines) == (ExitCode.USAGE, []) and "hint: write it like" in error


def test_nothing_to_run_is_a_usage_error(run: Run) -> None:
    code, _, error = run("idle loses", "-k", "absent")
    assert code == ExitCode.USAGE and "-k absent selects none of 1 checks" in error
    code, _, error = run("")
    assert code == ExitCode.USAGE and "no file has an expectation" in error and "has no block `expect`" in error


def test_faulty_files_and_wrong_arguments_give_their_exit_codes(run: Run, tmp_path: Path, capsys: Capture) -> None:
    code, lines, error = run("idle lses within 3", "--junit-xml", str(tmp_path / "r.xml"))
    assert code == ExitCode.MISSION and "did you mean `loses`?" in error and lines[-1].startswith("1 error in ")
    assert ET.parse(tmp_path / "r.xml").getroot().get("errors") == "1"
    for arguments in (["absent"], ["-"], [str(run.file), "-j", "0"], [str(run.file), "--junit-xml", str(tmp_path)]):
        assert run_command(["test", *arguments]) == ExitCode.USAGE
        assert "hint: " in capsys.readouterr().err


def test_shipped_missions_are_found_by_name(capsys: Capture) -> None:
    assert run_command(["test", "ssr", "bi", "--list"]) == ExitCode.OK
    names = capsys.readouterr().out.splitlines()
    assert any(name.startswith("ssr::oracle wins") for name in names)
    assert any(name.startswith("bi::") for name in names)


def test_junit_xml_has_every_check(run: Run, tmp_path: Path) -> None:
    block = "idle loses for seeds 0\nidle wins for seeds 0\norakel wins\ndraws spread over start"
    file = tmp_path / "results.xml"
    assert run(block, "-x", "--junit-xml", str(file))[0] == ExitCode.MISSION
    root = ET.parse(file).getroot()
    counted = {name: root.get(name) for name in ("tests", "failures", "errors", "skipped")}
    assert counted == {"tests": "4", "failures": "1", "errors": "0", "skipped": "2"}
    cases = list(root.iter("testcase"))
    assert [case.get("name") for case in cases] == block.splitlines()
    failure = cases[1].find("failure")
    assert failure is not None and failure.text is not None and "lingjing run" in failure.text


@pytest.fixture
def command(tmp_path: Path) -> Callable[[str], subprocess.Popen[str]]:
    def start(block: str) -> subprocess.Popen[str]:
        (tmp_path / "policies.py").write_text(POLICIES)
        (tmp_path / "m.ljs").write_text(MISSION.replace("BLOCK", block).replace("ticks <= 4", "ticks <= 4000"))
        words = [sys.executable, "-m", "lingjing.cli.main", "test", "m.ljs"]
        return subprocess.Popen(words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    return start


def test_an_interrupt_ends_the_episodes_and_reports_what_ran(command: Callable[[str], subprocess.Popen[str]]) -> None:
    process = command('"policies.py:Mover" wins for seeds 0, idle loses for seeds 0')
    assert process.stdout is not None
    first = process.stdout.readline()
    process.send_signal(signal.SIGINT)
    rest, _ = process.communicate(timeout=120)
    assert process.returncode == ExitCode.INTERRUPTED
    assert first.startswith("PASSED") and "1 passed, interrupted in " in rest


SCENARIOS = Path(__file__).parents[2] / "scenarios"


@pytest.mark.parametrize(
    "file", [*SCENARIOS.glob("*.ljs"), *SCENARIOS.glob("examples/*.ljs")], ids=lambda file: file.stem
)
def test_shipped_missions_have_expectations_and_the_cheap_ones_hold(file: Path, capsys: Capture) -> None:
    assert run_command(["test", str(file), "--list"]) == ExitCode.OK
    names = capsys.readouterr().out
    assert ("::oracle wins within " in names and "::idle loses" in names) or "::random loses" in names
    if "::draws" in names or "::infeasible" in names:
        assert run_command(["test", str(file), "-k", "draws or infeasible"]) == ExitCode.OK
