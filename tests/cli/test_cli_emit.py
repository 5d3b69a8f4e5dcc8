"""`lingjing compile --emit ljs`."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from lingjing.testing import mission_file
from tools.python_forks import run_python


def lingjing(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "lingjing.cli.main", *map(str, arguments)]
    return run_python(command)


def test_a_mission_is_unchanged_from_json_to_text_and_back(tmp_path: Path) -> None:
    first, text, second = tmp_path / "a.json", tmp_path / "b.ljs", tmp_path / "c.json"
    assert lingjing("compile", mission_file("ssr"), "-o", first).returncode == 0
    done = lingjing("compile", first, "--emit", "ljs", "-o", text)
    assert (done.returncode, done.stderr) == (0, "")
    assert lingjing("fmt", "--check", text).returncode == 0
    assert lingjing("compile", text, "-o", second).returncode == 0
    before, after = first.read_text().split('"origin"')[0], second.read_text().split('"origin"')[0]
    assert before == after


def test_parts_that_the_text_leaves_out_are_reported(tmp_path: Path) -> None:
    done = lingjing("compile", mission_file("reset/ssr-001.json"), "--emit", "ljs")
    assert done.returncode == 0
    assert done.stdout.startswith("ljs 2\n")
    assert "note: $.origin.document cannot be written in .ljs and is left out" in done.stderr


def test_the_object_added_to_a_reset_scenario_is_reported_and_can_be_left_out() -> None:
    listing = mission_file("reset/ssr-001.json")
    done = lingjing("compile", listing, "--emit", "reset-scenario")
    assert done.stdout != listing.read_text() and "note: the object 'lingjing' was added" in done.stderr
    done = lingjing("compile", listing, "--emit", "reset-scenario", "--plain")
    assert done.stdout == listing.read_text() and "was added" not in done.stderr
    assert lingjing("compile", listing, "--plain").returncode == 2


def test_other_commands_refuse_a_mission_that_validate_refuses(tmp_path: Path) -> None:
    """A document with an unwinnable mission: at three metres a second the boat does not reach a place 40 km away."""
    far = tmp_path / "far.json"
    listing = json.loads(mission_file("reset/ssr-001.json").read_text())
    state = listing["scenario"]["taskMatrix"][0]["initial_state"]
    state["rescueRange"] = [{**c, "Y": c["Y"] + 5.0e5 if c["Y"] > 9.0e4 else 9.0e4} for c in state["rescueRange"]]
    listing["scenario"]["equipmentList"]["shipEntityList"][0]["data"]["Y"] = -2.9e5
    far.write_text(json.dumps(listing))
    checked = lingjing("validate", far)
    assert checked.returncode == 1 and "LJ060" in checked.stdout
    for verb in (("compile",), ("graph",), ("docs",), ("compile", "--emit", "reset-scenario")):
        done = lingjing(*verb, far)
        assert done.returncode == 1 and done.stdout == "" and "LJ060" in done.stderr
