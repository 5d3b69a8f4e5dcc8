"""The memory of a suite's processes, and the line about it."""

import os
import signal
import time
from collections.abc import Iterator

import pytest

from lingjing.bench import memory_watch

CHILD_MB = 60


@pytest.fixture
def child() -> Iterator[int]:
    """A child process that holds `CHILD_MB` of its own."""
    ready, held = os.pipe()
    process = os.fork()
    if process == 0:
        memory = bytearray(os.urandom(2**20) * CHILD_MB)
        os.write(held, b"1")
        time.sleep(60.0)
        os._exit(len(memory) & 1)
    os.read(ready, 1)
    yield process
    os.kill(process, signal.SIGKILL)
    os.waitpid(process, 0)
    os.close(ready)
    os.close(held)


def test_the_memory_of_descendants_is_included(child: int) -> None:
    assert memory_watch.tree_mb(child) >= CHILD_MB
    assert memory_watch.tree_mb(os.getpid()) >= memory_watch.tree_mb(child), "the child is one of this process's"
    assert memory_watch.tree_mb(2**22 + 1) == 0.0, "a process that has ended counts nothing"


def test_the_peak_memory_is_kept_and_reported_in_total_and_per_episode(
    child: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory_watch, "FIRST_S", 0.01)
    watch = memory_watch.MemoryWatch()
    assert watch.in_words(4) == "", "nothing was measured yet"
    with watch.watching():
        until = time.monotonic() + 120.0  # a loaded machine measures late
        while watch.peak_mb == 0.0 and time.monotonic() < until:
            time.sleep(0.01)
    assert watch.peak_mb >= CHILD_MB
    watch.peak_mb = 300.0
    assert watch.in_words(4) == "memory: at most 300 MB in all processes with -j 4, 75 MB an episode"
    assert watch.in_words(1) == "memory: at most 300 MB in all processes with -j 1"
