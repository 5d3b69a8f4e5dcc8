"""The two standard environments: PettingZoo's `ParallelEnv` for a mission, Gymnasium's `Env` for one of its agents."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import EzPickle
from pettingzoo import ParallelEnv

from lingjing.data import data_path
from lingjing.dsl.loading.load import load_mission
from lingjing.envs.codec import Codec
from lingjing.envs.stepping import SteppedEpisodes
from lingjing.errors import UsageError
from lingjing.kernel.step import Published
from lingjing.kernel.world import WorldKind
from lingjing.mission.instance import Instance
from lingjing.mission.model import Mission
from lingjing.suggest import nearest_or
from lingjing.trace.records import Decision

LARGEST_SEED = 2**31 - 1
"""Exclusive bound of the seeds that are drawn when `reset` is called without a seed (chosen)."""

REACH_M = 1000.0
"""Default reach of positions in actions, metres (chosen). It is used if the mission has no public region."""


class LingjingParallelEnv(ParallelEnv, EzPickle):  # type: ignore[misc] # the package publishes no types
    """A mission for all its agents at once.

    `mission` is a compiled mission, a file or the name of a shipped mission. `picture_width` is the width of pictures
    in pixels; 0 leaves pictures out. Each step is one decision tick. The reward of every agent is the increase of the
    score (0..1) in that step.

    An engine that fails raises `InfrastructureError`; `reset` then begins a new episode. `reset(seed=…)` selects the
    instance. Without a seed it draws the next seed of the stream that the last seed started. A copy (pickled or deep)
    is a new environment with the same arguments.

    >>> env = lingjing.envs.LingjingParallelEnv("ssr", mode="star", picture_width=0, world="inline")
    >>> observations, infos = env.reset(seed=7)
    >>> sorted(observations)
    ['commander', 'scout[1]', 'scout[2]', 'scout[3]', 'skipper']
    >>> observations, rewards, ended, late, infos = env.step({})
    >>> infos["skipper"]["tick"], rewards["skipper"]
    (1, 0.0)
    >>> env.close()
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "lingjing_v0", "render_modes": []}

    def __init__(
        self,
        mission: Mission | str,
        *,
        mode: str | None = None,
        settings: Mapping[str, float] | None = None,
        tier: int = 0,
        picture_width: int = 160,
        world: WorldKind = "process",
        policy_seed: int = 0,
    ) -> None:
        EzPickle.__init__(
            self, mission, mode=mode, settings=settings, tier=tier, picture_width=picture_width, world=world,
            policy_seed=policy_seed,
        )  # fmt: skip
        self._game = SteppedEpisodes(
            mission_of(mission), mode, settings or {}, "random", world, valid_seed(policy_seed), tier=tier
        )
        self._instance = self._game.instance(0)
        self._codecs = codecs(self._instance, picture_width)
        self.possible_agents = list(self._codecs)
        self.agents: list[str] = []
        self.render_mode = None
        self._random = np.random.default_rng(0)
        self._score = 0.0

    def observation_space(self, agent: str) -> spaces.Dict:
        """Return the space of one agent's observations; every call returns the same object."""
        return self._codecs[agent].observation_space

    def action_space(self, agent: str) -> spaces.Dict:
        """Return the space of one agent's actions; every call returns the same object."""
        return self._codecs[agent].action_space

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, dict[str, Any]], dict[str, dict[str, Any]]]:
        """Begin an episode and return the observations and infos of boundary 0, by agent."""
        if seed is not None:
            self._random = np.random.default_rng(valid_seed(seed))
        number = int(self._random.integers(LARGEST_SEED)) if seed is None else seed
        self.agents = list(self.possible_agents)
        published = self._game.begin(number, self.agents)
        self._score = published.evaluation.reward
        return self._observed(published), self._infos(published)

    def step(
        self, actions: dict[str, dict[str, Any]]
    ) -> tuple[
        dict[str, dict[str, Any]], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
    ]:
        """Play one decision tick. An agent without an action does nothing.

        Raises `UsageError` if no episode is running, an agent's name is unknown or an action is no member of its space.
        """
        before = self._game.published
        if before is None or not self.agents:
            raise UsageError("the environment has no episode going on", hint="call `reset` first")
        unknown = [name for name in actions if name not in self._codecs]
        if unknown:
            hint = nearest_or(unknown[0], self.possible_agents, f"there are: {', '.join(self.possible_agents)}")
            raise UsageError(f"no agent is called `{unknown[0]}`", hint=hint)
        decisions = {
            name: self._codecs[name].decide(actions[name], before.observations[name]) if name in actions else Decision()
            for name in self.agents
        }
        published = self._game.step(decisions)
        names, gained = self.agents, published.evaluation.reward - self._score
        self._score = published.evaluation.reward
        ended = published.evaluation.done
        late = not ended and published.record.tick >= self._game.ticks
        if ended or late:
            self.agents = []
        return (
            self._observed(published),
            dict.fromkeys(names, gained),
            dict.fromkeys(names, ended),
            dict.fromkeys(names, late),
            self._infos(published),
        )

    def render(self) -> None:
        """Draw nothing: observations hold the pictures of agents, and traces hold the whole episode."""

    def close(self) -> None:
        """End the engines' processes."""
        self._game.close()

    def _observed(self, published: Published) -> dict[str, dict[str, Any]]:
        return {
            name: codec.observe(published.observations[name], published.inboxes[name])
            for name, codec in self._codecs.items()
        }

    def _infos(self, published: Published) -> dict[str, dict[str, Any]]:
        return {name: info_of(published) for name in self._codecs}


class LingjingEnv(gymnasium.Env[dict[str, Any], dict[str, Any]], EzPickle):
    """A mission for one of its agents, by default the first.

    `others` names the policy that plays the other agents. Its random streams start from `policy_seed`. The other
    arguments are those of `LingjingParallelEnv`.

    >>> env = lingjing.envs.LingjingEnv("ssr", mode="broadcast", agent="skipper", others="random", picture_width=0)
    >>> observation, info = env.reset(seed=7)
    >>> observation in env.observation_space, info["score"]
    (True, 0.0)
    >>> env.close()
    """

    metadata: dict[str, Any] = {"render_modes": []}  # declared so by the base class

    def __init__(
        self,
        mission: Mission | str,
        *,
        agent: str | None = None,
        others: str = "heuristic",
        mode: str | None = None,
        settings: Mapping[str, float] | None = None,
        tier: int = 0,
        picture_width: int = 160,
        world: WorldKind = "process",
        policy_seed: int = 0,
    ) -> None:
        EzPickle.__init__(
            self, mission, agent=agent, others=others, mode=mode, settings=settings, tier=tier,
            picture_width=picture_width, world=world, policy_seed=policy_seed,
        )  # fmt: skip
        self._game = SteppedEpisodes(
            mission_of(mission), mode, settings or {}, others, world, valid_seed(policy_seed), tier=tier
        )
        instance = self._game.instance(0)
        each = codecs(instance, picture_width)
        self.agent = agent if agent is not None else next(iter(each))
        if self.agent not in each:
            hint = nearest_or(self.agent, each, f"there are: {', '.join(each)}")
            raise UsageError(f"no agent is called `{self.agent}`", hint=hint)
        self._codec = each[self.agent]
        self.observation_space = self._codec.observation_space
        self.action_space = self._codec.action_space
        self._score = 0.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode and return the observation and info of boundary 0."""
        super().reset(seed=seed)
        number = int(self.np_random.integers(LARGEST_SEED)) if seed is None else valid_seed(seed)
        published = self._game.begin(number, {self.agent})
        self._score = published.evaluation.reward
        return self._observed(published), info_of(published)

    def step(self, action: dict[str, Any]) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Play one decision tick.

        Raises `UsageError` if no episode is running or the action is no member of its space.
        """
        before = self._game.published
        if before is None or before.evaluation.done or before.record.tick >= self._game.ticks:
            raise UsageError("the environment has no episode going on", hint="call `reset` first")
        published = self._game.step({self.agent: self._codec.decide(action, before.observations[self.agent])})
        gained, self._score = published.evaluation.reward - self._score, published.evaluation.reward
        ended = published.evaluation.done
        late = not ended and published.record.tick >= self._game.ticks
        return self._observed(published), gained, ended, late, info_of(published)

    def close(self) -> None:
        """End the engines' processes."""
        self._game.close()

    def _observed(self, published: Published) -> dict[str, Any]:
        return self._codec.observe(published.observations[self.agent], published.inboxes[self.agent])


def parallel_env(mission: Mission | str, **options: Any) -> LingjingParallelEnv:
    """Return a `LingjingParallelEnv`; PettingZoo's usual name for the constructor, with the same options.

    >>> env = lingjing.envs.parallel_env("bi", picture_width=64)
    >>> env.possible_agents
    ['inspector']
    >>> env.close()
    """
    return LingjingParallelEnv(mission, **options)


def register_missions() -> None:
    """Register every shipped mission and mode with Gymnasium, as `lingjing/ssr-broadcast-v0` and so on.

    The import of `lingjing.envs` calls it; a second call changes nothing.

    >>> lingjing.envs.register_missions()
    >>> import gymnasium
    >>> "lingjing/bi-single-v0" in gymnasium.registry, "lingjing/ssr-star-flat-v0" in gymnasium.registry
    (True, True)
    """
    for file in sorted(data_path("scenarios").glob("*.ljs")):
        for mode in ("single", "star", "broadcast"):
            name = f"lingjing/{file.stem}-{mode}-v0"
            if name not in gymnasium.registry:
                gymnasium.register(
                    id=f"lingjing/{file.stem}-{mode}-flat-v0",
                    entry_point="lingjing.envs.flat_environments:FlatEnv",
                    vector_entry_point="lingjing.envs.vectors:flat_vector_env",
                    kwargs={"mission": file.stem, "mode": mode},
                )
                gymnasium.register(
                    id=name,
                    entry_point="lingjing.envs.environments:LingjingEnv",
                    kwargs={"mission": file.stem, "mode": mode},
                )


def codecs(instance: Instance, picture_width: int) -> dict[str, Codec]:
    """Return one codec for each agent, by agent id. Raises `UsageError` for a negative `picture_width`."""
    reach = reach_of(instance)
    if picture_width < 0:
        raise UsageError(f"pictures cannot be {picture_width} pixels across", hint="`picture_width=0` leaves them out")
    return {agent.id: Codec(instance, agent, reach, picture_width) for agent in instance.agents}


def reach_of(instance: Instance) -> float:
    """Return the largest absolute coordinate of a public region, metres; `REACH_M` without one."""
    points = [point for region in instance.regions if not region.hidden for point in region.polygon]
    return max([abs(part) for point in points for part in point], default=REACH_M)


def mission_of(mission: Mission | str) -> Mission:
    """Return a compiled mission, or the one of a file or a shipped name."""
    return load_mission(mission) if isinstance(mission, str) else mission


def valid_seed(seed: int) -> int:
    """Return a seed. Raises `UsageError` for a number that is none."""
    if not 0 <= seed < 2**63:
        raise UsageError(f"{seed} is not a seed", hint="a seed is a whole number from 0 to 2**63 - 1")
    return int(seed)


def info_of(published: Published) -> dict[str, Any]:
    """Return the info of a boundary, which is the same for every agent."""
    record, evaluation = published.record, published.evaluation
    return {
        "tick": record.tick,
        "time_s": record.time_s,
        "score": evaluation.reward,
        "success": evaluation.reason == "success",
        "reason": evaluation.reason,
        "digest": record.digest,
    }
