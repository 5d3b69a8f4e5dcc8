"""Learners that run unchanged on the flat environments: `make learners` installs them and runs this file.

Each test skips if its package is not installed, and `test_every_learner_is_installed` fails then: in the environment of
`make learners` nothing may be skipped.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from lingjing.envs import FlatEnv, FlatParallelEnv, flat_parallel_env

pytestmark = pytest.mark.learners
ID = "lingjing.envs:lingjing/ssr-broadcast-flat-v0"


@pytest.mark.parametrize("package", ["stable_baselines3", "sb3_contrib", "supersuit", "ray.rllib", "torchrl", "pygame"])
def test_every_learner_is_installed(package: str) -> None:
    assert importlib.util.find_spec(package) is not None


def one_agent(**options: object) -> gymnasium.Env[object, object]:
    chosen = {"agent": "skipper", "others": "random", "world": "inline", "max_cycles": 6, **options}
    return gymnasium.make(ID, **chosen)  # type: ignore[arg-type]


def all_agents(**options: object) -> FlatParallelEnv:
    return flat_parallel_env("ssr", mode="broadcast", world="inline", max_cycles=4, **options)


@pytest.mark.parametrize("actions", ["multidiscrete", "discrete", "box"])
def test_stable_baselines_checks_and_learns(actions: str) -> None:
    sb3 = pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.env_checker import check_env

    env = one_agent(actions=actions)
    check_env(env)
    model = sb3.PPO("MlpPolicy", env, n_steps=16, batch_size=16, n_epochs=1, seed=1, device="cpu").learn(32)
    assert model.num_timesteps == 32
    env.close()


@pytest.mark.parametrize("actions", ["multidiscrete", "discrete"])
def test_masked_ppo_takes_only_admissible_actions(actions: str) -> None:
    contrib = pytest.importorskip("sb3_contrib")
    env = one_agent(actions=actions)
    model = contrib.MaskablePPO("MlpPolicy", env, n_steps=16, batch_size=16, n_epochs=1, seed=1, device="cpu").learn(32)
    observation, _ = env.reset(seed=3)
    for _ in range(4):
        mask = env.unwrapped.action_masks()  # type: ignore[attr-defined]
        action, _ = model.predict(observation, action_masks=mask)
        chosen = np.atleast_1d(action)
        sizes = env.action_space.nvec if actions == "multidiscrete" else [env.action_space.n]  # type: ignore[attr-defined]
        starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
        assert mask[starts + chosen].all()
        observation, *_ = env.step(action)
    env.close()


def test_masked_ppo_refuses_actions_without_masks() -> None:
    contrib = pytest.importorskip("sb3_contrib")
    with pytest.raises(AssertionError, match="Box"):
        contrib.MaskablePPO("MlpPolicy", one_agent(actions="box"))


def test_stable_baselines_learns_in_forked_worlds() -> None:
    sb3 = pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.vec_env import SubprocVecEnv

    env = FlatEnv("bi", world="inline", actions="discrete", max_cycles=6)
    env.reset(seed=0)
    worlds = SubprocVecEnv([lambda: env] * 2, start_method="fork")
    assert (
        sb3.PPO("MlpPolicy", worlds, n_steps=8, batch_size=16, n_epochs=1, device="cpu").learn(32).num_timesteps == 32
    )
    worlds.close()


@pytest.mark.parametrize("actions", ["discrete", "box"])
def test_supersuit_makes_all_agents_one_vector_for_ppo(actions: str) -> None:
    supersuit, sb3 = pytest.importorskip("supersuit"), pytest.importorskip("stable_baselines3")
    env = supersuit.pad_action_space_v0(supersuit.pad_observations_v0(all_agents(actions=actions)))
    env = supersuit.black_death_v3(env)
    vector = supersuit.concat_vec_envs_v1(
        supersuit.pettingzoo_env_to_vec_env_v1(env), 1, num_cpus=1, base_class="stable_baselines3"
    )
    assert vector.num_envs == 4
    sb3.PPO("MlpPolicy", vector, n_steps=8, batch_size=8, n_epochs=1, device="cpu").learn(64)
    vector.close()


def test_the_example_trains_evaluates_and_stores_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for package in ("sb3_contrib", "matplotlib"):
        pytest.importorskip(package)
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "examples")
    example = importlib.import_module("learn_bridge")
    env = example.Inspection()
    env.reset(seed=1)
    listed = {name for name, allowed in zip(env._flat.choices, env.action_masks(), strict=True) if allowed}
    assert {"uav.takeoff/1", "uav.setDestination/east"} <= listed
    assert all(name.startswith(example.DECISIONS) for name in listed)
    ended, ticks = False, 0
    while not ended:
        _, _, ended, truncated, _ = env.step(env._flat.choices.index("uav.takeoff/1"))
        ticks += 1
        assert not truncated
    assert ticks == 60
    monkeypatch.setattr(example, "UNSEEN", range(1_000_000, 1_000_002))
    monkeypatch.setattr("sys.argv", ["learn_bridge.py", "--seeds", "1", "--steps", "64", "--out", str(tmp_path)])
    example.main()
    results = json.loads((tmp_path / "results.json").read_text())
    assert [run["seed"] for run in results["runs"]] == [1]
    assert results["runs"][0]["unseen"]["full"]["episodes"] == results["random"]["coarse"]["episodes"] == 2
    assert (tmp_path / "curve.png").stat().st_size > 1000


def test_supersuit_stacks_and_clips() -> None:
    supersuit = pytest.importorskip("supersuit")
    env = supersuit.clip_reward_v0(supersuit.frame_stack_v1(supersuit.pad_observations_v0(all_agents()), 2))
    observations, _ = env.reset(seed=1)
    widths = {observation.shape for observation in observations.values()}
    assert len(widths) == 1
    env.step({name: env.action_space(name).sample() for name in env.agents})
    env.close()


def test_rllib_checks_all_agents_and_samples_one() -> None:
    pytest.importorskip("ray.rllib")
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.env.single_agent_env_runner import SingleAgentEnvRunner
    from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
    from ray.rllib.utils.pre_checks.env import check_multiagent_environments
    from ray.tune.registry import register_env

    together = ParallelPettingZooEnv(all_agents())
    check_multiagent_environments(together)
    together.close()
    register_env("lingjing", lambda _: one_agent())
    runner = SingleAgentEnvRunner(config=PPOConfig().environment("lingjing").env_runners(num_env_runners=0))
    assert sum(len(episode) for episode in runner.sample(num_timesteps=8)) >= 8
    runner.stop()


def test_torchrl_wraps_both_interfaces() -> None:
    pytest.importorskip("torchrl")
    from torchrl.envs import GymWrapper, PettingZooWrapper, check_env_specs

    for env in (GymWrapper(one_agent()), PettingZooWrapper(all_agents(), use_mask=False)):
        check_env_specs(env)
        assert env.rollout(3).shape[0] == 3
        env.close()


def test_a_window_shows_the_map(monkeypatch: pytest.MonkeyPatch) -> None:
    pygame = pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = all_agents(render_mode="human")
    env.reset(seed=1)
    assert env.render() is None
    window = env._window
    assert window is not None
    assert window._screen.get_size() == (480, 480)
    shown = np.swapaxes(pygame.surfarray.array3d(window._screen), 0, 1)
    assert len(np.unique(shown.reshape(-1, 3), axis=0)) > 3
    env.close()
    assert env._window is None
