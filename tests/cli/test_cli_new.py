"""`lingjing new mission`, `lingjing new agent` and `lingjing docs`."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

import lingjing as package
from lingjing.cli.new import write_mission
from lingjing.dsl.formatting.formatter import format_text
from lingjing.errors import UsageError
from lingjing.testing import compile_file, shortened
from tools.python_forks import run_python


def lingjing(*arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "lingjing.cli.main", *map(str, arguments)]
    return run_python(command, cwd=cwd)


def test_a_new_mission_compiles_and_is_formatted(tmp_path: Path) -> None:
    done = lingjing("new", "mission", "bay-watch", cwd=tmp_path)
    assert done.stdout.splitlines() == [
        "wrote bay_watch.ljs", "check it: lingjing validate bay_watch.ljs", "play it: lingjing run bay_watch.ljs",
    ]  # fmt: skip
    path = tmp_path / "bay_watch.ljs"
    compilation = compile_file(str(path))
    assert compilation.diagnostics == () and compilation.mission is not None
    assert (compilation.mission.name, compilation.mission.title) == ("bay_watch", "Bay watch")
    assert format_text(path.read_text()).text == path.read_text()
    assert "mission0" not in path.read_text() and "Title0" not in path.read_text()


@pytest.mark.slow
def test_a_new_mission_runs_at_once(tmp_path: Path) -> None:
    mission = write_mission("first", tmp_path)
    report = package.run(shortened(mission, 10), seed=3, world="inline", overview=False, out=tmp_path / "out")
    assert report.reason in ("success", "budget")
    assert (tmp_path / "out" / "trace.mcap").is_file()


def test_new_agent_prints_the_next_commands_and_the_agent_passes_its_own_test(tmp_path: Path) -> None:
    printed = lingjing("new", "agent", "scout", cwd=tmp_path).stdout.splitlines()
    assert printed == [
        "wrote scout.py",
        "install it: a file needs no installation",
        "play it: lingjing run ssr --policy ./scout.py:Scout",
        "test it: python scout.py",
        "list its options: lingjing plugins ./scout.py:Scout",
    ]
    tested = subprocess.run([sys.executable, "scout.py"], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert (tested.returncode, tested.stdout) == (0, "Scout keeps the promises of the contract\n"), tested.stderr


@pytest.mark.slow
def test_a_new_agent_finds_a_target_and_sends_the_boat_to_a_reported_place(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "scenarios" / "ssr.ljs").read_text(encoding="utf-8")
    (tmp_path / "ssr.ljs").write_text(text.replace("ticks <= 60", "ticks <= 20"), encoding="utf-8")
    assert "scout.py" in lingjing("new", "agent", "scout", cwd=tmp_path).stdout
    options = ("--policy", "./scout.py:Scout", "--seed", "1", "--json", "-o", "o", "--no-overview")
    done = lingjing("run", "ssr.ljs", *options, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    answer = msgspec.json.decode(done.stdout, type=package.EpisodeReport)
    assert (answer.policy, answer.reason) == ("./scout.py:Scout", "budget")
    metrics = json.loads(done.stdout)["metrics"]
    assert metrics["targets_found"] >= 1
    assert metrics["frames"] >= 10
    assert (metrics["substitutions"], metrics["rejections"]) == (0, 0)
    boundaries = package.read(tmp_path / "o" / "trace.mcap").boundaries
    sent = next(command for boundary in boundaries for command in boundary.commands if command.resource == "boat")
    messages = [message for boundary in boundaries[: sent.tick] for message in boundary.messages]
    reported = [tuple(message.body["position"][:2]) for message in messages if message.kind == "detection"]
    assert (sent.verb, sent.sender) == ("moveTo", "skipper")
    assert (sent.arguments["x"], sent.arguments["y"]) in reported
    receipts = [receipt for boundary in boundaries for receipt in boundary.receipts if receipt.request == sent.id]
    assert receipts[-1].status == "running" and receipts[-1].progress > 0.1


def test_new_mission_overwrites_no_file_and_checks_the_name(tmp_path: Path) -> None:
    assert write_mission("水", tmp_path).name == "水.ljs"
    with pytest.raises(UsageError, match="already exists"):
        write_mission("水", tmp_path)
    for name in ("two words", "mission", "1st", "", "../up"):
        with pytest.raises(UsageError, match="cannot be the name"):
            write_mission(name, tmp_path)


def test_docs_are_written_to_a_file_or_to_standard_output(tmp_path: Path) -> None:
    shown = lingjing("docs", "ssr", cwd=tmp_path)
    assert (shown.returncode, shown.stderr) == (0, "")
    written = lingjing("docs", "ssr", "-o", "ssr.md", cwd=tmp_path)
    assert (written.returncode, written.stdout) == (0, "")
    assert (tmp_path / "ssr.md").read_text() == shown.stdout
    assert shown.stdout.startswith("# Sea search and rescue\n")


def test_docs_of_a_broken_mission_report_its_errors(tmp_path: Path) -> None:
    (tmp_path / "bad.ljs").write_text("ljs 1\nmission m {}\n")
    done = lingjing("docs", "bad.ljs", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    assert "LJ0106" in done.stderr
