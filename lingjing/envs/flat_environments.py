"""The flat preset: environments that learners of fixed vectors accept, such as those of Stable-Baselines3.

An observation is one `Box` in [-1, 1] with named entries, an action one `MultiDiscrete`, `Discrete` or `Box`. Cameras
give ids and boxes alone (`outlines`), and observations hold the largest boxes, as from a perfect detector.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.utils import EzPickle
from pettingzoo import ParallelEnv

from lingjing.envs.choices import Sight
from lingjing.envs.environments import LARGEST_SEED, codecs, info_of, mission_of, reach_of, valid_seed
from lingjing.envs.flat import Actions, Entry, FlatCodec, Vector
from lingjing.envs.map_picture import MapWindow, map_picture
from lingjing.envs.shaping import TargetPotential, shaped
from lingjing.envs.stepping import Motion, SteppedEpisodes
from lingjing.errors import UsageError
from lingjing.kernel.step import Published
from lingjing.kernel.world import WorldKind
from lingjing.mission.model import Mission
from lingjing.suggest import nearest_or
from lingjing.trace.records import BodyState, Decision

_STATE = ("present", "x", "y", "z", "vx", "vy", "vz", "heading_sine", "heading_cosine")
"""The numbers of each entity in `state`."""


class FlatParallelEnv(ParallelEnv, EzPickle):  # type: ignore[misc] # the package publishes no types
    """A mission for all its agents at once, in flat spaces. A step is one decision tick.

    `max_cycles` ends an episode after that many ticks (`truncated`), if its budget is not used up before. `shaping` is
    the weight of the potential-based reward, with `discount` as its γ; 0 leaves it out. With `drawn`, the camera draws
    every picture and boxes are those of visible pixels. `motion="full"` is the motion that is scored. `actions` is the
    form of an action: `multidiscrete`, `discrete` (a list of whole decisions, `lingjing.envs.choices`) or `box`.
    `render_mode="rgb_array"` makes `render` return a map, `"human"` shows it in a window.

    Infos hold numbers alone, which wrappers turn into arrays; `reason` and `digest` hold the texts.

    >>> env = lingjing.envs.flat_parallel_env("ssr", mode="broadcast", max_cycles=2, world="inline")
    >>> observations, infos = env.reset(seed=1)
    >>> observations["skipper"].dtype, float(abs(observations["skipper"]).max()) <= 1.0
    (dtype('float32'), True)
    >>> env.action_space("skipper").shape == env.action_space("skipper").sample().shape
    True
    >>> env.close()
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "lingjing_flat_v0", "render_modes": ["rgb_array", "human"], "render_fps": 2, "is_parallelizable": True
    }  # fmt: skip

    def __init__(
        self,
        mission: Mission | str,
        *,
        mode: str | None = None,
        settings: Mapping[str, float] | None = None,
        tier: int = 0,
        world: WorldKind = "process",
        policy_seed: int = 0,
        max_cycles: int | None = None,
        shaping: float = 1.0,
        discount: float = 0.99,
        drawn: bool = False,
        motion: Motion = "coarse",
        actions: Actions = "multidiscrete",
        render_mode: str | None = None,
        others: str = "random",
    ) -> None:
        EzPickle.__init__(
            self, mission, mode=mode, settings=settings, tier=tier, world=world, policy_seed=policy_seed,
            max_cycles=max_cycles, shaping=shaping, discount=discount, drawn=drawn, motion=motion, actions=actions,
            render_mode=render_mode, others=others,
        )  # fmt: skip
        _check(max_cycles, shaping, discount, render_mode)
        compiled = mission_of(mission)
        self._game = SteppedEpisodes(
            compiled,
            mode,
            settings or {},
            others,
            world,
            valid_seed(policy_seed),
            outlines=not drawn,
            tier=tier,
            motion=motion,
        )
        instance = self._instance = self._game.instance(0)
        self._reach_m = reach_of(instance)
        self._codecs = codecs(instance, 0)
        self._flat = {
            name: FlatCodec(codec, self._reach_m, instance.budget.ticks, instance.clock.tick_s, actions)
            for name, codec in self._codecs.items()
        }
        self.possible_agents = list(self._codecs)
        self.agents: list[str] = []
        self.render_mode = render_mode
        self.state_space = spaces.Box(-1.0, 1.0, (len(_STATE) * len(instance.entities) + 2,), np.float32)
        self._most = min(instance.budget.ticks, max_cycles or instance.budget.ticks)
        self._shaping, self._discount = shaping, discount
        self._potential = TargetPotential(instance, self._reach_m)
        self._before = self._score = 0.0
        self._random = np.random.default_rng(0)
        self._sights: dict[str, Sight] = {}
        self._window: MapWindow | None = None

    def observation_space(self, agent: str) -> spaces.Box:
        """Return the space of one agent's observations; every call returns the same object."""
        return self._flat[agent].observation_space

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the space of one agent's actions; every call returns the same object."""
        return self._flat[agent].action_space

    def entries(self, agent: str) -> tuple[Entry, ...]:
        """Return the names and scales of the entries of an agent's observations, in order."""
        return self._flat[agent].entries

    def choices(self, agent: str) -> tuple[str, ...]:
        """Return the names of the numbers of an agent's actions, in order; for `discrete` those of the decisions."""
        return self._flat[agent].choices

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Vector], dict[str, dict[str, Any]]]:
        """Begin an episode and return the observations and infos of boundary 0, by agent."""
        if seed is not None:
            self._random = np.random.default_rng(valid_seed(seed))
        number = int(self._random.integers(LARGEST_SEED)) if seed is None else seed
        self.agents = list(self.possible_agents)
        published = self._game.begin(number, self._played())
        self._potential.restart()
        self._score = published.evaluation.reward
        self._before = self._potential.of(_states(published), published.record.frames)
        return self._observe(published), self._infos(published)

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[dict[str, Vector], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Play one decision tick. An agent without an action does nothing.

        Raises `UsageError` if no episode is running, an agent's name is unknown or an action is no member of its space.
        """
        before = self._game.published
        if before is None or not self.agents:
            raise UsageError("the environment has no episode going on", hint="call `reset` first")
        for name in actions:
            if name not in self._flat:
                raise UsageError(f"no agent is called `{name}`", hint=nearest_or(name, self._flat, _listed(self._flat)))
        decisions = {
            name: self._flat[name].decide(actions[name], self._sights[name]) if name in actions else Decision()
            for name in self._played()
        }
        published = self._game.step(decisions)
        ended = published.evaluation.done
        late = not ended and published.record.tick >= self._most
        reward = self._reward(published, ended)
        names = self.agents
        if ended or late:
            self.agents = []
        return (
            self._observe(published),
            dict.fromkeys(names, reward),
            dict.fromkeys(names, ended),
            dict.fromkeys(names, late),
            self._infos(published),
        )

    def action_mask(self, agent: str) -> npt.NDArray[np.bool_]:
        """Return the admissible values of each number of the agent's next action, one after another.

        Raises `UsageError` before the first `reset`, and for `actions="box"`, which has no masks.
        """
        if agent not in self._sights:
            raise UsageError("there is no mask before the first episode", hint="call `reset` first")
        return self._flat[agent].mask(self._sights[agent])

    @property
    def reason(self) -> str:
        """The reason of the episode's end, such as `success`; empty while it runs and after a truncation."""
        return "" if self._game.published is None else self._game.published.evaluation.reason

    @property
    def digest(self) -> str:
        """The digest of the trace so far; empty before the first episode."""
        return "" if self._game.published is None else self._game.published.record.digest

    def state(self) -> Vector:
        """Return the state of all entities and the time, for a central critic: it holds what no agent observes."""
        published = self._game.published
        if published is None:
            raise UsageError("the environment has no state before its first episode", hint="call `reset` first")
        states = _states(published)
        rows = [_row(states.get(entity.id), self._reach_m) for entity in self._instance.entities]
        left = published.record.tick / self._instance.budget.ticks
        numbers = [*(number for row in rows for number in row), left, published.evaluation.reward]
        return np.clip(np.array(numbers, np.float32), -1.0, 1.0)

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Return a map of the present state, height × width × 3; None without a render mode or an episode.

        With `human` the map is shown in a window, and None is returned.
        """
        published = self._game.published
        if self.render_mode is None or published is None:
            return None
        picture = map_picture(self._instance, _states(published), self._reach_m)
        if self.render_mode == "rgb_array":
            return picture
        self._window = self._window or MapWindow()
        self._window.show(picture)
        return None

    def close(self) -> None:
        """End the engines' processes and the window."""
        self._game.close()
        if self._window is not None:
            self._window.close()
            self._window = None

    def _played(self) -> list[str]:
        """Return the agents with decisions from the caller."""
        return self.possible_agents

    def _reward(self, published: Published, ended: bool) -> float:
        self._potential.note(published.record.stages)
        after = self._potential.of(_states(published), published.record.frames)
        gained = published.evaluation.reward - self._score
        gained += self._shaping * shaped(self._before, after, self._discount, ended=ended)
        self._score, self._before = published.evaluation.reward, after
        return gained

    def _observe(self, published: Published) -> dict[str, Vector]:
        frames = published.record.frames
        self._sights = {
            name: Sight(published.observations[name], published.inboxes[name], frames) for name in self._played()
        }
        if self.render_mode == "human":
            self.render()
        return {
            name: self._flat[name].observe(self._codecs[name].observe(sight.observation, sight.inbox), frames)
            for name, sight in self._sights.items()
        }

    def _infos(self, published: Published) -> dict[str, dict[str, Any]]:
        numbers = {name: value for name, value in info_of(published).items() if not isinstance(value, str)}
        return {
            name: numbers | ({"action_mask": self.action_mask(name)} if self._flat[name].has_masks else {})
            for name in self._sights
        }


class _OneAgent(FlatParallelEnv):
    """The parallel environment in which a policy plays every agent but one."""

    def __init__(self, mission: Mission | str, agent: str | None, options: Mapping[str, Any]) -> None:
        super().__init__(mission, **options)
        self.agent = self.possible_agents[0] if agent is None else agent
        if self.agent not in self._flat:
            hint = nearest_or(self.agent, self._flat, _listed(self._flat))
            raise UsageError(f"no agent is called `{self.agent}`", hint=hint)
        self.possible_agents = [self.agent]

    def _played(self) -> list[str]:
        return [self.agent]


class FlatEnv(gymnasium.Env[Any, Any], EzPickle):
    """A mission for one of its agents, by default the first, in flat spaces. A step is one decision tick.

    `others` names the policy that plays the other agents. The other arguments are those of `FlatParallelEnv`.

    >>> env = lingjing.envs.FlatEnv("ssr", mode="broadcast", agent="skipper", others="random", world="inline")
    >>> observation, info = env.reset(seed=1)
    >>> observation in env.observation_space, len(env.entries) == len(observation)
    (True, True)
    >>> env.action_masks().shape == (int(sum(env.action_space.nvec)),)
    True
    >>> env.close()
    """

    metadata: dict[str, Any] = {
        "render_modes": ["rgb_array", "human"],
        "render_fps": 2,
    }  # as in the base class

    def __init__(
        self, mission: Mission | str, *, agent: str | None = None, others: str = "heuristic", **options: Any
    ) -> None:
        EzPickle.__init__(self, mission, agent=agent, others=others, **options)
        self._all = _OneAgent(mission, agent, {"others": others, **options})
        self.agent = self._all.agent
        self.render_mode = self._all.render_mode
        self.observation_space = self._all.observation_space(self.agent)
        self.action_space = self._all.action_space(self.agent)
        self.entries = self._all.entries(self.agent)
        self.choices = self._all.choices(self.agent)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Vector, dict[str, Any]]:
        """Begin an episode and return the observation and info of boundary 0."""
        super().reset(seed=seed)
        number = int(self.np_random.integers(LARGEST_SEED)) if seed is None else valid_seed(seed)
        observations, infos = self._all.reset(seed=number)
        return observations[self.agent], infos[self.agent]

    def step(self, action: Any) -> tuple[Vector, float, bool, bool, dict[str, Any]]:
        """Play one decision tick. Raises `UsageError` if no episode is running or the action is no member."""
        name = self.agent
        observations, rewards, ended, late, infos = self._all.step({name: action})
        return observations[name], rewards[name], ended[name], late[name], infos[name]

    def action_masks(self) -> npt.NDArray[np.bool_]:
        """Return the admissible values of each number of the next action, as MaskablePPO calls it."""
        return self._all.action_mask(self.agent)

    @property
    def reason(self) -> str:
        """The reason of the episode's end, such as `success`; empty while it runs and after a truncation."""
        return self._all.reason

    @property
    def digest(self) -> str:
        """The digest of the trace so far."""
        return self._all.digest

    def state(self) -> Vector:
        """Return the state of all entities and the time; it holds what the agent does not observe."""
        return self._all.state()

    def render(self) -> Any:
        """Return a map of the present state, height × width × 3; None without a render mode."""
        return self._all.render()

    def close(self) -> None:
        """End the engines' processes."""
        self._all.close()


def flat_parallel_env(mission: Mission | str, **options: Any) -> FlatParallelEnv:
    """Return a `FlatParallelEnv`; PettingZoo's usual name for the constructor, with the same options.

    >>> env = lingjing.envs.flat_parallel_env("bi", actions="discrete", world="inline")
    >>> env.choices("inspector")[:3]
    ('none', 'uav.takeoff/0.25', 'uav.takeoff/0.5')
    >>> env.close()
    """
    return FlatParallelEnv(mission, **options)


def _states(published: Published) -> dict[str, BodyState]:
    snapshots = published.record.snapshots
    return {state.id: state for state in snapshots[-1].states} if snapshots else {}


def _row(state: BodyState | None, reach_m: float) -> tuple[float, ...]:
    """Return the numbers of one entity in `state`; zeros for one that is not there."""
    if state is None:
        return (0.0,) * len(_STATE)
    heading = np.radians(state.heading_deg)
    places = (part / (abs(part) + reach_m) for part in state.position)
    speeds = (part / (abs(part) + 20.0) for part in state.velocity)
    return 1.0, *places, *speeds, float(np.sin(heading)), float(np.cos(heading))


def _listed(names: Mapping[str, object]) -> str:
    return f"there are: {', '.join(names)}"


def _check(max_cycles: int | None, shaping: float, discount: float, render_mode: str | None) -> None:
    if max_cycles is not None and max_cycles < 1:
        raise UsageError(f"max_cycles={max_cycles} must be at least 1", hint="an episode has at least one tick")
    if not (np.isfinite(shaping) and shaping >= 0.0):
        raise UsageError(f"shaping={shaping} must be 0 or more", hint="0 leaves the shaping out")
    if not 0.0 <= discount <= 1.0:
        raise UsageError(f"discount={discount} is out of range", hint="a discount lies between 0 and 1")
    if render_mode not in (None, "rgb_array", "human"):
        raise UsageError(f"there is no render_mode={render_mode!r}", hint='the modes are None, "rgb_array" and "human"')
    if render_mode == "human":
        MapWindow.check()


__all__ = ["FlatEnv", "FlatParallelEnv", "flat_parallel_env"]
