"""Bad input through functions and the command line: one clear message and the right exit code."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import msgspec
import pytest

import lingjing
from lingjing.dsl.diagnostics.render import render_text
from lingjing.errors import ExitCode, MissionError, UsageError
from lingjing.testing import compile_file, compile_text, run_command
from lingjing.testing.missions import Diagnostic

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("data", "part"),
    [
        (b"ljs 1\n\xff", "not UTF-8: byte 0xff at offset 6"),
        ("ljs 1".encode("utf-16"), "not UTF-8"),
        (b"x" * 10_000_000, "line of 10,000,000 characters"),
    ],
)
def test_unreadable_bytes_are_a_usage_error(tmp_path: Path, data: bytes, part: str) -> None:
    file = tmp_path / "bad.ljs"
    file.write_bytes(data)
    with pytest.raises(UsageError, match=part) as caught:
        compile_file(str(file))
    assert "bad.ljs" in str(caught.value)
    assert run_command(["validate", str(file)]) == ExitCode.USAGE


def test_a_missing_file_and_a_folder_are_usage_errors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(UsageError, match="does not exist"):
        compile_file(str(tmp_path / "none.ljs"))
    with pytest.raises(UsageError, match="is a folder"):
        compile_file(str(tmp_path))
    with pytest.raises(UsageError):
        compile_file("a\0b")
    assert run_command(["validate", str(tmp_path / "none.ljs")]) == ExitCode.USAGE
    assert "none.ljs" in capsys.readouterr().err


def test_one_unreadable_file_does_not_hide_the_others(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = tmp_path / "bad.ljs"
    bad.write_text("ljs 1\nmission x { goal 5 }\n")
    assert run_command(["validate", str(tmp_path / "none.ljs"), str(bad)]) == ExitCode.USAGE
    assert "bad.ljs:2:" in capsys.readouterr().out


def test_validate_prints_nothing_for_valid_files(capsys: pytest.CaptureFixture[str]) -> None:
    library = sorted(str(file) for file in (ROOT / "scenarios" / "std").glob("*.ljs"))
    assert run_command(["validate", str(ROOT / "scenarios" / "ssr.ljs"), *library]) == ExitCode.OK
    assert capsys.readouterr().out == ""


def test_validate_shows_the_line_and_a_hint(tmp_path: Path, small: str, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "m.ljs"
    file.write_text(small.replace("tick = 10 s", "tick = 10 sec"))
    assert run_command(["validate", str(file)]) == ExitCode.MISSION
    out = capsys.readouterr().out
    assert f"{file}:9:21: error[LJ0204]: no unit is called `sec`" in out
    assert "9 |   clock { tick = 10 sec, sync = 500 ms }\n  |                     ^^^\n" in out
    assert "\x1b" not in out


def test_validate_prints_diagnostics_as_json(tmp_path: Path, small: str, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "m.ljs"
    file.write_text(small.replace("boat, v)", "boot, v)"))
    assert run_command(["validate", "--output-format", "json", str(file)]) == ExitCode.MISSION
    (output,) = msgspec.json.decode(capsys.readouterr().out, type=list[Diagnostic])
    assert (output.code, output.span.path, output.span.line) == ("LJ0101", str(file), 34)


def test_validate_reads_standard_input(
    small: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(small.replace("boat, v)", "boot, v)").encode())))
    assert run_command(["validate", "-"]) == ExitCode.MISSION
    assert "<stdin>:34:" in capsys.readouterr().out


def test_compile_writes_the_complete_mission(tmp_path: Path, small: str) -> None:
    source, out = tmp_path / "m.ljs", tmp_path / "m.json"
    source.write_text(small)
    assert run_command(["compile", str(source), "-o", str(out)]) == ExitCode.OK
    assert lingjing.compile(out).name == "small"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["m.json", "m.ljs"]
    assert lingjing.compile(out) == lingjing.compile(source)


def test_compile_of_a_faulty_mission_writes_nothing(
    tmp_path: Path, small: str, capsys: pytest.CaptureFixture[str]
) -> None:
    source, out = tmp_path / "m.ljs", tmp_path / "m.json"
    source.write_text(small.replace("boat, v)", "boot, v)"))
    assert run_command(["compile", str(source), "-o", str(out)]) == ExitCode.MISSION
    assert "error[LJ0101]" in capsys.readouterr().err
    assert not out.exists()


def test_compile_to_an_unwritable_place_is_a_usage_error(tmp_path: Path, small: str) -> None:
    source = tmp_path / "m.ljs"
    source.write_text(small)
    for target in (tmp_path, tmp_path / "none" / "m.json"):
        assert run_command(["compile", str(source), "-o", str(target)]) == ExitCode.USAGE


def test_compile_emits_a_reset_scenario(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["compile", "--emit", "reset-scenario", str(ROOT / "scenarios" / "ssr.ljs")]) == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["commandType"] == "resetScenario"


def test_the_python_api_compiles_a_document_and_refuses_a_library() -> None:
    assert lingjing.compile(ROOT / "scenarios" / "reset" / "ssr-001.json").name == "ssr"
    with pytest.raises(UsageError, match="holds types and no mission"):
        lingjing.compile(ROOT / "scenarios" / "std" / "air.ljs")


def test_the_python_api_reports_every_error(tmp_path: Path, small: str) -> None:
    file = tmp_path / "m.ljs"
    file.write_text(small.replace("boat, v)", "boot, v)").replace("10 s,", "10 m,"))
    with pytest.raises(MissionError) as caught:
        lingjing.compile(file)
    assert "2 errors in 1 file" in str(caught.value) and "LJ0203" in str(caught.value)


def test_a_long_or_wide_line_is_cut_around_the_error() -> None:
    text = "ljs 1\n# 海\n" + "record 海上 : report { " + ", ".join(f"f{k}: name" for k in range(200)) + ", x: nam }\n"
    compilation = compile_text(text)
    lines = render_text(compilation.diagnostics, compilation.source, color=True).splitlines()
    assert compilation.diagnostics[0].code == "LJ0109"
    assert "…" in lines[2] and max(len(line) for line in lines) < 250
