"""Tests of `plugins`, `new` and `doctor`: printed text and written files."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from lingjing.cli import doctor, libraries
from lingjing.errors import UsageError
from lingjing.play.policy_files import load_policy
from lingjing.testing import PluginHost, build_policy, run_command


def test_plugins_lists_the_built_in_engines_and_the_agents_with_their_source(capsys) -> None:
    assert run_command(["plugins", "--output-format", "json"]) == 0
    offers = {(offer["kind"], offer["name"]): offer for offer in json.loads(capsys.readouterr().out)}
    for engine in ("multirotor", "vessel", "city", "camera"):
        assert offers["engine", engine]["source"] == "builtin"
    for policy in ("heuristic", "oracle", "random", "react"):
        assert offers["policy", policy]["source"] == "agents"
    assert offers["policy", "oracle"]["notes"] == "privileged"
    assert offers["scene", "bay"]["summary"]


def test_plugins_prints_one_line_for_each_plugin(capsys) -> None:
    assert run_command(["plugins"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.split()[:3] == ["policy", "heuristic", "agents"] for line in lines)


def test_plugins_lists_type_bounds_default_and_help_of_the_options_of_a_policy(capsys) -> None:
    assert run_command(["plugins", "react"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["policy", "react", "agents"]
    assert ["max_tokens", "whole number: 16 to 1000000", "default 2048", "the longest answer"] in [
        re.split(r"  +", line.strip()) for line in lines
    ]
    assert run_command(["plugins", "react", "--output-format", "json"]) == 0
    (offer,) = json.loads(capsys.readouterr().out)
    assert offer["options"][1] == {
        "name": "model", "type": "text", "bounds": "not empty", "default": "", "required": True,
        "help": "a model of the list, or any other model's name at its service",
    }  # fmt: skip
    assert run_command(["plugins", "raect"]) == 2
    assert "did you mean `react`?" in capsys.readouterr().err


def test_plugins_lists_the_options_of_engines_and_scenes(capsys) -> None:
    assert run_command(["plugins", "camera"]) == 0
    assert "  quality  whole number: 50 to 100  default 90  JPEG quality" in capsys.readouterr().out
    assert run_command(["plugins", "bay"]) == 0
    listed = " ".join(capsys.readouterr().out.split())
    assert "distractors number: from 0 to 400 default 45 things afloat" in listed
    assert run_command(["plugins", "city", "--output-format", "json"]) == 0
    assert [offer["kind"] for offer in json.loads(capsys.readouterr().out)] == ["engine", "scene"]


def test_plugins_lists_the_options_of_a_policy_in_a_file(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_command(["new", "agent", "scout"]) == 0
    capsys.readouterr()
    assert run_command(["plugins", "./scout.py:Scout"]) == 0
    output = capsys.readouterr().out
    assert "altitude  number: 40 to 160  default 80  elevation of the search, metres" in output


@pytest.mark.parametrize(
    "text", ["import os; os._exit(0)", "import os; os.closerange(0, 4096)", "raise ValueError('no')"]
)
def test_plugins_names_a_file_that_harms_its_process(text: str, tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(text)
    assert run_command(["plugins", "mine.py"]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and "mine.py" in captured.err and "hint: " in captured.err


def test_a_new_agent_can_be_loaded_as_it_is(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_command(["new", "agent", "deep-scout"]) == 0
    assert "--policy ./deep_scout.py:DeepScout" in capsys.readouterr().out
    plugin = load_policy("./deep_scout.py:DeepScout", PluginHost(entry_points=False))
    assert plugin.name == "deep_scout.py:DeepScout"
    assert type(build_policy(plugin, {})).__name__ == "DeepScout"


def test_a_new_agent_overwrites_nothing(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("scout.py").write_text("mine")
    assert run_command(["new", "agent", "scout"]) == 2
    assert "already exists" in capsys.readouterr().err
    assert Path("scout.py").read_text() == "mine"


@pytest.mark.parametrize("name", ["class", "1st", "a/b", "", "é", "a b"])
def test_a_new_agent_needs_a_python_name(name: str, tmp_path: Path, monkeypatch) -> None:
    from lingjing.cli.new import write_agent

    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match="cannot be the name"):
        write_agent(name, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_new_agent_in_a_missing_folder_is_a_usage_error(tmp_path: Path) -> None:
    from lingjing.cli.new import write_agent

    with pytest.raises(UsageError, match="cannot write"):
        write_agent("scout", tmp_path / "gone")


def test_doctor_finds_no_problem_on_this_machine(capsys) -> None:
    assert run_command(["doctor", "--output-format", "json"]) == 0
    findings = json.loads(capsys.readouterr().out)
    assert {finding["name"]: finding["ok"] for finding in findings} == dict.fromkeys(
        (
            "python",
            "installation",
            "system",
            "numbers",
            "libraries",
            "rendering",
            "flight",
            "road",
            "dogs",
            "processes",
            "walls",
            "queues",
            "disk",
            "cache",
            "plugins",
            "extras",
        ),
        True,
    )
    assert next(finding for finding in findings if finding["name"] == "extras")["found"].startswith("installed: bench")
    assert "OpenGL" in next(finding["found"] for finding in findings if finding["name"] == "rendering")


def test_doctor_lists_the_extras_that_are_not_installed(monkeypatch) -> None:
    monkeypatch.setattr(doctor, "find_spec", lambda name: None if name in ("rerun", "websockets") else name)
    finding = doctor.check_extras()
    assert finding.ok and finding.found.endswith("; not installed: foxglove, rerun")
    assert finding.advice.startswith("pip install 'rerun-sdk>=0.41' 'websockets>=14', or")


def test_doctor_names_the_package_of_a_missing_system_library(capsys, monkeypatch) -> None:
    absent = libraries.SystemLibrary("libNoSuchThing.so.9", "libnosuchthing9", "a test")
    monkeypatch.setattr(libraries, "SYSTEM_LIBRARIES", (*libraries.SYSTEM_LIBRARIES, absent))
    monkeypatch.setattr(doctor, "CHECKS", (doctor.check_python, doctor.check_libraries))
    assert run_command(["doctor"]) == 3
    printed = capsys.readouterr().out
    assert printed.startswith("ok  python: 3.")
    assert "BAD libraries: cannot load libNoSuchThing.so.9" in printed
    assert "do: apt-get install -y libnosuchthing9" in printed


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("import os; os.abort()", "ended with code -6"),
        ("raise OSError('no display')", "OSError: no display"),
        ("import time; time.sleep(3600)", "no answer within 2 s"),
    ],
)
def test_a_probe_that_crashes_fails_or_hangs_is_a_finding(code: str, expected: str, monkeypatch) -> None:
    if "sleep" in code:
        monkeypatch.setattr(doctor, "PROBE_S", 2.0)
    finding = doctor._probe("rendering", code, "do this")
    assert (finding.ok, finding.advice) == (False, "do this")
    assert expected in finding.found


def test_doctor_warns_when_digests_may_differ_from_those_of_other_machines(monkeypatch) -> None:
    monkeypatch.setattr(doctor, "runtime_fingerprint", lambda: {"processor": "without avx2, fma", "libm": "no fma"})
    finding = doctor.check_processor()
    assert finding.ok  # missions can be played, and won
    assert finding.found.startswith("the processor is without avx2, fma; the C library computes without FMA")
    assert "digests may differ" in finding.advice
    monkeypatch.setattr(doctor, "runtime_fingerprint", lambda: {"processor": "avx2, fma", "libm": "0123456789abcdef"})
    assert doctor.check_processor().found.startswith("this C library gives other results than glibc")


def test_doctor_warns_when_deadlines_can_only_be_wall_clock_time(monkeypatch) -> None:
    from lingjing.processes import deadlines

    monkeypatch.setattr(deadlines, "_threads", lambda pid: {})
    finding = doctor.check_queues()
    assert finding.ok  # missions can be played
    assert "deadlines are wall-clock time" in finding.found
    assert "raise `engine`" in finding.advice


def test_the_check_of_system_libraries_needs_no_installed_package() -> None:
    code = "import sys; import lingjing.cli.libraries; print(sorted(m for m in sys.modules if 'msgspec' in m))"
    root = Path(libraries.__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", f"import sys; sys.path.insert(0, {str(root)!r}); {code}"],
        capture_output=True, text=True, check=True, timeout=900,
    )  # fmt: skip
    assert done.stdout.strip() == "[]"
