"""The synthetic sea rescue of the trace tests, loaded by path because test folders are no packages."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

from lingjing.trace.reader import Trace, read_trace


@pytest.fixture(scope="session")
def synthetic() -> ModuleType:
    path = Path(__file__).parent.parent / "trace" / "synthetic.py"
    spec = importlib.util.spec_from_file_location("synthetic_episode", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def trace(synthetic: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Trace:
    path = tmp_path_factory.mktemp("episode") / "trace.mcap"
    synthetic.write_episode(path, ticks=60)
    return read_trace(path)
