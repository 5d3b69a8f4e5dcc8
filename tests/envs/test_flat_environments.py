"""The flat preset: its libraries' checks, its entries, masks and shaping, and worlds that draw nothing."""

from __future__ import annotations

import pickle
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test, parallel_seed_test

from lingjing.envs import FlatEnv, FlatParallelEnv, flat_parallel_env, flat_vector_env, parallel_env
from lingjing.errors import UsageError

pytestmark = pytest.mark.slow
DISCOUNT = 0.9


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return the sea rescue with a budget of six ticks."""
    text = Path(__file__).parents[2].joinpath("scenarios", "ssr.ljs").read_text()
    file = tmp_path_factory.mktemp("missions") / "ssr.ljs"
    short = text.replace("ticks <= 60", "ticks <= 6").replace("effects, information,", "effects,")  # tier 1 needs more
    file.write_text(short)
    return str(file)


@pytest.fixture(scope="module")
def env(short: str) -> Iterator[FlatParallelEnv]:
    made = flat_parallel_env(short, mode="broadcast", world="inline", discount=DISCOUNT, render_mode="rgb_array")
    yield made
    made.close()


def played(env: FlatParallelEnv, seed: int) -> Iterator[tuple[dict, dict, dict, dict]]:  # type: ignore[type-arg]
    for name in env.possible_agents:
        env.action_space(name).seed(seed)
    while env.agents:
        observations, rewards, ended, late, _ = env.step({name: env.action_space(name).sample() for name in env.agents})
        yield observations, rewards, ended, late


def test_the_environment_passes_the_parallel_api_test(env: FlatParallelEnv) -> None:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*render.*")
        parallel_api_test(env, num_cycles=10)


def test_equal_seeds_give_equal_episodes(short: str) -> None:
    made: list[FlatParallelEnv] = []

    def make() -> FlatParallelEnv:
        made.append(flat_parallel_env(short, mode="star", world="inline", max_cycles=3))
        return made[-1]

    parallel_seed_test(make, num_cycles=4)
    for each in made:
        each.close()


def test_gymnasiums_checker_accepts_an_id(short: str) -> None:
    made = gymnasium.make(
        "lingjing.envs:lingjing/ssr-broadcast-flat-v0", agent="skipper", others="random", mission=short,
        world="inline", render_mode="rgb_array",
    )  # fmt: skip
    try:
        check_env(made.unwrapped, skip_render_check=True)
        assert isinstance(made.observation_space, gymnasium.spaces.Box)
        assert isinstance(made.action_space, gymnasium.spaces.MultiDiscrete)
    finally:
        made.close()


def test_entries_name_each_number_of_an_observation(env: FlatParallelEnv) -> None:
    observations, _ = env.reset(seed=3)
    for name in env.possible_agents:
        entries = env.entries(name)
        assert len(entries) == len({entry.name for entry in entries}) == observations[name].shape[0]
        assert env.choices(name)[0] == "command"
        assert len(env.choices(name)) == len(env.action_space(name).nvec)
    values = dict(zip([entry.name for entry in env.entries("skipper")], observations["skipper"], strict=True))
    assert (values["time/elapsed"], values["time/left"], values["receipt/none"]) == (0.0, 1.0, 1.0)
    assert values["entities/boat/observed"] == 1.0
    assert values["entities/boat/y"] < 0.0  # it begins in the south


def test_the_shaping_is_a_telescoping_sum(env: FlatParallelEnv) -> None:
    """The discounted shaped rewards less the discounted rewards are γⁿ Φ(last) - Φ(first), whatever the actions are."""
    plain = FlatParallelEnv(env._instance.mission, mode="broadcast", world="inline", shaping=0.0, max_cycles=6)
    try:
        for seed in (1, 2):
            env.reset(seed=5)
            plain.reset(seed=5)
            first = env._before
            assert -1.0 <= first < 0.0
            shaped = [next(iter(rewards.values())) for _, rewards, _, _ in played(env, seed)]
            unshaped = [next(iter(rewards.values())) for _, rewards, _, _ in played(plain, seed)]
            assert len(shaped) == len(unshaped) == 6
            extra = sum(DISCOUNT**k * (a - b) for k, (a, b) in enumerate(zip(shaped, unshaped, strict=True)))
            assert extra == pytest.approx(DISCOUNT**6 * env._before - first, abs=1e-9)
            assert any(a != b for a, b in zip(shaped, unshaped, strict=True))
    finally:
        plain.close()


def test_an_episode_is_truncated_after_max_cycles(short: str) -> None:
    made = flat_parallel_env(short, mode="broadcast", world="inline", max_cycles=2)
    try:
        made.reset(seed=1)
        *_, (_, _, ended, late) = played(made, 1)
        assert all(late.values())
        assert not any(ended.values())
        with pytest.raises(UsageError, match="no episode"):
            made.step({})
    finally:
        made.close()


def test_commands_of_a_busy_body_are_masked(env: FlatParallelEnv) -> None:
    env.reset(seed=3)
    space = env.action_space("skipper")
    commands = int(space.nvec[0])
    assert env.action_mask("skipper").all()
    action = np.zeros_like(space.nvec)
    action[0] = 1
    _, _, _, _, infos = env.step({"skipper": action})
    mask = infos["skipper"]["action_mask"]
    assert mask.shape == (sum(space.nvec),)
    assert mask[0]
    assert not mask[1:commands].all()
    assert mask[commands:].all()


def test_the_environment_has_a_state_and_a_rendered_map_and_can_be_copied(env: FlatParallelEnv) -> None:
    env.reset(seed=3)
    assert env.state() in env.state_space
    picture = env.render()
    assert picture is not None
    assert (picture.shape, picture.dtype) == ((480, 480, 3), np.uint8)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 3
    copied = pickle.loads(pickle.dumps(env))
    try:
        assert copied.action_space("skipper") == env.action_space("skipper")
    finally:
        copied.close()


def test_boxes_without_drawing_are_near_the_drawn_boxes() -> None:
    """The front camera sees the damage of the bridge, drawn or not, at the same place."""
    boxes = {}
    for drawn in (False, True):
        made = FlatParallelEnv("bi", world="inline", drawn=drawn, max_cycles=3, shaping=0.0)
        try:
            made.reset(seed=1)
            agent = made.possible_agents[0]
            for verb in ("takeoff", "takePhoto", "takePhoto"):
                action = np.array([5 if name.startswith("arguments") else 0 for name in made.choices(agent)])
                commands = made._codecs[agent].commands
                action[0] = next(number for number, command in enumerate(commands, 1) if command[1] == verb)
                observations, *_ = made.step({agent: action})
            published = made._game.published
            assert published is not None
            seen = {box.entity: box.box for info in published.record.frames for box in info.boxes}
            boxes[drawn] = seen["fracture"]
            values = dict(zip([entry.name for entry in made.entries(agent)], observations[agent], strict=True))
            assert values["seen/uav/front/0/present"] == 1.0
            assert values["seen/uav/front/0/left"] == pytest.approx(seen["fracture"][0], abs=1e-6)
        finally:
            made.close()
    assert boxes[False] == pytest.approx(boxes[True], abs=0.03)


WRONG = [
    {"max_cycles": 0}, {"shaping": -1.0}, {"shaping": float("nan")}, {"discount": 1.5}, {"render_mode": "movie"},
    {"world": "moon"}, {"mode": "loud"}, {"motion": "slow"}, {"actions": "discret"},
]  # fmt: skip


@pytest.mark.parametrize("options", WRONG, ids=str)
def test_wrong_options_are_usage_errors(options: dict[str, object]) -> None:
    with pytest.raises(UsageError):
        flat_parallel_env("ssr", **options)


def test_wrong_names_and_actions_are_usage_errors(env: FlatParallelEnv) -> None:
    with pytest.raises(UsageError, match="no agent is called `captain`"):
        FlatEnv("ssr", mode="broadcast", agent="captain")
    env.reset(seed=1)
    with pytest.raises(UsageError, match="no agent is called `skiper`"):
        env.step({"skiper": env.action_space("skipper").sample()})
    for wrong in (3, None, [99] * len(env.choices("skipper")), np.full(len(env.choices("skipper")), np.nan)):
        with pytest.raises(UsageError, match="is no action"):
            env.step({"skipper": wrong})


NAMES = {"none", "uav.takeoff/0.5", "uav.setDestination/north", "uav.takePhoto/front", "uav.stop", "say/finding"}


def choose(env: FlatEnv, name: str) -> int:
    return env.choices.index(name)


def test_discrete_decisions_win_the_bridge_inspection() -> None:
    """Take off, fly east, go to what the camera shows and report it: four of the listed decisions win the mission."""
    env = FlatEnv("bi", world="inline", actions="discrete", shaping=0.0)
    try:
        _, info = env.reset(seed=1)
        assert set(env.choices) >= NAMES
        assert isinstance(env.action_space, gymnasium.spaces.Discrete)
        assert env.action_space.n == len(env.choices) == len(info["action_mask"])
        report = choose(env, "say/finding")
        assert not info["action_mask"][report]  # no box yet
        total, ended, late = 0.0, False, False
        plan = ["uav.takeoff/0.5"]
        while not (ended or late):
            mask = env.action_masks()
            if not plan:
                plan = ["say/finding", "uav.setDestination/seen"] if mask[report] else ["uav.setDestination/east"]
            number = choose(env, plan.pop())
            _, reward, ended, late, info = env.step(number if mask[number] else 0)
            total += reward
        assert (env.reason, info["success"]) == ("success", True)
        assert total == pytest.approx(info["score"])
        assert len(env.digest) == 64
    finally:
        env.close()


def test_infos_contain_only_numbers(env: FlatParallelEnv) -> None:
    _, infos = env.reset(seed=1)
    assert {np.asarray(value).dtype.kind for info in infos.values() for value in info.values()} <= set("biuf")


def test_an_impossible_choice_has_no_effect() -> None:
    env = FlatEnv("bi", world="inline", actions="discrete")
    try:
        _, info = env.reset(seed=3)
        names = [entry.name for entry in env.entries]
        number = choose(env, "uav.setDestination/seen")
        assert not info["action_mask"][number]
        observation, *_ = env.step(number)
        assert observation[names.index("entities/uav/busy")] == 0.0
        assert observation[names.index("receipt/none")] == 1.0
        observation, _, _, _, info = env.step(choose(env, "uav.takeoff/1"))
        assert observation[names.index("entities/uav/busy")] == 1.0
        possible = {name for name, allowed in zip(env.choices, info["action_mask"], strict=True) if allowed}
        assert possible == {"none", "uav.stop"}
    finally:
        env.close()


def test_a_box_action_is_divided_into_intervals_and_has_no_mask() -> None:
    env = FlatEnv("bi", world="inline", actions="box")
    try:
        _, info = env.reset(seed=3)
        assert "action_mask" not in info
        with pytest.raises(UsageError, match="has no mask"):
            env.action_masks()
        names = [entry.name for entry in env.entries]
        action = np.full(env.action_space.shape or (), -1.0, np.float32)
        assert env.step(action)[0][names.index("receipt/none")] == 1.0  # the first interval commands nothing
        action[:2] = -0.8, 1.0  # takeoff to the top of the band
        observation, *_ = env.step(action)
        assert observation[names.index("entities/uav/busy")] == 1.0
        with pytest.raises(UsageError, match="is no action"):
            env.step(np.full(3, 0.0, np.float32))
    finally:
        env.close()


def test_full_motion_gives_the_episode_of_the_other_environments(short: str) -> None:
    """Drawn and with full motion, the flat environment plays the episode that the other environments play."""
    digests = []
    for options in ({"drawn": True, "motion": "full"}, {"drawn": True, "motion": "coarse"}):
        env = flat_parallel_env(short, mode="broadcast", world="inline", max_cycles=1, **options)
        env.reset(seed=4)
        env.step({})
        digests.append(env.digest)
        env.close()
    other = parallel_env(short, mode="broadcast", world="inline", picture_width=0)
    other.reset(seed=4)
    infos = other.step({})[-1]
    other.close()
    assert infos["skipper"]["digest"] == digests[0] != digests[1]


def test_forked_worlds_give_the_episodes_of_their_seeds(short: str) -> None:
    options = {"mode": "broadcast", "agent": "skipper", "others": "random", "max_cycles": 3}
    worlds = gymnasium.make_vec(
        "lingjing.envs:lingjing/ssr-broadcast-flat-v0", num_envs=3, vectorization_mode="vector_entry_point",
        mission=short, **options,
    )  # fmt: skip
    alone = FlatEnv(short, world="inline", **options)
    try:
        observations, _ = worlds.reset(seed=5)
        actions = np.zeros((3, len(alone.choices)), np.int64)
        after, rewards, *_ = worlds.step(actions)
        for number in range(3):
            first, _ = alone.reset(seed=5 + number)
            second, reward, *_ = alone.step(actions[number])
            assert np.array_equal(first, observations[number])
            assert np.array_equal(second, after[number])
            assert reward == pytest.approx(rewards[number])
    finally:
        worlds.close()
        alone.close()
    with pytest.raises(UsageError, match="at least one world"):
        flat_vector_env(short, 0)


def test_a_missing_window_package_is_a_usage_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(UsageError, match="needs the package pygame"):
        flat_parallel_env("ssr", mode="broadcast", render_mode="human")
