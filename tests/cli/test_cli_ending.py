"""Ends of disturbed runs: signals, hostile policies, closed streams, full disks."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from lingjing import EpisodeReport
from lingjing import read as read_trace
from lingjing.analysis.metrics import StageMetric
from lingjing.cli.files import write_whole
from lingjing.cli.scorecard import scorecard
from lingjing.errors import LingjingError, UsageError
from lingjing.play.report import summarise
from lingjing.testing import compiled, mission_file, run_command
from tests.play.report_kit import ABORTED, INTERRUPTED, blank_metrics, made_report
from tools.python_forks import run_python

pytestmark = pytest.mark.slow

COMMAND = (sys.executable, "-c", "import sys; from lingjing.cli.main import main; sys.exit(main())")

POLICY = """
import asyncio, os, sys, time
from lingjing.plugins.policy import Decision
class P:
    def __init__(self): {init}
    async def reset(self, brief): {reset}
    async def act(self, observation, inbox): {act}
"""


BOATS = Path(__file__).with_name("boats.ljs")


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A mission of two boats without cameras, with a budget of two ticks."""
    text = BOATS.read_text(encoding="utf-8")
    assert "ticks <= 3," in text
    path = tmp_path_factory.mktemp("mission") / "short.ljs"
    path.write_text(text.replace("ticks <= 3,", "ticks <= 2,"), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def endless(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The two boats with more ticks than any test waits for."""
    path = tmp_path_factory.mktemp("endless") / "boats.ljs"
    path.write_text(BOATS.read_text(encoding="utf-8").replace("ticks <= 3,", "ticks <= 1000000,"), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def pictured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sea rescue with a budget of three ticks, in which a boat may be proved too far."""
    text = mission_file("ssr").read_text(encoding="utf-8")
    path = tmp_path_factory.mktemp("mission") / "short.ljs"
    away, near = "(12.4 m, -1351.8 m)", "(270 m, -920 m)"  # so that three ticks are not proved too few in every draw
    assert away in text
    path.write_text(text.replace("ticks <= 60,", "ticks <= 3,").replace(away, near), encoding="utf-8")
    return path


def write_policy(folder: Path, init: str = "pass", reset: str = "pass", act: str = "return Decision()") -> str:
    (folder / "p.py").write_text(POLICY.format(init=init, reset=reset, act=act), encoding="utf-8")
    return "./p.py:P"


def lingjing(*arguments: object, cwd: Path, **options: object) -> subprocess.CompletedProcess[str]:
    return run_python([*COMMAND, *map(str, arguments)], cwd=cwd, **options)  # type: ignore[call-overload]


@pytest.mark.parametrize("init", ["raise RuntimeError('boom')", "sys.exit('boom')"])
def test_a_policy_that_cannot_be_built_is_named(init: str, short: Path, tmp_path: Path) -> None:
    done = lingjing("run", short, "--policy", write_policy(tmp_path, init=init), cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("error: policy `p.py:P` cannot be built: ")
    assert re.search(r"boom \(p.py:\d+\)\nhint: ", done.stderr)


def test_output_of_policies_is_not_mixed_into_the_json_result(short: Path, tmp_path: Path) -> None:
    policy = write_policy(
        tmp_path, init="print('built')", reset="os.write(1, b'raw')", act="print('acted'); sys.stdout.close()"
    )
    done = lingjing("run", short, "--policy", policy, "--json", "--no-overview", "-o", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["ticks"] == 2
    for word in ("built", "raw", "acted"):  # the agents print at once, so lines may run into each other
        assert word in done.stderr


def test_replaced_answers_are_reported_with_the_first_failure(pictured: Path, tmp_path: Path) -> None:
    policy = write_policy(tmp_path, act="raise ValueError('no idea')")
    done = lingjing("run", pictured, "--policy", policy, "--json", "--no-overview", "-o", "out", cwd=tmp_path)
    assert done.returncode == 0
    expected = "12 of 12 policy answers were replaced by doing nothing (policy_error 12); the first was `scout[1]`: "
    infeasible, warning = json.loads(done.stdout)["warnings"]
    assert infeasible.startswith("this could not be won (LJ0601): `boat` cannot come within 50 m of")
    assert re.fullmatch(re.escape(f"{expected}ValueError: no idea ") + r"\(p.py:\d+\)", warning)
    assert done.stderr == f"warning: seed 0: {infeasible}\nwarning: seed 0: {warning}\n"


def test_a_thread_that_a_policy_leaves_running_does_not_delay_the_end_of_the_command(
    short: Path, tmp_path: Path
) -> None:
    policy = write_policy(tmp_path, reset="asyncio.get_running_loop().run_in_executor(None, time.sleep, 600)")
    done = lingjing("run", short, "--policy", policy, "--json", "--no-overview", "-o", "out", cwd=tmp_path)
    assert (done.returncode, json.loads(done.stdout)["reason"]) == (0, "budget")


@pytest.mark.parametrize(
    "closed",
    [*(pytest.param(closed, marks=pytest.mark.thorough) for closed in (">&-", "2>&-")), ">&- 2>&- <&-"],
)
def test_closed_streams_cause_no_error(closed: str, short: Path, tmp_path: Path) -> None:
    script = f'"$@" {closed}'
    command = ["sh", "-c", script, "sh", *COMMAND, "run", str(short), "--policy", "random"]
    command += ["-o", "out", "--no-overview"]
    assert subprocess.run(command, cwd=tmp_path, timeout=900, check=False, capture_output=True).returncode == 0
    assert read_trace(tmp_path / "out" / "trace.mcap").complete


def test_a_full_output_gives_one_message(tmp_path: Path) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*COMMAND, "compile", "ssr"], cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 2
    assert done.stderr == (
        "error: cannot write the output: No space left on device\nhint: choose another place with -o, or make room\n"
    )


def test_a_file_size_limit_leaves_a_readable_part(pictured: Path, tmp_path: Path) -> None:
    limited = ["sh", "-c", 'ulimit -f 280; exec "$@"', "sh", *COMMAND]
    arguments = ["run", str(pictured), "--policy", "random", "-o", "out", "--json", "--no-overview"]
    done = subprocess.run([*limited, *arguments], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    part = tmp_path / "out" / "trace.mcap.part"
    assert done.stderr.startswith(f"error: cannot write the trace {part}: File too large\nhint: ")
    assert os.listdir(tmp_path / "out") == ["trace.mcap.part"]
    assert read_trace(tmp_path / "out" / "trace.mcap.part").boundaries


def group_is_gone(leader: int) -> bool:
    """True if no living process belongs to the session of `leader`."""
    for entry in Path("/proc").iterdir():
        try:
            fields = (entry / "stat").read_text().rpartition(")")[2].split() if entry.name.isdigit() else None
        except OSError:
            continue
        if fields and fields[3] == str(leader) and fields[0] != "Z":
            return False
    return True


def has_begun(part: Path) -> bool:
    """True if the trace holds a boundary: before it, an interrupt leaves no report."""
    try:
        return bool(read_trace(part).boundaries)
    except LingjingError:  # half of its header
        return False


def ended(
    mission: Path, arguments: tuple[str, ...], folder: Path, traces: int, act: Callable[[subprocess.Popen[str]], None]
) -> tuple[subprocess.Popen[str], str, str]:
    """Start a run that does not end, in a separate session; call `act` when enough traces have boundaries; wait for
    its end.
    """
    options = ("--policy", "random", "-o", "out", "--json", "--no-overview", *arguments)
    process = subprocess.Popen(
        [*COMMAND, "run", str(mission), *options], cwd=folder,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    deadline = time.monotonic() + 600
    while sum(map(has_begun, folder.rglob("*.part"))) < traces:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.05)
    act(process)
    out, err = process.communicate(timeout=900)
    patience = time.monotonic() + 600
    while not group_is_gone(process.pid) and time.monotonic() < patience:
        time.sleep(0.05)
    assert group_is_gone(process.pid)
    return process, out, err


@pytest.mark.parametrize("number", [signal.SIGTERM, pytest.param(signal.SIGHUP, marks=pytest.mark.thorough)])
def test_a_termination_signal_interrupts_the_run(number: signal.Signals, endless: Path, tmp_path: Path) -> None:
    process, out, err = ended(endless, (), tmp_path, 1, lambda process: process.send_signal(number))
    answer = json.loads(out)
    assert (process.returncode, answer["reason"]) == (130, INTERRUPTED)
    part = "the partial trace is out/trace.mcap.part"
    assert err == f"interrupted: seed 0 at tick {answer['ticks']}; {part}\n"
    assert read_trace(tmp_path / "out" / "trace.mcap.part").boundaries


def test_repeated_control_c_is_reported_as_one_interrupt(endless: Path, tmp_path: Path) -> None:
    def impatient(process: subprocess.Popen[str]) -> None:
        for _ in range(6):
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGINT)
            time.sleep(0.04)

    process, _, err = ended(endless, (), tmp_path, 1, impatient)
    assert process.returncode == 130
    assert err.startswith("interrupted")
    assert err.count("\n") == 1


def test_an_interrupt_of_parallel_episodes_reports_each_of_them(endless: Path, tmp_path: Path) -> None:
    process, out, err = ended(
        endless, ("--seeds", "0-3", "-j", "2"), tmp_path, 2, lambda process: os.killpg(process.pid, signal.SIGINT)
    )
    answer = json.loads(out)
    assert process.returncode == 130
    assert [(episode["seed"], episode["reason"]) for episode in answer["episodes"]] == [
        (0, INTERRUPTED), (1, INTERRUPTED),
    ]  # fmt: skip
    assert answer["tsr"] is None
    assert err.count("interrupted: seed ") == 2
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["boats-broadcast-0-1", "boats-broadcast-1-1"]


def test_killing_the_command_of_parallel_episodes_leaves_no_process(endless: Path, tmp_path: Path) -> None:
    process, out, _ = ended(endless, ("--seeds", "0-3", "-j", "2"), tmp_path, 2, lambda process: process.kill())
    assert (process.returncode, out) == (-signal.SIGKILL, "")
    assert not list(tmp_path.rglob("trace.mcap"))


def test_output_to_a_named_pipe_is_written_into_the_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = subprocess.Popen(["cat", pipe], stdout=subprocess.PIPE, text=True)
    write_whole(str(pipe), "text")
    assert reader.communicate(timeout=900)[0] == "text"
    assert pipe.is_fifo()


@pytest.mark.parametrize("name", ["", "x" * 5000])
def test_a_name_that_cannot_be_a_file_is_no_mission(name: str) -> None:
    with pytest.raises(UsageError, match="there is no mission") as caught:
        compiled(name)
    assert len(str(caught.value)) < 400


def test_a_place_beyond_the_scene_is_an_error_of_the_mission(tmp_path: Path, capsys, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = mission_file("reset/ssr-001.json").read_text(encoding="utf-8")
    Path("far.json").write_text(text.replace('"X": 30660.0', '"X": 1e300'), encoding="utf-8")
    assert run_command(["run", "far.json", "--policy", "random"]) == 1
    assert "beyond the scene\nhint: " in capsys.readouterr().err
    assert os.listdir() == ["far.json"]


def test_a_file_without_an_end_is_refused(capsys) -> None:
    assert run_command(["validate", "/dev/zero"]) == 2
    assert "`/dev/zero` does not end" in capsys.readouterr().err


def test_a_text_over_32_mb_is_refused(tmp_path: Path, capsys, monkeypatch) -> None:
    long = tmp_path / "long.ljs"
    with long.open("wb") as file:
        file.truncate(32_000_001)
    assert run_command(["validate", str(long)]) == 2
    errors = capsys.readouterr().err
    assert "has 32.0 MB" in errors and "at most 32 MB" in errors
    with Path("/dev/zero").open() as endless:
        monkeypatch.setattr("sys.stdin", endless)
        assert run_command(["validate", "-"]) == 2
    assert "`<stdin>` does not end within 32 MB" in capsys.readouterr().err


def test_a_text_of_32_mb_is_read(tmp_path: Path, capsys) -> None:
    long = tmp_path / "long.ljs"
    long.write_bytes((b"# " + b"a" * 7_997 + b"\n") * 4_000)
    assert long.stat().st_size == 32_000_000
    assert run_command(["validate", str(long)]) == 1
    assert "error[LJ0106]" in capsys.readouterr().out


def test_an_output_folder_that_is_a_file_is_a_usage_error(short: Path, tmp_path: Path, capsys) -> None:
    (tmp_path / "taken").write_text("mine")
    assert run_command(["run", str(short), "-o", str(tmp_path / "taken")]) == 2
    assert "is a file, not a folder" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"policy": 3}, "3 is not a policy"),
        ({"seed": -1}, "seed: at least 0 is due, this is -1"),
        ({"seed": "x", "world": "moon"}, "seed: a whole number is due, this is the text 'x'\nworld: inline or process"),
        ({"settings": {"uavs": "two"}}, "settings.uavs: a number is due"),
    ],
)
def test_wrong_arguments_from_python_are_usage_errors(wrong, message, short: Path, tmp_path: Path, monkeypatch) -> None:
    import lingjing as package

    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match=message):
        package.run(package.compile(short), **wrong)
    assert os.listdir(tmp_path) == []


def test_the_python_api_plays_a_policy_class_inside_a_running_event_loop(pictured: Path, tmp_path: Path) -> None:
    import asyncio

    import lingjing as package
    from lingjing.plugins.policy import Decision

    class Idle:
        async def reset(self, brief: object) -> None:
            self.brief = brief

        async def act(self, observation: object, inbox: object) -> Decision:
            return Decision()

    async def notebook() -> package.EpisodeReport:
        return package.run(package.compile(pictured), policy=Idle, seed=3, overview=False, out=tmp_path / "out")

    result = asyncio.run(notebook())
    assert (result.reason, result.ticks) == ("budget", 3)
    assert [warning[:31] for warning in result.warnings] == ["this could not be won (LJ0601):"]


def episode(reason: str, **metrics: object) -> EpisodeReport:
    made = blank_metrics(**metrics)
    return made_report(success=reason == "success", reason=reason, scr=0.5, metrics=made)


def test_interrupted_episodes_count_in_no_rate() -> None:
    suite = summarise([episode("success"), episode(INTERRUPTED), episode(ABORTED)], seeds="1", folder="runs")
    assert suite.tsr == 1.0


def test_the_scorecard_is_grouped_and_marks_undefined_metrics() -> None:
    stage = StageMetric(name="detect", done=1, required=3, cumulative=False)
    report = episode("budget", precision=None, recall=0.25, f1=None, kilobytes=5.688, reports=4, false_positives=1,
                     localisation_error_m=None, stages=(stage,))  # fmt: skip
    groups = {name: dict(rows) for name, rows in scorecard(report)}
    assert list(groups) == ["Outcome", "Perception", "Communication", "Behaviour", "Cost"]
    assert groups["Outcome"]["success"] == "no: the budget of ticks ran out"
    assert groups["Outcome"]["stages"] == "detect 1/3"
    assert groups["Perception"]["precision / recall / F1"] == "N/A / 0.25 / N/A"
    assert groups["Perception"]["reports"] == "4, 1 of them false"
    assert groups["Perception"]["localisation error"] == "N/A"
    assert groups["Communication"]["payload"] == "5.69 kB"


INTERRUPTED_WHILE_MSGSPEC_LOADS = """
import os, signal, sys

class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == "msgspec._core":
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupting())
from lingjing.cli.main import main
code = main(["validate", "none.ljs"])
print(code, hasattr(sys.modules.get("msgspec._core"), "Struct"))
"""


def test_an_interrupt_takes_effect_after_msgspec_is_completely_loaded(tmp_path: Path) -> None:
    """A partial import crashed the process later, when a value was decoded."""
    command = [sys.executable, "-c", INTERRUPTED_WHILE_MSGSPEC_LOADS]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert (done.stdout, done.stderr) == ("130 True\n", "interrupted\n")
