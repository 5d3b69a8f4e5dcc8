"""Episodes and suites in which one call of the system fails, each in turn: an exit code that says so, a message with a
way out, nothing left running, nothing half written, every trace readable."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.faults.cases import Aftermath, Injection
from tests.faults.verdict import faults_of

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are watched through /proc")


def planted(*arguments: str) -> subprocess.CompletedProcess[str]:
    """A run of the harness; what it prints names each wrong case with the line that plays it again."""
    line = [sys.executable, "-m", "tests.faults.again", *arguments]
    return subprocess.run(line, cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.mark.faults  # a sample depends on threads, and some still have a wrong case
def test_a_hundred_planted_faults_end_as_they_should() -> None:
    done = planted("--cases", "100", "--seed", "0")
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.startswith("100 cases, 0 wrong; ")


@pytest.mark.faults
def test_two_thousand_planted_faults_end_as_they_should() -> None:
    done = planted("--cases", os.environ.get("FAULTS", "2000"), "--seed", os.environ.get("SEED", "1"))
    assert done.returncode == 0, done.stdout + done.stderr


def aftermath(**changes: object) -> Aftermath:
    """What a case leaves that ended as it should, with changes."""
    good = {"code": 2, "output": "", "errors": "error: no\nhint: yes\n", "counts": {}, "orphans": [], "left": []}
    return Aftermath(**{**good, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({}, None),
        ({"code": 70}, "exit code 70"),
        ({"code": -7}, "exit code -7"),
        ({"code": -1000}, "it hung"),
        ({"errors": "Traceback (most recent call last)\nerror: no\nhint: yes\n"}, "a traceback"),
        ({"errors": ""}, "no message"),
        ({"errors": "error: no\n"}, "a message without a way out"),
        ({"orphans": ["python -m lingjing"]}, "left running: python -m lingjing"),
        ({"left": ["work/out/.report.json.7.partial"]}, "left behind: work/out/.report.json.7.partial"),
        ({"left": ["tmp/lingjing-x"]}, "left behind: tmp/lingjing-x"),
        ({"left": ["work/cut.mcap"]}, "cut.mcap cannot be read: "),
        ({"code": 0, "output": '{"digest": "b"}'}, "another digest with exit code 0"),
        ({"code": 0, "output": ""}, "no result with exit code 0: "),
        ({"code": 0, "output": '{"digest": "a"}'}, None),
    ],
)
def test_the_verdict_sees_each_fault(tmp_path: Path, changes: dict[str, object], fault: str | None) -> None:
    (tmp_path / "work").mkdir()
    (tmp_path / "work" / "cut.mcap").write_bytes(b"\x89MCAP0\r\n")
    found = faults_of(Injection("trip", "write", 1), aftermath(**changes), tmp_path, "a")
    assert [one[: len(fault or "")] for one in found] == ([] if fault is None else [fault])


FULL_DISK = ("unshare", "--mount", "sh", "-c", 'mount -t tmpfs -o size=48k none "$PWD" && cd "$PWD" && exec "$@"', "sh")


@pytest.mark.slow
@pytest.mark.skipif(
    shutil.which("unshare") is None
    or subprocess.run(["unshare", "--mount", "true"], capture_output=True, check=False).returncode != 0,
    reason="mounting a small disk needs root",
)
def test_an_episode_on_a_full_disk_says_so(tmp_path: Path) -> None:
    here = Path(__file__).parent
    line = [*FULL_DISK, sys.executable, "-m", "lingjing.cli.main", "run", str(here / "trip.ljs"), "--no-overview"]
    line += ["--policy", f"{here / 'trip.py'}:Sail", "-o", "out"]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    trace = tmp_path / "out" / "trace.mcap.part"
    assert f"error: cannot write the trace {trace}: No space left on device\nhint: " in done.stderr
