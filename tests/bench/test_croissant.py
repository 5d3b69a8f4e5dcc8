"""Results for others: Croissant cards, which MLCommons' package validates and loads, and TensorBoard's event files."""

from __future__ import annotations

import hashlib
import importlib
import json
import sys
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
def test_a_croissant_card_needs_exactly_one_results_folder(
    results: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], places: list[str], message: str
) -> None:
    monkeypatch.chdir(results.parent)
    assert run_command(["bench", "card", *places, "--format", "croissant"]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.slow
def test_tensorboard_reads_the_scalars_of_each_seed(
    results: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    pytest.importorskip("tensorboard", reason="tensorboard is not installed: run `make readers`")
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    monkeypatch.chdir(results.parent)
    log_class = importlib.import_module("lingjing.bench.tensorboard_log").TensorboardLog
    with log_class(tmp_path / "board") as log:
        played = lingjing.bench("first.toml", out="fresh", progress=log)
    events = EventAccumulator(str(tmp_path / "board" / "idle" / "first-broadcast"))
    events.Reload()
    for name in ("scr", "success"):
        points = {event.step: event.tensor_proto.float_val[0] for event in events.Tensors(name)}
        assert points == {row.seed: float(row.report.metrics[name]) for row in played.rows if row.report.metrics}


def test_without_tensorboard_there_is_one_message(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "tensorboard.summary", None)
    log_class = importlib.import_module("lingjing.bench.tensorboard_log").TensorboardLog
    with pytest.raises(lingjing.UsageError, match="needs the package tensorboard"):
        log_class(tmp_path)


@pytest.mark.slow
def test_mlflow_reads_the_metrics_of_each_seed(results: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    mlflow = pytest.importorskip("mlflow", reason="mlflow is not installed: run `make readers`")
    monkeypatch.chdir(results.parent)
    monkeypatch.setenv("MLFLOW_ALLOW_FILE_STORE", "true")  # mlflow-skinny has no database
    place = (tmp_path / "runs").as_uri()
    log_class = importlib.import_module("lingjing.bench.mlflow_log").MlflowLog
    with log_class("first", place) as log:
        played = lingjing.bench("first.toml", out="again", progress=log)
    client = mlflow.MlflowClient(place)
    experiment = client.get_experiment_by_name("first")
    runs = {run.info.run_name: run for run in client.search_runs([experiment.experiment_id])}
    run = runs["idle/first-broadcast"]
    assert run.info.status == "FINISHED" and run.data.tags["lingjing.policy"] == played.rows[0].policy
    points = {point.step: point.value for point in client.get_metric_history(run.info.run_id, "scr")}
    assert points == {row.seed: float(row.report.metrics["scr"]) for row in played.rows if row.report.metrics}
    monkeypatch.delenv("MLFLOW_ALLOW_FILE_STORE")
    with pytest.raises(lingjing.UsageError, match="MLflow refuses the experiment `other`"):
        log_class("other", "no-such-scheme://x")


def test_without_mlflow_there_is_one_message(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mlflow", None)
    log_class = importlib.import_module("lingjing.bench.mlflow_log").MlflowLog
    with pytest.raises(lingjing.UsageError, match="needs the package mlflow"):
        log_class("first")
