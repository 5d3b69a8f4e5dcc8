"""`docs/testing.md`: its module of tests fails with a faulty plug-in; its table is complete."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from lingjing import testing
from lingjing.errors import ForeignCodeError, MissionError, UsageError
from lingjing.testing import bare_instance, compiled, does, episode, play, rescue, scripted, shortened
from tools.python_forks import run_python

PAGE = (Path(__file__).parents[2] / "docs" / "testing.md").read_text(encoding="utf-8")
(CODE,) = re.findall(r"^```python[^\n]*\n(.*?)^```", PAGE, flags=re.MULTILINE | re.DOTALL)


def results(code: str, folder: Path) -> list[str]:
    """The results of the module's tests as pytest reports them, `PASSED test_…`."""
    file = folder / "test_ferry.py"
    file.write_text(code, encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-rA", "-p", "no:cacheprovider", f"--rootdir={folder}", str(file)]
    done = run_python(command, cwd=folder, timeout=600)
    return re.findall(r"^((?:PASSED|FAILED|ERROR) \S+)", done.stdout, flags=re.MULTILINE)


@pytest.fixture(scope="module")
def ferry() -> str:
    return re.search(r'MISSION = """\\\n(.*?)"""', CODE, flags=re.DOTALL)[1]


def test_the_tests_of_the_page_are_short() -> None:
    """`make docs` runs them."""
    assert len(re.findall(r"^def (test_\w+)", CODE, flags=re.MULTILINE)) == 4
    assert all(len(body.strip().splitlines()) <= 10 for body in re.split(r"^def test_", CODE, flags=re.MULTILINE)[1:])


def test_the_tests_of_the_page_detect_a_wrong_engine_evaluator_and_policy(tmp_path: Path) -> None:
    faults = {"x + step_m, y": "x - step_m, y", "/ 20.0": "/ 60.0", "observation.tick == 0": "observation.tick == 9"}
    for number, (right, wrong) in enumerate(faults.items()):
        folder = tmp_path / str(number)
        folder.mkdir()
        assert CODE.count(right) == 1
        assert [result for result in results(CODE.replace(right, wrong), folder) if result.startswith("FAILED")]


def test_the_table_names_the_exported_functions() -> None:
    section = PAGE.partition("## What there is\n")[2].partition("\n## ")[0]
    table = "\n".join(line for line in section.splitlines() if line.startswith("| `"))
    named = {word for code in re.findall(r"`([^`]+)`", table) for word in re.findall(r"^(\w+)", code)}
    assert named - set(testing.__all__) <= {"report", "trace", "receipts", "events", "do"}
    functions = {name for name in testing.__all__ if name[0].islower()}
    assert functions - named <= {"mission_file", "shipped_missions", "square"}


def test_a_script_for_an_unknown_agent_is_an_error(ferry: str, tmp_path: Path) -> None:
    with pytest.raises(ForeignCodeError, match="no agent is called skiper: the mission has counter, walker"):
        play("queue", tmp_path, policy=scripted({"skiper": {}}))
    with rescued() as small, pytest.raises(ValueError, match="no agent skiper"):
        small.do({"skiper": does("go", x=0.0, y=0.0)})


def test_two_episodes_of_one_folder_have_folders_of_their_own(tmp_path: Path) -> None:
    played = [play(shortened("queue", 2), tmp_path, policy=scripted({}), seed=seed) for seed in (1, 2)]
    assert [episode.path.parent.name for episode in played] == ["episode-1", "episode-2"]
    assert [(each.report.ticks, each.report.reason, each.receipts) for each in played] == [(2, "budget", ())] * 2


def test_a_faulty_text_raises_its_diagnostics(ferry: str) -> None:
    with pytest.raises(MissionError, match="no asset type is called `raff`"):
        compiled(ferry.replace("asset raft : raft", "asset raft : raff"))
    with pytest.raises(UsageError, match="there is no mission `ferry`"):
        compiled("ferry")
    with pytest.raises(TypeError, match="wether"):
        bare_instance((), wether=None)


def rescued():
    return episode((rescue.instance(), rescue.CITY), plugins=[rescue.RescueEngines()])
