"""Fixtures: the trace of the sea rescue of the kit, and traces of chosen records."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from lingjing import Trace
from lingjing import read as read_trace
from lingjing.testing import sea_rescue, write_trace
from lingjing.trace.records import BoundaryRecord, Header


@pytest.fixture(scope="session")
def trace(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    """A whole trace of a won episode."""
    target = tmp_path_factory.mktemp("episode") / "trace.mcap"
    sea_rescue.write_episode(target, ticks=60)
    return read_trace(target)


@pytest.fixture
def written(tmp_path: Path) -> Callable[..., Trace]:
    """A function that writes records as a trace without pictures, and reads it."""

    def write(records: list[BoundaryRecord], header: Header, *, finish: bool = True) -> Trace:
        return write_trace(tmp_path / "made" / "trace.mcap", header, records, finish=finish)

    return write
