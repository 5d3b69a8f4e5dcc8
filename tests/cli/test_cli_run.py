"""End-to-end tests of `lingjing run` on a shipped mission of a few ticks and on two boats without cameras."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from configparser import ConfigParser
from dataclasses import dataclass
from pathlib import Path

import msgspec
import pytest

import lingjing
from lingjing import Metrics
from lingjing import read as read_trace
from lingjing.cli.results import explain, print_episode
from lingjing.cli.scorecard import plain
from lingjing.errors import LingjingError
from lingjing.testing import mission_file, run_command
from tests.kernel.test_world_process import is_running
from tests.play.report_kit import made_report
from tools.python_forks import run_python

pytestmark = pytest.mark.slow

KEYS = {"mission", "seed", "mode", "success", "reason", "scr", "ticks", "digest", "trace", "metrics"}
RUN = (sys.executable, "-m", "lingjing.cli.main", "run")
BOATS = Path(__file__).with_name("boats.ljs")


LOOKS = """
from lingjing.plugins.policy import Action, Decision

class Looks:
    async def reset(self, brief): ...

    async def act(self, observation, inbox):
        return Decision(command=Action(verb="takePhoto"), thought=str([p.rgb.sum() for p in observation.pictures]))
"""
"""A policy with the brightness of its pictures as thoughts."""


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The mission with a budget of three ticks."""
    text = mission_file("ssr").read_text(encoding="utf-8")
    assert "ticks <= 60" in text
    path = tmp_path_factory.mktemp("mission") / "short.ljs"
    away, near = "(12.4 m, -1351.8 m)", "(270 m, -920 m)"  # so that three ticks are not proved too few
    assert away in text
    path.write_text(text.replace("ticks <= 60", "ticks <= 3").replace(away, near), encoding="utf-8")
    return path


def without_warning(stderr: str) -> str:
    """Return standard error without the warning that three ticks are too few for this seed's victims."""
    return "".join(line for line in stderr.splitlines(keepends=True) if "could not be won (LJ0601)" not in line)


def lingjing_run(*arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    return run_python([*RUN, *map(str, arguments)], cwd=cwd)


@dataclass(frozen=True)
class Ended:
    """A command that ran in the process of the tests."""

    returncode: int
    stdout: str
    stderr: str


@pytest.fixture
def run_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., Ended]:
    """Return a function that calls `lingjing run` in this process, in `tmp_path`."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: object) -> Ended:
        try:
            code = run_command(["run", *map(str, arguments)])
        except SystemExit as ended:  # argparse ends so
            code = int(ended.code or 0)
        return Ended(code, *capsys.readouterr())

    return call


def test_json_output_is_one_object_with_the_documented_keys(short: Path, tmp_path: Path) -> None:
    """Without an overview the trace is the same, and so are the pictures that policies receive."""
    (tmp_path / "looks.py").write_text(LOOKS)
    policies = ("--policy", "random", "--policy-for", "scout[1]=./looks.py:Looks", "--policy-seed", 8)
    options = (short, "--seed", 3, "--mode", "star", *policies, "--json")
    done = lingjing_run(*options, cwd=tmp_path)
    assert (done.returncode, without_warning(done.stderr)) == (0, "")
    answer = json.loads(done.stdout)
    assert answer.keys() >= KEYS
    assert (answer["mission"], answer["seed"], answer["mode"], answer["ticks"]) == ("ssr", 3, "star", 3)
    assert (answer["reason"], answer["success"]) == ("budget", False)
    assert answer["trace"] == "runs/ssr-star-3-1/trace.mcap"
    assert (answer["policy_seed"], read_trace(tmp_path / answer["trace"]).header.policy_seed) == (8, 8)
    played = read_trace(tmp_path / answer["trace"]).boundaries
    thoughts = {made.decision.thought for record in played for made in record.decisions if made.agent == "scout[1]"}
    assert thoughts - {"[]", "[0]"}
    assert sorted(path.name for path in (tmp_path / "runs/ssr-star-3-1").iterdir()) == ["overview.png", "trace.mcap"]
    bare = lingjing_run(*options, "--no-overview", "-o", "bare", "--world", "inline", cwd=tmp_path)
    assert json.loads(bare.stdout)["digest"] == answer["digest"]
    assert [path.name for path in (tmp_path / "bare").iterdir()] == ["trace.mcap"]


def test_only_the_policy_seed_decides_the_draws_of_a_policy(tmp_path: Path) -> None:
    """The instance's seed has no effect: `random` decides equally in two instances, and differently with another
    policy seed.
    """
    instances = set()

    def decided(seed: int, policy_seed: int) -> list[object]:
        report = lingjing.run(
            BOATS, seed=seed, policy_seed=policy_seed, policy="random", world="inline", overview=False,
            out=tmp_path / f"{seed}-{policy_seed}",
        )  # fmt: skip
        trace = read_trace(report.trace)
        instances.add(tuple(entity.position for entity in trace.header.instance.entities))
        return [made.decision for made in trace.boundaries[1].decisions]

    assert decided(0, 4) == decided(1, 4) != decided(0, 5)
    assert len(instances) == 2


def test_seeds_played_in_one_world_equal_seeds_played_in_parallel_processes(tmp_path: Path) -> None:
    options = (BOATS, "--seeds", "0-1", "--policy", "random", "--json", "--no-overview")
    warm = lingjing_run(*options, "-o", "warm", cwd=tmp_path)
    apart = lingjing_run(*options, "-o", "apart", "-j", 2, cwd=tmp_path)
    assert (warm.returncode, apart.returncode) == (0, 0), warm.stderr + apart.stderr
    first, second = json.loads(warm.stdout), json.loads(apart.stdout)
    assert first.keys() >= KEYS | {"tsr", "episodes"}
    assert [episode["seed"] for episode in first["episodes"]] == [0, 1]
    assert [e["digest"] for e in first["episodes"]] == [e["digest"] for e in second["episodes"]]
    assert first["episodes"][0]["digest"] != first["episodes"][1]["digest"]
    assert (first["tsr"], first["digest"]) == (0.0, second["digest"])
    assert sorted(path.name for path in (tmp_path / "warm").iterdir()) == ["boats-broadcast-0-1", "boats-broadcast-1-1"]


def test_piped_output_is_grouped_has_units_and_ends_with_the_trace(tmp_path: Path) -> None:
    done = lingjing_run(BOATS, "--policy", "random", "-o", "here", "--world", "inline", cwd=tmp_path)
    assert (done.returncode, without_warning(done.stderr)) == (0, "")
    assert "\x1b" not in done.stdout
    lines = done.stdout.splitlines()
    assert "success: no (budget)" in lines
    assert lines[-1] == "trace: here/trace.mcap"
    read = ConfigParser(interpolation=None, delimiters=(":",))
    read.read_string(done.stdout)
    assert read.sections() == ["episode", "outcome", "perception", "communication", "behaviour", "cost", "files"]
    assert read["episode"]["mission"] == "boats" and read["outcome"]["ticks"] == "3"
    assert (read["outcome"]["sim_s"], read["cost"]["cost_usd"]) == ("30 s", "0 USD")
    assert read["perception"]["localisation_error_m"] == "N/A"
    assert read["communication"]["kilobytes"].endswith(" kB")


def test_piped_output_has_every_metric_once_and_the_attribution_of_the_map(capsys: pytest.CaptureFixture[str]) -> None:
    report = made_report(trace="gone/trace.mcap", attribution="© OpenStreetMap contributors, ODbL 1.0")
    names = [name for _, rows in plain(report) for name, _ in rows]
    assert len(names) == len(set(names))
    assert set(Metrics.__struct_fields__) - {"scr", "reason"} <= set(names)
    print_episode(report)
    lines = capsys.readouterr().out.splitlines()
    assert lines[-2:] == ["map: © OpenStreetMap contributors, ODbL 1.0", "trace: gone/trace.mcap"]
    print_episode(msgspec.structs.replace(report, attribution="procedural"))
    assert "map:" not in capsys.readouterr().out


def test_a_run_is_never_overwritten(run_here: Callable[..., Ended], tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "trace.mcap").write_text("precious")
    done = run_here(BOATS, "--policy", "random", "-o", "out")
    assert done.returncode == 2
    assert "`out` is not empty" in done.stderr
    assert (tmp_path / "out" / "trace.mcap").read_text() == "precious"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--policy", "heuristik"), "no policy is called `heuristik`"),
        (("--policy", "./none.py:Scout"), "there is no policy file `none.py`"),
        (("--policy-for", "pilot=random"), "no role or agent is called `pilot`"),
        (("--policy-for", "searcher"), "--policy-for searcher: expected name=value"),
        (("--policy-arg", "hight=3", "--policy", "random"), "hight"),
        (("--set", "victims=99"), "victims"),
        (("--set", "height=3"), "height"),
        (("--set", "victims=2.5"), "--set victims=2.5: ssr/victim: expected a whole number"),
        (("--set", "altitude=80 s"), "duration where length is due"),
        (("--mode", "mesh"), "mesh"),
        (("--seed", "-1"), "`-1` is not a seed"),
        (("--seeds", "5-1"), "runs backwards"),
        (("--seeds", "0-"), "--seeds 0-: a range has two ends"),
        (("-j", "0"), "must be a whole number of at least 1"),
        (("-o", "/proc/nowhere"), "/proc/nowhere"),
    ],
)
def test_wrong_arguments_are_named_in_the_message_and_leave_no_file(
    arguments: tuple[str, ...], message: str, short: Path, run_here: Callable[..., Ended], tmp_path: Path
) -> None:
    done = run_here(short, *arguments)
    assert done.returncode == 2, done.stderr
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("content", "code"),
    [(None, 2), (b"", 1), (b"\xff\xfe\x00", 2), (b"mission ssr {", 1), (b"x" * 10_000_000, 2)],
    ids=["missing", "empty", "not-utf8", "broken", "ten-megabytes-of-one-line"],
)
def test_wrong_missions_give_a_message_and_an_exit_code(
    content: bytes | None, code: int, run_here: Callable[..., Ended], tmp_path: Path
) -> None:
    if content is not None:
        (tmp_path / "m.ljs").write_bytes(content)
    done = run_here("m.ljs")
    assert done.returncode == code, done.stderr[:2000]
    assert "m.ljs" in done.stderr
    assert len(done.stderr) < 20_000
    assert "Traceback" not in done.stderr


def has_begun(part: Path) -> bool:
    """True if the trace holds a boundary: before it, an interrupt leaves no report."""
    try:
        return bool(read_trace(part).boundaries)
    except LingjingError:  # no file, or half of its header
        return False


def test_control_c_ends_with_a_partial_trace_and_no_process(endless: Path, tmp_path: Path, descendants) -> None:
    process = subprocess.Popen(
        [*RUN, str(endless), "--policy", "random", "-o", "out", "--json"], cwd=tmp_path,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    part = tmp_path / "out" / "trace.mcap.part"
    deadline = time.monotonic() + 600
    while not has_begun(part) and time.monotonic() < deadline:
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    workers = descendants(process.pid)
    assert workers
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=900)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    answer = json.loads(out)
    assert answer["reason"] == "interrupted"
    assert Path(tmp_path / answer["trace"]) == part
    assert not (tmp_path / "out" / "trace.mcap").exists()
    while any(map(is_running, workers)):  # loops until the test's time limit if a process stays
        time.sleep(0.05)
    assert os.listdir(tmp_path / "out") == ["trace.mcap.part"]


THREADED = """
import os, sys, threading
from pathlib import Path

from lingjing.cli.main import main
from lingjing.plugins.fleet import FleetEngine

reset = FleetEngine.reset

def noting_reset(engine, *arguments):
    Path("engine.pid").write_text(str(os.getpid()))
    return reset(engine, *arguments)

FleetEngine.reset = noting_reset
Path("me.py").write_text('''
import os
from lingjing.plugins.policy import Brief, Decision, Inbox, Observation

class Me:
    async def reset(self, brief: Brief) -> None:
        open("policy.pid", "w").write(str(os.getpid()))
    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        return Decision()
''')
threading.Thread(target=threading.Event().wait, daemon=True).start()
code = main(["run", sys.argv[1], "--policy", "./me.py:Me", "--world", "inline", "--no-overview", "-o", "out"])
print(code, *(Path(f"{part}.pid").read_text() == str(os.getpid()) for part in ("engine", "policy")))
"""


def test_a_program_with_threads_plays_inline_engines_and_their_policies_in_its_own_process(tmp_path: Path) -> None:
    """A fork copies locks that other threads hold, and nothing in the fork releases them."""
    done = subprocess.run(
        [sys.executable, "-c", THREADED, str(BOATS)], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.stdout.splitlines()[-1:] == ["0 True True"], done.stderr


def test_the_hint_for_an_aborted_episode_depends_on_whether_its_partial_trace_exists(tmp_path: Path, capsys) -> None:
    trace = tmp_path / "trace.mcap.part"
    missing = made_report(reason="infrastructure-abort", success=False, trace=str(trace))
    explain([missing])
    assert "if a program clears the folder" in capsys.readouterr().err
    trace.touch()
    explain([missing])
    assert "the trace holds the episode up to this error" in capsys.readouterr().err
