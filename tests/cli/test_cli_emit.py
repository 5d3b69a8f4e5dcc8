"""`lingjing compile --emit ljs`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from lingjing.data import data_path


def lingjing(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "lingjing.cli.main", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=900, check=False)


def test_text_and_json_go_round(tmp_path: Path) -> None:
    first, text, second = tmp_path / "a.json", tmp_path / "b.ljs", tmp_path / "c.json"
    assert lingjing("compile", data_path("scenarios", "ssr.ljs"), "-o", first).returncode == 0
    done = lingjing("compile", first, "--emit", "ljs", "-o", text)
    assert (done.returncode, done.stderr) == (0, "")
    assert lingjing("fmt", "--check", text).returncode == 0
    assert lingjing("compile", text, "-o", second).returncode == 0
    before, after = first.read_text().split('"origin"')[0], second.read_text().split('"origin"')[0]
    assert before == after


def test_what_is_left_out_is_said(tmp_path: Path) -> None:
    done = lingjing("compile", data_path("scenarios", "reset", "ssr-001.json"), "--emit", "ljs")
    assert done.returncode == 0
    assert done.stdout.startswith("ljs 1\n")
    assert "note: $.origin.document has no place in .ljs text and is left out" in done.stderr
