"""A mission becomes a `resetScenario` document, a mission again, a text and a document again, without a loss.

Its events, stages, behaviours, deadlines and drawn params stay.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lingjing.errors import ExitCode
from lingjing.testing import run_command
from tests.mission.language_cases import Variant
from tests.mission.over_time_cases import WINNABLE

SCENARIOS = Path(__file__).parents[2] / "scenarios"
FILES = sorted((*SCENARIOS.glob("*.ljs"), *SCENARIOS.glob("examples/*.ljs")))
REDRAWN = "castaways"
"""A mission with a requirement that discards draws. A document keeps the places and params, and draws the drift from
the first stream."""


def written(source: Path, emitted: str, target: Path, *options: str) -> str:
    """The text that `compile --emit` writes."""
    assert run_command(["compile", str(source), "--emit", emitted, *options, "-o", str(target)]) == ExitCode.OK
    return target.read_text(encoding="utf-8")


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_document_of_a_mission_gives_the_mission_and_the_document_again(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(file.parent, tmp_path / "beside", ignore=shutil.ignore_patterns("examples", "reset", "std"))
    mission, document = tmp_path / "beside" / file.name, tmp_path / "beside" / "document.json"
    first = written(mission, "reset-scenario", document, "--seed", "3")
    capsys.readouterr()
    written(document, "ljs", tmp_path / "again.ljs")
    notes = [line for line in capsys.readouterr().err.splitlines() if "cannot be written in .ljs" in line]
    assert notes == ["note: $.origin.document cannot be written in .ljs and is left out"]
    again = written(tmp_path / "again.ljs", "reset-scenario", tmp_path / "again.json", "--seed", "3")
    assert file.stem == REDRAWN or again == first


@pytest.mark.parametrize("variant", WINNABLE, ids=lambda variant: variant.name)
def test_a_mission_with_events_and_drawn_params_is_written_as_text_without_a_loss(
    variant: Variant, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mission.ljs").write_text(variant.text, encoding="utf-8")
    written(tmp_path / "mission.ljs", "ljs", tmp_path / "again.ljs")
    assert "left out" not in capsys.readouterr().err
