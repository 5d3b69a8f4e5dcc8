"""Several worlds in one vectorised environment: forks of one environment that is ready to begin.

The forks share the compiled mission, the built city and all loaded libraries with their parent, and
begin without loading or building anything. Each runs its engines in its own process.
"""

from __future__ import annotations

import sys
from typing import Any

from gymnasium.vector import AsyncVectorEnv

from lingjing.envs.flat_environments import FlatEnv
from lingjing.errors import UsageError
from lingjing.mission.model import Mission


def flat_vector_env(mission: Mission | str, num_envs: int = 2, **options: Any) -> AsyncVectorEnv:
    """Return Gymnasium's vector environment of `num_envs` forks of a `FlatEnv`, with the options of `FlatEnv`.

    `reset(seed=s)` gives world i the seed s + i. `gymnasium.make_vec(id, num_envs,
    vectorization_mode="vector_entry_point")` returns the same.

    >>> envs = lingjing.envs.flat_vector_env("ssr", 2, mode="broadcast", agent="skipper", others="random", max_cycles=2)
    >>> observations, infos = envs.reset(seed=1)
    >>> len(observations), bool((observations[0] != observations[1]).any())
    (2, True)
    >>> envs.close()

    Raises `UsageError` for fewer than one world, and outside of Linux.
    """
    if num_envs < 1:
        raise UsageError(f"num_envs={num_envs} must be at least 1", hint="a vector environment has at least one world")
    if sys.platform != "linux":
        raise UsageError("worlds are forked on Linux (or WSL2) alone", hint="use `gymnasium.vector.SyncVectorEnv`")
    template = FlatEnv(mission, **{"world": "inline", **options})
    template.reset(seed=0)  # builds the city and loads the engines, which the forks inherit
    return AsyncVectorEnv([lambda: template] * num_envs, context="fork")


__all__ = ["flat_vector_env"]
