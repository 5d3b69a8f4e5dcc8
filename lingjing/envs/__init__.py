"""Missions as reinforcement-learning environments: PettingZoo's parallel environment and, for one agent, Gymnasium's.

    import lingjing.envs
    env = lingjing.envs.parallel_env("ssr", mode="broadcast")
    env = gymnasium.make("lingjing.envs:lingjing/ssr-broadcast-v0", agent="skipper")

Importing this module registers every shipped mission with Gymnasium, once for each of its modes. Gymnasium loads no
entry points of packages; the module's name before an id's colon has it imported where the id is asked for.

`stepping` (an episode that decisions are put into) → `codec` (one agent's observations and actions as arrays and
back) ← `vocabulary` (which names have which number) → `environments` (the two classes). What an environment shows is
what a policy is shown, nothing more; rewards are what the score gained in the step.
"""

from __future__ import annotations

from lingjing.numerics import pin

pin()  # for what is not loaded yet

from lingjing.envs.environments import LingjingEnv, LingjingParallelEnv, parallel_env, register_missions  # noqa: E402

__all__ = ["LingjingEnv", "LingjingParallelEnv", "parallel_env", "register_missions"]

register_missions()
