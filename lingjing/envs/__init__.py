"""Reinforcement-learning environments of missions: PettingZoo's `ParallelEnv` and, for one agent, Gymnasium's `Env`.

    import lingjing.envs
    env = lingjing.envs.parallel_env("ssr", mode="broadcast")
    env = gymnasium.make("lingjing.envs:lingjing/ssr-broadcast-v0", agent="skipper")

An environment steps one episode of a mission at a time. Its observations hold exactly what a policy of the same agent
observes. The reward of a step is the increase of the mission's score in that step.

Importing this module registers every shipped mission with Gymnasium, once for each of its modes. Gymnasium loads no
entry points of packages. It imports the module that stands before the colon of an id, so ids begin with
`lingjing.envs:`.

Modules:

- `environments`: the two environment classes and their registration.
- `flat_environments`: the flat preset, for learners of vectors ← `flat` (its spaces), `choices` (whole decisions as
  a list), `shaping` (its reward), `outlines` (its cameras, which draw nothing), `map_picture` (for `render`).
- `vectors`: several worlds, forked from one flat environment.
- `stepping`: an episode with decisions from the caller.
- `codec`: one agent's observations and actions as arrays.
- `vocabulary`: the numbers that stand for names in these arrays.
"""

from __future__ import annotations

from lingjing.numerics import pin

pin()  # before numpy is imported: the number of threads is read at import

from lingjing.envs.environments import LingjingEnv, LingjingParallelEnv, parallel_env, register_missions  # noqa: E402
from lingjing.envs.flat_environments import FlatEnv, FlatParallelEnv, flat_parallel_env  # noqa: E402
from lingjing.envs.vectors import flat_vector_env  # noqa: E402

__all__ = [
    "FlatEnv", "FlatParallelEnv", "LingjingEnv", "LingjingParallelEnv", "flat_parallel_env", "flat_vector_env",
    "parallel_env", "register_missions",
]  # fmt: skip

register_missions()
