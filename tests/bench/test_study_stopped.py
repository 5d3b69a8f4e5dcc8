"""A study that is stopped, killed or asked for nonsense: nothing is lost, doubled or written half."""

from __future__ import annotations

import collections
import json
import os
import random
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from lingjing.bench.columns import Column
from lingjing.bench.study import CASES, Study, main, missing, play
from lingjing.errors import ExitCode, UsageError
from lingjing.play.options import PlayOptions
from lingjing.play.parallel import EpisodeTask, play_apart
from lingjing.play.report import ABORTED, INTERRUPTED

STAR = Column(Path("m.ljs"), "m", "star")

ANSWER = """
import json, sys, time, pathlib
options = json.load(sys.stdin)
pathlib.Path(sys.argv[1]).mkdir()
pathlib.Path(sys.argv[1], "trace.mcap.part").touch()
time.sleep(0.05)
print(json.dumps({"mission": "m", "seed": options["seed"], "mode": "star", "policy": "p", "success": True,
    "reason": REASON, "scr": 1.0, "ticks": 3, "digest": "d", "trace": "t", "metrics": None}))
"""

STUDY = f"""
import sys
from lingjing.bench import study
from lingjing.play import parallel
answer = {ANSWER!r}.replace("REASON", "'success'")
parallel.EpisodeTask.command = lambda self: [sys.executable, "-S", "-c", answer, str(self.folder)]
sys.exit(study.main(sys.argv[1:]))
"""


def answering(monkeypatch: pytest.MonkeyPatch, script: str) -> None:
    """Play an episode by a script that gets the seed and the folder."""

    def command(self: EpisodeTask) -> list[str]:
        return [sys.executable, "-S", "-c", textwrap.dedent(script), str(self.folder)]

    monkeypatch.setattr(EpisodeTask, "command", command)


def test_an_episode_that_was_interrupted_is_played_anew(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    answering(monkeypatch, ANSWER.replace("REASON", repr(INTERRUPTED)))
    study = Study(tmp_path)
    play(study, missing(study, CASES[:1], [STAR], range(2)), jobs=2, keep=False)
    assert Study(tmp_path).rows == []
    answering(monkeypatch, ANSWER.replace("REASON", "'success'"))
    play(study, missing(study, CASES[:1], [STAR], range(2)), jobs=2, keep=False)
    assert sorted(row.report.seed for row in Study(tmp_path).rows) == [0, 1]


def test_a_killed_child_is_an_abort_of_its_episode_alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    killed = "import os\nif options['seed'] == 0: os.kill(os.getpid(), 9)\n"
    before, sleeping, after = ANSWER.replace("REASON", "'success'").partition("time.sleep(0.05)\n")
    answering(monkeypatch, before + killed + sleeping + after)
    each = [PlayOptions(mission="m.ljs", policy="p", mode="star", seed=seed) for seed in range(2)]
    tasks = [EpisodeTask(options, tmp_path / str(options.seed)) for options in each]
    reports = {task.options.seed: report for task, report in play_apart(tasks, jobs=1)}
    assert reports[1].reason == "success"
    assert reports[0].reason == ABORTED
    assert reports[0].detail == "its process was killed by signal 9"
    assert reports[0].trace == str(tmp_path / "0" / "trace.mcap.part")


def test_a_run_that_is_not_kept_is_gone_before_its_row_is_written(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    answering(monkeypatch, ANSWER.replace("REASON", "'success'"))
    study, left, add = Study(tmp_path), [], Study.add
    monkeypatch.setattr(Study, "add", lambda self, row: (left.append([*tmp_path.glob("*-*")]), add(self, row)))
    play(study, missing(study, CASES[:1], [STAR], range(2)), jobs=1, keep=False)
    assert left == [[], []] and len(study.rows) == 2
    play(study, missing(study, CASES[:1], [STAR], range(2, 3)), jobs=1, keep=True)
    assert [len(found) for found in left] == [0, 0, 1]


def test_killed_again_and_again_it_plays_everything_once(tmp_path: Path) -> None:
    """kill -9 at any moment: what was told is there, what was not is played by the next, and no row comes twice."""
    script = tmp_path / "study.py"
    script.write_text(STUDY)
    folder = tmp_path / "results"
    command = [sys.executable, str(script), "--missions", "bi", "cd", "--policy", "oracle", "random", "--seeds", "3",
               "-j", "2", "-o", str(folder)]  # fmt: skip
    moments = random.Random(5)
    for _ in range(4):
        running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + 600
        while not (folder / "results.json").exists() and time.monotonic() < deadline:
            time.sleep(0.02)
        time.sleep(moments.uniform(0.0, 0.6))
        running.kill()
        running.wait()
        json.loads((folder / "results.json").read_bytes())
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == ExitCode.OK, done.stderr
    rows = Study(folder).rows
    counted = collections.Counter((row.case, row.column, row.report.seed) for row in rows)
    assert set(counted.values()) == {1}
    assert len(counted) == 3 * 2 * 3  # bi-single, cd-star, cd-broadcast; two policies; three seeds
    assert not [path for path in folder.iterdir() if path.is_dir()]
    assert len({row.code for row in rows}) == 1 and rows[0].code
    again = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "18 episodes are there, 0 to play" in again.stderr
    assert "| bi-single | oracle | 3 of 3 |" in again.stdout


def test_two_studies_do_not_share_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import fcntl

    with (tmp_path / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert main(["--missions", "bi", "--seeds", "1", "-o", str(tmp_path)]) == ExitCode.USAGE
    assert "another study is writing" in capsys.readouterr().err


def test_results_of_other_code_are_counted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    answering(monkeypatch, ANSWER.replace("REASON", "'success'"))
    before = Study(tmp_path, "before")
    play(before, missing(before, CASES[:1], [STAR], range(2)), jobs=2, keep=False)
    assert Study(tmp_path, "before").strangers() == 0
    assert Study(tmp_path, "now").strangers() == 2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--missions", "nope"), "there is no mission `nope`"),
        (("--missions", "bi", "-j", "0"), "-j 0"),
        (("--missions", "bi", "--seeds", "5-2"), "`5-2` names no seeds"),
        (("--missions", "bi", "--sweeps"), "nothing to play"),
        (("--missions", "bi", "--modes", "star"), "nothing to play"),
        (("--missions", "bi", "-o", "/proc/study"), "cannot write to `/proc/study`"),
    ],
)
def test_nonsense_is_a_usage_error(
    arguments: tuple[str, ...], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == ExitCode.USAGE
    assert said in capsys.readouterr().err
    assert os.listdir(tmp_path) == []


def test_a_file_that_holds_no_results_is_not_overwritten_and_all_its_faults_are_told(tmp_path: Path) -> None:
    (tmp_path / "results.json").write_text('[{"case": 1, "tries": "x"}]')
    with pytest.raises(UsageError, match="holds no results of a study") as told:
        Study(tmp_path)
    assert str(told.value).splitlines()[1:] == [
        "[0].case: a text is due, this is the number 1",
        "[0].tries: a whole number is due, this is the text 'x'",
        "[0]: 'report' is missing",
    ]
    assert (tmp_path / "results.json").read_text() == '[{"case": 1, "tries": "x"}]'
