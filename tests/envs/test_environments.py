"""The environments pass the standard checks of their libraries, and repeat for the same seed."""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test, parallel_seed_test

import lingjing
from lingjing.bench.columns import columns
from lingjing.envs import LingjingParallelEnv, parallel_env
from lingjing.envs.vocabulary import EVENT_KINDS
from lingjing.errors import UsageError
from lingjing.testing import shipped_missions

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return the sea rescue with a budget of six ticks."""
    folder = tmp_path_factory.mktemp("missions")
    text = Path(__file__).parents[2].joinpath("scenarios", "ssr.ljs").read_text()
    file = folder / "ssr.ljs"
    short = text.replace("ticks <= 60", "ticks <= 6").replace("effects, information,", "effects,")  # tier 1 needs more
    file.write_text(short)
    return str(file)


@pytest.fixture
def env(short: str) -> Iterator[LingjingParallelEnv]:
    made = parallel_env(short, mode="broadcast", picture_width=32, world="inline")
    yield made
    made.close()


def test_the_environment_passes_the_parallel_api_test(env: LingjingParallelEnv) -> None:
    parallel_api_test(env, num_cycles=10)


def test_equal_seeds_give_equal_episodes(short: str) -> None:
    made: list[LingjingParallelEnv] = []

    def make() -> LingjingParallelEnv:
        made.append(parallel_env(short, mode="star", picture_width=0, world="inline"))
        return made[-1]

    parallel_seed_test(make, num_cycles=8)
    for each in made:
        each.close()


def test_observations_and_actions_lie_in_the_spaces(env: LingjingParallelEnv) -> None:
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


def test_a_command_is_accepted_and_makes_the_body_busy(env: LingjingParallelEnv) -> None:
    env.reset(seed=3)
    space = env.action_space("skipper")
    action = {**space.sample(), "command": 1, "message": 0, "arguments": np.array([0.1, -1.0], np.float32)}
    observations, *_ = env.step({"skipper": action})
    assert observations["skipper"]["receipt"] in (1, 2)  # accepted or running
    assert observations["skipper"]["entities"]["boat"][9] == 1.0  # busy


def test_a_message_is_in_the_inbox_of_every_other_agent_after_the_step(env: LingjingParallelEnv) -> None:
    env.reset(seed=3)
    silent = {**env.action_space("scout[1]").sample(), "command": 0, "message": 0, "to": 0}
    spoken = {**silent, "message": 2, "fields": np.zeros_like(silent["fields"])}
    sender, senders = env.possible_agents.index("scout[1]") + 1, []
    for action in (silent, spoken, silent):
        observations, *_ = env.step({"scout[1]": action})
        senders.append({name: set(observations[name]["inbox"][:, 1]) - {0.0} for name in env.possible_agents})
    silence: dict[str, set[int]] = {name: set() for name in env.possible_agents}
    assert senders == [silence, {name: set() if name == "scout[1]" else {sender} for name in silence}, silence]


@pytest.mark.parametrize(("mode", "agent"), [("broadcast", "skipper"), ("star", "commander")])
def test_gymnasiums_checker_accepts_the_environment(short: str, mode: str, agent: str) -> None:
    """The check runs for an agent with a body and for an agent that only coordinates."""
    made = gymnasium.make(
        f"lingjing/ssr-{mode}-v0", agent=agent, others="random", mission=short, world="inline", picture_width=0
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


def test_every_agent_of_every_mission_has_spaces_without_empty_parts() -> None:
    """Gymnasium's check rejects an empty part; samples of the spaces lie in them."""
    for column in columns(shipped_missions()):
        made = parallel_env(column.mission, mode=column.mode, world="inline")
        for agent in made.possible_agents:
            shown, actions = made.observation_space(agent), made.action_space(agent)
            assert all(part.spaces for part in (shown, *shown.values()) if isinstance(part, gymnasium.spaces.Dict))
            assert actions.contains(actions.sample())


WRONG = (
    None, {}, {"command": 99}, {"command": -1}, {"command": "x"}, {"arguments": np.zeros(0)}, {"arguments": None},
    {"arguments": np.full(3, np.nan)}, {"message": 9}, {"fields": np.full(1, np.nan)}, {"to": 99},
)  # fmt: skip


@pytest.mark.parametrize("wrong", WRONG, ids=str)
def test_an_invalid_action_is_a_usage_error(wrong: object, env: LingjingParallelEnv) -> None:
    space = env.action_space("skipper")
    fine = {**space.sample(), "command": 1, "message": 1, "to": 0}
    observations, _ = env.reset(seed=3)
    action = {**fine, **wrong} if wrong else wrong
    with pytest.raises(UsageError, match="an action of `skipper`"):
        env.step({"skipper": action})  # type: ignore[dict-item]
    observations, *_ = env.step({"skipper": {**fine, "arguments": np.array([-7.0, 7.0], np.float32)}})
    assert observations["skipper"]["time"][0] == 10.0  # no command before; numbers beyond the bounds are clipped
    with pytest.raises(UsageError, match="no agent is called `nobody`"):
        env.step({"nobody": fine})


def test_a_copied_environment_gives_the_same_observations(env: LingjingParallelEnv) -> None:
    copied = pickle.loads(pickle.dumps(env))
    try:
        assert copied.possible_agents == env.possible_agents
        assert copied.action_space("skipper") == env.action_space("skipper")
        (mine, _), (theirs, _) = env.reset(seed=4), copied.reset(seed=4)
        assert np.array_equal(mine["skipper"]["entities"]["boat"], theirs["skipper"]["entities"]["boat"])
    finally:
        copied.close()


def test_a_change_of_the_weather_is_observed(short: str) -> None:
    file = Path(short).with_name("front.ljs")
    front = "event front at 2 tick { weather { visibility = 800 m } }\n  success when"
    file.write_text(Path(short).read_text().replace("success when", front, 1))
    made = parallel_env(str(file), mode="broadcast", picture_width=0, world="inline")
    try:
        seen = [observed["skipper"] for observed in (made.reset(seed=3)[0], *(made.step({})[0] for _ in range(3)))]
        assert [float(shown["weather"][3]) for shown in seen] == [8000.0, 8000.0, 800.0, 800.0]
        assert [float(shown["events"][EVENT_KINDS.index("weather")]) for shown in seen] == [0.0, 0.0, 1.0, 0.0]
        assert all(shown in made.observation_space("skipper") for shown in seen)
    finally:
        made.close()


@pytest.mark.usefixtures("workers_are_interpreters_once")
def test_closing_leaves_no_process(short: str) -> None:
    made = parallel_env(short, mode="broadcast", picture_width=0, world="process")
    made.reset(seed=1)
    assert children()
    made.close()
    made.close()
    assert children() == []


_WORKER = "-m\0lingjing.kernel.world.worker\0"
"""A part of the command line of a world's process."""


def children() -> list[str]:
    """Return the running processes that this one has started."""
    workers = []
    for tasks in Path("/proc/self/task").glob("*/children"):  # a child belongs to the thread that started it
        with suppress(OSError):  # the thread has just ended, and its child
            children = tasks.read_text().split()
            workers += [child for child in children if _WORKER in Path(f"/proc/{child}/cmdline").read_text()]
    return workers


@pytest.mark.parametrize(
    "options", [{"world": "moon"}, {"picture_width": -1}, {"mode": "single"}, {"settings": {"victims": 9.0}}]
)
def test_wrong_options_are_usage_errors(options: dict[str, object]) -> None:
    with pytest.raises(UsageError):
        parallel_env("ssr", **options)


def test_an_unknown_agent_is_named() -> None:
    with pytest.raises(UsageError, match="no agent is called `captain`"):
        gymnasium.make("lingjing/ssr-broadcast-v0", agent="captain")


def test_a_vector_of_environments_runs_in_processes(short: str) -> None:
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


def test_the_load_of_a_vehicle_is_observed() -> None:
    """States have the declared name (`load`), although the name in the graph differs (`load_kg`)."""
    env = parallel_env("cd", mode="star", settings={"points": 5.0}, picture_width=0)
    try:
        seen, _ = env.reset(seed=1)
        carried = [body[-1] for name, body in seen["planner"]["entities"].items() if name.startswith("van")]
        assert carried == [200.0] * 5
    finally:
        env.close()
