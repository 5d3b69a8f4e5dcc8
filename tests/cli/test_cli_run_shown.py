"""Tests of `run --watch=browser`: the page exists while the episode is played, and stays until an interrupt."""

from __future__ import annotations

import http.client
import itertools
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tools.python_forks import run_python

RUN = (sys.executable, "-m", "lingjing.cli.main", "run")
MISSION = """ljs 1
use std.air { quadrotor }
mission short "Three ticks" {
  goal "Do nothing."
  scene bay
  clock { tick = 1 s, sync = 500 ms }
  budget { ticks <= 3 }
  asset uav : quadrotor { position = (0 m, 0 m, 1 m), actions { takeoff } }
  agent pilot as flier controls uav { observes uav.* }
  adjudicate landed(u: uav) { when speed(u) >= 9 m/s }
  success when forall u in uav: landed(u)
}
"""


def test_the_page_shows_the_episode_and_stays_until_an_interrupt(tmp_path: Path) -> None:
    (tmp_path / "short.ljs").write_text(MISSION)
    process = subprocess.Popen(
        [*RUN, "--watch=browser", "short.ljs", "--policy", "random", "-o", "out", "--no-overview", "--json"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "BROWSER": "true"},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    try:
        assert process.stderr is not None
        lines = iter(process.stderr.readline, "the episode has ended; its page stays until Ctrl-C\n")
        errors = "".join(itertools.takewhile(bool, lines))  # an early end gives empty lines for ever
        url = next(word for word in errors.replace(",", " ").split() if word.startswith("http://"))
        host, _, rest = url.removeprefix("http://").partition("/")
        connection = http.client.HTTPConnection(host, timeout=300)
        connection.request("GET", f"/follow{rest}")
        assert b"event: ending" in connection.getresponse().read()  # it is sent after all steps of the page
        connection.close()
        connection.request("GET", f"/page-start{rest}")
        document = json.loads(connection.getresponse().read())
        assert document["head"]["mission"] == "short" and [step["tick"] for step in document["steps"]] == [0, 1, 2, 3]
        process.send_signal(signal.SIGINT)
        result, errors = process.communicate(timeout=600)
    finally:
        process.kill()
    assert process.returncode == 0 and json.loads(result)["ticks"] == 3 and "Traceback" not in errors
    with pytest.raises(OSError):
        http.client.HTTPConnection(host, timeout=300).request("GET", "/")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("ssr", "--watch=cinema"), "--watch=cinema: must be one of terminal, browser, foxglove"),
        (("ssr", "--watch=browser", "--seeds", "0-1"), "--watch=browser shows one episode"),
        (("--watch", "nowhere.ljs"), "nowhere.ljs"),
    ],
)
def test_wrong_arguments_give_a_message_and_leave_no_file(
    tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    done = run_python([*RUN, *arguments], cwd=tmp_path, timeout=600)
    assert done.returncode == 2 and message in done.stderr and "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_viewer_that_cannot_start_is_reported_and_no_episode_is_played(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text("import sys\nsys.modules['websockets.sync.server'] = None\n")
    done = subprocess.run(
        [*RUN, "ssr", "--watch=foxglove", "-o", "out"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=600,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])},
    )
    assert done.returncode == 2 and "needs websockets" in done.stderr and "pip install 'websockets>=14'" in done.stderr
    assert not (tmp_path / "out").exists()
