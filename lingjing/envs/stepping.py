"""Episodes with decisions from the caller; both environments step them.

A built-in or user policy plays the agents that the caller does not play, behind the same barrier as in any episode. The
engines' world is kept from episode to episode. After an infrastructure abort the next `begin` opens a new episode.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Literal

import msgspec

from lingjing.envs.outlines import OutlineWorld
from lingjing.errors import UsageError
from lingjing.kernel.barrier import PolicyBarrier
from lingjing.kernel.cities import CityBuilder
from lingjing.kernel.episode import policy_barrier
from lingjing.kernel.step import Kernel, Published
from lingjing.kernel.world import open_world
from lingjing.kernel.world.contract import World
from lingjing.mission.instance import Clock, Instance
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import Mission
from lingjing.play.policy_files import load_policy
from lingjing.play.siting import sited_mission
from lingjing.plugins.host import PluginHost
from lingjing.plugins.loading import build_policy
from lingjing.suggest import nearest_or
from lingjing.trace.records import Decision, DecisionRecord

Motion = Literal["full", "coarse"]
"""The value of the option `motion` of the engines that have it."""

MOTIONS: tuple[Motion, ...] = ("full", "coarse")

COARSE_ENGINES = frozenset({"multirotor", "vessel", "road", "city"})
"""The engines with the option `motion`."""

WANTED_ENGINES = frozenset({"road", "city"})
"""Engines that may take part although they own no entity."""

COARSE_SYNC_S = 1.0
"""Macro-step with coarse motion, seconds (chosen): two steps of the slowest engine."""


class SteppedEpisodes:
    """Episodes of one mission in one mode with the same settings."""

    def __init__(
        self,
        mission: Mission,
        mode: str | None,
        settings: Mapping[str, float],
        others: str,
        world: Literal["process", "inline"],
        policy_seed: int = 0,
        *,
        tier: int = 0,
        outlines: bool = False,
        motion: Motion = "full",
    ) -> None:
        if world not in ("process", "inline"):
            raise UsageError(f"there is no world={world!r}", hint='engines run in "process" or "inline"')
        if motion not in MOTIONS:
            raise UsageError(
                f"there is no motion={motion!r}", hint=nearest_or(str(motion), MOTIONS, 'it is "full" or "coarse"')
            )
        self._host = PluginHost()
        self._mission = sited_mission(mission, "", self._host)
        self._mode, self._settings, self._tier = mode, dict(settings), tier
        self._cities = CityBuilder(self._host)
        self._others = load_policy(others, self._host)
        self._kind = world
        self._policy_seed = policy_seed
        self._outlines = outlines
        self._motion = motion
        self._world: World | None = None
        self._kernel: Kernel | None = None
        self._barrier: PolicyBarrier | None = None
        self.published: Published | None = None

    def instance(self, seed: int) -> Instance:
        """Return the instance of a seed. Raises `UsageError` for a mode or setting that the mission does not have."""
        instance = instantiate(self._mission, seed=seed, mode=self._mode, settings=self._settings, tier=self._tier)
        if self._motion == "full":
            return instance
        engines = {entity.engine for entity in instance.entities} | WANTED_ENGINES
        options = {name: {"motion": self._motion} for name in sorted(engines & COARSE_ENGINES)}
        return msgspec.structs.replace(instance, engine_options=options, clock=_coarse(instance.clock))

    def begin(self, seed: int, outside: Collection[str]) -> Published:
        """Begin the episode of `seed` and return boundary 0. The caller plays the agents in `outside`."""
        self._end()
        imported = bool(self._mission.origin.places)
        instance, city = self._cities.place(self.instance(seed), imported=imported, hold=True)
        if self._world is None:
            opened = open_world(self._kind, host=self._host, hold_starts=True)
            self._world = OutlineWorld(opened) if self._outlines else opened
        played = [agent.id for agent in instance.agents if agent.id not in outside]
        privileged = frozenset(played) if self._others.privileged else frozenset()
        self._kernel = Kernel(
            instance, city, self._world, privileged=privileged, policy_seed=self._policy_seed
        )  # fmt: skip
        self._barrier = policy_barrier(
            self._kernel, {name: build_policy(self._others, {}, host=self._host) for name in played}
        )
        self.published = self._kernel.reset()
        return self.published

    def step(self, decisions: Mapping[str, Decision]) -> Published:
        """Play one tick with the caller's decisions and return the next boundary.

        Raises `UsageError` before the first `begin`. Raises `InfrastructureError` if an engine fails; the episode is
        then over.
        """
        kernel, before, barrier = self._kernel, self.published, self._barrier
        if kernel is None or before is None or barrier is None:
            raise UsageError("the environment has no episode yet", hint="call `reset` first")
        waiting = {
            name: (before.observations[name], before.inboxes[name])
            for name in before.observations
            if name not in decisions and name in barrier
        }
        records = {record.agent: record for record in barrier.act(waiting)} if waiting else {}
        records |= {name: DecisionRecord(agent=name, decision=decision) for name, decision in decisions.items()}
        order = [agent.id for agent in kernel.instance.agents]
        self.published = kernel.step([records[name] for name in order if name in records])
        return self.published

    @property
    def ticks(self) -> int:
        """Budget of the episode in decision ticks; 0 before the first episode."""
        return self._kernel.instance.budget.ticks if self._kernel is not None else 0

    def close(self) -> None:
        """End the episode and the engines' processes."""
        self._end()
        if self._world is not None:
            self._world.close()
            self._world = None

    def _end(self) -> None:
        if self._barrier is not None:
            self._barrier.close()
        self._kernel = self._barrier = self.published = None


def _coarse(clock: Clock) -> Clock:
    """Return the clock with macro-steps of `COARSE_SYNC_S`, if a tick is a whole number of them."""
    if clock.sync_s >= COARSE_SYNC_S or clock.tick_s % COARSE_SYNC_S:
        return clock
    return msgspec.structs.replace(clock, sync_s=COARSE_SYNC_S)
