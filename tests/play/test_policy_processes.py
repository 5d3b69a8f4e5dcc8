"""A policy that attacks its process, or others from it, harms only itself (`lingjing run`, real processes)."""

from __future__ import annotations

import json
import os
import random
import re
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import lingjing
from lingjing import PlayOptions, Trace
from lingjing import read as read_trace
from lingjing.errors import LingjingError, UsageError
from lingjing.kernel.ambient_random import generator_states, generators_advanced
from lingjing.play.parallel import EpisodeTask, play_apart
from lingjing.play.policy_processes.barrier import LOAD_VARIABLE, AgentPolicy, ProcessBarrier
from lingjing.play.policy_processes.examination import examine
from lingjing.play.policy_processes.messages import LoadPolicy
from lingjing.play.policy_processes.output import MOST_BYTES
from lingjing.play.policy_processes.preloading import SERVES
from lingjing.play.policy_processes.servers import OpenServer
from lingjing.plugins.loading import UNRECORDED
from lingjing.plugins.policy import Decision
from lingjing.processes.fork_client import ForkServer, ForkServerClient
from lingjing.trace.records import DecisionRecord

pytestmark = pytest.mark.usefixtures("workers_are_interpreters")

POLICIES = Path(__file__).with_name("hostile_policies.py")

MISSION = """\
ljs 1
use std.sea {{ lifeboat }}
mission crew "Boats that wait" {{
  goal "Wait."
  scene bay {{ datum = sea level at -3.5 m }}
  clock {{ tick = 1 s, sync = 500 ms }}
  budget {{ ticks <= {ticks}, policy <= {policy_s} s }}
  asset boat[1..{boats}] : lifeboat {{ position = at(i, [{places}]) }}
  agent skipper[i in 1..{boats}] as skipper controls boat[i] {{ observes boat[i].* }}
  success when exists b in boat: b.status == "aground"
}}
"""

WORDS = {
    "Chdir": ("", "elsewhere"),
    "Close": ("policy_error", r"its process (ended \(exit code 1\)|sent an invalid answer.*)"),
    "Replace": ("", "replaced"),
    "Exit": ("policy_error", r"RuntimeError: the policy tried to exit \(SystemExit\)"),
    "HardExit": ("policy_error", r"its process ended \(exit code 0\)"),
    "Segfault": ("policy_error", r"its process was killed by signal 11 \(SIGSEGV\)"),
    "Kill": ("policy_error", r"its process was killed by signal 9 \(SIGKILL\)"),
    "Wrong": ("malformed", "a lock cannot stand in a decision"),
    "NoDecision": ("malformed", "`act` returned function, not a Decision"),
    "Raw": ("policy_error", "its process sent an invalid answer, or closed its channel"),
    "Deep": ("policy_error", "its process sent an invalid answer, or closed its channel"),
    "Descriptors": ("policy_error", "its process sent an invalid answer, or closed its channel"),
    "Huge": ("malformed", r"the decision has \d+ bytes, at most 1000000"),
    "Flood": ("", "printed"),
    "Forks": ("", "forked"),
    "Threads": ("", "threads"),
    "Hog": ("policy_error", r"MemoryError \(hostile_policies.py:\d+\)"),
    "Ambient": ("", r"[\d.e-]+ [\d.e-]+ -?\d+ \[.*\]"),
}
"""The result of each attack at every turn: the reason, and its detail or the thought."""

LATE = {
    "Regex": ("late", "late"),
    "Spin": ("late", "late"),
    "Sleep": ("late", "late"),
    "Stop": ("late", "late"),
    "Signals": ("late", "late"),
    "Await": ("late", "turn 2"),
    "Finaliser": ("kept", "late"),
}
"""The results of a policy that takes too long at its first two turns: a late answer, or the thought."""


@dataclass(frozen=True)
class Played:
    """An episode of the command line: each attack plays a boat of its own, and one boat is steady."""

    folder: Path
    code: int
    errors: str
    trace: Trace
    left: list[str]

    def of(self, attack: str) -> list[DecisionRecord]:
        policies = {binding.agent: binding.policy.rpartition(":")[2] for binding in self.trace.header.bindings}
        made = [record for boundary in self.trace.boundaries for record in boundary.decisions]
        return [record for record in made if policies[record.agent] == attack]


def write_mission(folder: Path, boats: int, ticks: int, policy_s: float) -> Path:
    places = ", ".join(f"({60 * number} m, -900 m)" for number in range(boats))
    file = folder / "crew.ljs"
    file.write_text(MISSION.format(ticks=ticks, policy_s=policy_s, boats=boats, places=places))
    return file


def command(mission: Path, attacks: Sequence[str], *options: str) -> list[str]:
    chosen = [f"--policy-for=skipper[{number}]={POLICIES}:{name}" for number, name in enumerate(attacks, 1)]
    run = [sys.executable, "-m", "lingjing.cli.main", "run", str(mission), "--no-overview", "--json"]
    return [*run, f"--policy={POLICIES}:Steady", *chosen, *options]


def marked(mark: str, **others: str) -> dict[str, str]:
    return {**os.environ, "LINGJING_TEST_MARK": mark, "LINGJING_POLICY_MEMORY_GB": "0.5", **others}


def marked_processes(mark: str) -> list[str]:
    """The command lines of processes that have inherited the mark."""
    command_lines = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            try:
                if mark.encode() in (entry / "environ").read_bytes():
                    command_lines.append((entry / "cmdline").read_text().replace("\0", " "))
            except OSError:
                continue
    return command_lines


def play(folder: Path, attacks: Sequence[str], ticks: int, policy_s: float) -> Played:
    mission, mark = write_mission(folder, len(attacks) + 1, ticks, policy_s), uuid.uuid4().hex
    run = command(mission, attacks, "-o", "out")
    done = subprocess.run(run, cwd=folder, env=marked(mark), capture_output=True, text=True, check=False)
    assert (folder / "out" / "trace.mcap").exists(), done.stderr[-3000:]
    return Played(
        folder, done.returncode, done.stderr, read_trace(folder / "out" / "trace.mcap"), marked_processes(mark)
    )


@pytest.fixture(scope="module")
def attacked(tmp_path_factory: pytest.TempPathFactory) -> Played:
    return play(tmp_path_factory.mktemp("attacked"), tuple(WORDS), ticks=2, policy_s=600.0)


@pytest.fixture(scope="module")
def delayed(tmp_path_factory: pytest.TempPathFactory) -> Played:
    return play(tmp_path_factory.mktemp("delayed"), tuple(LATE), ticks=2, policy_s=4.0)


@pytest.mark.parametrize("attack", WORDS)
def test_an_attack_costs_at_most_the_turn_of_its_own_agent(attacked: Played, attack: str) -> None:
    reason, words = WORDS[attack]
    for record in attacked.of(attack):
        assert record.substituted == reason
        assert re.fullmatch(words, record.detail or record.decision.thought), record


@pytest.mark.parametrize("attack", LATE)
def test_a_call_that_never_ends_costs_its_own_agent_a_deadline(delayed: Played, attack: str) -> None:
    for record, words in zip(delayed.of(attack), LATE[attack], strict=True):
        assert (record.substituted == "policy_timeout") == (words == "late"), record
        assert record.decision.thought == ("" if words == "late" else words)


def test_the_other_agents_are_unaffected(attacked: Played, delayed: Played) -> None:
    for played in (attacked, delayed):
        thoughts = [record.decision.thought for record in played.of("Steady")]
        assert thoughts == [f"turn {number} in {played.folder}" for number in (1, 2)]


def test_an_attacked_episode_ends_with_a_complete_trace_and_no_process(attacked: Played, delayed: Played) -> None:
    for played in (attacked, delayed):
        assert played.code == 0
        assert played.trace.complete and played.trace.outcome is not None
        assert played.trace.outcome.reason == "budget"
        assert played.left == []


def test_the_output_of_policies_is_escaped_and_limited(attacked: Played) -> None:
    assert "\x1b" not in attacked.errors
    assert "\\x1b[2Jyyy" in attacked.errors
    assert "bytes: the rest is left out]" in attacked.errors
    assert len(attacked.errors) < 3 * MOST_BYTES


def test_ambient_randomness_is_the_same_in_each_run(attacked: Played, tmp_path: Path) -> None:
    """`random`, `numpy.random` and the hash of texts; here through `-j 2`, as a suite plays, and with other hash seeds
    in the environment."""
    mission = write_mission(tmp_path, 2, 2, 600.0)
    digests = []
    for number, seed in enumerate(("1", "2")):
        run = command(mission, ("Ambient",), "-o", f"out{number}")
        done = subprocess.run(
            run, cwd=tmp_path, env=marked("x", PYTHONHASHSEED=seed), capture_output=True, text=True, check=True
        )
        digests.append(json.loads(done.stdout)["digest"])
    options = PlayOptions(
        mission=str(mission),
        policy=f"{POLICIES}:Steady",
        policies_for={"skipper[1]": f"{POLICIES}:Ambient"},
        overview=False,
    )
    digests += [report.digest for _, report in play_apart([EpisodeTask(options, tmp_path / "apart")], jobs=1)]
    assert len(set(digests)) == 1
    first, second = (record.decision.thought for record in attacked.of("Ambient"))
    assert first.split()[:2] != second.split()[:2]


@pytest.fixture
def server() -> Iterator[ForkServerClient]:
    with ForkServer(SERVES) as started:
        client = started.client()
        yield client
        client.close()


def loaded(server: ForkServerClient, names: Mapping[str, str]) -> ProcessBarrier:
    policies = {
        agent: AgentPolicy(LoadPolicy(spec=f"{POLICIES}:{name}", source="", arguments={}, seed=1), UNRECORDED)
        for agent, name in names.items()
    }
    return ProcessBarrier(policies, 60.0, OpenServer(server))


def test_a_constructor_that_never_ends_is_refused(server: ForkServerClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LOAD_VARIABLE, "1")
    crew = loaded(server, {"good": "Steady", "slow": "SlowConstructor"})
    with pytest.raises(UsageError, match=r"hostile_policies.py:SlowConstructor` of `slow` was not loaded within 1 s"):
        crew.load()


def test_an_import_that_never_ends_is_refused(
    server: ForkServerClient, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv(LOAD_VARIABLE, "1")
    file = tmp_path / "endless.py"
    file.write_text("while True:\n    pass\n")
    with pytest.raises(UsageError, match=r"policy `.*endless.py` was not loaded within 1 s"):
        examine([str(file)], {}, OpenServer(server), whole=True)
    file.write_text("import os\nos._exit(4)\n")
    with pytest.raises(UsageError, match=r"could not be loaded: its process ended \(exit code 4\)"):
        examine([str(file)], {}, OpenServer(server), whole=True)


def test_a_process_that_ends_in_reset_is_named(tmp_path: Path) -> None:
    mission = write_mission(tmp_path, 2, 2, 600.0)
    done = subprocess.run(
        command(mission, ("BadReset",), "-o", "out"), cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr.startswith(
        "error: the policy of `skipper[1]` failed in `reset`: its process ended (exit code 9)"
    )
    assert not (tmp_path / "out").exists()


def interrupted(folder: Path, attack: str) -> tuple[subprocess.Popen[str], str]:
    """A run whose policy never answers, once it has begun."""
    mark = uuid.uuid4().hex
    mission = write_mission(folder, 2, 2, 36_000.0)
    run = command(mission, (attack,), "-o", "out")
    process = subprocess.Popen(
        run, cwd=folder, env=marked(mark), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    while not _has_begun(folder / "out" / "trace.mcap.part"):
        assert process.poll() is None
        time.sleep(0.02)
    return process, mark


def _has_begun(part: Path) -> bool:
    """True if the first boundary is written: from then on the policies are called."""
    try:
        return bool(read_trace(part).boundaries)
    except LingjingError:
        return False


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.thorough)])
def test_an_interrupt_leaves_a_partial_trace_and_no_process(number: signal.Signals, tmp_path: Path) -> None:
    process, mark = interrupted(tmp_path, "Signals")
    process.send_signal(number)
    out, errors = process.communicate()
    assert process.returncode == 130, errors
    assert json.loads(out)["reason"] == "interrupted"
    assert read_trace(tmp_path / "out" / "trace.mcap.part").header.instance.mission == "crew"
    assert marked_processes(mark) == []


def test_a_killed_run_leaves_no_process(tmp_path: Path) -> None:
    process, mark = interrupted(tmp_path, "Signals")
    process.kill()
    process.communicate()
    while marked_processes(mark):  # loops until the test's time limit if it does not hold
        time.sleep(0.02)


TWICE = """
import os, signal, subprocess, time
from lingjing.cli.process import ending_at_second_interrupt
signal.signal(signal.SIGINT, lambda number, frame: os.write(1, b"again\\n"))
with ending_at_second_interrupt():
    subprocess.Popen(["setsid", "sh", "-c", "sleep 3600 & sleep 3600"])
    print("begun", flush=True)
    while True:
        time.sleep(3600)
"""


def test_the_second_interrupt_ends_everything_at_once() -> None:
    """It does so whatever the first one has begun. Two equal signals within a moment may arrive as one."""
    mark = uuid.uuid4().hex
    process = subprocess.Popen([sys.executable, "-c", TWICE], env=marked(mark), stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "begun\n"
    process.send_signal(signal.SIGINT)
    process.send_signal(signal.SIGINT)
    assert process.stdout.readline() == "again\n"
    while process.poll() is None:
        process.send_signal(signal.SIGINT)
        time.sleep(0.05)
    process.communicate()
    assert process.returncode == 130
    assert marked_processes(mark) == []


def test_run_in_python_plays_policies_in_the_process_of_the_caller(tmp_path: Path) -> None:
    """As with `--world inline`, the policies act in the process of the caller."""
    seen = []

    class Here:
        async def reset(self, brief: object) -> None:
            seen.append(os.getpid())

        async def act(self, observation: object, inbox: object) -> Decision:
            return Decision()

    mission = lingjing.compile(write_mission(tmp_path, 1, 1, 60.0))
    lingjing.run(mission, policy=Here, out=tmp_path / "out", overview=False)
    assert seen == [os.getpid()]


class Drawing:
    """Draws from a global generator at every turn."""

    def __init__(self, draw: Callable[[], object]) -> None:
        self.draw = draw

    async def reset(self, brief: object) -> None:
        self.name = brief

    async def act(self, observation: object, inbox: object) -> Decision:
        self.draw()
        return Decision()


@pytest.mark.parametrize(
    ("draw", "names"),
    [
        (lambda: None, ()),
        (lambda: random.Random(1).random(), ()),
        (random.random, ("skipper[1]",)),
        (np.random.random, ("skipper[1]",)),
        (lambda: np.random.default_rng(1).random(), ()),
    ],
    ids=["none", "own", "random", "numpy", "generator"],
)
def test_run_in_python_reports_the_use_of_a_global_random_generator(
    draw: Callable[[], object], names: tuple[str, ...], tmp_path: Path
) -> None:
    """`run` itself does not draw from the generators of the caller."""
    mission = lingjing.compile(write_mission(tmp_path, 1, 1, 60.0))
    report = lingjing.run(mission, policy=lambda: Drawing(draw), out=tmp_path / "out", overview=False)
    outcome = read_trace(tmp_path / "out" / "trace.mcap").outcome
    assert outcome is not None and outcome.ambient_random == report.ambient_random == names
    assert any("draws from a global random generator" in line for line in report.warnings) == bool(names)


@pytest.mark.parametrize("draw", [random.random, np.random.random])
def test_run_in_python_reports_a_random_draw_while_a_policy_is_built(draw: Callable[[], float], tmp_path: Path) -> None:
    def build() -> Drawing:
        draw()
        return Drawing(lambda: None)

    mission = lingjing.compile(write_mission(tmp_path, 1, 1, 60.0))
    report = lingjing.run(mission, policy=build, out=tmp_path / "out", overview=False)
    assert report.ambient_random == ("skipper[1]",)


def test_the_output_folder_does_not_follow_a_policy_that_changes_the_working_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "start").mkdir()
    mission = lingjing.compile(write_mission(tmp_path, 1, 2, 60.0))
    monkeypatch.chdir(tmp_path / "start")
    report = lingjing.run(mission, policy=lambda: Drawing(lambda: os.chdir("..")), out="out", overview=False)
    assert report.trace == "out/trace.mcap"
    assert read_trace(tmp_path / "start" / "out" / "trace.mcap").complete


def test_a_partly_loaded_numpy_generator_does_not_count_as_a_draw(monkeypatch: pytest.MonkeyPatch) -> None:
    """numpy loads its generators when they are first used, perhaps in the thread of another policy."""
    monkeypatch.setitem(sys.modules, "numpy.random", ModuleType("numpy.random"))
    before = generator_states()
    monkeypatch.undo()
    assert before[1] is None and not generators_advanced(before, (before[0], generator_states()[1]))
