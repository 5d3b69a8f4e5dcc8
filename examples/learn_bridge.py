"""Train masked PPO on the bridge inspection, and compare it with random play on unseen seeds.

    make learners
    .venv-learners/bin/python examples/learn_bridge.py --seeds 1 2 3 --steps 30000 --out build/learn-bridge

Needs stable-baselines3, sb3-contrib and matplotlib. The folder `--out` receives each policy, `results.json` and
`curve.png`. Training plays four forks of one world with coarse motion; the evaluation plays the trained policies on
seeds that no training saw, with coarse motion and with the motion that is scored.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from sb3_contrib import MaskablePPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import SubprocVecEnv, VecMonitor

from lingjing.envs import FlatEnv

MISSION = "bi"
WORLDS = 4
UNSEEN = range(1_000_000, 1_000_050)


class Curve(BaseCallback):
    """The mean score of the latest 100 episodes after each rollout."""

    def __init__(self) -> None:
        super().__init__()
        self.points: list[dict[str, float]] = []
        self._begin_s = time.monotonic()

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        episodes = list(self.model.ep_info_buffer or [])
        if episodes:
            score = float(np.mean([episode["score"] for episode in episodes]))
            spent_s = round(time.monotonic() - self._begin_s, 1)
            self.points.append({"step": self.num_timesteps, "seconds": spent_s, "score": round(score, 4)})
            print(self.points[-1], flush=True)


def train(seed: int, steps: int, out: Path) -> tuple[MaskablePPO, list[dict[str, float]]]:
    """Return a trained model and its curve."""
    world = FlatEnv(MISSION, actions="discrete", world="inline")
    world.reset(seed=0)  # builds the city once, for all forks
    worlds = VecMonitor(SubprocVecEnv([lambda: world] * WORLDS, start_method="fork"), info_keywords=("score",))
    worlds.seed(1000 * seed)
    model = MaskablePPO(
        "MlpPolicy", worlds, n_steps=256, batch_size=256, n_epochs=6, learning_rate=1e-3, gamma=0.99, ent_coef=0.01,
        seed=seed, device="cpu",
    )  # fmt: skip
    curve = Curve()
    model.learn(steps, callback=curve)
    model.save(out / f"policy-{seed}")
    worlds.close()
    return model, curve.points


def scores(model: MaskablePPO | None, motion: Any) -> list[float]:
    """Return the scores of a model on the unseen seeds; None stands for uniform admissible decisions."""
    env = FlatEnv(MISSION, actions="discrete", world="inline", motion=motion, shaping=0.0)
    draw = np.random.default_rng(0)
    torch.manual_seed(0)
    result = []
    for seed in UNSEEN:
        observation, info = env.reset(seed=seed)
        ended = late = False
        while not (ended or late):
            mask = env.action_masks()
            if model is None:
                action = draw.choice(np.flatnonzero(mask))
            else:
                action, _ = model.predict(observation, action_masks=mask)  # sampled, as in training
            observation, _, ended, late, info = env.step(int(action))
        result.append(float(info["score"]))
    env.close()
    return result


def summary(values: list[float]) -> dict[str, float]:
    """Return the mean and the half width of its 95 % interval (normal)."""
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
    results: dict[str, Any] = {"mission": MISSION, "steps": args.steps, "runs": []}
    results["random"] = {motion: summary(scores(None, motion)) for motion in ("coarse", "full")}
    for seed in args.seeds:
        begin, cpu = time.monotonic(), sum(_cpu_s())
        model, curve = train(seed, args.steps, args.out)
        spent = {"wall_s": round(time.monotonic() - begin), "cpu_s": round(sum(_cpu_s()) - cpu)}
        unseen = {motion: summary(scores(model, motion)) for motion in ("coarse", "full")}
        results["runs"].append({"seed": seed, **spent, "unseen": unseen, "curve": curve})
        (args.out / "results.json").write_text(json.dumps(results, indent=1))
        draw_curve(results, args.out / "curve.png")
        print(seed, spent, unseen, flush=True)


def _cpu_s() -> tuple[float, float]:
    """Return the processor time of this process and of its ended children, seconds."""
    import os

    times = os.times()
    return times.user + times.system, times.children_user + times.children_system


if __name__ == "__main__":
    main()
