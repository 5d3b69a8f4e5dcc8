"""Content from a growing trace. A viewer delays neither the run nor other viewers."""

from __future__ import annotations

import json
import threading
from pathlib import Path

import pytest

from lingjing import Trace
from lingjing.errors import UsageError
from lingjing.testing import TraceWriter, sea_rescue
from lingjing.testing.traces import part_path
from lingjing.viewer.live import LiveSource


def test_steps_are_yielded_when_they_are_written_and_then_the_ending(trace: Trace, tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    served = LiveSource(part_path(path), truth=False)
    assert json.loads(served.page_start()) == {"waiting": True}
    with pytest.raises(UsageError, match="not begun"):
        served.ground()
    writer = TraceWriter(path, trace.header)
    writer.boundary(trace.boundaries[0])
    events: list[tuple[str, bytes]] = []
    reader = threading.Thread(target=lambda: events.extend(item for item in served.follow(0) if item[0]))
    reader.start()
    for record in trace.boundaries[1:]:
        writer.boundary(record)
    writer.finish(sea_rescue.outcome_of(list(trace.boundaries)))
    reader.join(600)
    assert [event for event, _ in events][-1] == "ending" and json.loads(events[-1][1])["state"] == "won"
    ticks = [step["tick"] for event, data in events if event == "steps" for step in json.loads(data)["steps"]]
    assert ticks == [record.tick for record in trace.boundaries]
    assert json.loads(served.page_start())["live"] is False
    assert [event for event, _ in served.follow(len(ticks)) if event] == ["ending"]
    assert len(json.loads(served.details(0))) == len(trace.boundaries)
    served.close()


def test_a_waiting_reader_is_released_at_the_end(trace: Trace, tmp_path: Path) -> None:
    writer = TraceWriter(tmp_path / "trace.mcap", trace.header)
    served = LiveSource(tmp_path / "trace.mcap", truth=False)
    reader = threading.Thread(target=lambda: list(served.follow(0)))
    reader.start()
    served.close()
    reader.join(600)
    assert not reader.is_alive()
    writer.abandon()


def test_a_file_that_is_no_trace_is_an_error_at_once(tmp_path: Path) -> None:
    (tmp_path / "trace.mcap").write_text("no trace")
    with pytest.raises(UsageError, match="not a trace"):
        LiveSource(tmp_path / "trace.mcap", truth=False)
