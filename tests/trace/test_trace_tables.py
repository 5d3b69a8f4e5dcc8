"""Tables of a trace: rows, data frames of both libraries, pictures as arrays, and errors for unknown names."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lingjing
from lingjing import Trace, UsageError

TABLES = ("ticks", "bodies", "decisions", "commands", "receipts", "messages", "events", "pictures")


def frames_of(library: str) -> object:
    return pytest.importorskip(library, reason=f"the extra `{library}` is not installed")


def test_the_rows_of_tables_have_the_values_of_the_records(trace: Trace) -> None:
    ticks, last = trace.rows(), trace.boundaries[-1]
    assert len(ticks) == len(trace.boundaries)
    assert (ticks[-1].tick, ticks[-1].score, ticks[-1].scr) == (last.tick, last.reward, last.scr)
    assert sum(row.commands for row in ticks) == len(trace.rows("commands")) > 0
    assert sum(row.messages for row in ticks) == len(trace.rows("messages")) > 0
    assert sum(row.receipts for row in ticks) == len(trace.rows("receipts")) > 0
    assert sum(row.events for row in ticks) == len(trace.rows("events"))
    assert [row.id for row in trace.rows("pictures")] == list(trace.frames)
    state = last.snapshots[-1].states[0]
    body = next(row for row in trace.rows("bodies") if (row.tick, row.entity) == (last.tick, state.id))
    assert (body.x_m, body.y_m, body.z_m) == state.position
    decisions = [made for record in trace.boundaries for made in record.decisions]
    assert [row.agent for row in trace.rows("decisions")] == [made.agent for made in decisions]
    verbs = [None if made.decision.command is None else made.decision.command.verb for made in decisions]
    assert [row.verb for row in trace.rows("decisions")] == verbs


@pytest.mark.parametrize("library", ["pandas", "polars"])
@pytest.mark.parametrize("table", TABLES)
def test_a_data_frame_has_the_rows_and_their_types(trace: Trace, table: str, library: str) -> None:
    frames_of(library)
    frame, rows = trace.to_frame(table, library), trace.rows(table)  # type: ignore[arg-type]
    assert not rows or list(frame.columns) == list(rows[0].__struct_fields__)
    assert len(frame) == len(rows)
    for name in frame.columns:
        values = list(frame[name]) if library == "polars" else frame[name].to_list()
        for value, row in zip(values, rows, strict=True):
            expected = getattr(row, name)
            is_null = value is None or value != value or str(value) == "<NA>"
            assert is_null if expected is None else value == expected


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_an_empty_table_has_the_same_types(trace: Trace, library: str) -> None:
    frames_of(library)
    header = Trace(path=trace.path, header=trace.header, boundaries=(), outcome=None, complete=False)
    for table in ("ticks", "bodies", "receipts"):
        empty, full = header.to_frame(table, library), trace.to_frame(table, library)  # type: ignore[arg-type]
        assert len(empty) == 0
        assert list(map(str, empty.dtypes)) == list(map(str, full.dtypes))


def test_pictures_are_arrays(trace: Trace) -> None:
    first = next(trace.pictures())
    size = (first.info.pose.height, first.info.pose.width)
    assert (first.rgb.shape, first.rgb.dtype) == ((*size, 3), np.uint8)
    assert first.depth is not None
    assert (first.depth.shape, first.depth.dtype) == (size, np.float32)
    entity = first.info.entity
    chosen = [picture.info.id for picture in trace.pictures(entity=entity, camera=first.info.camera)]
    assert chosen == [info.id for info in trace.frames.values() if info.entity == entity]
    with pytest.raises(UsageError, match="no picture of the entity `uav\\[9\\]`") as error:
        trace.pictures(entity="uav[9]")
    assert "uav[1]" in error.value.hint


def test_the_trace_of_a_folder_is_read(episode_path: Path, tmp_path: Path) -> None:
    assert len(lingjing.read(episode_path.parent).boundaries) == len(lingjing.read(episode_path).boundaries)
    shutil.copy(episode_path, tmp_path / "trace.mcap.part")
    assert lingjing.read(tmp_path).path.name == "trace.mcap.part"
    with pytest.raises(UsageError, match="cannot read the trace"):
        lingjing.read(tmp_path / "runs")


def test_the_error_for_an_unknown_table_or_library_has_its_name(trace: Trace) -> None:
    with pytest.raises(UsageError, match="no table `comands`") as error:
        trace.rows("comands")  # type: ignore[call-overload]
    assert "`commands`" in error.value.hint
    with pytest.raises(UsageError, match="no library of data frames is called `dask`"):
        trace.to_frame("ticks", "dask")  # type: ignore[arg-type]


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_a_missing_library_names_its_extra(trace: Trace, library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, library, None)  # an import of it now fails
    with pytest.raises(UsageError, match=f"needs the package `{library}`") as error:
        trace.to_frame("ticks", library)  # type: ignore[arg-type]
    assert f"extra `{library}`" in error.value.hint


def test_reading_imports_no_library_of_data_frames(episode_path: Path) -> None:
    code = (
        "import sys, lingjing\n"
        "before = set(sys.modules)\n"
        f"lingjing.read({str(episode_path)!r}).rows('bodies')\n"
        "print(sorted({'pandas', 'polars', 'pyarrow'} & set(sys.modules)))\n"
        "print(sum(name.startswith('lingjing.') for name in before))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=900)
    assert done.stdout.split() == ["[]", "0"]
