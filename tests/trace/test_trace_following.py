"""A trace that is being written is read as far as possible, each boundary once."""

from __future__ import annotations

from pathlib import Path

import pytest

from lingjing import Trace
from lingjing import read as read_trace
from lingjing.errors import UsageError
from lingjing.testing import TraceWriter, sea_rescue
from lingjing.testing.traces import part_path
from lingjing.trace.following import TraceFollower


def test_each_boundary_is_read_when_it_is_written_and_the_outcome_at_the_end(trace: Trace, tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    follower = TraceFollower(path)
    assert follower.more() == () and follower.trace is None
    writer = TraceWriter(path, trace.header)
    assert follower.more() == () and follower.trace is not None
    for record in trace.boundaries:
        writer.boundary(record)
        assert follower.more() == (record,)
        assert follower.more() == ()
    assert follower.trace.outcome is None and len(follower.trace.boundaries) == len(trace.boundaries)
    writer.finish(sea_rescue.outcome_of(list(trace.boundaries)))
    assert follower.more() == ()
    assert follower.trace.outcome is not None and follower.trace.complete and follower.trace.path == path
    assert follower.trace.boundaries == read_trace(path).boundaries


def test_a_file_that_grows_byte_by_byte_has_the_same_boundaries(
    episode_path: Path, trace: Trace, tmp_path: Path
) -> None:
    data = episode_path.read_bytes()
    follower, boundaries = TraceFollower(tmp_path / "trace.mcap"), []
    part = part_path(tmp_path / "trace.mcap")
    step = max(1, len(data) // 97)  # ends in the middle of chunks, indexes and seals
    for end in (*range(0, len(data), step), len(data)):
        part.write_bytes(data[:end])
        boundaries += follower.more()
    assert boundaries == list(trace.boundaries)
    assert follower.trace is not None and follower.trace.outcome == trace.outcome
    assert follower.trace.places == trace.places
    name = next(iter(trace.frames))
    assert follower.trace.jpeg(name) == trace.jpeg(name)


def test_a_file_that_is_no_trace_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "trace.mcap.part").write_bytes(b"this is no trace at all")
    with pytest.raises(UsageError, match="not a trace"):
        TraceFollower(tmp_path / "trace.mcap").more()


def test_boundaries_that_a_call_lost_during_a_rename_are_returned_by_the_next_call(
    trace: Trace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "trace.mcap"
    follower = TraceFollower(path)
    writer = TraceWriter(path, trace.header)
    for record in trace.boundaries[:3]:
        writer.boundary(record)
    assert follower.more() == trace.boundaries[:3]
    for record in trace.boundaries[3:]:
        writer.boundary(record)
    writer.finish(sea_rescue.outcome_of(list(trace.boundaries)))

    def renamed(at: Path) -> bool:
        raise UsageError(f"cannot read the trace {at}: No such file or directory")

    with monkeypatch.context() as patch:
        patch.setattr("lingjing.trace.reader.ends_properly", renamed)
        with pytest.raises(UsageError):
            follower.more()
    assert follower.more() == trace.boundaries[3:]
    assert follower.trace is not None and follower.trace.complete
