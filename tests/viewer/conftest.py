"""Fixtures: the synthetic sea rescue of the trace tests, and traces of chosen records."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import BoundaryRecord, Header
from lingjing.trace.writer import TraceWriter
from tests.trace import synthetic


@pytest.fixture(scope="session")
def trace(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    """A whole trace of a won episode."""
    target = tmp_path_factory.mktemp("episode") / "trace.mcap"
    synthetic.write_episode(target, ticks=60)
    return read_trace(target)


@pytest.fixture
def written(tmp_path: Path) -> Callable[..., Trace]:
    """A function that writes records as a trace without pictures, and reads it."""

    def write(records: list[BoundaryRecord], header: Header, *, finish: bool = True) -> Trace:
        target = tmp_path / "made" / "trace.mcap"
        target.parent.mkdir()
        writer = TraceWriter(target, header)
        for record in records:
            writer.boundary(record)
        if finish and records:
            return read_trace(writer.finish(synthetic.outcome_of(records)))
        return read_trace(writer.abandon())

    return write
