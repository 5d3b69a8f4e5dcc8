"""Fixtures: the trace of the sea rescue of the kit, with depth."""

from pathlib import Path

import pytest

from lingjing import Trace
from lingjing import read as read_trace
from lingjing.testing import sea_rescue


@pytest.fixture(scope="session")
def episode_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("episode") / "trace.mcap"
    sea_rescue.write_episode(path, ticks=60, depth=True)
    return path


@pytest.fixture(scope="session")
def trace(episode_path: Path) -> Trace:
    return read_trace(episode_path)
