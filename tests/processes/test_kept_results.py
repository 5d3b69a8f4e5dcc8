"""Results that one process of a fork server leaves to the later ones."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from lingjing.processes import kept_results
from lingjing.processes.fork_client import ForkServer
from lingjing.processes.kept_results import MOST_BYTES, MOST_RESULTS, find_result, keep_result
from tests.kernel.test_world_process import ROOT

MODULE = "tests.processes.forked_module"


@pytest.fixture(autouse=True)
def empty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_results, "_results", {})


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[ForkServer]:
    monkeypatch.syspath_prepend(ROOT)
    with ForkServer([]) as server:
        yield server


def run(server: ForkServer, folder: Path, result: str) -> str:
    """Run a module that prints the kept result and keeps another one."""
    with (folder / "out").open("w") as out, (folder / "err").open("w") as errors, Path("/dev/null").open() as nothing:
        process = server.run_module(MODULE, ("keeping", result), (nothing.fileno(), out.fileno(), errors.fileno()))
    assert process.wait(600) == 0, (folder / "err").read_text()
    process.close()
    printed: str = json.loads((folder / "out").read_text())
    return printed


def test_later_modules_find_the_results_of_earlier_ones(server: ForkServer, tmp_path: Path) -> None:
    assert [run(server, tmp_path, result) for result in ("one", "two", "three")] == ["", "one", "two"]
    assert find_result(b"key") is None


def test_the_caller_keeps_results_for_itself_and_for_its_modules(server: ForkServer, tmp_path: Path) -> None:
    client = server.client()
    client.keep_result(b"key", b"from the caller")
    client.close()
    assert find_result(b"key") == b"from the caller"
    assert run(server, tmp_path, "one") == "from the caller"


def test_the_number_and_the_size_of_results_are_limited() -> None:
    for number in range(MOST_RESULTS + 1):
        keep_result(b"%d" % number, b"x")
    assert find_result(b"0") is None and find_result(b"1") == b"x"
    keep_result(b"large", bytes(MOST_BYTES))
    assert find_result(b"large") is None and find_result(b"1") == b"x"
