"""Fixes: safety, application, output, and replacement of a file in one step or not at all."""

from __future__ import annotations

import io
import json
import os
import sys
from pathlib import Path

import jsonschema
import pytest

from lingjing.dsl.diagnostics.fixes import fix_source
from lingjing.errors import ExitCode
from lingjing.testing import compile_text, run_command
from lingjing.testing.missions import SourceText, compile_source

ROOT = Path(__file__).parents[2]

SAFE = [
    ("delay = 1 tick,", "delay = 1 tick;"),
    ("  asset boat", "  aset boat"),
    ("visibility = 8 km", "visibilty = 8 km"),
    ("ticks <= 60", "ticks = 60"),
    ("channels = [rgb]", "channels = [rgv]"),
    ("from searcher to all", "from searcher too all"),
    ("# the end", "# the\u202e end"),
]
UNSAFE = [
    ("distance_xy(boat, v)", "distance_xy(boot, v)"),
    ("heading = 30 deg", "heading = 30"),
    ("r.frame", "r.fraem"),
    ("apart >= 10 m)\n  }", "apart >= 10 m)\n"),
]


@pytest.fixture
def ended(small: str) -> str:
    return small + "# the end\n"


@pytest.mark.parametrize(("good", "bad"), SAFE)
def test_a_safe_fix_gives_back_the_mission(ended: str, good: str, bad: str) -> None:
    assert ended.count(good) == 1
    fixed = fix_source(SourceText(ended.replace(good, bad)), compile_source)
    assert len(fixed.applied) == 1 and fixed.compilation.diagnostics == ()
    now, then = fixed.compilation.mission, compile_text(ended).mission
    assert now is not None and then is not None
    assert (now.groups, now.comms, now.budget, now.weather) == (then.groups, then.comms, then.budget, then.weather)


@pytest.mark.parametrize(("good", "bad"), UNSAFE)
def test_a_likely_fix_is_applied_only_on_request(ended: str, good: str, bad: str) -> None:
    broken = SourceText(ended.replace(good, bad))
    assert fix_source(broken, compile_source).applied == ()
    fixed = fix_source(broken, compile_source, unsafe=True)
    assert fixed.applied and fixed.compilation.diagnostics == ()


def test_all_safe_fixes_can_be_applied_at_once(ended: str) -> None:
    text = ended
    for good, bad in SAFE:
        text = text.replace(good, bad)
    fixed = fix_source(SourceText(text), compile_source)
    assert len(fixed.applied) == len(SAFE) and fixed.text == ended


def test_validate_fix_writes_the_file_and_lists_the_fixes(
    tmp_path: Path, small: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "m.ljs"
    broken = small.replace("ticks <= 60", "ticks = 60").replace("boat, v)", "boot, v)").replace("\n", "\r\n")
    file.write_bytes(b"\xef\xbb\xbf" + broken.encode())
    file.chmod(0o640)
    assert run_command(["validate", "--fix", str(file)]) == ExitCode.MISSION
    out = capsys.readouterr().out
    assert f"{file}:10: fixed LJ0303: write `ticks <= `\n" in out
    assert "error[LJ0101]" in out and "1 likely fix: --unsafe-fixes applies it too" in out
    assert file.read_bytes() == b"\xef\xbb\xbf" + broken.replace("ticks = 60", "ticks <= 60").encode()
    assert file.stat().st_mode & 0o777 == 0o640
    assert os.listdir(tmp_path) == ["m.ljs"]
    assert run_command(["validate", "--unsafe-fixes", str(file)]) == ExitCode.OK
    assert "fixed LJ0101: write `boat`" in capsys.readouterr().out


def test_validate_diff_changes_nothing(tmp_path: Path, small: str, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "m.ljs"
    broken = small.replace("ticks <= 60", "ticks = 60")
    file.write_text(broken)
    assert run_command(["validate", "--diff", str(file)]) == ExitCode.MISSION
    out = capsys.readouterr().out
    assert "-  budget { ticks = 60, policy <= 90 s }\n+  budget { ticks <= 60, policy <= 90 s }\n" in out
    assert file.read_text() == broken


def test_a_file_that_cannot_be_written_is_left_as_it_is(
    tmp_path: Path, small: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    file = tmp_path / "m.ljs"
    file.write_text(small.replace("ticks <= 60", "ticks = 60"))
    monkeypatch.setattr(os, "replace", full)
    assert run_command(["validate", "--fix", "--no-cache", str(file)]) == ExitCode.USAGE
    assert "No space left" in capsys.readouterr().err
    assert "ticks = 60" in file.read_text() and os.listdir(tmp_path) == ["m.ljs"]


def test_fixing_standard_input_prints_the_text(
    small: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = small.replace("ticks <= 60", "ticks = 60")
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(broken.encode())))
    assert run_command(["validate", "--fix", "-"]) == ExitCode.OK
    captured = capsys.readouterr()
    assert captured.out == small and "fixed LJ0303" in captured.err


def test_the_json_is_valid_and_its_schema_is_committed(
    tmp_path: Path, small: str, capsys: pytest.CaptureFixture[str]
) -> None:
    committed = (ROOT / "schemas" / "diagnostics.schema.json").read_bytes()
    file = tmp_path / "m.ljs"
    file.write_text(small.replace("boat, v)", "boot, v)").replace("visibility = 8 km", "wind = 1 m/s from 2 deg"))
    run_command(["validate", "--output-format", "json", str(file)])
    output = json.loads(capsys.readouterr().out)
    jsonschema.Draft202012Validator(json.loads(committed)).validate(output)
    assert [item["code"] for item in output] == ["LJ0103", "LJ0101"] and output[0]["related"]
