"""Train masked PPO on the bridge inspection, and compare it with random play on unseen seeds.

    make learners
    .venv-learners/bin/python examples/learn_bridge.py --out build/learn-bridge

Needs stable-baselines3, sb3-contrib and matplotlib. The folder `--out` receives each policy, `results.json` and
`curve.png`. Training plays eight forks of one world with coarse motion. It ends when the mean score of the latest 100
episodes reaches 0.95, at the latest after `--steps` ticks. The evaluation plays seeds that no training used, with
coarse motion and with the motion that is scored.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from sb3_contrib import MaskablePPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import SubprocVecEnv, VecMonitor

from lingjing.envs import FlatEnv

MISSION = "bi"
WORLDS = 8
UNSEEN = range(1_000_000, 1_000_050)
SOLVED = 0.95
DECISIONS = ("uav.takeoff/1", "uav.up/1", "uav.setDestination/", "say/")
"""The beginnings of the names of the decisions that the policy may take: to the top of the band, to places, reports."""


class Inspection(gymnasium.Wrapper[Any, Any, Any, Any]):
    """The flat environment with fewer decisions, and with the end of the budget as an end of the task.

    The observation holds the ticks left, so that the end of the budget is an ordinary end: a learner that continues the
    value beyond it takes the reward for coming near away again (Pardo et al., "Time limits in reinforcement learning",
    ICML 2018).
    """

    def __init__(self, motion: Any = "coarse", shaping: float = 1.0) -> None:
        env = FlatEnv(MISSION, actions="discrete", world="inline", motion=motion, shaping=shaping)
        super().__init__(env)
        self._flat = env
        self._listed = np.array([name.startswith(DECISIONS) for name in env.choices])

    def action_masks(self) -> Any:
        """Return the listed decisions that are possible now; if there are none, `none`."""
        possible = self._flat.action_masks()
        listed = possible & self._listed
        return listed if listed.any() else possible

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Play one tick. `truncated` is always False."""
        observation, reward, ended, late, info = self.env.step(action)
        return observation, float(reward), ended or late, False, info


class Curve(BaseCallback):
    """The mean score of the latest 100 episodes after each rollout; ends the training when it reaches `SOLVED`."""

    def __init__(self) -> None:
        super().__init__()
        self.points: list[dict[str, float]] = []
        self._begin_s = time.monotonic()

    def _on_step(self) -> bool:
        return not self.points or self.points[-1]["score"] < SOLVED

    def _on_rollout_end(self) -> None:
        episodes = list(self.model.ep_info_buffer or [])
        if episodes:
            score = float(np.mean([episode["score"] for episode in episodes]))
            spent_s = round(time.monotonic() - self._begin_s, 1)
            self.points.append({"step": self.num_timesteps, "seconds": spent_s, "score": round(score, 4)})
            print(self.points[-1], flush=True)


def train(world: Inspection, seed: int, steps: int, out: Path) -> tuple[MaskablePPO, list[dict[str, float]]]:
    """Return a trained model and its curve."""
    worlds = VecMonitor(SubprocVecEnv([lambda: world] * WORLDS, start_method="fork"), info_keywords=("score",))
    worlds.seed(1000 * seed)
    model = MaskablePPO(
        "MlpPolicy", worlds, n_steps=64, batch_size=128, n_epochs=8, learning_rate=1e-3, gamma=0.99, ent_coef=0.01,
        seed=seed, device="cpu",
    )  # fmt: skip
    curve = Curve()
    model.learn(steps, callback=curve)
    model.save(out / f"policy-{seed}")
    worlds.close()
    return model, curve.points


def played(seed: int) -> float:
    """Return the score of one episode; without a model, of uniform decisions among those that the model may take."""
    env, model = _PLAYERS[-1]
    draw = np.random.default_rng(seed)
    torch.manual_seed(seed)
    observation, info = env.reset(seed=seed)
    ended = False
    while not ended:
        mask = env.action_masks()
        if model is None:
            action = draw.choice(np.flatnonzero(mask))
        else:
            action, _ = model.predict(observation, action_masks=mask)  # sampled, as in training
        observation, _, ended, _, info = env.step(int(action))
    return float(info["score"])


_PLAYERS: list[tuple[Inspection, MaskablePPO | None]] = []
"""The environment and model of the present evaluation; its processes inherit them."""


def evaluated(env: Inspection, model: MaskablePPO | None) -> dict[str, float]:
    """Return the mean score on the unseen seeds, and the half width of its 95 % interval (normal)."""
    _PLAYERS.append((env, model))
    with multiprocessing.get_context("fork").Pool(WORLDS) as pool:
        values = pool.map(played, UNSEEN, chunksize=1)
    half = 1.96 * float(np.std(values, ddof=1)) / len(values) ** 0.5
    return {"mean": round(float(np.mean(values)), 4), "half_width_95": round(half, 4), "episodes": len(values)}


def draw_curve(results: dict[str, Any], path: Path) -> None:
    """Write the curves of all seeds and the interval of random play."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.subplots()
    for run in results["runs"]:
        points = run["curve"]
        axes.plot([p["step"] for p in points], [p["score"] for p in points], label=f"seed {run['seed']}")
    chance = results["random"]["coarse"]
    low, high = chance["mean"] - chance["half_width_95"], chance["mean"] + chance["half_width_95"]
    axes.axhspan(low, max(high, low + 0.004), color="grey", alpha=0.5, label="random play, 95 % interval")
    axes.set(xlabel="ticks played in training", ylabel="score, mean of 100 episodes", ylim=(-0.02, 1.02))
    axes.legend(loc="upper left")
    figure.savefig(path, dpi=110)


def main() -> None:
    """Train, evaluate and store."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--steps", type=int, default=30_000)
    parser.add_argument("--out", type=Path, default=Path("build/learn-bridge"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    unseen = {motion: Inspection(motion, shaping=0.0) for motion in ("coarse", "full")}
    world = Inspection()
    for env in (world, *unseen.values()):
        env.reset(seed=0)  # builds the city once, for all forks
    results: dict[str, Any] = {"mission": MISSION, "steps": args.steps, "random": {}, "runs": []}
    models = []
    for seed in args.seeds:
        begin, cpu = time.monotonic(), _cpu_s()
        model, curve = train(world, seed, args.steps, args.out)
        spent = {"wall_s": round(time.monotonic() - begin), "cpu_s": round(_cpu_s() - cpu)}
        results["runs"].append({"seed": seed, "ticks": model.num_timesteps, **spent, "unseen": {}, "curve": curve})
        models.append(model)
        (args.out / "results.json").write_text(json.dumps(results, indent=1))
        print(seed, spent, flush=True)
    for motion, env in unseen.items():
        results["random"][motion] = evaluated(env, None)
        for run, model in zip(results["runs"], models, strict=True):
            run["unseen"][motion] = evaluated(env, model)
            print(motion, run["seed"], run["unseen"][motion], "random", results["random"][motion], flush=True)
        (args.out / "results.json").write_text(json.dumps(results, indent=1))
        draw_curve(results, args.out / "curve.png")


def _cpu_s() -> float:
    """Return the processor time of this process and of its ended children, seconds."""
    return sum(os.times()[:4])


if __name__ == "__main__":
    main()
