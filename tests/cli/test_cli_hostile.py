"""Policies that damage their process or the run's output: later seeds are played, and no process is left."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lingjing import read as read_trace
from tools.python_forks import run_python

RUN = (sys.executable, "-m", "lingjing.cli.main", "run")

POLICY = """
import os, pathlib, shutil, subprocess, sys, threading, time
from lingjing.plugins.policy import Decision

HERE = pathlib.Path(__file__).parent

def leave(): os._exit(0)
def vanish(): shutil.rmtree(next((HERE / "out").iterdir()))
def cut(): os.truncate(next(HERE.glob("out/*/trace.mcap.part")), 10)
def plant(): next((HERE / "out").iterdir()).joinpath("trace.mcap").mkdir()
def close(): os.closerange(0, 4096)
def deepen(): sys.setrecursionlimit(20)
def settle():
    subprocess.run(["setsid", "sh", "-c", f"sleep 3600 & echo $! > {HERE}/settled"], stdout=subprocess.DEVNULL)
def stay(): time.sleep(3600)

class P:
    async def reset(self, brief):
        self.first = brief.agent == "skipper[1]"

    async def act(self, observation, inbox):
        plan = HERE / "plan"
        if self.first and observation.tick == 1 and plan.exists():
            todo, _, rest = plan.read_text().partition("\\n")
            plan.write_text(rest)
            for word in todo.split():
                globals()[word]()
        return Decision()
"""


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """Two boats with a budget of three ticks, and a policy that executes the lines of `plan`."""
    text = Path(__file__).with_name("boats.ljs").read_text(encoding="utf-8")
    assert "policy <= 60 s" in text
    (tmp_path / "short.ljs").write_text(text.replace("policy <= 60 s", "policy <= 3600 s"), encoding="utf-8")
    (tmp_path / "p.py").write_text(POLICY, encoding="utf-8")
    return tmp_path


def line(*arguments: str) -> list[str]:
    return [*RUN, "short.ljs", "--policy", "./p.py:P", "--no-overview", "--json", "-o", "out", *arguments]


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return run_python(line(*arguments), cwd=folder, timeout=1500)


def runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


@pytest.mark.slow
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_damaged_policy_process_costs_one_decision_and_all_seeds_are_played(short: Path, jobs: str) -> None:
    (short / "plan").write_text("settle leave\nclose\ndeepen\n")
    done = run(short, "--seeds", "0-3", "-j", jobs)
    assert done.returncode == 0, done.stderr
    episodes = json.loads(done.stdout)["episodes"]
    assert [(episode["seed"], episode["reason"]) for episode in episodes] == [(seed, "budget") for seed in range(4)]
    assert sum(episode["metrics"]["substitutions"] for episode in episodes) == 3
    assert "Traceback" not in done.stderr
    for episode in episodes:
        assert read_trace(short / episode["trace"]).complete
    assert not runs(int((short / "settled").read_text()))


def descendants_of(pid: int) -> set[int]:
    """Return the processes below a process. `ps` must not cut lines at the test runner's width."""
    listed = subprocess.run(["ps", "-wweo", "pid,ppid"], capture_output=True, text=True).stdout.split("\n")[1:]
    parents = {int(child): int(parent) for child, parent in (line.split() for line in listed if line.strip())}
    below: set[int] = set()
    while more := {child for child, parent in parents.items() if parent in {pid, *below}} - below:
        below |= more
    return below


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        ("vanish", ".part was removed, or its folder was, while"),
        ("cut", " was changed by another program while the episode was played: "),
        ("plant", " was changed by another program while the episode was played: Is a directory"),
    ],
)
def test_a_policy_that_damages_the_output_aborts_only_its_own_episode(short: Path, damage: str, message: str) -> None:
    (short / "plan").write_text(f"{damage}\n")
    done = run_python(line("--seeds", "0-1"), cwd=short)
    assert done.returncode == 3, done.stderr
    first, second = json.loads(done.stdout)["episodes"]
    assert (first["reason"], second["reason"]) == ("infrastructure-abort", "budget")
    message = f"the trace {short}/out/boats-broadcast-0-1/trace.mcap{message}"
    assert first["detail"].startswith(message)
    assert f"error: seed 0 was aborted: {message}" in done.stderr
    assert "hint: do not change the folder of a run before the run has ended" in done.stderr
    assert read_trace(short / second["trace"]).complete


def test_a_killed_command_leaves_no_process(short: Path, request: pytest.FixtureRequest) -> None:
    (short / "plan").write_text("settle stay\n")
    process = subprocess.Popen(line(), cwd=short, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    request.addfinalizer(process.kill)  # a failure leaves no playing process either
    while not ((short / "settled").exists() and (short / "settled").read_text().strip()):
        assert process.poll() is None
        time.sleep(0.05)
    below = descendants_of(process.pid)
    assert int((short / "settled").read_text()) in below
    assert len(below) >= 4  # the fork server, a policy, the engines, and the program that the policy has started
    process.kill()
    process.communicate(timeout=1500)
    while any(map(runs, below)):  # loops until the test's time limit if a process stays
        time.sleep(0.05)
