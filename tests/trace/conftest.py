"""Fixtures: the synthetic sea rescue and its trace file."""

from pathlib import Path
from types import ModuleType

import pytest

from lingjing.trace.reader import Trace, read_trace
from tests.trace import synthetic as episode


@pytest.fixture(scope="session")
def synthetic() -> ModuleType:
    return episode


@pytest.fixture(scope="session")
def episode_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("episode") / "trace.mcap"
    episode.write_episode(path, ticks=60, depth=True)
    return path


@pytest.fixture(scope="session")
def trace(episode_path: Path) -> Trace:
    return read_trace(episode_path)
