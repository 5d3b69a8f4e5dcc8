"""A world with cameras that give ids and boxes alone, for learners that look at no pictures.

The box of an entity is the outline of its declared length, width and height, projected into the picture. Nothing is
drawn, which saves most of an episode's time. The differences from a drawn picture: walls, terrain, weather and darkness
hide nothing, and a box is the outline of the whole body.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from lingjing.engines.camera.contrast import projected_rect
from lingjing.kernel.world.contract import StoredFrame, World, WorldBoundary
from lingjing.kernel.world.frames import without_pixels
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.schedule import Occurrence
from lingjing.plugins.engine import CaptureRequest
from lingjing.scene.camera_geometry import mounted_camera_pose
from lingjing.scene.city import City
from lingjing.trace.records import Absent, BodyState, Box, CameraPose, Command, FrameInfo

LEAST_PX = 4
"""Least width and height of a box, pixels: smaller outlines are not seen (chosen)."""

FARTHEST_M = 3000.0
"""Greatest distance of an entity in a box, metres (chosen)."""

UNSAID_M = 1.0
"""Length, width or height of an entity that declares none, metres (chosen)."""


class OutlineWorld:
    """A world without pictures around another world with the engines that move the bodies."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._entities: dict[str, Entity] = {}

    @property
    def processes(self) -> Mapping[str, Mapping[str, str]]:
        """The processes of the engines."""
        return self._world.processes

    def reset(self, instance: Instance, city: City) -> WorldBoundary:
        """Reset every engine and return boundary 0."""
        self._entities = {entity.id: entity for entity in instance.entities}
        return self._world.reset(instance, city)

    def step(self, tick: int, commands: Sequence[Command], occurrences: Sequence[Occurrence] = ()) -> WorldBoundary:
        """Move every engine to boundary `tick`."""
        return self._world.step(tick, commands, occurrences)

    def capture(
        self,
        tick: int,
        requests: Sequence[CaptureRequest],
        states: Sequence[BodyState],
        occurrences: Sequence[Occurrence] = (),
    ) -> tuple[StoredFrame | Absent, ...]:
        """Return one description for each request: pose, ids and boxes, with a single black pixel as its image."""
        present = {state.id: state for state in states if state.id in self._entities}
        return tuple(without_pixels(self._described(request, present)) for request in requests)

    def fork(self) -> OutlineWorld:
        """Return a copy that continues on its own."""
        other = OutlineWorld(self._world.fork())
        other._entities = self._entities
        return other

    def close(self) -> None:
        """End all workers."""
        self._world.close()

    def _described(self, request: CaptureRequest, states: Mapping[str, BodyState]) -> FrameInfo:
        pose = request.pose
        if pose is None:
            entity = self._entities[request.entity]
            camera = next(camera for camera in entity.cameras if camera.name == request.camera)
            pose = mounted_camera_pose(states[entity.id], camera, entity.mounts, request.placement)
        boxes = (
            self._box(self._entities[name], state, pose) for name, state in states.items() if name != request.entity
        )
        return FrameInfo(
            id=request.frame,
            entity=request.entity,
            camera=request.camera,
            tick=request.tick,
            time_s=request.time_s,
            pose=pose,
            channels=("rgb",),
            boxes=tuple(box for box in boxes if box is not None),
            renderer="outlines",
        )

    def _box(self, entity: Entity, state: BodyState, pose: CameraPose) -> Box | None:
        """Return the box of an entity; None if it is out of the picture, too small or too far."""
        if math.dist(state.position, pose.position) > FARTHEST_M:
            return None
        length, width, height = (entity.number(name) or UNSAID_M for name in ("length_m", "width_m", "height_m"))
        turn = math.radians(state.heading_deg)
        east = (length * abs(math.sin(turn)) + width * abs(math.cos(turn))) / 2.0
        north = (length * abs(math.cos(turn)) + width * abs(math.sin(turn))) / 2.0
        x, y, z = state.position
        low = z - (height / 2.0 if entity.properties.get("origin") == "middle" else 0.0)
        place = projected_rect((x - east, y - north, low, x + east, y + north, low + height), pose)
        if place is None:
            return None
        left, top, wide, tall = place
        if min(wide, tall) < LEAST_PX or (wide, tall) == (pose.width, pose.height):
            return None
        box = left / pose.width, top / pose.height, (left + wide) / pose.width, (top + tall) / pose.height
        return Box(entity=entity.id, cls=entity.type, box=box, pixels=wide * tall)


__all__ = ["OutlineWorld"]
