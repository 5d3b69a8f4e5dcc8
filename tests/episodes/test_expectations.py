"""The expectations of the shipped missions and of the examples, as `lingjing test` runs them."""

from __future__ import annotations

from pathlib import Path

import pytest

from lingjing.testing import run_command, shipped_missions

ROOT = Path(__file__).parents[2]
FILES = sorted([*shipped_missions(), *(ROOT / "scenarios" / "examples").glob("*.ljs")])

pytestmark = pytest.mark.episodes


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_mission_meets_its_expectations(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code = run_command(["test", str(file), "-x"])
    assert code == 0, capsys.readouterr().out
