"""The cost of a policy in a process of its own: CPU of the player and of the policy's process, per turn and per start.

An agent that decides nothing is called repeatedly, with a 1080p picture: colour alone, and colour with depth and
classes. Beside it the same turn in a thread of the caller. Starting is one more process of `heuristic` from a fork
server that is there already, from the request to the answer of `reset`.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np

from lingjing.kernel.barrier import Barrier, PolicyBarrier
from lingjing.kernel.visibility import Projector
from lingjing.mission.instantiate import instantiate
from lingjing.play.options import PlayOptions, compiled
from lingjing.play.policy_processes.barrier import AgentPolicy, ProcessBarrier
from lingjing.play.policy_processes.messages import LoadPolicy
from lingjing.play.policy_processes.preloading import PRELOAD, SERVES
from lingjing.play.policy_processes.servers import OpenServer, PolicyServer, WalledServer, walls_of
from lingjing.plugins.loading import UNRECORDED
from lingjing.plugins.policy import Brief, Decision, Inbox, Observation, Picture
from lingjing.processes.fork_client import ForkServer
from lingjing.trace.images import encode_jpeg
from lingjing.trace.records import CameraPose

WARM, TURNS = 5, 100
HEIGHT, WIDTH = 1080, 1920


class Idle:
    """A policy that decides nothing."""

    async def reset(self, brief: Brief) -> None:
        """Do nothing."""

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return no command and no message."""
        return Decision()


def main() -> None:
    """Print the table: CPU milliseconds per turn, and for one more process."""
    brief = _brief()
    with _server(walls=False) as server, _server(walls=True) as walled:
        print("picture | player, process of its own | both | player, behind walls | both | in a thread")
        for name, picture in (("none", None), ("colour", _picture(False)), ("colour, depth, classes", _picture(True))):
            cells = [name]
            for kind in (server, walled):
                apart = ProcessBarrier({"a": _idle()}, 600.0, kind)
                apart.load()
                ours, theirs = _turns(apart, brief, picture)
                cells += [f"{ours:.2f}", f"{ours + theirs:.2f}"]
            here, _ = _turns(PolicyBarrier({"a": Idle()}, 600.0), brief, picture)
            print(*cells, f"{here:.2f}", sep=" | ")
        for kind, words in ((server, "process"), (walled, "process behind walls")):
            print(f"one more {words}: {_starting(kind, brief):.1f} ms of CPU, player and process")


def _turns(barrier: Barrier, brief: Brief, picture: Picture | None) -> tuple[float, float]:
    """Return the CPU milliseconds per turn of this process and of the policy's."""
    barrier.reset({"a": brief})
    pids = [process.pid for process in barrier._processes.values()] if isinstance(barrier, ProcessBarrier) else []
    pictures = (picture,) if picture is not None else ()
    for turn in range(WARM + TURNS):
        if turn == WARM:
            ours, theirs = time.process_time(), sum(map(_cpu_s, pids))
        barrier.act({"a": (Observation(agent="a", tick=turn, time_s=float(turn), pictures=pictures), Inbox())})
    spent = time.process_time() - ours, sum(map(_cpu_s, pids)) - theirs
    barrier.close()
    return spent[0] / TURNS * 1e3, spent[1] / TURNS * 1e3


def _starting(server: PolicyServer, brief: Brief, count: int = 10) -> float:
    spent = time.process_time()
    load = LoadPolicy(spec="heuristic", source="agents", arguments={}, seed=1)
    crew = ProcessBarrier({f"a{number}": AgentPolicy(load, UNRECORDED) for number in range(count)}, 600.0, server)
    crew.load()
    crew.reset({f"a{number}": brief for number in range(count)})
    whole = time.process_time() - spent + sum(_cpu_s(process.pid) for process in crew._processes.values())
    crew.close()
    return whole / count * 1e3


def _cpu_s(pid: int) -> float:
    """Return the CPU seconds of a process's first thread (`schedstat`, nanoseconds)."""
    return int(Path(f"/proc/{pid}/schedstat").read_text().split()[0]) * 1e-9


def _idle() -> AgentPolicy:
    return AgentPolicy(LoadPolicy(spec=f"{__file__}:Idle", source="", arguments={}, seed=1), UNRECORDED)


@contextmanager
def _server(*, walls: bool) -> Iterator[PolicyServer]:
    with ForkServer(SERVES, walls=walls) as started, closing(started.client()) as client:
        started.call(PRELOAD, json.dumps(["heuristic"]))
        options = PlayOptions(mission="ssr", policy=f"{__file__}:Idle", isolate="yes")
        yield WalledServer(client, walls_of(options)) if walls else OpenServer(client)


def _brief() -> Brief:
    instance = instantiate(compiled(PlayOptions(mission="ssr")), seed=1, mode=None, settings={})
    return Projector(instance).brief(instance.agents[0], ())


def _picture(whole: bool) -> Picture:
    rgb = np.random.default_rng(1).integers(0, 255, (HEIGHT // 8, WIDTH // 8, 3), np.uint8)
    rgb = np.repeat(np.repeat(rgb, 8, 0), 8, 1)
    return Picture(
        frame="f", entity="uav", camera="nadir", tick=0, time_s=0.0,
        pose=CameraPose(position=(0.0, 0.0, 50.0), heading_deg=0.0, tilt_deg=90.0),
        rgb=rgb, jpeg=encode_jpeg(rgb),
        depth=np.ones((HEIGHT, WIDTH), np.float32) if whole else None,
        semantic=np.zeros((HEIGHT, WIDTH), np.uint8) if whole else None,
    )  # fmt: skip


if __name__ == "__main__":
    main()
