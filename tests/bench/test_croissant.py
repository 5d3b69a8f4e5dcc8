"""Croissant cards of results and of frame sets: MLCommons' own package validates them and loads their records."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest

import lingjing
from lingjing.testing import run_command
from tests.bench.test_frame_sets import PERSON, written

__all__ = ["written"]

SUITE = """suite = 1
name = "first"
title = "First"
missions = ["first.ljs"]
modes = ["broadcast"]
seeds = [0, 1]
entrants = [{ policy = "idle" }]
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("croissant")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert run_command(["new", "mission", "first"]) == 0
        Path("first.ljs").write_text(Path("first.ljs").read_text().replace("ticks <= 40", "ticks <= 9"))
        Path("first.toml").write_text(SUITE)
        lingjing.bench("first.toml", out="results")
        card = ["bench", "card", "results", "--format", "croissant", "-o", "results/croissant.json"]
        assert run_command(card) == 0
    return folder / "results"


def valid(card: Path) -> Any:
    """Return the data set of a card that mlcroissant finds no fault with."""
    package = pytest.importorskip("mlcroissant", reason="mlcroissant is not installed: run `make readers`")
    data = package.Dataset(str(card))
    assert not data.metadata.ctx.issues.errors
    assert {warning.partition("] ")[2] for warning in data.metadata.ctx.issues.warnings} <= {
        'Property "https://schema.org/datePublished" is recommended, but does not exist.'
    }
    return data


@pytest.mark.slow
def test_the_card_of_results_names_the_columns_and_the_checksum(results: Path) -> None:
    card = json.loads((results / "croissant.json").read_text(encoding="utf-8"))
    (file,) = card["distribution"]
    assert file["sha256"] == hashlib.sha256((results / "results.parquet").read_bytes()).hexdigest()
    fields = {field["name"]: field for field in card["recordSet"][0]["field"]}
    assert fields["episodes/scr"]["dataType"] == "sc:Float"
    assert fields["episodes/scr"]["description"].startswith("Subtask completion rate")
    assert fields["episodes/success"]["dataType"] == "sc:Boolean"


@pytest.mark.slow
def test_mlcroissant_loads_the_episodes(results: Path) -> None:
    records = list(valid(results / "croissant.json").records("episodes"))
    assert [record["episodes/seed"] for record in records] == [0, 1]
    assert {record["episodes/reason"] for record in records} == {b"budget"}


def test_mlcroissant_loads_the_frames(written: Path) -> None:
    data = valid(written / "croissant.json")
    sets = [each.name for each in data.metadata.record_sets]
    assert sets == [f"{PERSON}/train", f"{PERSON}/validation"]
    for name in sets:
        records = list(data.records(name))
        names = {record[f"{name}/file_name"].decode() for record in records}
        assert names == {path.name for path in (written / name).glob("*.jpg")}


@pytest.mark.parametrize(
    ("places", "message"), [(["nowhere"], "holds no results.parquet"), (["results", "results"], "describes one")]
)
@pytest.mark.slow
def test_what_has_no_card(
    results: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], places: list[str], message: str
) -> None:
    monkeypatch.chdir(results.parent)
    assert run_command(["bench", "card", *places, "--format", "croissant"]) == 2
    assert message in capsys.readouterr().err
