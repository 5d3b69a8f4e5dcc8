"""`CameraEngine`: the sensor engine that draws the city with all entities and answers captures.

It owns nothing: every entity of the instance reaches it as a mirror through `advance`, and a picture shows the
states of the last one. A picture is a function of (city, instance, states, time, pose) alone, whatever was drawn
before. An entity is not drawn while its status is in `HIDDEN_STATUSES`, nor by its own cameras; one for which no
mirror has come yet stands where the instance puts it. The context and static meshes stay warm between resets.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from lingjing.errors import InfrastructureError
from lingjing.mission.instance import CameraSpec, Entity
from lingjing.plugins.engine import Boundary, CaptureRequest, EngineSpec, Frame
from lingjing.plugins.engines.camera.boxes import entity_boxes
from lingjing.plugins.engines.camera.classes import FIRST_ENTITY, MAX_ENTITIES, semantic_table
from lingjing.plugins.engines.camera.draw import Renderer, Scenery
from lingjing.plugins.engines.camera.ground import build_ground, height_under, water_level
from lingjing.plugins.engines.camera.instances import Batch, entity_batches, marks, prop_batches
from lingjing.plugins.engines.camera.models import entity_model
from lingjing.plugins.engines.camera.noise import noise_texture
from lingjing.plugins.engines.camera.ocean import Ocean
from lingjing.plugins.geometry import body_camera_pose
from lingjing.scene.city import City
from lingjing.trace.records import BodyState, Command, FrameInfo, Receipt

HIDDEN_STATUSES = frozenset({"rescued"})
AFLOAT = frozenset({"person_in_water", "lifeboat"})
"""Types that are drawn on the water's plane: the drawn sea is flat (waves live in its shading), so a body that an
engine heaves with its waves would sink out of sight or hover."""


class CameraEngine:
    """The five engine methods over a `Renderer`."""

    def __init__(self) -> None:
        self._renderer: Renderer | None = None
        self._city: City | None = None
        self._props: tuple[Batch, ...] = ()
        self._spec: EngineSpec | None = None
        self._ocean: Ocean | None = None
        self._states: dict[str, BodyState] = {}
        self._time_s = 0.0
        self._level = 0.0

    def reset(self, spec: EngineSpec, city: City, seed: int) -> Boundary:
        """Open the context if need be, build the city's meshes if it changed, forget the last episode."""
        entities = spec.instance.entities
        if len(entities) > MAX_ENTITIES:
            raise InfrastructureError(f"the camera draws at most {MAX_ENTITIES} entities, not {len(entities)}")
        if self._renderer is None:
            self._renderer = Renderer()
        if city != self._city:
            self._renderer.load(build_ground(city, noise_texture()[::4, ::4, 0]))
            self._props, self._city, self._level = prop_batches(city), city, water_level(city)
        self._spec, self._time_s = spec, 0.0
        self._ocean = Ocean(spec.instance.weather, seed)
        self._states = {e.id: BodyState(id=e.id, position=e.position, heading_deg=e.heading_deg) for e in entities}
        return Boundary(engine=spec.engine, time_s=0.0)

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """A camera obeys no command: pictures are asked for through `capture`."""
        return tuple(
            Receipt(request=c.id, tick=c.tick, sender=c.sender, resource=c.resource, status="rejected",
                    reason="unknown_verb", by="camera", time_s=self._time_s)
            for c in commands
        )  # fmt: skip

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Take over all states at `until`."""
        spec = self._playing()
        self._states.update((state.id, state) for state in mirrors)
        self._time_s = until
        return Boundary(engine=spec.engine, time_s=until)

    def capture(self, requests: Sequence[CaptureRequest]) -> tuple[Frame, ...]:
        """One picture for each request, in order."""
        return tuple(self._picture(request) for request in requests)

    def fingerprint(self) -> dict[str, str]:
        """The GL renderer and version behind the pictures; {} before the first reset."""
        return {"gl": self._renderer.name} if self._renderer is not None else {}

    def close(self) -> None:
        """Free everything; the engine may be reset again."""
        renderer, self._renderer = self._renderer, None
        self._city, self._props, self._spec, self._ocean, self._states = None, (), None, None, {}
        if renderer is not None:
            renderer.close()

    def _playing(self) -> EngineSpec:
        if self._spec is None:
            raise InfrastructureError("the camera engine was used before its reset")
        return self._spec

    def _mount(self, request: CaptureRequest) -> tuple[Entity, CameraSpec]:
        for entity in self._playing().instance.entities:
            for camera in entity.cameras:
                if (entity.id, camera.name) == (request.entity, request.camera):
                    return entity, camera
        raise InfrastructureError(f"`{request.entity}` has no camera `{request.camera}` to take `{request.frame}` with")

    def _picture(self, request: CaptureRequest) -> Frame:
        entity, camera = self._mount(request)
        assert self._renderer is not None
        pose = body_camera_pose(self._states[entity.id], camera)
        buffers = self._renderer.render(pose, self._scenery(entity), "depth" in camera.channels)
        entities = self._playing().instance.entities
        info = FrameInfo(
            id=request.frame,
            entity=request.entity,
            camera=request.camera,
            tick=request.tick,
            time_s=request.time_s,
            pose=pose,
            channels=camera.channels,
            boxes=entity_boxes(buffers.ids, entities),
            renderer=self._renderer.name,
        )
        semantic = semantic_table(entities)[buffers.ids] if "semantic" in camera.channels else None
        return Frame(info=info, rgb=buffers.rgb, depth=buffers.depth, semantic=semantic)

    def _scenery(self, viewer: Entity) -> Scenery:
        """Everything but the viewer's own body; its shadow goes with it."""
        assert self._ocean is not None and self._city is not None
        instance = self._playing().instance
        drawn, wet = [], []
        for number, entity in enumerate(instance.entities):
            state = self._states[entity.id]
            if entity.id != viewer.id and state.status not in HIDDEN_STATUSES:
                key, mesh = entity_model(entity.type, entity.index, self._time_s)
                plane = height_under(self._city, state.position[0], state.position[1])
                if entity.type in AFLOAT and plane == self._level:
                    state = msgspec.structs.replace(state, position=(*state.position[:2], plane))
                    wet.append((state, entity.type))
                drawn.append((state, f"entity/{key}", mesh, FIRST_ENTITY + number, plane))
        batches = (*self._props, *entity_batches(drawn))
        sea = self._ocean.surfaces(self._time_s)
        return Scenery(self._time_s, instance.weather, sea, batches, marks(wet))


__all__ = ["CameraEngine"]
