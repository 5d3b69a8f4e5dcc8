"""Whole `resetScenario` documents and missions of fleets, won by the oracle or the heuristic."""

from __future__ import annotations

from pathlib import Path

import pytest

import lingjing
from lingjing.errors import ExitCode
from lingjing.testing import run_command

pytestmark = pytest.mark.episodes

WILD = Path(__file__).parents[1] / "mission" / "wild"
DOCUMENTS = {
    "bridge": "bi",
    "delivery_degrees": "cd",
    "delivery_uavs": "air_delivery",
    "fire_rescue_uav": "fire_search",
    "multicars_delivery": "cd",
    "singledog": "vdn",
    "uavdog": "upr",
}
"""One document of each kind and its mission; `uavdog` is the longest."""

FLEETS = {
    "upr_fleet": {"uavs": 2, "dogs": 2, "leaks": 2},
    "queue_fleet": {"uavs": 2, "dogs": 2},
    "ssr_fleet": {"uavs": 0, "boats": 2},
    "ld_fleet": {"uavs": 2, "vans": 2, "dogs": 2, "houses": 2},
}


@pytest.mark.parametrize("name", DOCUMENTS)
def test_the_oracle_wins_a_document(name: str, tmp_path: Path) -> None:
    report = lingjing.run(WILD / f"{name}.json", policy="oracle", overview=False, out=tmp_path / "run")
    assert (report.mission, report.success) == (DOCUMENTS[name], True)


def test_the_heuristic_wins_a_document_and_the_notes_are_printed_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (document,) = (WILD.parent / "made_up").glob("06*.json")
    arguments = ["run", str(document), "--seed", "1", "--no-overview", "-o", str(tmp_path / "out")]
    assert run_command(arguments) == ExitCode.OK
    output = capsys.readouterr()
    assert "success: yes" in output.out and "note: template 'free'" in output.err


@pytest.mark.parametrize("name", FLEETS)
def test_the_oracle_wins_with_fleets(name: str, tmp_path: Path) -> None:
    settings = {key: float(value) for key, value in FLEETS[name].items()}
    report = lingjing.run(
        f"reset/{name}", policy="oracle", seed=1, settings=settings, overview=False, out=tmp_path / "run"
    )
    assert (report.mission, report.success) == (name, True)
