"""Branches of an episode with a chat model: answers come from its record up to the branch and from a real server beyond
it.
"""

from collections.abc import Iterator
from pathlib import Path

import pytest

import lingjing
from agents.tests.chat_server import NOOP, ChatServer, Reply, serve
from lingjing import Trace
from lingjing import read as read_trace
from lingjing.causal.branch_host import BranchHost
from lingjing.causal.interventions import BranchPlan
from lingjing.causal.redriven import BranchOptions
from lingjing.errors import ExitCode, UsageError
from lingjing.testing import run_command

TEXT = """\
ljs 1
use std.air { quadrotor }
use std.sensors { nadir_hd }

mission rise "One goes up" {
  goal "Go up."
  scene bay
  clock { tick = 2 s, sync = 500 ms }
  budget { ticks <= 4, policy <= 30 s, engine <= 60 s, capture <= 60 s }
  asset uav[1..2] : quadrotor {
    position = at(i, [(100 m, -700 m), (140 m, -700 m)], spread 8 m), band = 20 m..60 m
    camera nadir : nadir_hd { size = 320 by 180 }
    actions { takeoff, takePhoto }
  }
  agent scout as scout controls uav[1] { observes uav[1].*, events }
  success when distance_xy(uav[1], uav[2]) <= 0 m
}
"""
LOOK = {
    **NOOP,
    "thought": "look",
    "command": {"verb": "takePhoto", "arguments": {"camera": "nadir"}, "resource": "uav[1]"},
}
RISE = {**NOOP, "thought": "rise", "command": {"verb": "takeoff", "arguments": {}, "resource": "uav[1]"}}


@pytest.fixture(scope="module")
def server() -> Iterator[ChatServer]:
    """A service with a script: look down; after the end of the episode, rise and look down."""
    with serve([Reply(LOOK)]) as opened:
        yield opened


@pytest.fixture(scope="module")
def seen(server: ChatServer, tmp_path_factory: pytest.TempPathFactory) -> Trace:
    folder = tmp_path_factory.mktemp("rise")
    (folder / "rise.ljs").write_text(TEXT)
    report = lingjing.run(
        folder / "rise.ljs", policy="react", policy_args={"model": "m", "base_url": server.url}, overview=False,
        world="inline", out=folder / "episode",
    )  # fmt: skip
    answers = iter([RISE, LOOK])
    server.script = lambda request: Reply(next(answers))
    return read_trace(report.trace)


def options(trace: Trace, calls: str = "live") -> BranchOptions:
    return BranchOptions(trace=str(trace.path), calls=calls, referenced=())


def test_answers_are_recorded_up_to_the_branch_point_and_live_after_it(
    server: ChatServer, seen: Trace, tmp_path: Path
) -> None:
    recorded = len(server.requests)
    assert recorded == 4
    with BranchHost(seen, options(seen)) as host:
        (null,) = host.play([BranchPlan(at=4)])
        assert (null.failed, null.differs, len(server.requests)) == ("", None, recorded)
        (branch,) = host.play([BranchPlan(at=2, out=str(tmp_path / "branch"))])
    assert (branch.failed, branch.differs, branch.swayed) == ("", 3, 3)
    assert len(server.requests) == recorded + 2
    made = read_trace(branch.path)
    assert made.boundaries[:3] == seen.boundaries[:3]
    thoughts = [entry.decision.thought for record in made.boundaries for entry in record.decisions]
    assert thoughts == ["look", "look", "rise", "look"]
    prompt = str(server.requests[-2]["messages"])
    assert prompt.count("look") > 1  # the request repeats the model's own answers up to the branch


def test_a_fork_calls_no_model_without_calls_live_and_fails_without_a_record(
    server: ChatServer, seen: Trace, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recorded = len(server.requests)
    assert run_command(["fork", str(seen.path), "--at", "2"]) == ExitCode.USAGE
    printed = capsys.readouterr().err
    assert (
        "`scout` called chat models, and no answers are recorded after the branch point" in printed
        and "--calls live" in printed
    )
    alone = tmp_path / "trace.mcap"
    alone.write_bytes(seen.path.read_bytes())
    with (
        pytest.raises(UsageError, match=r"no record of model calls .`calls\.sqlite`"),
        BranchHost(seen, options(read_trace(alone))),
    ):
        pass
    assert len(server.requests) == recorded
