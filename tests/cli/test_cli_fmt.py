"""Tests of `lingjing fmt`: exit codes, changed and unchanged files."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from lingjing.testing import mission_file
from tools.python_forks import run_python

UGLY = "ljs   1\nasset  a{engine=vessel,speed=3m/s}\n"
NEAT = "ljs 1\nasset a { engine = vessel, speed = 3 m/s }\n"


def fmt(*arguments: str | Path, stdin: str = "") -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "lingjing.cli.main", "fmt", *map(str, arguments)]
    return run_python(command, input=stdin)


def test_a_file_is_formatted_in_place_and_not_written_again(tmp_path: Path) -> None:
    file = tmp_path / "a.ljs"
    file.write_text(UGLY)
    done = fmt(file)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"reformatted {file}\n", "")
    assert file.read_text() == NEAT
    stamp = file.stat().st_mtime_ns
    assert (fmt(file).stdout, file.stat().st_mtime_ns) == ("", stamp)
    assert list(tmp_path.iterdir()) == [file]


def test_check_writes_nothing(tmp_path: Path) -> None:
    file = tmp_path / "a.ljs"
    file.write_text(UGLY)
    done = fmt("--check", file)
    assert (done.returncode, done.stdout, file.read_text()) == (1, f"would reformat {file}\n", UGLY)
    file.write_text(NEAT)
    assert fmt("--check", file).returncode == 0


def test_diff_prints_the_changes_and_writes_nothing(tmp_path: Path) -> None:
    file = tmp_path / "a.ljs"
    file.write_text(UGLY)
    done = fmt("--diff", file)
    assert done.returncode == 1
    assert "-ljs   1\n" in done.stdout and "+ljs 1\n" in done.stdout
    assert file.read_text() == UGLY


def test_a_file_that_differs_only_in_line_ends_is_reformatted(tmp_path: Path) -> None:
    file = tmp_path / "a.ljs"
    file.write_bytes(NEAT.replace("\n", "\r\n").encode())
    assert fmt("--check", file).returncode == 1
    fmt(file)
    assert file.read_bytes() == NEAT.encode()


def test_standard_input_goes_to_standard_output() -> None:
    done = fmt("-", stdin=UGLY)
    assert (done.returncode, done.stdout) == (0, NEAT)


def test_a_file_with_syntax_errors_is_not_changed_and_its_errors_are_listed(tmp_path: Path) -> None:
    bad, good = tmp_path / "bad.ljs", tmp_path / "good.ljs"
    bad.write_text("ljs 1\nasset a { engine = }\n")
    good.write_text(UGLY)
    done = fmt(bad, good)
    assert done.returncode == 1
    assert "LJ0010" in done.stderr and f"{bad}: not formatted: 1 error" in done.stderr
    assert (bad.read_text(), good.read_text()) == ("ljs 1\nasset a { engine = }\n", NEAT)


def test_an_unreadable_file_is_a_usage_error_and_the_others_are_formatted(tmp_path: Path) -> None:
    good = tmp_path / "good.ljs"
    good.write_text(UGLY)
    done = fmt(tmp_path / "none.ljs", good)
    assert done.returncode == 2
    assert "does not exist" in done.stderr
    assert good.read_text() == NEAT


def test_a_folder_argument_formats_the_missions_in_it(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "a.ljs").write_text(UGLY)
    (tmp_path / "notes.txt").write_text(UGLY)
    assert fmt(tmp_path).returncode == 0
    assert (tmp_path / "sub" / "a.ljs").read_text() == NEAT
    assert (tmp_path / "notes.txt").read_text() == UGLY


def test_shipped_missions_are_formatted() -> None:
    done = fmt("--check", mission_file("ssr").parent)
    assert (done.returncode, done.stdout) == (0, "")
