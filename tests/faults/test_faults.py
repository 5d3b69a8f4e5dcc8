"""Episodes and suites in which one system call fails, each in turn.

Each must give the exit code of the failure and a message with a hint, and leave no running process, no half-written
file and only readable traces.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

import lingjing
from lingjing import EpisodeReport
from lingjing import read as read_trace
from tests.faults.cases import Aftermath, Injection
from tests.faults.planted import planted
from tests.faults.targets import sample
from tests.faults.verdict import Result, faults_of

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are watched through /proc")


@pytest.mark.faults
def test_two_thousand_planted_faults_are_handled_correctly() -> None:
    done = planted("--cases", os.environ.get("FAULTS", "2000"), "--seed", os.environ.get("SEED", "1"), shown=True)
    assert done.returncode == 0, "the wrong cases are printed above"


@pytest.mark.parametrize("target", ["trip", "process"])
def test_a_clock_in_2200_changes_nothing_but_the_date(tmp_path: Path, target: str) -> None:
    done = planted(target, "wall", "-", "0", "leap", "--keep", str(tmp_path / "kept"))
    assert done.returncode == 0 and "exit code 0; nothing is wrong" in done.stdout, done.stdout + done.stderr
    trace = read_trace(tmp_path / "kept" / "work" / "out" / "trace.mcap")
    assert trace.complete and trace.header.started_wall.startswith("2200-01-01")


def test_the_line_of_a_case_replays_it() -> None:
    case = Injection("trip", "open", "command/trace.container:__init__", 1, "ENOSPC")
    done = planted(*case.line.split()[3:])
    assert done.returncode == 0, done.stdout + done.stderr
    case_line, end, met, *_ = done.stdout.splitlines()
    assert case_line == case.line and end == "  exit code 2; nothing is wrong"
    assert met.startswith("  met: open command/trace.container:__init__ 1 ") and "trace.mcap.part" in met


def test_a_sample_changes_little_when_a_place_is_added() -> None:
    counts = {("open", f"command/a:{letter}"): 3 for letter in "bcdefghijklm"}
    before = sample("trip", counts, 40, 1)
    after = sample("trip", {**counts, ("open", "command/a:n"): 3}, 40, 1)
    assert len(set(before)) == 40 and len(set(before) & set(after)) > 30


def aftermath(**changes: object) -> Aftermath:
    """Return the aftermath of a case that ended as expected, with changes."""
    good = {"code": 2, "output": "", "errors": "error: no\nhint: yes\n", "calls": [], "orphans": [], "left": []}
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
        ({"code": 0, "output": ""}, "no result with exit code 0: "),
    ],
)
def test_the_verdict_sees_each_fault(tmp_path: Path, changes: dict[str, object], fault: str | None) -> None:
    (tmp_path / "work").mkdir()
    (tmp_path / "work" / "cut.mcap").write_bytes(b"\x89MCAP0\r\n")
    faults = faults_of(Injection("trip", "write", "command/a:b", 1), aftermath(**changes), tmp_path, {})
    assert [fault_line[: len(fault or "")] for fault_line in faults] == ([] if fault is None else [fault])


RAISES = """
class Raises:
    async def reset(self, brief): ...
    async def act(self, observation, inbox):
        raise ValueError("no")
"""


@pytest.fixture(scope="module")
def lost(tmp_path_factory: pytest.TempPathFactory) -> EpisodeReport:
    """Return the report of an episode with lost turns of its policy, and its trace."""
    folder = tmp_path_factory.mktemp("lost")
    (folder / "policy.py").write_text(RAISES)
    mission = lingjing.compile(str(Path(__file__).parent / "trip.ljs"))
    return lingjing.run(mission, seed=0, policy=f"{folder / 'policy.py'}:Raises", out=folder / "out", world="inline")


WARNING = "warning: seed 0: 3 of 3 policy answers were replaced by doing nothing"


@pytest.mark.parametrize(
    ("changes", "errors", "fault"),
    [
        ({}, WARNING, None),
        ({"warnings": ()}, WARNING, "another digest of the episode with exit code 0"),
        ({"metrics": None}, WARNING, "another digest of the episode with exit code 0"),
        ({}, "", "turns of the episode that were lost, which the output does not report"),
        ({"digest": "wanted"}, "", None),
    ],
)
def test_lost_turns_are_accepted_only_if_output_report_and_trace_state_them(
    tmp_path: Path, lost: EpisodeReport, changes: dict[str, object], errors: str, fault: str | None
) -> None:
    output = msgspec.json.encode(msgspec.structs.replace(lost, **changes)).decode()
    case, after = Injection("trip", "open", "policy2/a:b", 1), aftermath(code=0, errors=errors, output=output)
    assert faults_of(case, after, tmp_path, {"the episode": Result("wanted")}) == ([] if fault is None else [fault])


FULL_DISK = ("unshare", "--mount", "sh", "-c", 'mount -t tmpfs -o size=48k none "$PWD" && cd "$PWD" && exec "$@"', "sh")


@pytest.mark.slow
@pytest.mark.skipif(
    shutil.which("unshare") is None
    or subprocess.run(["unshare", "--mount", "true"], capture_output=True, check=False).returncode != 0,
    reason="mounting a small disk needs root",
)
def test_an_episode_on_a_full_disk_ends_with_an_error_and_a_hint(tmp_path: Path) -> None:
    here = Path(__file__).parent
    line = [*FULL_DISK, sys.executable, "-m", "lingjing.cli.main", "run", str(here / "trip.ljs"), "--no-overview"]
    line += ["--policy", f"{here / 'trip.py'}:Sail", "-o", "out"]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    trace = tmp_path / "out" / "trace.mcap.part"
    assert f"error: cannot write the trace {trace}: No space left on device\nhint: " in done.stderr
