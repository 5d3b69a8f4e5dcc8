"""Reports of several episodes, episodes in child processes, and the columns of suites."""

from __future__ import annotations

import subprocess
import sys
import textwrap
import time
from pathlib import Path

import msgspec
import pytest

from lingjing import EpisodeReport, PlayOptions
from lingjing.bench.columns import columns
from lingjing.errors import InfrastructureError, UsageError
from lingjing.play import parallel
from lingjing.play.parallel import play_apart
from lingjing.play.report import summarise
from lingjing.testing import shipped_missions
from tests.bench.suite_kit import EpisodeTask
from tests.play.report_kit import ABORTED, blank_metrics, made_report

ECHO = """
import json, sys
options = json.load(sys.stdin)
print(json.dumps({"mission": "m", "seed": options["seed"], "mode": options["mode"],
    "policy": options["policy"], "success": True, "reason": "success",
    "scr": 1.0, "ticks": 3, "digest": "d", "trace": "t", "metrics": None}))
"""


def report(seed: int, *, success: bool, reason: str = "budget", scr: float = 0.5, **metrics: object) -> EpisodeReport:
    made = blank_metrics(**metrics) if metrics else None
    return made_report(seed=seed, success=success, reason=reason, scr=scr, ticks=10 + seed, metrics=made)


def test_aborted_episodes_are_left_out_of_every_mean() -> None:
    episodes = [
        report(0, success=True, reason="success", scr=1.0, kilobytes=4, gap=None),
        report(1, success=False, kilobytes=2.0, gap=3.0),
        report(2, success=False, reason=ABORTED, scr=0.0, kilobytes=100.0),
    ]
    suite = summarise(episodes, seeds="0-2", folder="runs")
    assert suite.tsr == 0.5
    assert suite.scr == 0.75
    assert suite.ticks == 21
    assert suite.success is False
    assert (suite.metrics["kilobytes"], suite.metrics["gap"]) == (3.0, 3.0)
    assert "recall" not in suite.metrics and "reason" not in suite.metrics
    assert suite.reason == "budget 1, infrastructure-abort 1, success 1"


def test_the_success_rate_is_absent_without_counted_episodes() -> None:
    assert summarise([report(0, success=False, reason=ABORTED)], seeds="0", folder="runs").tsr is None


@pytest.fixture
def child(monkeypatch: pytest.MonkeyPatch):
    """Replace the command that plays an episode by a small script with the same arguments."""

    def use(script: str) -> None:
        monkeypatch.setattr(EpisodeTask, "command", lambda self: [sys.executable, "-c", textwrap.dedent(script)])

    return use


def tasks(count: int, folder: Path) -> list[EpisodeTask]:
    return [
        EpisodeTask(PlayOptions(mission="m.ljs", policy="p", mode="star", seed=n), folder / str(n))
        for n in range(count)
    ]


def test_each_child_process_answers_for_its_own_task(child, tmp_path: Path) -> None:
    child(ECHO)
    answers = {task.options.seed: answer.seed for task, answer in play_apart(tasks(5, tmp_path), jobs=2)}
    assert answers == {n: n for n in range(5)}


@pytest.mark.parametrize(("code", "kind"), [(2, UsageError), (3, InfrastructureError)])
def test_an_error_of_a_child_process_is_raised_with_its_message(
    child, tmp_path: Path, code: int, kind: type[Exception]
) -> None:
    child(f"import sys; print('error: no policy is called x', file=sys.stderr); sys.exit({code})")
    with pytest.raises(kind, match=r"^no policy is called x"):
        list(play_apart(tasks(1, tmp_path), jobs=1))


@pytest.mark.parametrize("code", ["pass", "print('{')"])
def test_a_child_process_without_a_result_aborts_its_episode(child, tmp_path: Path, code: str) -> None:
    child(code)
    ((_, report),) = play_apart(tasks(1, tmp_path), jobs=1)
    assert (report.reason, report.detail) == (ABORTED, "its process ended without a result (exit code 0)")


def test_a_killed_child_process_aborts_only_its_episode(child, tmp_path: Path) -> None:
    child(
        ECHO.replace(
            "print(",
            "import os, pathlib\n"
            "folder = pathlib.Path(FOLDER, str(options['seed']))\n"
            "folder.mkdir()\n"
            "(folder / 'trace.mcap.part').touch()\n"
            "if options['seed'] == 0: os.kill(os.getpid(), 9)\n"
            "print(",
            1,
        ).replace("FOLDER", repr(str(tmp_path)))
    )
    reports = {task.options.seed: report for task, report in play_apart(tasks(2, tmp_path), jobs=1)}
    assert reports[1].reason == "success"
    assert (reports[0].reason, reports[0].detail) == (ABORTED, "its process was killed by signal 9")
    assert reports[0].trace == str(tmp_path / "0" / "trace.mcap.part")


def test_an_interrupt_leaves_no_child_process_running(child, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    child("import time; time.sleep(600)")
    started: list[subprocess.Popen[bytes]] = []
    real = parallel.EpisodeProcesses.start

    def start(self: parallel.EpisodeProcesses, task: EpisodeTask) -> parallel._Worker:
        made = real(self, task)
        started.append(made.process)
        return made

    monkeypatch.setattr(parallel.EpisodeProcesses, "start", start)

    class Clock:
        """The module's clock: the first wait for the two children is interrupted."""

        monotonic = staticmethod(time.monotonic)

        @staticmethod
        def sleep(seconds: float) -> None:
            raise KeyboardInterrupt

    monkeypatch.setattr(parallel, "time", Clock)
    with pytest.raises(KeyboardInterrupt):
        list(play_apart(tasks(4, tmp_path), jobs=2))
    assert len(started) == 2
    assert all(process.poll() is not None for process in started)


def test_a_child_process_receives_its_options_and_a_lost_episode_keeps_its_policy_seed(child, tmp_path: Path) -> None:
    child("import sys; sys.stderr.write(sys.stdin.read()); sys.exit(2)")
    task = EpisodeTask(PlayOptions(mission="m.ljs", settings={"uavs": 2.0}, policy_seed=77), tmp_path / "run")
    with pytest.raises(UsageError) as error:
        list(play_apart([task], jobs=1))
    assert msgspec.json.decode(str(error.value), type=PlayOptions) == task.options
    assert parallel.without_result(task, "gone", "episode-process").policy_seed == 77


def test_the_columns_are_the_shipped_missions_in_the_modes_that_they_allow() -> None:
    names = [column.name for column in columns(shipped_missions())]
    assert len(names) == len(set(names)) >= 12
    assert {"vdn-single", "ufr-star", "ufr-broadcast", "cd-star", "cd-broadcast"} <= set(names)
    swept = columns([path for path in shipped_missions() if path.stem == "cr"], sweeps=True)
    assert [column.settings for column in swept] == [
        {"replans_most": 0.0},
        {"replans_most": 3.0},
        {"replans_most": 6.0},
    ]
