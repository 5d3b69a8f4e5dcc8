"""Gathering of evidence: the runs at the places, duplicates that count once, and runs left out with a note."""

from __future__ import annotations

import gc
import shutil
import weakref
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest

from lingjing import PlayOptions, Trace
from lingjing import read as read_trace
from lingjing.analysis.attention import attention_beside
from lingjing.bench.folder import read_results
from lingjing.bench.merging import merge_results
from lingjing.bench.parquet import encode_rows
from lingjing.bench.tables import make_tables
from lingjing.errors import UsageError
from lingjing.report import gathering
from lingjing.report.evidence import ReportEvidence
from lingjing.report.gathering import gather
from lingjing.report.trace_rows import with_conditions
from lingjing.testing import TraceWriter
from tests.bench.suite_kit import made_row
from tests.play.report_kit import made_report


def copied(runs: Path, place: Path, *, keep: float = 1.0) -> Path:
    """A copy of the star episode's trace, or of the first part of its bytes, as of a killed run."""
    place.parent.mkdir(parents=True, exist_ok=True)
    data = (runs / "star" / "trace.mcap").read_bytes()
    place.write_bytes(data[: int(keep * len(data))])
    return place


def trace_of_a_later_version(runs: Path, place: Path) -> Path:
    """A trace whose header names a format of a later version."""
    trace = read_trace(runs / "star" / "trace.mcap")
    place.parent.mkdir(parents=True, exist_ok=True)
    writer = TraceWriter(place, msgspec.structs.replace(trace.header, format="lingjing-trace/999"))
    writer.boundary(msgspec.structs.replace(trace.boundaries[0], frames=(), observations=()))
    return writer.abandon()


def test_traces_become_rows(evidence: ReportEvidence) -> None:
    (study,) = evidence.studies
    assert [(row.entrant, row.mission, row.mode, row.condition, row.seed) for row in study.rows] == [
        ("oracle", "ssr", "star", "", 1), ("oracle", "ssr", "broadcast", "", 1),
    ]  # fmt: skip
    assert all(
        row.privileged and row.report.metrics is not None and row.report.metrics.ticks == 12 for row in study.rows
    )
    assert len(evidence.traced) == 2 and evidence.left_out == ()


def test_a_trace_that_is_found_twice_counts_once(runs: Path, tmp_path: Path) -> None:
    copied(runs, tmp_path / "again" / "trace.mcap")
    result = gather([runs, runs / "star", tmp_path])
    assert result.episodes == 2
    assert "counted already" in result.left_out[0]


def test_episodes_that_were_cut_short_are_excluded_from_rates_and_reported_in_a_note(
    runs: Path, tmp_path: Path
) -> None:
    cut = copied(runs, tmp_path / "cut" / "trace.mcap.part", keep=0.6)
    result = gather([runs, tmp_path])
    assert result.episodes == 2
    assert str(cut) in result.left_out[0] and "cut short" in result.left_out[0] and "damaged" in result.left_out[0]
    with pytest.raises(UsageError, match="nothing at these places counts") as error:
        gather([cut])
    assert str(cut) in error.value.hint


def test_a_trace_of_another_version_is_an_error_if_named_and_a_note_if_found(runs: Path, tmp_path: Path) -> None:
    later = trace_of_a_later_version(runs, tmp_path / "new" / "trace.mcap")
    with pytest.raises(UsageError, match="lingjing-trace/999"):
        gather([runs, later])
    result = gather([runs, tmp_path])
    assert result.episodes == 2
    assert "cannot be read" in result.left_out[0] and "lingjing-trace/999" in result.left_out[0]


def test_a_place_without_runs_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(UsageError, match="holds no trace and no results"):
        gather([tmp_path / "empty"])
    with pytest.raises(UsageError, match="there is no"):
        gather([tmp_path / "gone"])
    (tmp_path / "text.mcap").write_text("no trace")
    with pytest.raises(UsageError):
        gather([tmp_path / "text.mcap"])


def test_the_rows_of_a_suite_count_and_its_traces_do_not(runs: Path, results: Callable[..., Path]) -> None:
    folder = results([made_row(seed=1, report=None)])
    shutil.copytree(runs / "star", folder / "runs" / "one")
    assert gather([folder]).episodes == 1, "a trace inside of results is no further episode"
    row = made_row(seed=1)
    kept = msgspec.structs.replace(row, report=msgspec.structs.replace(row.report, trace="runs/one/trace.mcap"))
    result = gather([results([kept])])
    assert [episode.path for episode in result.traced] == [folder / "runs" / "one" / "trace.mcap"]


def test_one_trace_at_a_time_is_in_memory(runs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in range(4):
        copied(runs, tmp_path / str(number) / "trace.mcap")
    alive = most = 0

    def freed() -> None:
        nonlocal alive
        alive -= 1

    def reading(path: Path) -> Trace:
        nonlocal alive, most
        gc.collect()
        trace = read_trace(path)
        alive += 1
        most = max(most, alive)
        weakref.finalize(trace, freed)
        return trace

    monkeypatch.setattr(gathering, "read_trace", reading)
    progress: list[tuple[int, int]] = []
    gather([tmp_path], tell=lambda done, whole: progress.append((done, whole)))
    assert most == 1 and progress == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_attention_maps_beside_a_trace_are_read(runs: Path, tmp_path: Path) -> None:
    trace = read_trace(copied(runs, tmp_path / "trace.mcap"))
    targets = {entity.id for entity in trace.header.instance.entities if entity.role == "target"}
    frame = next(
        frame for frame in trace.frames.values() if any(box.entity in targets and box.pixels for box in frame.boxes)
    )
    np.savez(tmp_path / "attention.npz", **{frame.id: np.eye(8)})
    (row,) = gather([tmp_path]).studies[0].rows
    assert row.attention_iou is not None and 0.0 <= row.attention_iou < 1.0
    (tmp_path / "attention.npz").write_text("none")
    assert "attention.npz" in gather([runs, tmp_path]).left_out[0], "a faulty file beside a trace leaves the trace out"


def test_attention_maps_of_a_suite_are_in_its_tables_and_stay_when_merged(runs: Path, tmp_path: Path) -> None:
    suite = tmp_path / "suite"
    trace = read_trace(copied(runs, suite / "runs" / "one" / "trace.mcap"))
    targets = {entity.id for entity in trace.header.instance.entities if entity.role == "target"}
    frame = next(
        frame for frame in trace.frames.values() if any(box.entity in targets and box.pixels for box in frame.boxes)
    )
    report = made_report(trace="runs/one/trace.mcap", seed=0)
    (suite / "results.parquet").write_bytes(encode_rows([made_row(report=report), made_row(seed=1)]))

    def shown() -> str:
        (table,) = make_tables(read_results(suite), ["perception"])
        return table.lines[0].cells[table.heads.index("Attn-IoU")].text

    assert shown() == "N/A"
    np.savez(suite / "runs" / "one" / "attention.npz", **{frame.id: np.eye(8)})
    played, other = read_results(suite)
    assert played.attention_iou == attention_beside(suite / "runs" / "one" / "trace.mcap") is not None
    assert other.attention_iou is None and shown() == f"{played.attention_iou:.2f}"
    submitted = tmp_path / "all.parquet"
    submitted.write_bytes(encode_rows(merge_results([suite])))
    assert read_results(submitted) == [played, other]
    assert merge_results([submitted, suite]) == merge_results([suite, submitted]) == [played, other]


def test_several_processes_give_the_same_evidence(runs: Path, evidence: ReportEvidence) -> None:
    assert gather([runs], jobs=2) == evidence


def test_options_that_differ_among_traces_become_their_conditions() -> None:
    def played(seed: int, uavs: float, **args: object) -> object:
        options = PlayOptions(mission="ssr", policy="react", settings={"uavs": uavs, "victims": 3.0}, policy_args=args)
        return made_row(seed=seed, mode="broadcast", entrant="m", options=options)

    rows = with_conditions([played(1, 3.0), played(1, 10.0), played(1, 3.0, research=0)])  # type: ignore[list-item]
    assert [(row.condition, row.baseline, row.condition_place) for row in rows] == [
        ("uavs = 3", True, 0), ("uavs = 10", False, 2), ("uavs = 3, research = 0", False, 1),
    ]  # fmt: skip
    alone = with_conditions([played(1, 3.0), played(2, 3.0)])  # type: ignore[list-item]
    assert {(row.condition, row.baseline) for row in alone} == {("", False)}
