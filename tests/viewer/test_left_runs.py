"""A killed run ends for its viewers."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from lingjing import Trace
from lingjing.testing import TraceWriter
from lingjing.testing.traces import part_path
from lingjing.trace.container import is_being_written
from lingjing.viewer import live
from lingjing.viewer.live import LiveSource

WRITE = """
import sys, time
from pathlib import Path
from lingjing.testing import TraceWriter
from lingjing.testing import sea_rescue
steps = sea_rescue.episode(ticks=4)
with TraceWriter(Path(sys.argv[1]), sea_rescue.header()) as writer:
    for record, pictures in steps:
        writer.boundary(record, pictures)
        if record.tick == 2:
            print("written", flush=True)
            sys.stdin.read()
"""


def test_the_page_receives_the_end_of_a_killed_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "LEFT_S", 0.5)
    path = tmp_path / "trace.mcap"
    root = Path(__file__).parents[2]
    run = subprocess.Popen(
        [sys.executable, "-c", WRITE, str(path)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=root, env={**os.environ, "PYTHONPATH": str(root)},
    )  # fmt: skip
    assert run.stdout is not None and run.stdout.readline() == b"written\n"
    served = LiveSource(path, truth=False)
    events: list[tuple[str, bytes]] = []
    reader = threading.Thread(target=lambda: events.extend(item for item in served.follow(0) if item[0]))
    reader.start()
    reader.join(3 * live.LEFT_S)
    assert reader.is_alive() and is_being_written(part_path(path))  # the file does not grow, and its writer still runs
    assert json.loads(served.page_start())["live"] is True
    run.send_signal(signal.SIGKILL)
    run.communicate()
    reader.join(600)
    assert events[-1][0] == "ending" and json.loads(events[-1][1])["state"] == "open"
    assert "killed" in json.loads(events[-1][1])["line"] and json.loads(served.page_start())["live"] is False
    served.close()


def test_a_trace_is_locked_until_it_is_closed(trace: Trace, tmp_path: Path) -> None:
    writer = TraceWriter(tmp_path / "trace.mcap", trace.header)
    assert is_being_written(part_path(tmp_path / "trace.mcap"))
    writer.abandon()
    assert not is_being_written(part_path(tmp_path / "trace.mcap"))
    assert is_being_written(tmp_path / "none.mcap")  # unknown counts as being written
