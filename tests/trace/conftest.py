"""The synthetic sea rescue, loaded by path because test folders are no packages."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

from lingjing.trace.reader import Trace, read_trace


def _load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("synthetic_episode", Path(__file__).with_name("synthetic.py"))
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def synthetic() -> ModuleType:
    return _load()


@pytest.fixture(scope="session")
def episode_path(synthetic: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("episode") / "trace.mcap"
    synthetic.write_episode(path, ticks=60, depth=True)
    return path


@pytest.fixture(scope="session")
def trace(episode_path: Path) -> Trace:
    return read_trace(episode_path)
