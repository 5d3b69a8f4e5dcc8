"""Reports of several episodes, and the study's bookkeeping."""

from __future__ import annotations

import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import msgspec
import pytest

from lingjing.bench.columns import Column, columns, shipped
from lingjing.bench.countdown import Countdown
from lingjing.bench.study import CASES, Study, StudyRow, _bar, missing, play, table
from lingjing.errors import InfrastructureError, UsageError
from lingjing.play import parallel
from lingjing.play.options import PlayOptions
from lingjing.play.parallel import EpisodeTask, play_apart
from lingjing.play.report import ABORTED, EpisodeReport, summarise
from tests.play.report_kit import blank_metrics, made_report

STAR = Column(Path("m.ljs"), "m", "star")

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


def test_no_counted_episode_has_no_rate() -> None:
    assert summarise([report(0, success=False, reason=ABORTED)], seeds="0", folder="runs").tsr is None


@pytest.fixture
def child(monkeypatch: pytest.MonkeyPatch):
    """Replace the command that plays an episode by a small script that gets the same arguments."""

    def use(script: str) -> None:
        monkeypatch.setattr(EpisodeTask, "command", lambda self: [sys.executable, "-c", textwrap.dedent(script)])

    return use


def tasks(count: int, folder: Path) -> list[EpisodeTask]:
    return [
        EpisodeTask(PlayOptions(mission="m.ljs", policy="p", mode="star", seed=n), folder / str(n))
        for n in range(count)
    ]


def test_children_answer_each_for_its_task(child, tmp_path: Path) -> None:
    child(ECHO)
    answers = {task.options.seed: answer.seed for task, answer in play_apart(tasks(5, tmp_path), jobs=2)}
    assert answers == {n: n for n in range(5)}


@pytest.mark.parametrize(("code", "kind"), [(2, UsageError), (3, InfrastructureError)])
def test_a_child_that_fails_speaks_for_itself(child, tmp_path: Path, code: int, kind: type[Exception]) -> None:
    child(f"import sys; print('error: no policy is called x', file=sys.stderr); sys.exit({code})")
    with pytest.raises(kind, match=r"^no policy is called x"):
        list(play_apart(tasks(1, tmp_path), jobs=1))


@pytest.mark.parametrize("code", ["pass", "print('{')"])
def test_a_child_without_a_result_is_an_abort(child, tmp_path: Path, code: str) -> None:
    child(code)
    ((_, report),) = play_apart(tasks(1, tmp_path), jobs=1)
    assert (report.reason, report.detail) == (ABORTED, "its process ended without a result (exit code 0)")


def test_no_child_is_left_behind(child, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    child("import time; time.sleep(600)")
    started: list[subprocess.Popen[bytes]] = []
    real = parallel._start

    def start(task: EpisodeTask) -> parallel._Worker:
        made = real(task)
        started.append(made.process)
        return made

    monkeypatch.setattr(parallel, "_start", start)

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 1.0)
    try:
        with pytest.raises(KeyboardInterrupt):
            list(play_apart(tasks(4, tmp_path), jobs=2))
    finally:
        signal.signal(signal.SIGALRM, before)
    assert len(started) == 2
    assert all(process.poll() is not None for process in started)


def test_a_study_goes_on_where_it_was(child, tmp_path: Path) -> None:
    child(ECHO)
    cases = CASES[:2]
    study = Study(tmp_path)
    first = missing(study, cases, [STAR], range(2))
    assert [(one.case.name, one.task.options.seed) for one in first] == [
        ("oracle", 0), ("heuristic", 0), ("oracle", 1), ("heuristic", 1),
    ]  # fmt: skip
    for one in first:
        one.task.folder.mkdir()
    play(study, first[:3], jobs=2, keep=True)
    again = Study(tmp_path)
    assert {(row.case, row.report.seed) for row in again.rows} == {("oracle", 0), ("heuristic", 0), ("oracle", 1)}
    left = missing(again, cases, [STAR], range(2))
    assert [(one.case.name, one.task.options.seed) for one in left] == [("heuristic", 1)]


def policy_seeds(study: Study) -> dict[tuple[str, int], int]:
    episodes = missing(study, CASES[:2], [STAR], range(50))
    return {(one.case.name, one.task.options.seed): one.task.options.policy_seed for one in episodes}


def test_policy_seeds_come_from_the_studys_own_salt(tmp_path: Path) -> None:
    folders = [tmp_path / name for name in ("a", "b", "c")]
    for folder in folders:
        folder.mkdir()
    first, other = policy_seeds(Study(folders[0])), policy_seeds(Study(folders[1]))
    assert len({*first.values(), *other.values()}) == 200, "one of its own for every row of every study"
    assert policy_seeds(Study(folders[0])) == first, "a study that goes on draws the same"
    (folders[2] / "salt").write_text((folders[0] / "salt").read_text())
    assert policy_seeds(Study(folders[2])) == first, "the same salt draws the same"


def test_an_episode_is_told_its_options_and_its_row_keeps_the_policy_seed(child, tmp_path: Path) -> None:
    child("import sys; sys.stderr.write(sys.stdin.read()); sys.exit(2)")
    task = EpisodeTask(PlayOptions(mission="m.ljs", settings={"uavs": 2.0}, policy_seed=77), tmp_path / "run")
    with pytest.raises(UsageError) as told:
        list(play_apart([task], jobs=1))
    assert msgspec.json.decode(str(told.value), type=PlayOptions) == task.options
    assert parallel.without_result(task, "gone").policy_seed == 77


def test_an_aborted_episode_is_played_again_with_its_seed(child, tmp_path: Path) -> None:
    marker = tmp_path / "tried"
    child(
        "import pathlib\n"
        f"marker = pathlib.Path({str(marker)!r})\n"
        f"reason = 'success' if marker.exists() else {ABORTED!r}\n"
        "marker.touch()\n" + ECHO.replace('"reason": "success"', '"reason": reason')
    )
    study = Study(tmp_path)
    play(study, missing(study, CASES[:1], [STAR], range(1)), jobs=1, keep=True)
    assert [(row.tries, row.report.reason) for row in study.rows] == [(2, "success")]


def test_the_table_counts_successes_of_what_was_not_aborted() -> None:
    rows = [
        StudyRow(case="oracle", column="m-star", wall_s=4.0, report=report(0, success=True, reason="success", scr=1.0)),
        StudyRow(case="oracle", column="m-star", wall_s=6.0, report=report(1, success=False, scr=0.5)),
        StudyRow(case="oracle", column="m-star", wall_s=9.0, report=report(2, success=False, reason=ABORTED)),
    ]
    assert table(rows).splitlines()[2:] == ["| m-star | oracle | 1 of 2 | 0.75 | 10.0 | 1 | 5 |"]


def test_the_columns_are_the_shipped_missions_in_the_modes_that_they_allow() -> None:
    found = [column.name for column in columns(shipped())]
    assert len(found) == len(set(found)) >= 12
    assert {"vdn-single", "ufr-star", "ufr-broadcast", "cd-star", "cd-broadcast"} <= set(found)
    swept = columns([path for path in shipped() if path.stem == "cr"], sweeps=True)
    assert [column.settings for column in swept] == [
        {"replans_most": 0.0},
        {"replans_most": 3.0},
        {"replans_most": 6.0},
    ]


def test_the_time_left_is_that_of_each_kind_of_episode() -> None:
    countdown = Countdown(2, ["quick", "quick", "slow", "new"])
    assert countdown.left_s != countdown.left_s
    countdown.done("quick", 10.0)
    countdown.learn("slow", 90.0)
    assert countdown.left_s == (10.0 + 90.0 + 50.0) / 2


def test_the_bar_says_what_is_done_and_left() -> None:
    assert _bar(0, 20, float("nan")) == "[..........] 0/20, ? left:"
    assert _bar(10, 20, 3900.0) == "[#####.....] 10/20, 1 h 05 min left:"
    assert _bar(19, 20, 100.0) == "[##########] 19/20, 2 min left:"
    assert _bar(20, 20, 0.4) == "[##########] 20/20, 0 s left:"
