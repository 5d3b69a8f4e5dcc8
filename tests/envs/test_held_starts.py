"""An instance that begins again starts from a copy of its world, with an equal episode."""

from __future__ import annotations

import os
import signal

import pytest

import lingjing
from lingjing.envs.stepping import SteppedEpisodes
from lingjing.kernel.world.process import ProcessWorld
from lingjing.play import selfcheck
from lingjing.plugins.policy import Action, Decision
from tests.kernel.test_world_process import await_gone

TICKS = 3
MOVES = {"flyer": "takeoff", "walker": "takePhoto"}


@pytest.fixture
def game() -> SteppedEpisodes:
    return SteppedEpisodes(lingjing.compile(str(selfcheck.MISSION)), None, {}, "random", "process")


def played(game: SteppedEpisodes, seed: int) -> list[str]:
    """Return the digests of the first boundaries, with the aircraft in the air and a picture taken."""
    agents = {agent.id: agent.role for agent in game.instance(seed).agents}
    record = game.begin(seed, agents).record
    digests = [record.digest]
    for tick in range(TICKS):
        made = {
            agent: Decision(command=Action(verb=MOVES[role])) if tick == 0 and role in MOVES else Decision()
            for agent, role in agents.items()
        }
        digests.append(game.step(made).record.digest)
    return digests


def test_a_repeated_seed_starts_from_a_copy_and_gives_the_same_episode(game: SteppedEpisodes) -> None:
    try:
        first, other, again, once_more = (played(game, seed) for seed in (5, 6, 5, 5))
        assert first == again == once_more != other
        assert isinstance(game._world, ProcessWorld)
        workers = game._world._workers
        assert workers.original is not None and workers.world is not None
        assert workers.starts is not None and len(workers.starts) == 2
        pids = [workers.original.pid, workers.world.pid, *(copy.worker.pid for copy in workers.starts._held.values())]
    finally:
        game.close()
    await_gone(pids)


def test_a_killed_copy_is_replaced_and_gives_the_same_episode(game: SteppedEpisodes) -> None:
    try:
        first = played(game, 5)
        assert isinstance(game._world, ProcessWorld) and game._world._workers.starts is not None
        (held,) = game._world._workers.starts._held.values()
        os.kill(held.worker.pid, signal.SIGKILL)
        await_gone([held.worker.pid])
        assert played(game, 5) == first == played(game, 5)
    finally:
        game.close()
