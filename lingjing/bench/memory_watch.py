"""`MemoryWatch`: the memory of a suite's processes while it is played, so that a machine can be given the right `-j`.

Memory is the proportional set size of this process and its descendants: private pages whole, shared pages in
proportion (`/proc/PID/smaps_rollup`). Elsewhere than on Linux nothing is measured.
"""

from __future__ import annotations

import os
import re
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

FIRST_S, LEAST_S = 2.0, 5.0
"""Seconds until the first sample, and between later ones at least. Chosen: a session has its memory after a second."""

SHARE = 0.01
"""Share of the time that sampling may take: with many processes samples are rarer. Chosen."""

_PSS = re.compile(r"^Pss:\s+(\d+) kB", re.MULTILINE)


class MemoryWatch:
    """The largest sample so far. `peak_mb` is 0 if none was taken."""

    def __init__(self) -> None:
        self.peak_mb = 0.0
        self._ended = threading.Event()

    @contextmanager
    def watching(self) -> Iterator[MemoryWatch]:
        """Take samples in a thread inside of the context."""
        thread = threading.Thread(target=self._sample, daemon=True)
        thread.start()
        try:
            yield self
        finally:
            self._ended.set()
            thread.join()

    def in_words(self, episodes: int) -> str:
        """Return the peak and its share of one episode, for so many at a time; "" without a sample."""
        if self.peak_mb == 0.0:
            return ""
        each = f", {self.peak_mb / episodes:,.0f} MB an episode" if episodes > 1 else ""
        return f"memory: at most {self.peak_mb:,.0f} MB in all processes with -j {episodes}{each}"

    def _sample(self) -> None:
        pause_s = FIRST_S
        while not self._ended.wait(pause_s):
            begin = time.monotonic()
            self.peak_mb = max(self.peak_mb, tree_mb(os.getpid()))
            pause_s = max(LEAST_S, (time.monotonic() - begin) / SHARE)


def tree_mb(pid: int) -> float:
    """Return the megabytes of a process and its descendants; those that end meanwhile count nothing."""
    total, waiting, known = 0.0, [pid], set[int]()
    while waiting:
        process = waiting.pop()
        if process in known:
            continue
        known.add(process)
        try:
            match = _PSS.search(Path(f"/proc/{process}/smaps_rollup").read_text(encoding="ascii"))
            lists = [path.read_text() for path in Path(f"/proc/{process}/task").glob("*/children")]
        except OSError:
            continue
        total += int(match[1]) / 1024 if match else 0.0
        waiting += map(int, " ".join(lists).split())
    return total
