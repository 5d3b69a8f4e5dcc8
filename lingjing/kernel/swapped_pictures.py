"""`SwappedPictures`: the pictures of another instance, from the poses of the bodies of this one, for control studies.

A second world plays the other instance without commands. At each boundary it receives the states of this instance's
assets, so that a camera stands where it stands here and sees what the other seed has placed there: other targets,
another layout, another light. Agents receive these pictures in the place of their own, under the same ids. Whatever
is adjudicated or recorded is of this instance. A policy that wins all the same does not need what pictures show.
"""

from __future__ import annotations

from collections.abc import Sequence

from lingjing.kernel.pictures import ReferencePictures
from lingjing.kernel.world.contract import StoredFrame, World
from lingjing.mission.instance import Instance
from lingjing.plugins.engine import CaptureRequest
from lingjing.plugins.policy import REFERENCE
from lingjing.scene.city import City
from lingjing.trace.records import Absent, BodyState


class SwappedPictures:
    """The pictures of one episode. `close` ends the second world."""

    def __init__(self, world: World, instance: Instance, city: City) -> None:
        """`instance` and `city`: the other ones, placed. `world` belongs to this object."""
        self._world = world
        self._assets = frozenset(entity.id for entity in instance.entities if entity.role == "asset")
        self._references = {each.frame: each for each in ReferencePictures(instance).requests(0, 0.0)}
        self._boundary = world.reset(instance, city)

    def take(
        self, tick: int, requests: Sequence[CaptureRequest], states: Sequence[BodyState]
    ) -> tuple[StoredFrame | Absent, ...]:
        """Return one picture for each request of boundary `tick`. `states` are those of this instance's entities.

        Raises `InfrastructureError` as the second world does.
        """
        while self._boundary.tick < tick:
            self._boundary = self._world.step(self._boundary.tick + 1, ())
        if not requests:
            return ()
        own = {state.id: state for state in states if state.id in self._assets}
        now = self._boundary.snapshots[-1]
        merged = tuple(own.get(state.id, state) for state in now.states)
        wanted = [self._references.get(each.frame, each) if each.camera == REFERENCE else each for each in requests]
        return self._world.capture(tick, wanted, merged + now.ambient)

    def close(self) -> None:
        """End the second world."""
        self._world.close()


__all__ = ["SwappedPictures"]
