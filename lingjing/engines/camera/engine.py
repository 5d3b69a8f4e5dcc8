"""`CameraEngine`: the sensor engine that draws the city with all entities.

It owns no entity. Every entity reaches it as a mirror through `advance`, and a picture shows the states of the last
one. A picture is a function of city, instance, states, time and pose; earlier pictures do not matter. An entity is not
drawn while it is absent (`lingjing.engines.bodies.is_absent`), nor in pictures of its own cameras. An entity without a
mirror stands at its declared place. The context and static meshes stay loaded between resets.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from functools import partial

import msgspec

from lingjing.engines.bodies import is_absent
from lingjing.engines.camera.boxes import entity_boxes
from lingjing.engines.camera.draw import Renderer, Scenery
from lingjing.engines.camera.effects import Site, changes_of
from lingjing.engines.camera.ground import build_ground, height_under, water_level
from lingjing.engines.camera.instances import Batch, prop_batches
from lingjing.engines.camera.models import look_of
from lingjing.engines.camera.moving_things import stage
from lingjing.engines.camera.noise import noise_texture
from lingjing.engines.camera.ocean import Ocean
from lingjing.engines.camera.options import CameraOptions
from lingjing.engines.camera.picture_keys import picture_key
from lingjing.engines.camera.redaction import ALL, PictureRedaction, Shot
from lingjing.errors import InfrastructureError
from lingjing.mission.instance import CameraSpec, Entity, Weather
from lingjing.mission.instance_entities import DRAWN_MOST
from lingjing.mission.schedule import Schedule
from lingjing.plugins.engine import Boundary, CaptureRequest, EngineSpec, Frame
from lingjing.plugins.options import engine_options
from lingjing.scene.camera_geometry import CameraPlacement, mounted_camera_pose
from lingjing.scene.city import City
from lingjing.scene.picture_weather import PictureWeather
from lingjing.scene.terrain import Terrain
from lingjing.scene.tiles import Tiles
from lingjing.trace.images import JPEG_QUALITY
from lingjing.trace.records import BodyState, CameraPose, Command, FrameInfo, Receipt

WARM_PLACES = 4
"""Most places with tiles that are loaded at a reset (chosen)."""
STUCK_M, CLEARANCE_M, HIGH_M = 0.2, 0.06, 2000.0
"""A camera up to this deep in the ground is lifted by the second value above it, up to the third height; metres
(chosen)."""
TOWN = ("buildings", "roads", "junctions", "areas", "bridges", "pipes", "slopes")
"""Parts that only a city with streets and buildings has. A city without them is drawn as open country and sea."""


class CameraEngine:
    """The engine contract over a `Renderer`."""

    def __init__(self) -> None:
        self._renderer: Renderer | None = None
        self._city: City | None = None
        self._props: tuple[Batch, ...] = ()
        self._spec: EngineSpec | None = None
        self._oceans: dict[Weather, Ocean] = {}
        self._schedule: Schedule | None = None
        self._terrain: Terrain | None = None
        self._sites: dict[str, Site] = {}
        self._redaction = PictureRedaction(())
        self._seed = 0
        self._quality = JPEG_QUALITY
        self._states: dict[str, BodyState] = {}
        self._ambient: tuple[BodyState, ...] = ()
        self._time_s = 0.0
        self._level = 0.0

    def reset(self, spec: EngineSpec, city: City, seed: int) -> Boundary:
        """Open the context on first use, build the city's meshes if the city changed, and drop the last episode.

        Raises `InfrastructureError` for more entities than the id buffer can hold, or without OpenGL.
        """
        entities = spec.instance.entities
        if len(entities) > DRAWN_MOST:
            raise InfrastructureError(f"the camera draws at most {DRAWN_MOST} entities, not {len(entities)}")
        if self._renderer is None:
            self._renderer = Renderer()
        if city != self._city and not self._replace_props(self._renderer, city):
            self._build(self._renderer, city)
        self._spec, self._time_s, self._seed = spec, 0.0, seed
        self._quality = engine_options(CameraOptions, spec).quality
        self._oceans, self._schedule = {}, spec.schedule
        self._sites, self._redaction = {}, PictureRedaction(entities)
        if self._terrain is not None:
            self._change_town(self._renderer, self._terrain, Tiles(city), entities)
        self._states = {e.id: BodyState(id=e.id, position=e.position, heading_deg=e.heading_deg) for e in entities}
        self._ambient = ()
        self._warm(self._renderer, entities)
        return Boundary(engine=spec.engine, time_s=0.0)

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Reject all commands: pictures are requested through `capture`."""
        return tuple(command.receipt("camera", "rejected", self._time_s, "unknown_verb") for command in commands)

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Take over all states at `until`."""
        spec = self._playing()
        self._states.update((state.id, state) for state in mirrors if state.id in self._states)
        self._ambient = tuple(state for state in mirrors if state.id not in self._states)
        self._time_s = until
        return Boundary(engine=spec.engine, time_s=until)

    def capture(self, requests: Sequence[CaptureRequest]) -> tuple[Frame, ...]:
        """Return one picture for each request, in order."""
        return tuple(self._picture(request) for request in requests)

    def picture_key(self, request: CaptureRequest) -> bytes:
        """Return a key of all inputs of the requested picture (`lingjing.plugins.engine.KeyedPictures`)."""
        if request.pose is not None:
            return picture_key(request.pose, self._scenery(None), self._level)
        entity, camera = self._mount(request)
        scenery = self._scenery(entity, changed=request.weather)
        return picture_key(self._seen_from(entity, camera, request.placement), scenery, self._level)

    def fingerprint(self) -> dict[str, str]:
        """Return the GL renderer and version; empty before the first reset."""
        return {"gl": self._renderer.name} if self._renderer is not None else {}

    def close(self) -> None:
        """Free everything; the engine may be reset again."""
        renderer, self._renderer = self._renderer, None
        self._city, self._props, self._spec, self._oceans, self._states = None, (), None, {}, {}
        self._terrain, self._schedule, self._ambient = None, None, ()
        if renderer is not None:
            renderer.close()

    def _warm(self, renderer: Renderer, entities: Sequence[Entity]) -> None:
        """Load what the first pictures need at the places of the cameras; the first picture would be slow otherwise."""
        looking = [e for e in entities if e.cameras and e.position[2] < HIGH_M]
        if not looking:
            return
        places = tuple(dict.fromkeys(e.position for e in looking))[:WARM_PLACES]
        depth = any("depth" in camera.channels for entity in looking for camera in entity.cameras)
        assert self._schedule is not None
        renderer.warm(places, self._schedule.weather(self._time_s), partial(self._scenery, None), depth)

    def _change_town(self, renderer: Renderer, terrain: Terrain, tiles: Tiles, entities: Sequence[Entity]) -> None:
        """Apply the entities' changes to the town: all of them, without hidden ones, and without targets."""
        kept = self._redaction
        whole = changes_of(tiles.near, terrain.surface, entities)
        public = changes_of(tiles.near, terrain.surface, entities, kept.hidden)
        bare = changes_of(tiles.near, terrain.surface, entities, kept.targets, razed=True)
        renderer.set_variants(whole, public, bare)
        kept.note_changes((whole, public, bare), tiles.load, terrain.surface)
        self._sites = whole.sites

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

    def _seen_from(self, entity: Entity, camera: CameraSpec, placement: CameraPlacement | None) -> CameraPose:
        return self._above(mounted_camera_pose(self._states[entity.id], camera, entity.mounts, placement))

    def _picture(self, request: CaptureRequest) -> Frame:
        if request.pose is not None:
            return self._picture_from(request.pose, request)
        entity, camera = self._mount(request)
        assert self._renderer is not None
        pose = self._seen_from(entity, camera, request.placement)
        depth, semantic, instance = (name in camera.channels for name in ("depth", "semantic", "instance"))
        scenery = partial(self._scenery, entity, changed=request.weather)
        shot = Shot(pose, depth, semantic, scenery, instance, self._visible_m(pose))
        shown = self._redaction.take(self._renderer, shot)
        info = FrameInfo(
            id=request.frame,
            entity=request.entity,
            camera=request.camera,
            tick=request.tick,
            time_s=request.time_s,
            pose=pose,
            channels=camera.channels,
            boxes=shown.boxes,
            faint=shown.faint,
            others=shown.others,
            renderer=self._renderer.name,
            instance_ids=shown.instance_ids,
        )
        return Frame(info, shown.rgb, shown.depth, shown.semantic, self._quality, shown.instance)

    def _visible_m(self, pose: CameraPose) -> float:
        """Return the distance beyond which a camera measures nothing, metres: the visibility, for weather with
        effects. It is infinite from orbit, where the air is thin."""
        assert self._schedule is not None
        weather = self._schedule.weather(self._time_s)
        return weather.visibility_m if weather.effects and pose.position[2] < HIGH_M else math.inf

    def _above(self, pose: CameraPose) -> CameraPose:
        """Return the pose of a camera, lifted out of the ground or deck on which its body stands."""
        if self._terrain is None or pose.position[2] > HIGH_M:
            return pose
        east, north, up = pose.position
        least = self._terrain.support(east, north, up + STUCK_M) + CLEARANCE_M
        return pose if up >= least else msgspec.structs.replace(pose, position=(east, north, least))

    def _picture_from(self, pose: CameraPose, request: CaptureRequest) -> Frame:
        """Return a picture from a free pose, only with colours and with every entity."""
        assert self._renderer is not None
        buffers = self._renderer.render(pose, self._scenery(None), False)
        info = FrameInfo(
            id=request.frame,
            entity=request.entity,
            camera=request.camera,
            tick=request.tick,
            time_s=request.time_s,
            pose=pose,
            channels=("rgb",),
            boxes=entity_boxes(buffers.ids, self._playing().instance.entities),
            renderer=self._renderer.name,
        )
        return Frame(info, buffers.rgb, quality=self._quality)

    def _build(self, renderer: Renderer, city: City) -> None:
        """Build the static world. Open country is drawn whole; a town is drawn in tiles, with its solids and props."""
        self._city, self._level, self._terrain = None, water_level(city), None
        noise = noise_texture()[::4, ::4, 0]
        if city.store or any(getattr(city, kind) for kind in TOWN):
            terrain = self._terrain = Terrain(city)
            renderer.load(build_ground(city, noise, town=True), (city, terrain.surface))
            self._props = ()
        else:
            renderer.load(build_ground(city, noise))
            self._props = prop_batches(city)
        self._city = city

    def _replace_props(self, renderer: Renderer, city: City) -> bool:
        """Take over a city that differs from the present one only in its props; return False for any other city.

        Floating props of a sea or harbour differ from episode to episode.
        """
        if self._city is None or city.store or _without_props(city) != _without_props(self._city):
            return False
        if self._terrain is None:
            self._props = prop_batches(city)
        else:
            self._terrain = Terrain(city)
            renderer.replace_props(city, self._terrain.surface)
        self._city = city
        return True

    def _under(self, east: float, north: float, up: float) -> float:
        """Return the elevation of the plane on which the shadow of a thing at a point falls, metres."""
        assert self._city is not None
        if self._terrain is None:
            return height_under(self._city, east, north)
        return self._terrain.support(east, north, up + 0.5)

    def _scenery(
        self,
        viewer: Entity | None,
        without: Collection[str] = (),
        variant: int = ALL,
        changed: PictureWeather | None = None,
    ) -> Scenery:
        """Return the moving content of a picture.

        It has no body of the `viewer` and none of the entities `without`, and no shadows of these bodies. Their light
        stays. The town is the `variant`, one of the constants of `redaction`. `changed` replaces values of the weather.
        """
        assert self._schedule is not None
        declared = self._schedule.weather(self._time_s)
        weather = declared if changed is None else changed.over(declared)
        shown, own = [], None
        for number, entity in enumerate(self._playing().instance.entities):
            state = self._states[entity.id]
            here = not is_absent(state, entity) and self._schedule.present(entity.id, self._time_s)
            if here and viewer is not None and entity.id == viewer.id:
                own = state, look_of(entity)
            elif here and entity.id not in without:
                shown.append((number, entity, state))
        cast = stage(shown, self._ambient, self._sites, self._time_s, weather, self._under, self._level, own)
        sea = self._ocean(declared).surfaces(self._time_s)
        return Scenery(self._time_s, weather, sea, (*self._props, *cast.batches), cast.marks,
                       cast.billboards, cast.decals, variant)  # fmt: skip

    def _ocean(self, weather: Weather) -> Ocean:
        if weather not in self._oceans:
            self._oceans[weather] = Ocean(weather, self._seed)
        return self._oceans[weather]


def _without_props(city: City) -> City:
    return msgspec.structs.replace(city, id="", sha256="", props=())


__all__ = ["CameraEngine"]
