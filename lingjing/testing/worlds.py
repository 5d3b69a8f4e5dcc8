"""Several engines in one world, tick by tick, without agents: for tests of what one engine does to another's bodies."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence

from lingjing.kernel.world import open_world
from lingjing.kernel.world.contract import StoredFrame, World, WorldBoundary
from lingjing.mission.instance import Datum, Instance
from lingjing.plugins.engine import CaptureRequest
from lingjing.scene.city import City
from lingjing.trace.records import BodyState, Command, TaskEvent


class WorldRun:
    """The engines of an instance in a world, driven by ticks; `boundaries` holds all boundaries so far."""

    def __init__(self, world: World, instance: Instance, city: City) -> None:
        self.world, self.instance = world, instance
        self.boundaries: list[WorldBoundary] = [world.reset(instance, city)]
        self._commands = 0

    def tick(self, *orders: Command, count: int = 1) -> WorldBoundary:
        """Play some ticks, the first with these commands, and return the last boundary.

        Raises `AssertionError` if a command is not admitted or an engine does not answer.
        """
        for number in range(count):
            commands = orders if number == 0 else ()
            boundary = self.world.step(len(self.boundaries), commands)
            refused = [receipt for receipt in boundary.admissions if receipt.status != "accepted"]
            assert not refused and not boundary.missing, (refused, boundary.missing)
            self.boundaries.append(boundary)
        return self.boundaries[-1]

    def order(self, resource: str, verb: str, **arguments: Datum) -> Command:
        """Return a command for the next boundary in the name of the agent that controls the resource."""
        self._commands += 1
        sender = next((agent.id for agent in self.instance.agents if resource in agent.controls), "kernel")
        return Command(
            id=f"c{len(self.boundaries)}-{self._commands}",
            tick=len(self.boundaries),
            sender=sender,
            resource=resource,
            verb=verb,
            arguments=arguments,
            origin="kernel" if sender == "kernel" else "agent",
        )

    def look(self, entity: str, camera: str) -> StoredFrame:
        """Return a picture of the present boundary. Raises `AssertionError` if it is absent."""
        tick, last = len(self.boundaries) - 1, self.boundaries[-1].snapshots[-1]
        request = CaptureRequest(
            frame=f"f{tick}-{entity}-{camera}",
            entity=entity,
            camera=camera,
            tick=tick,
            time_s=self.boundaries[-1].time_s,
        )
        (frame,) = self.world.capture(tick, (request,), (*last.states, *last.ambient))
        assert isinstance(frame, StoredFrame), frame
        return frame

    def path(self, entity: str) -> list[BodyState]:
        """Return the states of the entity at every macro-step so far."""
        return list(path(self.boundaries, entity))

    def series(self, entity: str, resource: str) -> list[float]:
        """Return the values of one of its resources at every macro-step so far."""
        return [state.resources[resource] for state in self.path(entity)]

    def now(self, entity: str) -> BodyState:
        """Return the state of the entity at the last boundary."""
        return self.path(entity)[-1]

    def events(self, kind: str) -> list[TaskEvent]:
        """Return all task events of a kind so far."""
        return [event for boundary in self.boundaries for event in boundary.events if event.kind == kind]


def path(boundaries: Iterable[WorldBoundary], entity: str) -> Iterator[BodyState]:
    """Yield the states of an entity at every macro-step of these boundaries."""
    for boundary in boundaries:
        for snapshot in boundary.snapshots:
            yield from (state for state in snapshot.states if state.id == entity)


def length_m(states: Sequence[BodyState]) -> float:
    """Return the length of a path in the plane, metres."""
    return sum(math.dist(a.position[:2], b.position[:2]) for a, b in itertools.pairwise(states))


__all__ = ["World", "WorldRun", "length_m", "open_world", "path"]
