"""Engines that are killed or hang during an episode of the command line, and the state that they leave behind."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import tests.couplings.mixed_world as kit
from lingjing import read as read_trace
from lingjing.errors import LingjingError
from lingjing.testing.traces import verify

POLICY = f"{kit.HERE / 'restless.py'}:Restless"
WORKER = "lingjing.kernel.world.worker"


def places(pids: set[int]) -> dict[str, int]:
    """Return the worker processes among these by their place: `world`, `camera`."""
    workers = {}
    for pid in filter(runs, pids):
        try:
            words = Path(f"/proc/{pid}/cmdline").read_bytes().decode().split("\0")
        except OSError:
            continue
        if WORKER in words:
            workers[next(place for place in ("world", "camera") if place in words)] = pid
    return workers


def runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def boundaries(part: Path):
    try:
        return read_trace(part).boundaries
    except LingjingError:  # the header is not complete yet
        return ()


@pytest.fixture
def episode(tmp_path, descendants):
    """Start the mixed mission without an end on the command line, with ten seconds a boundary, and play some ticks."""
    mission, text = tmp_path / "mixed.ljs", kit.MIXED.read_text("utf-8")
    text = text.replace("ticks <= 400,", "ticks <= 1000000,").replace("engine <= 120 s", "engine <= 10 s")
    mission.write_text(text, "utf-8")
    command = [sys.executable, "-m", "lingjing.cli.main", "run", str(mission)]
    options = ["--policy", POLICY, "--seed", "3", "-o", "out", "--json", "--no-overview"]
    options += [word for name in ("cars=20", "uavs=2", "dogs=1", "vans=1") for word in ("--set", name)]
    run = subprocess.Popen(
        [*command, *options], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    part = tmp_path / "out" / "trace.mcap.part"
    deadline = time.monotonic() + 600
    try:
        while time.monotonic() < deadline and run.poll() is None:
            if len(places(descendants(run.pid))) == 2 and part.is_file() and len(boundaries(part)) > 1:
                break
            time.sleep(0.2)
        yield run, part
    finally:
        run.kill()
        run.communicate()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "blow", "words"),
    [
        ("world", signal.SIGKILL, "the world process died (SIGKILL)"),
        pytest.param(
            "camera", signal.SIGKILL, "the camera process died (SIGKILL)", marks=pytest.mark.thorough
        ),  # in `make test`: tests/kernel/test_world_faults.py
        ("world", signal.SIGSTOP, "did not answer within 10 s; the world process was killed"),
    ],
)
def test_a_worker_that_dies_or_hangs_is_an_abort_with_its_trace_and_no_orphan(episode, descendants, place, blow, words):
    run, part = episode
    staff = places(descendants(run.pid))
    assert set(staff) == {"world", "camera"}, run.communicate()
    os.kill(staff[place], blow)
    output, errors = run.communicate(timeout=900)
    assert run.returncode == 3, (output, errors)
    assert words in errors + output
    assert "Traceback" not in errors
    trace = read_trace(part)
    assert [record.tick for record in trace.boundaries] == list(range(len(trace.boundaries)))
    assert len(trace.boundaries) > 1
    assert trace.outcome is not None
    assert trace.outcome.reason == "infrastructure-abort"
    assert verify(trace, pixels=True) is None
    deadline = time.monotonic() + 600
    while any(map(runs, staff.values())) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(runs, staff.values()))
