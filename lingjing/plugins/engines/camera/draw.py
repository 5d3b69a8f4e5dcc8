"""`Renderer`: one picture from a pose, a sea and the instances, in one pass over the scene.

Order: ground, solids, water, sky (each pixel shaded about once), then shadows and marks blended into the colour
alone, then objects. Shadows are planar: a mesh pressed along the sun's rays onto its plane, drawn twice so that
overlaps darken once (first its alpha is marked, then colour is multiplied by the mark and the mark removed).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, e, log2, radians, sin

import moderngl
import numpy as np
import numpy.typing as npt

from lingjing.mission.instance import Weather
from lingjing.plugins.engines.camera import shaders
from lingjing.plugins.engines.camera.classes import CLASSES
from lingjing.plugins.engines.camera.context import open_context, renderer_name
from lingjing.plugins.engines.camera.ground import SHORE_REACH_M, Ground
from lingjing.plugins.engines.camera.ground import Surface as Land
from lingjing.plugins.engines.camera.instances import Batch, Rows, afloat, in_sight, visible
from lingjing.plugins.engines.camera.meshes import indexed
from lingjing.plugins.engines.camera.noise import lace_texture, noise_texture
from lingjing.plugins.engines.camera.ocean import RIPPLE_M, Surface
from lingjing.plugins.engines.camera.ocean import SIZE as SEA_SIZE
from lingjing.plugins.engines.camera.targets import MAX_TARGETS, Buffers, Target
from lingjing.plugins.engines.camera.upload import Model, upload, upload_still
from lingjing.plugins.geometry import camera_axes, focal_px
from lingjing.trace.records import CameraPose

FAR_M = 40_000.0
MIPMAPPED = moderngl.LINEAR_MIPMAP_LINEAR
GROUND_CLASSES = tuple(CLASSES[name] for name in ("sand", "grass", "rock", "concrete"))


@dataclass(frozen=True, slots=True)
class Scenery:
    """What a picture shows besides the static ground: the sea at a time, all instances, marks on the water."""

    time_s: float
    weather: Weather
    sea: tuple[Surface, Surface]
    batches: Sequence[Batch]
    marks: npt.NDArray[np.void]


class Renderer:
    """Owns the GL context and everything in it. Not thread-safe; `close` frees all."""

    def __init__(self) -> None:
        self.context = open_context()
        self.name = renderer_name(self.context)
        program = self.context.program
        self._object = program(vertex_shader=shaders.OBJECT_VERTEX, fragment_shader=shaders.OBJECT_FRAGMENT)
        self._ground = {
            cls: program(vertex_shader=shaders.OBJECT_VERTEX, fragment_shader=shaders.ground_fragment(cls))
            for cls in GROUND_CLASSES
        }
        self._water = program(vertex_shader=shaders.WATER_VERTEX, fragment_shader=shaders.WATER_FRAGMENT)
        self._sky = program(vertex_shader=shaders.SKY_VERTEX, fragment_shader=shaders.SKY_FRAGMENT)
        self._shadow = program(vertex_shader=shaders.SHADOW_VERTEX, fragment_shader=shaders.SHADOW_FRAGMENT)
        self._mark = program(vertex_shader=shaders.MARK_VERTEX, fragment_shader=shaders.MARK_FRAGMENT)
        self._programs = (self._object, *self._ground.values(), self._water, self._sky, self._shadow, self._mark)
        self._corners = self.context.buffer(np.array([-1, -1, 1, -1, 1, 1, -1, -1, 1, 1, -1, 1], "f4").tobytes())
        noise = noise_texture()
        self._noise, self._lace = self.texture(noise), lace_texture()
        self._sea = (self._sea_texture(), self._sea_texture())
        self._sea_scales = ((1.0, 1.0), (1.0, 1.0))
        self._sea_now: tuple[Surface, Surface] | None = None
        self._shore = self.context.texture((1, 1), 2, b"\xff\x80")
        self._water_vao = self.context.vertex_array(self._water, [(self._corners, "2f", "in_corner")])
        self._sky_vao = self.context.vertex_array(self._sky, [(self._corners, "2f", "in_corner")])
        self._surfaces: list[tuple[Land, Model]] = []
        self._solids: list[Model] = []
        self._models: dict[str, Model] = {}
        self._targets: dict[tuple[tuple[int, int], bool], Target] = {}
        self._level = 0.0
        self._bounds = (0.0, 0.0, 1.0, 1.0)

    def texture(self, pixels: npt.NDArray[np.uint8]) -> moderngl.Texture:
        """A repeating, mipmapped texture of (rows, columns, components) bytes."""
        texture = self.context.texture(pixels.shape[1::-1], pixels.shape[2], pixels.tobytes())
        texture.filter = MIPMAPPED, moderngl.LINEAR
        texture.build_mipmaps()
        return texture

    def load(self, ground: Ground) -> None:
        """Replace the static geometry."""
        with self.context:
            self._load(ground)

    def _load(self, ground: Ground) -> None:
        for _, model in self._surfaces:
            model.release()
        for model in self._solids:
            model.release()
        self._surfaces = [(land, self._land(land, ground.level_m)) for land in ground.surfaces]
        self._solids = [
            upload_still(self.context, (self._object, self._shadow), indexed(mesh), plane, CLASSES["structure"])
            for plane, mesh in ground.solids
        ]
        self._shore.release()
        rows, columns, parts = ground.shore.shape
        self._shore = self.context.texture((columns, rows), parts, ground.shore.tobytes())
        self._shore.repeat_x = self._shore.repeat_y = False
        self._level = ground.level_m
        west, south, east, north = ground.bounds
        self._bounds = west, south, 1.0 / (east - west), 1.0 / (north - south)

    def render(self, pose: CameraPose, scenery: Scenery, depth: bool) -> Buffers:
        """Draw one picture and read it back."""
        with self.context:
            return self._render(pose, scenery, depth)

    def _render(self, pose: CameraPose, scenery: Scenery, depth: bool) -> Buffers:
        target = self._target((pose.width, pose.height), depth)
        self._prepare(pose, scenery)
        target.frame.use()
        target.write(colour=True, alpha=True, rest=True)
        target.frame.clear(0.0, 0.0, 0.0, 1.0)
        self.context.enable_only(moderngl.DEPTH_TEST)
        self.context.depth_func = "<="
        for land, model in self._surfaces:
            _draw_land(land, model, pose)
        for model in self._solids:
            model.lit.render(instances=1)
        self._water_vao.render()
        self._sky_vao.render()
        drawn = self._fill(pose, scenery)
        self._blend(target, drawn, scenery)
        for model, _, count in drawn:
            if count:
                model.lit.render(instances=count)
        return target.read()

    def close(self) -> None:
        """Release every GL object, then the context."""
        with self.context:
            self._release()
        self.context.release()

    def _release(self) -> None:
        for target in self._targets.values():
            target.release()
        for model in [*(m for _, m in self._surfaces), *self._solids, *self._models.values()]:
            model.release()
        self._targets, self._surfaces, self._solids, self._models = {}, [], [], {}
        for thing in (self._water_vao, self._sky_vao, self._corners, self._noise, *self._sea, self._shore):
            thing.release()
        for program in self._programs:
            program.release()

    def _target(self, size: tuple[int, int], depth: bool) -> Target:
        key = size, depth
        if key not in self._targets:
            if len(self._targets) >= MAX_TARGETS:
                self._targets.pop(next(iter(self._targets))).release()
            self._targets[key] = Target(self.context, size, depth)
        return self._targets[key]

    def _land(self, land: Land, level: float) -> Model:
        program = self._ground.get(land.cls, self._ground[CLASSES["concrete"]])
        index = np.concatenate([patch.triangles.ravel() for patch in land.patches])
        return upload_still(self.context, (program, self._shadow), (land.vertices, index), level, land.cls)

    def _sea_texture(self) -> moderngl.Texture:
        return self.texture(np.zeros((SEA_SIZE, SEA_SIZE, 4), np.uint8))

    def _prepare(self, pose: CameraPose, scenery: Scenery) -> None:
        if self._sea_now is not scenery.sea:
            packed = [scenery.sea[0].packed(), scenery.sea[1].packed(self._lace)]
            for texture, (pixels, _) in zip(self._sea, packed, strict=True):
                texture.write(pixels.tobytes())
                texture.build_mipmaps()
            self._sea_scales = packed[0][1], packed[1][1]
            self._sea_now = scenery.sea
        for unit, texture in enumerate((*self._sea, self._shore, self._noise)):
            texture.use(unit)
        for texture in self._sea:
            texture.filter = (moderngl.LINEAR if _close(pose, self._level) else MIPMAPPED), moderngl.LINEAR
        values = {**_view(pose), **_air(scenery), **self._sea_values(scenery), "u_level": self._level}
        for program in self._programs:
            for name in program:
                if name in values:
                    program[name] = values[name]

    def _sea_values(self, scenery: Scenery) -> dict[str, object]:
        return {
            "u_swell": 0,
            "u_ripple": 1,
            "u_shore": 2,
            "u_noise": 3,
            "u_swell_scale": self._sea_scales[0],
            "u_ripple_scale": self._sea_scales[1],
            "u_lengths": (scenery.sea[0].length_m, scenery.sea[1].length_m),
            "u_bounds": self._bounds,
            "u_reach": SHORE_REACH_M,
        }

    def _fill(self, pose: CameraPose, scenery: Scenery) -> list[tuple[Model, int, int]]:
        """Per mesh: (model, instances whose shadow may show, of these the first so many are themselves visible)."""
        drawn = []
        slack = 1.0 + 2.0 / max(_sun(scenery.weather)[2], 0.2)
        for batch in scenery.batches:
            near = visible(batch.rows, batch.radius, pose, slack) | _casts_far(batch)
            if not near.any():
                continue
            rows = afloat(batch, scenery.sea[0])
            seen = visible(rows, batch.radius, pose) & near
            ordered: Rows = np.concatenate([rows[seen], rows[near & ~seen]])
            model = self._loaded(batch, len(batch.rows))
            model.place(ordered)
            drawn.append((model, len(ordered), int(seen.sum())))
        return drawn

    def _loaded(self, batch: Batch, needed: int) -> Model:
        model = self._models.get(batch.key)
        if model is None or model.capacity < needed:
            if model is not None:
                model.release()
            model = self._models[batch.key] = upload(
                self.context, (self._object, self._shadow), indexed(batch.mesh), needed
            )
        return model

    def _blend(self, target: Target, drawn: list[tuple[Model, int, int]], scenery: Scenery) -> None:
        self.context.enable(moderngl.BLEND)
        self._marks(target, scenery)
        casters = [(model, count) for model, count, _ in drawn] + [(model, 1) for model in self._solids]
        target.write(colour=False, alpha=True, rest=False)
        self._cast(casters, _shade(scenery.weather), (moderngl.ONE, moderngl.ZERO))
        target.write(colour=True, alpha=True, rest=False)
        self._cast(casters, 1.0, (moderngl.ZERO, moderngl.DST_ALPHA, moderngl.ONE, moderngl.ZERO))
        target.write(colour=True, alpha=True, rest=True)
        self.context.disable(moderngl.BLEND)

    def _cast(self, casters: list[tuple[Model, int]], alpha: float, blend: tuple[int, ...]) -> None:
        self._shadow["u_dark"] = alpha
        self.context.blend_func = blend  # type: ignore[assignment] # two or four factors
        for model, count in casters:
            model.shadow.render(instances=count)

    def _marks(self, target: Target, scenery: Scenery) -> None:
        if not len(scenery.marks):
            return
        target.write(colour=True, alpha=False, rest=False)
        self.context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        buffer = self.context.buffer(scenery.marks.tobytes())
        array = self.context.vertex_array(
            self._mark, [(self._corners, "2f", "in_corner"), (buffer, "4f 2f/i", "in_place", "in_kind")]
        )
        array.render(instances=len(scenery.marks))
        array.release()
        buffer.release()


def _close(pose: CameraPose, level: float) -> bool:
    """Whether no pixel of the picture spans much more than a ripple's texel: then the sea needs no mipmaps, which
    cost a software renderer twice the look-ups."""
    steepest = pose.tilt_deg > 80.0 and pose.hfov_deg < 100.0
    return steepest and (pose.position[2] - level) / focal_px(pose) < 1.7 * RIPPLE_M / SEA_SIZE


def _draw_land(land: Land, model: Model, pose: CameraPose) -> None:
    """Only the patches that the picture can show, neighbours in one call."""
    centres = np.array([patch.centre for patch in land.patches])
    radius = np.array([patch.radius for patch in land.patches])
    seen = in_sight(centres, radius, pose)
    counts = [patch.triangles.size for patch in land.patches]
    first = run = 0
    for count, shown in zip([*counts, 0], [*seen.tolist(), False], strict=True):
        if shown:
            run += count
        else:
            if run:
                model.lit.render(vertices=run, first=first, instances=1)
            first, run = first + run + count, 0


def _casts_far(batch: Batch) -> npt.NDArray[np.bool_]:
    """Instances high over their shadow's plane, whose shadow lies far from themselves."""
    high = batch.rows["rows"][:, 2, 3] - batch.rows["plane"]
    return np.asarray(high > 2.0 * batch.radius)


def _sun(weather: Weather) -> tuple[float, float, float]:
    azimuth, elevation = radians(weather.sun_azimuth_deg), radians(max(weather.sun_elevation_deg, 3.0))
    return sin(azimuth) * cos(elevation), cos(azimuth) * cos(elevation), sin(elevation)


def _shade(weather: Weather) -> float:
    """What a shadow leaves of the developed colour."""
    return 0.60 + 0.32 * min(max(weather.cloud, 0.0), 1.0)


def _view(pose: CameraPose) -> dict[str, object]:
    right, down, axis = camera_axes(pose)
    focal = focal_px(pose)
    near = 0.05 if pose.position[2] < 10.0 else 0.4
    a, b = (FAR_M + near) / (FAR_M - near), -2.0 * FAR_M * near / (FAR_M - near)
    sx, sy = 2.0 * focal / pose.width, 2.0 * focal / pose.height
    clip = np.zeros((4, 4))
    clip[:, :3] = np.array([right, down, axis, axis]) * np.array([[sx], [sy], [a], [1.0]])
    clip[2, 3] = b
    return {
        "u_clip": tuple(clip.T.ravel().tolist()),
        "u_eye": pose.position,
        "u_right": right,
        "u_down": down,
        "u_axis": axis,
        "u_lens": (pose.width / 2.0, pose.height / 2.0, focal),
    }


def _haze(cloud: float) -> tuple[float, float, float]:
    """Radiance of the air towards the horizon, `sky_of` there."""
    clear, grey = (0.407, 0.517, 0.614), (0.459, 0.489, 0.519)
    return tuple(c * (1.0 - cloud) + g * cloud for c, g in zip(clear, grey, strict=True))  # type: ignore[return-value]


def _air(scenery: Scenery) -> dict[str, object]:
    weather = scenery.weather
    cloud = min(max(weather.cloud, 0.0), 1.0)
    sun = _sun(weather)
    strength = (1.0 - 0.8 * cloud) * min(1.0, 0.25 + 1.1 * sun[2])
    return {
        "u_sun": sun,
        "u_sunlight": (1.30 * strength, 1.22 * strength, 1.08 * strength),
        "u_skylight": (0.34 + 0.14 * cloud, 0.40 + 0.12 * cloud, 0.48 + 0.08 * cloud),
        "u_haze": _haze(cloud),
        "u_fog": 3.912 * log2(e) / max(weather.visibility_m, 1.0),
        "u_time": scenery.time_s % 3600.0,
        "u_cloud": cloud,
        "u_wind": weather.wind_mps,
    }
