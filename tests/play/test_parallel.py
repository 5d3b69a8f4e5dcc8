"""Episodes that are forked from one process: bit for bit equal to those of fresh processes, and isolated."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from lingjing import PlayOptions
from lingjing.cli.results import print_error_json
from lingjing.errors import ExitCode, InfrastructureError, UsageError, error_of
from lingjing.play import selfcheck
from lingjing.play.parallel import EpisodeProcesses, EpisodeTask, play_apart
from lingjing.play.report import EpisodeError
from lingjing.trace.writer import trace_removed_error
from tests.kernel.test_world_process import await_gone
from tests.play.report_kit import ABORTED

PLAYER = """
import os, signal
from pathlib import Path
import numpy as np
import lingjing.engines.road.engine as road
from lingjing.plugins.policy import Action, Decision

HERE = Path({folder!r})
Path(HERE, f"loaded-{{os.getpid()}}").write_text(str(float(np.random.random())))
if hasattr(road, "tainted") or "TAINTED" in os.environ:
    Path(HERE, "tainted").touch()
road.tainted = os.environ["TAINTED"] = "by an episode"
road.RoadEngine.advance = None  # in this process; the world is another one

def children(pid):
    return [int(one) for one in Path(f"/proc/{{pid}}/task/{{pid}}/children").read_text().split()]

def holders():
    layers = [one for one in children(os.getppid()) if children(one)]
    return [one for layer in layers for one in children(layer) if children(one)]

class Player:
    def __init__(self, fatal="no"):
        self.fatal = fatal

    async def reset(self, brief):
        self.role = brief.role
        Path(HERE, f"server-{{os.getppid()}}").touch()

    async def act(self, observation, inbox):
        if self.role == "flyer" and observation.tick == 0:
            for pid in holders():
                Path(HERE, f"holder-{{pid}}").open("a").write(f"{{os.getpid()}}\\n")
        if self.role == "flyer" and observation.tick == 1 and self.fatal == "yes":
            os.kill(os.getppid(), signal.SIGKILL)
        if self.role == "flyer" and observation.tick == 1 and self.fatal == "holder":
            os.kill(*holders(), signal.SIGKILL)
        if self.role == "flyer" and observation.tick == 0:
            return Decision(command=Action(verb="takeoff"))
        if self.role == "walker" and observation.tick == 0:
            return Decision(command=Action(verb="takePhoto"))
        return Decision()
"""


def mission(folder: Path) -> Path:
    """Write the mission of the self-check with three ticks; its place is so near that they are not proved too few."""
    text = selfcheck.MISSION.read_text(encoding="utf-8")
    for old, new in (("ticks <= 6,", "ticks <= 3,"), ("position = (0 m, 60 m)", "position = (0 m, -30 m)")):
        assert old in text
        text = text.replace(old, new)
    file = folder / "selfcheck.ljs"
    file.write_text(text, encoding="utf-8")
    return file


def player(folder: Path) -> str:
    file = folder / "player.py"
    file.write_text(PLAYER.format(folder=str(folder)))
    return f"{file}:Player"


def tasks(folder: Path, policy: str, seeds: tuple[int, ...]) -> list[EpisodeTask]:
    return [
        EpisodeTask(
            PlayOptions(mission=str(mission(folder)), policy=policy, seed=seed, policy_seed=number, overview=False),
            folder / f"run-{number}",
        )
        for number, seed in enumerate(seeds)
    ]


def fresh(task: EpisodeTask) -> tuple[str, str, str]:
    """The same episode in processes of its own, none of them forked from another that has played."""
    command = [*task.command()[:-2], str(task.folder) + "-fresh", "--json"]
    options = json.dumps({"mission": task.options.mission, "policy": task.options.policy, "seed": task.options.seed,
                          "policy_seed": task.options.policy_seed, "overview": False})  # fmt: skip
    done = subprocess.run(command, input=options, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    return report["digest"], report["frames_digest"], report["reason"]


@pytest.fixture(scope="module")
def processes() -> Iterator[EpisodeProcesses]:
    """The process from which two tests fork their episodes."""
    with EpisodeProcesses() as started:
        yield started


@pytest.mark.slow
@pytest.mark.usefixtures("workers_are_interpreters_once")
def test_forked_episodes_equal_those_of_fresh_processes_and_are_isolated(
    processes: EpisodeProcesses, tmp_path: Path
) -> None:
    episodes = tasks(tmp_path, player(tmp_path), (3, 4, 3))
    played = {task.folder: report for task, report in processes.play(episodes, jobs=1)}
    first, other, again = (played[task.folder] for task in episodes)
    results = [(report.digest, report.frames_digest, report.reason) for report in (first, other, again)]
    assert first.frames_digest
    assert results[0] == results[2] != results[1]
    assert first.withdrawn == ()
    assert fresh(episodes[1]) == results[1]
    assert not (tmp_path / "tainted").exists()
    users = sorted(len(path.read_text().split()) for path in tmp_path.glob("holder-*"))
    assert users == [1, 2], "the worlds of one instance are forks of one holder"
    loaded = {path.name.partition("-")[2]: path.read_text() for path in tmp_path.glob("loaded-*")}
    assert len(loaded) == 4 * 3 + 2, "a process for each agent, and one in each run that reads the declaration"
    streams = 3 * 3 + 1  # the fresh episode has the modules of the second
    assert len(set(loaded.values())) == streams, "global random streams start from policy seed and agent"
    servers = {path.name.partition("-")[2] for path in tmp_path.glob("server-*")}
    assert not servers & set(loaded), "a policy was loaded in the process that episodes are forked from"


def test_the_server_imports_and_prepares_everything_before_the_fork(tmp_path: Path) -> None:
    """The server imports and makes everything once, or each episode does: asyncio, protobuf and schemas took 0.15 s."""
    script = f"""
import sys
from importlib import import_module
from lingjing.play.parallel import PLAYED_WITH
for name in PLAYED_WITH:
    import_module(name)
from lingjing.play.sharing import share
share('{{"options": {{"mission": "ssr", "policy": "random"}}}}')
from lingjing.trace.schemas import schema_text
before, made = set(sys.modules), schema_text.cache_info().misses
from lingjing.play.episode import Session
class Begun(Exception):
    pass
def begun(progress):
    raise Begun
try:
    Session().run("ssr", policy="random", world="inline", overview=False, out={str(tmp_path / "run")!r}, progress=begun)
except Begun:
    new = {{name for name in set(sys.modules) - before if not name.startswith("lingjing_agents")}}
    print(sorted(new & {{"asyncio", "google.protobuf", "foxglove_schemas_protobuf"}}))
    ours = {{name for name in new if name.startswith(("lingjing.kernel", "lingjing.trace", "lingjing.play"))}}
    print(sorted(name for name in ours if not name.startswith("lingjing.kernel.world")))  # those are the workers'
    print(schema_text.cache_info().misses - made)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["[]", "[]", "0"], done.stderr


@pytest.mark.usefixtures("workers_are_interpreters_once")
@pytest.mark.thorough
def test_a_killed_holder_is_an_abort_of_its_episode_and_the_next_has_a_world_of_its_own(tmp_path: Path) -> None:
    first, second = tasks(tmp_path, player(tmp_path), (3, 3))
    first = first._replace(options=replace(first.options, policy_args={"fatal": "holder"}))
    played = {task.folder: report for task, report in play_apart([first, second], jobs=1)}
    assert played[first.folder].reason == ABORTED
    assert played[first.folder].detail.startswith("the world process died")
    assert played[first.folder].cause == "world-process"
    assert played[second.folder].reason == "budget"
    holders = [int(path.name.partition("-")[2]) for path in tmp_path.glob("holder-*")]
    await_gone(holders)


@pytest.mark.usefixtures("workers_are_interpreters_once")
def test_an_instance_that_is_played_once_has_no_holder(processes: EpisodeProcesses, tmp_path: Path) -> None:
    episodes = [task._replace(repeated=False) for task in tasks(tmp_path, player(tmp_path), (5,))]
    ((_, report),) = processes.play(episodes, jobs=1)
    assert report.reason == "budget"
    assert not list(tmp_path.glob("holder-*"))


@pytest.mark.usefixtures("workers_are_interpreters_once")
def test_a_killed_server_is_an_abort_of_its_episode_and_the_next_is_played(tmp_path: Path) -> None:
    first, second = tasks(tmp_path, player(tmp_path), (3, 4))
    first = first._replace(options=replace(first.options, policy_args={"fatal": "yes"}))
    played = {task.folder: report for task, report in play_apart([first, second], jobs=1)}
    aborted, whole = played[first.folder], played[second.folder]
    assert (aborted.reason, aborted.detail) == (ABORTED, "the process that it was forked from was killed")
    assert (aborted.cause, whole.cause) == ("episode-server", "")
    assert whole.reason == "budget", whole.detail
    servers = [int(path.name.partition("-")[2]) for path in tmp_path.glob("server-*")]
    assert len(servers) == 2
    await_gone(servers)


def test_the_error_of_a_child_keeps_message_and_hint_apart(tmp_path: Path) -> None:
    (task,) = tasks(tmp_path, "heuristic", (3,))
    wrong = task._replace(options=replace(task.options, calls="replay", calls_from="words\nhint: of a name"))
    with pytest.raises(UsageError) as caught:
        list(play_apart([wrong], jobs=1))
    alone = subprocess.run(wrong.command(), input=msgspec.json.encode(wrong.options), capture_output=True, check=False)
    printed = msgspec.json.decode(alone.stdout, type=EpisodeError)
    assert alone.returncode == ExitCode.USAGE
    assert (str(caught.value), caught.value.hint) == (printed.message, printed.hint)
    assert "hint: of a name" in printed.message and (printed.hint, printed.cause) == ("", "")


def test_an_infrastructure_error_of_a_child_keeps_its_cause(tmp_path: Path) -> None:
    printed = tmp_path / "printed"
    with printed.open("w") as output, contextlib.redirect_stdout(output):
        print_error_json(trace_removed_error(Path("trace.mcap.part")))
    error = msgspec.json.decode(printed.read_bytes(), type=EpisodeError)
    again = error_of(ExitCode.INFRASTRUCTURE, error.message, error.hint, error.cause)
    assert isinstance(again, InfrastructureError) and again.cause == "trace"
    assert (str(again), again.hint) == (error.message, error.hint)
