"""The trace of the sea rescue of the kit."""

import pytest

from lingjing import Trace
from lingjing import read as read_trace
from lingjing.testing import sea_rescue


@pytest.fixture(scope="session")
def trace(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    path = tmp_path_factory.mktemp("episode") / "trace.mcap"
    sea_rescue.write_episode(path, ticks=60)
    return read_trace(path)
