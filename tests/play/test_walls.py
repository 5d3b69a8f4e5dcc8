"""Walls around the processes of policies: each attack succeeds without them and fails behind them (`--isolate`)."""

from __future__ import annotations

import ctypes
import json
import os
import re
import socket
import subprocess
import sys
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import msgspec
import pytest
from msgspec.msgpack import encode

import lingjing
from lingjing import PlayOptions
from lingjing import read as read_trace
from lingjing.errors import InfrastructureError, UsageError
from lingjing.play.policy_processes.servers import walls_of
from lingjing.processes.fork_client import ForkServer
from lingjing.processes.walls.entering import Walls
from lingjing.processes.walls.offer import check_strict
from lingjing.processes.walls.readable import installed_files, modules_of
from lingjing.processes.walls.report import Guard, WallReport, broken_promises
from tests.play.test_policy_processes import write_mission
from tests.play.walled_attacks import ATTACKS, CHANNELS
from tests.play.walled_child import WalledRun

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="walls are made of Linux's own parts")

POLICIES = Path(__file__).with_name("walled_attacks.py")
CALLS = "calls.sqlite"
"""The record of model calls beside a trace."""
HOSTILE = Path(__file__).with_name("hostile_policies.py")

HELD_ANYWAY = {
    "truth_in_modules": "a single run holds no truth in its server; a suite does",
    "truth_in_the_collector": "as above",
    "truth_in_frames": "the processes of policies have no frames of the player",
    "inherited_descriptors": "a fork closes them",
    "private_memory": "RLIMIT_DATA holds everywhere",
}
"""Attacks that fail without walls too, in a single run, and the reasons."""


@dataclass(frozen=True)
class Outside:
    """The things that an attacker may look for."""

    config: dict[str, object]


@pytest.fixture(scope="module")
def outside(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Outside]:
    folder, mark, key = tmp_path_factory.mktemp("outside"), uuid.uuid4().hex, uuid.uuid4().int % 2**30
    library = ctypes.CDLL(None)
    with ExitStack() as stack:
        server = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        abstract = stack.enter_context(socket.socket(socket.AF_UNIX))
        abstract.bind(f"\0{mark}-listens")
        abstract.listen()
        named = stack.enter_context(socket.socket(socket.AF_UNIX))
        named.bind(str(folder / "socket"))
        named.listen()
        memory = Path("/dev/shm", mark)
        memory.write_bytes(b"secret")
        stack.callback(memory.unlink)
        segment = library.shmget(key, 4096, 0o1600)
        stack.callback(library.shmctl, segment, 0, None)
        (folder / "secret").write_text("sesame")
        stack.enter_context(pytest.MonkeyPatch.context()).setenv("HOME", str(folder))
        yield Outside(
            {
                "secret": str(folder / "secret"),
                "folder": str(folder),
                "home": str(folder),
                "shared": mark,
                "shm_key": key,
                "port": server.getsockname()[1],
                "abstract": f"{mark}-listens",
                "socket": str(folder / "socket"),
                "mark": mark,
                "writable": None,
            }
        )


@dataclass(frozen=True)
class Run:
    """A played episode with attackers."""

    results: dict[str, str]
    """The result of each attack of `Thief`."""
    channels: list[dict[str, bool]]
    """The findings of `Reader` at each turn."""
    wall_words: str
    errors: str


def play(outside: Outside, folder: Path, *options: str, walls: bool) -> Run:
    mission = write_mission(folder, 3, 2, 600.0)
    config = json.dumps({**outside.config, "folder": str(folder), "open": not walls})
    done = subprocess.run(
        [sys.executable, "-m", "lingjing.cli.main", "run", str(mission), "--no-overview", "-o", "out", "--json",
         f"--policy={POLICIES}:Thief", f"--policy-for=skipper[1]={POLICIES}:Writer",
         f"--policy-for=skipper[2]={POLICIES}:Reader", f"--policy-arg=config={config}", *options],
        cwd=folder, env={**os.environ, "LINGJING_TEST_KEY": "sesame", "LINGJING_POLICY_MEMORY_GB": "0.5"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    trace = read_trace(folder / "out" / "trace.mcap")
    thoughts = {name: [] for name in ("skipper[1]", "skipper[2]", "skipper[3]")}
    for boundary in trace.boundaries:
        for record in boundary.decisions:
            assert not record.substituted, record
            thoughts[record.agent].append(record.decision.thought)
    return Run(
        json.loads(thoughts["skipper[3]"][0]),
        [json.loads(thought) for thought in thoughts["skipper[2]"]],
        trace.header.fingerprint.get("walls", ""),
        done.stderr,
    )


@pytest.fixture(scope="module")
def unwalled(outside: Outside, tmp_path_factory: pytest.TempPathFactory) -> Run:
    return play(outside, tmp_path_factory.mktemp("open"), walls=False)


@pytest.fixture(scope="module")
def walled(outside: Outside, tmp_path_factory: pytest.TempPathFactory) -> Run:
    run = play(outside, tmp_path_factory.mktemp("walled"), "--isolate", walls=True)
    if "not promised" in run.errors:
        pytest.skip(f"this kernel does not offer every wall: {run.errors[-500:]}")
    return run


@pytest.mark.parametrize("attack", ATTACKS)
def test_an_attack_wins_without_walls_and_fails_behind_them(unwalled: Run, walled: Run, attack: str) -> None:
    assert unwalled.results[attack].startswith("won") == (attack not in HELD_ANYWAY), unwalled.results[attack]
    assert not walled.results[attack].startswith("won"), walled.results[attack]


def test_agents_of_one_policy_have_no_channel_beside_the_bus(unwalled: Run, walled: Run) -> None:
    """A module-global board is none under `lingjing run` at all: each agent has a process of its own."""
    others = dict.fromkeys(CHANNELS, True)
    assert unwalled.channels[1] == {"board": False, **others}
    assert walled.channels[1] == dict.fromkeys(("board", *others), False)


def test_the_trace_names_the_walls(unwalled: Run, walled: Run) -> None:
    assert unwalled.wall_words == ""
    assert re.fullmatch(
        r"user-namespace, pid-namespace, .*, mounts, own-user, landlock \d+, .*seccomp", walled.wall_words
    )


REACHING = (
    "environment", "first_environment", "secret_file", "names_of_processes", "memory_of_the_parent", "signals",
    "loopback", "abstract_socket", "installed_packages", "system_v_memory", "shared_memory_by_name",
)  # fmt: skip
"""Attacks that reach for something outside, and change nothing of their own process."""


@pytest.fixture
def child_results(outside: Outside, tmp_path: Path) -> Callable[..., tuple[WallReport, dict[str, str]]]:
    """Runs the attacks in a process that builds walls without some guards."""

    def run(
        *without: Guard, namespaces: bool = True, only: Sequence[str] = tuple(ATTACKS)
    ) -> tuple[WallReport, dict[str, str]]:
        walls = Walls(readable=installed_files(), folder="/", cpu_s=60, without=without)
        config = {**outside.config, "open": False, "writable": "/tmp", "only": only}
        request = WalledRun(walls=walls, config=json.dumps(config))
        with ForkServer(["tests.play.walled_child"], walls=namespaces) as server:
            reading, writing = os.pipe()
            with closing(server.client()) as client:
                client.start_function("tests.play.walled_child:run", (), writing, argument=encode(request), here=False)
                os.close(writing)
                with open(reading, "rb") as output:
                    answer = output.read()
        report, _, results = answer.partition(b"\n")
        return msgspec.json.decode(report, type=WallReport), json.loads(results)

    return run


def test_landlock_and_seccomp_hold_without_namespaces(
    child_results: Callable[..., tuple[WallReport, dict[str, str]]],
) -> None:
    """A container that forbids namespaces still gets most promises, and the report names the others."""
    report, results = child_results(namespaces=False)
    if not {"landlock", "seccomp"} <= set(report.guards):
        pytest.skip(f"this kernel has no Landlock, or no seccomp: {report.refused}")
    assert report.broken == ("no names and sizes of other files", "a limited number of threads")
    broken = {"threads", "other_user", "home"}
    assert {name for name, result in results.items() if result.startswith("won")} <= broken, results


def test_namespaces_hold_without_landlock_and_seccomp(
    child_results: Callable[..., tuple[WallReport, dict[str, str]]],
) -> None:
    report, results = child_results("landlock", "seccomp", only=REACHING)
    if "mounts" not in report.guards:
        pytest.skip(f"this kernel has no namespaces for users: {report.refused}")
    assert set(report.broken) == {"no marks on files that other agents see", "no processes of its own"}
    assert not {name for name in REACHING if results[name].startswith("won")}, results


@pytest.mark.parametrize("without", [("mounts", "landlock"), ("seccomp",), ("own-user",)])
def test_a_promise_without_a_guard_is_reported(without: tuple[Guard, ...]) -> None:
    guards = tuple(guard for guard in get_args(Guard) if guard not in without)
    assert broken_promises(guards)
    assert broken_promises(get_args(Guard)) == ()


def test_a_link_of_the_entrant_to_a_file_of_the_evaluator_is_left_out(tmp_path: Path) -> None:
    entrant, secret = tmp_path / "entrant", tmp_path / "split.salt"
    (entrant / "package").mkdir(parents=True)
    for file in (secret, entrant / "policy.py", entrant / "sibling.py", entrant / "package" / "__init__.py"):
        file.write_text("")
    (entrant / "salt.py").symlink_to(secret)
    (entrant / "weights.npz").symlink_to(secret)
    (entrant / "near.py").symlink_to(entrant / "sibling.py")
    assert set(modules_of(entrant)) == {
        str(entrant / name) for name in ("near.py", "package", "policy.py", "sibling.py")
    }
    options = PlayOptions(
        mission="",
        policy=f"{entrant / 'policy.py'}:A",
        policy_args={"weights": str(entrant / "weights.npz"), "own": str(entrant / "sibling.py")},
        isolate="yes",
    )
    readable = walls_of(options).readable
    assert not {str(secret), str(entrant / "weights.npz"), str(entrant)} & set(readable)
    assert str(entrant / "sibling.py") in readable
    with pytest.raises(UsageError, match="--policy-file: there is no file or folder `/missing`"):
        walls_of(PlayOptions(mission="", policy_files=("/missing",)))


@pytest.mark.parametrize("text", ["0", "-1", "1.5", "many"])
def test_a_wrong_limit_of_processor_time_is_one_message(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setenv("LINGJING_POLICY_CPU_S", text)
    with pytest.raises(UsageError, match="must be a whole number of seconds above 0"):
        walls_of(PlayOptions(mission="", isolate="yes"))


def test_strict_walls_refuse_a_kernel_that_breaks_a_promise() -> None:
    guards = tuple(guard for guard in get_args(Guard) if guard != "seccomp")
    report = WallReport(guards=guards, refused={"seccomp": "Function not implemented"})
    with pytest.raises(InfrastructureError, match=r"does not promise: .*processes of its own.*\(seccomp: Function not"):
        check_strict(report)
    check_strict(WallReport(guards=get_args(Guard)))


def test_policies_in_the_players_process_cannot_be_isolated(tmp_path: Path) -> None:
    mission = write_mission(tmp_path, 1, 2, 600.0)
    with pytest.raises(UsageError, match="in the player's own process cannot be isolated"):
        lingjing.run(mission, policy="idle", isolate="yes", overview=False)


@pytest.mark.parametrize(
    ("policy", "limit", "detail"),
    [
        (
            f"{POLICIES}:Spender",
            {"LINGJING_POLICY_CPU_S": "3"},
            "its process was killed by signal 9 (SIGKILL), as at its limit of 3 s of processor time",
        ),
        (f"{HOSTILE}:Hoarder", {"LINGJING_POLICY_MEMORY_GB": "0.5"}, "its process used more than 0.5 GB of memory"),
    ],
    ids=["processor", "memory"],
)
def test_a_policy_that_breaks_its_limit_in_its_first_call_loses_its_turns(
    tmp_path: Path, policy: str, limit: dict[str, str], detail: str
) -> None:
    record = first_decision(tmp_path, policy, "--isolate", **limit)
    assert (record.substituted, record.detail) == ("policy_error", detail)


def test_memory_that_a_policy_fills_after_its_answer_costs_its_next_turn(tmp_path: Path) -> None:
    limit = {"LINGJING_POLICY_MEMORY_GB": "0.5"}
    made = decisions(tmp_path, f"{HOSTILE}:LateHoarder", "--isolate", agents=1, turns=2, **limit)
    assert [record.detail for record in made] == ["", "its process used more than 0.5 GB of memory"]


@pytest.mark.parametrize("text", ["inf", "0", "abc"])
def test_a_wrong_limit_of_memory_is_one_message(tmp_path: Path, text: str) -> None:
    mission = write_mission(tmp_path, 1, 1, 600.0)
    done = subprocess.run(
        [sys.executable, "-m", "lingjing.cli.main", "run", str(mission), "--policy", "idle", "--no-overview"],
        cwd=tmp_path, env={**os.environ, "LINGJING_POLICY_MEMORY_GB": text}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 2 and f"LINGJING_POLICY_MEMORY_GB={text}: must be a number above 0" in done.stderr


def test_a_policy_behind_walls_cannot_record_a_model_call_that_it_has_not_made(tmp_path: Path) -> None:
    for name, options in (("open", ()), ("walled", ("--isolate",))):
        (tmp_path / name).mkdir()
        record = first_decision(tmp_path / name, f"{HOSTILE}:Inventor", *options)
        is_recorded = (tmp_path / name / "out" / CALLS).is_file()
        assert (bool(record.substituted), is_recorded) == ((False, True) if name == "open" else (True, False)), record


def test_the_description_of_the_processor_is_readable_without_its_frequency(tmp_path: Path) -> None:
    """Libraries choose their fast kernels by it."""
    record = first_decision(tmp_path, f"{HOSTILE}:Processor", "--isolate")
    lines = Path("/proc/cpuinfo").read_text().splitlines(keepends=True)
    constant = "".join(line for line in lines if "MHz" not in line)
    assert record.decision.thought == (constant + Path("/sys/devices/system/cpu/possible").read_text())[:3000]


def first_decision(folder: Path, policy: str, *options: str, **limits: str) -> Any:
    """Play one turn of an attacker. Returns its decision."""
    (record,) = decisions(folder, policy, *options, agents=1, turns=1, **limits)
    return record


def decisions(folder: Path, policy: str, *options: str, agents: int, turns: int, **limits: str) -> list[Any]:
    """Play some turns of attackers. Returns their decisions."""
    mission = write_mission(folder, agents, turns, 600.0)
    done = subprocess.run(
        [sys.executable, "-m", "lingjing.cli.main", "run", str(mission), "--no-overview", "-o", "out",
         f"--policy={policy}", *options],
        cwd=folder, env={**os.environ, **limits}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return [made for boundary in read_trace(folder / "out").boundaries for made in boundary.decisions]
