"""Missions behind the standard faces pass the standard checks, and say the same for the same seed."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test, parallel_seed_test

import lingjing
from lingjing.envs import LingjingParallelEnv, parallel_env
from lingjing.errors import UsageError

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The sea rescue with a budget of six ticks."""
    folder = tmp_path_factory.mktemp("missions")
    text = Path(__file__).parents[2].joinpath("scenarios", "ssr.ljs").read_text()
    file = folder / "ssr.ljs"
    file.write_text(text.replace("ticks <= 60", "ticks <= 6"))
    return str(file)


@pytest.fixture
def env(short: str) -> Iterator[LingjingParallelEnv]:
    made = parallel_env(short, mode="broadcast", picture_width=32, world="inline")
    yield made
    made.close()


def test_the_parallel_api(env: LingjingParallelEnv) -> None:
    parallel_api_test(env, num_cycles=10)


def test_seeds_repeat(short: str) -> None:
    made: list[LingjingParallelEnv] = []

    def make() -> LingjingParallelEnv:
        made.append(parallel_env(short, mode="star", picture_width=0, world="inline"))
        return made[-1]

    parallel_seed_test(make, num_cycles=8)
    for each in made:
        each.close()


def test_what_is_shown_and_taken_lies_in_the_spaces(env: LingjingParallelEnv) -> None:
    observations, _ = env.reset(seed=3)
    assert list(observations) == env.possible_agents
    score = 0.0
    while env.agents:
        for name in env.possible_agents:
            assert env.observation_space(name).contains(observations[name])
        observations, rewards, _, truncated, infos = env.step(
            {name: env.action_space(name).sample() for name in env.agents}
        )
        score += next(iter(rewards.values()))
    assert all(truncated.values())
    assert {info["tick"] for info in infos.values()} == {6}
    assert infos[env.possible_agents[0]]["score"] == pytest.approx(score)
    with pytest.raises(UsageError, match="no episode"):
        env.step({})


def test_a_command_and_a_message_arrive(env: LingjingParallelEnv) -> None:
    env.reset(seed=3)
    space = env.action_space("skipper")
    action = {**space.sample(), "command": 1, "message": 0, "arguments": np.array([0.1, -1.0, 0.0], np.float32)}
    observations, *_ = env.step({"skipper": action})
    assert observations["skipper"]["receipt"] in (1, 2)  # accepted or running
    assert observations["skipper"]["entities"]["boat"][9] == 1.0  # busy


def test_gymnasium_makes_it_and_finds_nothing_wrong(short: str) -> None:
    made = gymnasium.make(
        "lingjing/ssr-broadcast-v0", agent="skipper", others="random", mission=short, world="inline", picture_width=0
    )
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=".*(Box|infinity|render).*")
            check_env(made.unwrapped, skip_render_check=True)
    finally:
        made.close()


def test_every_shipped_mission_is_registered_in_its_modes() -> None:
    names = {name for name in gymnasium.registry if name.startswith("lingjing/")}
    missions = (Path(lingjing.__file__).parents[1] / "scenarios").glob("*.ljs")
    for file in missions:
        for mode in lingjing.compile(file).modes.allowed:
            assert f"lingjing/{file.stem}-{mode}-v0" in names


def test_an_unknown_agent_is_named() -> None:
    with pytest.raises(UsageError, match="no agent is called `captain`"):
        gymnasium.make("lingjing/ssr-broadcast-v0", agent="captain")


def test_a_vector_runs_in_processes(short: str) -> None:
    made = gymnasium.vector.AsyncVectorEnv(
        [lambda: gymnasium.make("lingjing/ssr-broadcast-v0", mission=short, agent="skipper", others="random",
                                picture_width=0, world="process")] * 2
    )  # fmt: skip
    try:
        observations, _ = made.reset(seed=5)
        assert observations["time"].shape == (2, 2)
        for _ in range(2):
            observations, *_ = made.step(made.action_space.sample())
        assert observations["time"][:, 0] == pytest.approx([20.0, 20.0])
    finally:
        made.close()
