"""Servers of AirSim's API in processes of their own, as a user starts them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from lingjing import Trace
from lingjing import read as read_trace
from tools.python_forks import PipedFork

WAIT_S = 120


@dataclass
class Served:
    process: PipedFork
    port: int
    folder: Path

    def finish(self) -> Trace:
        """Wait until the server has ended after its last client, and return the trace."""
        _, text = self.process.communicate(timeout=WAIT_S)
        assert self.process.returncode == 0, text
        return read_trace(self.folder / "trace.mcap")


Serve = Callable[..., Served]


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Serve]:
    started: list[PipedFork] = []

    def start(*options: str, overview: bool = False) -> Served:
        folder = tmp_path / f"run{len(started)}"
        command = [
            sys.executable, "-m", "lingjing.cli.main", "serve", "--airsim", *options,
            "--port", "0", "--once", "--pace", "wait", "--world", "inline", "-o", str(folder),
            *(() if overview else ("--no-overview",)),
        ]  # fmt: skip
        process = PipedFork(command, cwd=tmp_path)
        started.append(process)
        assert process.stdout is not None
        line = process.stdout.readline().strip()
        assert line.startswith("127.0.0.1:"), process.communicate(timeout=WAIT_S)
        return Served(process, int(line.rpartition(":")[2]), folder)

    yield start
    for process in started:
        if process.poll() is None:
            process.kill()
            process.wait(WAIT_S)


def thoughts(trace: Trace) -> list[tuple[int, str]]:
    """The calls that are recorded as thoughts, with the ticks of their boundaries."""
    return [
        (record.tick, line)
        for record in trace.boundaries
        for made in record.decisions
        for line in made.decision.thought.splitlines()
    ]
