"""`Renderer`: one picture from a pose, a sea and the instances.

Order of drawing: static things (buildings and props of a city), ground, solids, water and sky, so that each pixel is
shaded about once. Then shadows, blots and marks are blended into the colour alone. Objects follow, then soft sprites
(flames, spray, smoke) and rain. The solid bodies of flames and spray write ids and depth last.

Moving things have planar shadows: a mesh projected along the sun's rays onto its plane. It is drawn twice, so that
overlaps darken once: first its alpha is marked, then the colour is multiplied by the mark and the mark removed. A city
and everything static in it have a shadow map (`cityscape`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import moderngl
import numpy as np
import numpy.typing as npt

from lingjing.engines.camera import uniforms
from lingjing.engines.camera.array_cache import cached_array
from lingjing.engines.camera.cityscape import TOUCHING_M, Cityscape
from lingjing.engines.camera.classes import CLASSES
from lingjing.engines.camera.context import mipmapped, open_context, renderer_name
from lingjing.engines.camera.culling import blunt_from, near_plane, sky_bounds
from lingjing.engines.camera.effects import TownChanges, prop_effects
from lingjing.engines.camera.effects.drawing import EffectPass
from lingjing.engines.camera.effects.night import darkness
from lingjing.engines.camera.effects.particles import BILLBOARD, DECAL, Rows, wind_of
from lingjing.engines.camera.far_country import HIGH_M
from lingjing.engines.camera.ground import Ground, LandSurface
from lingjing.engines.camera.instances import Batch, afloat, by_detail, in_sight, visible
from lingjing.engines.camera.lamps import lamp_pools, lamp_rows
from lingjing.engines.camera.light import Light, light_of
from lingjing.engines.camera.meshes import indexed
from lingjing.engines.camera.noise import GRAIN, cloud_texture, grain_texture, noise_texture
from lingjing.engines.camera.ocean import SeaSurface
from lingjing.engines.camera.programs import build, source
from lingjing.engines.camera.prop_groups import MergedProps, looks_of, merged
from lingjing.engines.camera.reduced_meshes import reduced
from lingjing.engines.camera.render_targets import MAX_TARGETS, Buffers, PixelRect, Target, overlap
from lingjing.engines.camera.structure_meshes import GroundBelow
from lingjing.engines.camera.upload import Model, rows_array, upload, upload_still
from lingjing.engines.camera.view import TownView
from lingjing.engines.camera.water_pass import WaterPass
from lingjing.mission.instance import Vector, Weather
from lingjing.scene.camera_geometry import focal_px
from lingjing.scene.city import City
from lingjing.trace.records import CameraPose

NOISE_UNIT, SHADE_UNIT, MAP_UNIT, CLOUD_UNIT, GRAIN_UNIT = 3, 4, 5, 6, 7
"""Texture units after those of the waters."""
GRAINS = {"u_grain": slice(0, 4), "u_paved": slice(0, 2), "u_street": slice(2, 4), "u_tone": slice(2, 3)}
"""Channels of the grain that each texture holds. A software renderer spends time on every byte that it reads."""
WARM_SIZE, WARM_UP_M = (320, 180), 60.0
"""Size in pixels, and height over a place in metres, of the pictures that compile programs (chosen)."""
GRAIN_M = 64.0
"""Length that the grain's texture spans, metres (`GRAIN_M` of `city.glsl`)."""
RELIEF_M = 500.0
"""Upper bound of the height of land, metres."""
SEA_FLOOR, GROUND_FLOOR = (0.013, 0.065, 0.08), (0.09, 0.10, 0.05)
"""Linear colours of sea and country at the horizon of an eye high above."""
FLAKES_FROM = 0.3
"""Cover of snow from which rain falls as snow (chosen)."""
GROUND_CLASSES = tuple(CLASSES[name] for name in ("sand", "grass", "rock", "concrete"))
"""Class ids with a program of their own for the ground."""


@dataclass(frozen=True, slots=True)
class Scenery:
    """The moving content of a picture: everything besides the static ground and town."""

    time_s: float
    """Simulated time, seconds."""
    weather: Weather
    """The weather."""
    sea: tuple[SeaSurface, SeaSurface]
    """Swell and ripple at that time."""
    batches: Sequence[Batch]
    """Instances of meshes."""
    marks: npt.NDArray[np.void]
    """Marks on the water."""
    billboards: npt.NDArray[np.void] = field(default_factory=lambda: np.zeros(0, BILLBOARD))
    """Rows of `BILLBOARD`."""
    decals: npt.NDArray[np.void] = field(default_factory=lambda: np.zeros(0, DECAL))
    """Rows of `DECAL`."""
    variant: int = 0
    """Index of the town's variant that it shows (`Cityscape.set_variants`)."""


class Renderer:
    """Owner of the GL context and of everything in it; `close` frees all. Not thread-safe."""

    def __init__(self) -> None:
        self.context = open_context()
        self.name = renderer_name(self.context)
        self._objects = self._pair("object.vert", "object.frag")
        self._dull = self._pair("object.vert", "object.frag", "DULL")
        self._grounds = {cls: self._pair("ground.vert", "ground.frag", f"SURFACE {cls}") for cls in GROUND_CLASSES}
        self._sky = self._program("sky.vert", "sky.frag")
        self._below = self._program("below.vert", "below.frag")
        self._shadow = self._program("shadow.vert", "shadow.frag")
        self._mark = self._program("mark.vert", "mark.frag")
        self._rain = self._program("sky.vert", "rain.frag")
        self._snow = self._program("sky.vert", "rain.frag", "FLAKES")
        self._tree_shade = self._program("caster_instanced.vert", "caster.frag")
        self._effects = EffectPass(self.context)
        self._programs = (
            *self._objects, *self._dull, *(p for pair in self._grounds.values() for p in pair),
            self._sky, self._below, self._shadow, self._mark, self._rain, self._snow, self._tree_shade,
        )  # fmt: skip
        corners = np.array([-1, -1, 1, -1, 1, 1, -1, -1, 1, 1, -1, 1], "f4")
        self._corners = self.context.buffer(corners.tobytes())
        self._water = WaterPass(self.context, corners)
        self._noise = mipmapped(self.context, noise_texture())
        grain = cached_array("grain", grain_texture)
        self._grains = {
            name: mipmapped(self.context, np.ascontiguousarray(grain[..., part])) for name, part in GRAINS.items()
        }
        self._clouds = mipmapped(self.context, cached_array("clouds", cloud_texture))
        self._clouds.filter = moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR
        self._below_vao = self.context.vertex_array(self._below, [(self._corners, "2f", "in_corner")])
        self._sky_vao = self.context.vertex_array(self._sky, [(self._corners, "2f", "in_corner")])
        self._rain_vao = self.context.vertex_array(self._rain, [(self._corners, "2f", "in_corner")])
        self._snow_vao = self.context.vertex_array(self._snow, [(self._corners, "2f", "in_corner")])
        self._town: Cityscape | None = None
        self._casting: dict[str, tuple[Model, moderngl.VertexArray]] = {}
        self._standing = MergedProps()
        self._warmed: set[tuple[bool, bool, bool]] = set()
        self._surfaces: list[tuple[LandSurface, Model]] = []
        self._solids: list[Model] = []
        self._models: dict[str, Model] = {}
        self._targets: dict[tuple[tuple[int, int], bool], Target] = {}
        self._level = 0.0

    def load(self, ground: Ground, town: tuple[City, GroundBelow] | None = None) -> None:
        """Replace the static geometry; `town` is a city with streets and buildings."""
        with self.context:
            self._unload()
            self._load(ground)
            if town is not None:
                self._load_town(*town)

    def _load(self, ground: Ground) -> None:
        self._surfaces = [(land, self._land(land, ground.level_m)) for land in ground.surfaces]
        self._solids = [
            upload_still(self.context, (self._objects[0], self._shadow), indexed(mesh), plane, CLASSES["structure"])
            for plane, mesh in ground.solids
        ]
        self._water.load(ground)
        self._level = ground.level_m

    def set_variants(self, *variants: TownChanges) -> None:
        """Take over the changes of a mission to a town: the variant that pictures show, then those for `redraw`."""
        if self._town is not None:
            with self.context:
                self._town.set_variants(variants)

    def replace_props(self, city: City, under: GroundBelow) -> None:
        """Take over a town that differs from the loaded one only in its props."""
        assert self._town is not None
        with self.context:
            self._town.replace_props(city, under)

    def _load_town(self, city: City, under: GroundBelow) -> None:
        self._town = Cityscape(self.context, city, under)
        self._surfaces = [(land, self._shaded_land(model, land)) for land, model in self._surfaces]
        self._water.load_lakes(self._town.town_ground.waters, self._town.far_country.waters)

    def _shaded_land(self, old: Model, land: LandSurface) -> Model:
        old.release()
        return self._land(land, self._level, shaded=True)

    def _unload(self) -> None:
        for model in [*(m for _, m in self._surfaces), *self._solids, *self._models.values()]:
            model.release()
        for model, array in self._casting.values():
            array.release()
            model.release()
        self._water.unload()
        if self._town is not None:
            self._town.release()
        self._surfaces, self._solids, self._models, self._casting = [], [], {}, {}
        self._standing = MergedProps()
        self._warmed.clear()
        self._town = None

    def warm(self, places: Sequence[Vector], weather: Weather, staged: Callable[[], Scenery], depth: bool) -> None:
        """Load what pictures near some places need: tiles, and once for each kind of weather the programs.

        A small picture of the scenery `staged` is drawn and dropped, so that programs are compiled. Later pictures do
        not depend on it.
        """
        with self.context:
            if self._town is not None:
                self._town.warm(places)
            light = light_of(weather, places[0][2] - self._level)
            kind = light.wet, light.lamps, depth
            if kind in self._warmed:
                return
            self._warmed.add(kind)
            scenery = staged()
            for tilt in (90.0, 10.0):
                east, north, up = places[0]
                pose = CameraPose(position=(east, north, up + WARM_UP_M), heading_deg=0.0, tilt_deg=tilt, roll_deg=0.0,
                                  hfov_deg=84.0, width=WARM_SIZE[0], height=WARM_SIZE[1])  # fmt: skip
                self._render(pose, scenery, depth)
            self._targets.pop((WARM_SIZE, depth)).release()

    def render(self, pose: CameraPose, scenery: Scenery, depth: bool, near_m: float | None = None) -> Buffers:
        """Draw one picture and read it back. Without `near_m` it has its own near plane."""
        with self.context:
            return self._render(pose, scenery, depth, near_m)

    def near_plane(self, pose: CameraPose, scenery: Scenery) -> float:
        """Return the near plane of a picture, metres; the nearest thing in it decides."""
        with self.context:
            return self._near(pose, scenery, self._view(pose, scenery))

    def redraw(self, pose: CameraPose, scenery: Scenery, depth: bool, place: PixelRect, near_m: float) -> Buffers:
        """Return a part of a picture, after `render` of the same pose.

        They equal those of the whole picture with this near plane, pixel by pixel. The town's shadow map stays as
        `render` left it.
        """
        with self.context:
            return self._draw(pose, scenery, depth, near_m, self._view(pose, scenery), place).read_part(place, near_m)

    def _render(self, pose: CameraPose, scenery: Scenery, depth: bool, near_m: float | None = None) -> Buffers:
        view = self._view(pose, scenery)
        if view is not None:
            self._shade(view)
        near_m = self._near(pose, scenery, view) if near_m is None else near_m
        return self._draw(pose, scenery, depth, near_m, view, None).read(near_m)

    def _light(self, pose: CameraPose, scenery: Scenery) -> Light:
        return light_of(scenery.weather, pose.position[2] - self._level)

    def _view(self, pose: CameraPose, scenery: Scenery) -> TownView | None:
        """Return the view of the town, which shows the scenery's variant from now on; None without a town."""
        if self._town is None:
            return None
        self._town.variant = scenery.variant
        return self._town.view(pose, scenery.weather.visibility_m, self._light(pose, scenery))

    def _near(self, pose: CameraPose, scenery: Scenery, view: TownView | None) -> float:
        if self._town is not None and view is not None:
            return self._town.near_plane(view, pose, _closest(scenery, pose))
        if pose.position[2] > HIGH_M:
            return near_plane(pose, min(pose.position[2] - RELIEF_M, max(_closest(scenery, pose), TOUCHING_M)))
        return uniforms.bay_near(pose)

    def _draw(
        self,
        pose: CameraPose,
        scenery: Scenery,
        depth: bool,
        near_m: float,
        view: TownView | None,
        place: PixelRect | None,
    ) -> Target:
        """Draw a picture, or a part of the last picture again."""
        light = self._light(pose, scenery)
        target = self._target((pose.width, pose.height), depth)
        self._prepare(pose, scenery, light, view, near_m)
        target.frame.use()
        target.frame.scissor = place  # type: ignore[assignment] # None: the whole picture
        target.write(colour=True, alpha=True, rest=True)
        target.clear(uniforms.haze(light))
        self.context.enable_only(moderngl.DEPTH_TEST)
        self.context.depth_func = "<="
        weather = light.wet, light.lamps
        if self._town is not None and view is not None:
            self._draw_props(pose, view)
            self._town.structures(view, pose, *weather)
        for land, model in self._surfaces:
            _draw_land(land, model, pose)
        for model in self._solids:
            model.lit.render(instances=1)
        if self._town is not None and view is not None:
            self._town.floors(view, *weather)
        self._water.draw(sea=self._has_sea, high=pose.position[2] > HIGH_M)
        self._draw_sky(target, pose, place)
        if pose.position[2] > HIGH_M:
            self._below_vao.render()
        scenery = self._with_prop_effects(scenery, view, pose, light)
        drawn = self._fill(pose, scenery, light)
        self._blend(target, drawn, scenery, light)
        for model, _, count in drawn:
            if count:
                model.lit.render(instances=count)
        self._draw_air(target, pose, scenery, light)
        target.frame.scissor = None  # type: ignore[assignment] # the whole picture
        if self._town is not None:
            self._town.trim()
        return target

    @property
    def _has_sea(self) -> bool:
        """True if there is open water; a town may have none."""
        return self._town is None or self._town.town_ground.sea is not None

    def _draw_sky(self, target: Target, pose: CameraPose, place: PixelRect | None) -> None:
        """Draw the sky in the part of the picture that can show it; below, all is ground or water."""
        shown = sky_bounds(pose, self._level)
        if shown is not None and place is not None:
            shown = overlap(shown, place)
        if shown is not None:
            target.frame.scissor = shown
            self._sky_vao.render()
            target.frame.scissor = place  # type: ignore[assignment] # None: the whole picture

    def _draw_air(self, target: Target, pose: CameraPose, scenery: Scenery, light: Light) -> None:
        """Draw flames, smoke, spray, glow and rain, which write neither ids nor depth.

        Then the bodies of flames and spray write ids and depth, without colour.
        """
        target.write(colour=True, alpha=False, rest=False)
        self._effects.clouds(scenery.billboards, pose.position)
        if light.rain > 0.0:
            self.context.enable_only(moderngl.BLEND)
            self.context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
            (self._snow_vao if light.snow >= FLAKES_FROM else self._rain_vao).render()
        self.context.enable_only(moderngl.DEPTH_TEST)
        target.write(colour=False, alpha=False, rest=True)
        self._effects.bodies(scenery.billboards)
        target.write(colour=True, alpha=True, rest=True)

    def _with_prop_effects(self, scenery: Scenery, view: TownView | None, pose: CameraPose, light: Light) -> Scenery:
        """Return the scenery with the effects of the tiles' props and, after dark, with their lamps."""
        if self._town is None or view is None:
            return scenery
        tiles = [self._town.resident(key) for key in view.full]
        props = [prop for tile in tiles for prop in tile.lively]
        effects_of_props = [prop_effects(prop, scenery.time_s, scenery.weather) for prop in props]
        lamps = [lamp_rows(tile.lamps, pose.position, light.dark) for tile in tiles] if light.lamps else []
        pools = [lamp_pools(tile.lamps, pose.position, darkness(scenery.weather)) for tile in tiles]
        return replace(
            scenery,
            billboards=np.concatenate(
                [scenery.billboards, *(_prop_billboards(effects.billboards) for effects in effects_of_props), *lamps]
            ),
            decals=np.concatenate([scenery.decals, *(effects.decals for effects in effects_of_props), *pools]),
        )

    def _shade(self, view: TownView) -> None:
        """Update the shadow map, with plants and other props."""
        assert self._town is not None
        if not self._town.shade(view):
            return
        self._tree_shade["u_light"] = self._town.light_uniform
        for batch in merged([self._town.resident(key).props for key in view.casters]):
            mesh = reduced(batch)
            key = f"shade/{batch.key}"
            model, array = self._caster(key, batch.coarsest if mesh is None else mesh, len(batch.rows))
            model.place(batch.rows)
            array.render(instances=len(batch.rows))

    def _caster(self, key: str, mesh: npt.NDArray[np.float32], needed: int) -> tuple[Model, moderngl.VertexArray]:
        caster = self._casting.get(key)
        if caster is None or caster[0].capacity < needed:
            if caster is not None:
                caster[1].release()
                caster[0].release()
            model = upload(self.context, (self._objects[1], self._shadow), indexed(mesh), max(needed, 64))
            caster = self._casting[key] = model, rows_array(self.context, self._tree_shade, model)
        return caster

    def _draw_props(self, pose: CameraPose, view: TownView) -> None:
        """Draw trees, lamps and other props of the tiles in sight; small plants have simpler meshes."""
        assert self._town is not None
        lump_m, _ = blunt_from(view.reach_m)
        for batch in self._standing.of([self._town.resident(key).props for key in sorted(view.full)]):
            for look in looks_of(batch, pose, lump_m):
                model = self._loaded(look.key, look.mesh, len(look.rows), look.dull)
                model.place(look.rows)
                model.lit.render(instances=len(look.rows))

    def close(self) -> None:
        """Free every GL object, then the context."""
        with self.context:
            self._release()
        self.context.release()

    def _release(self) -> None:
        self._unload()
        for target in self._targets.values():
            target.release()
        self._targets = {}
        self._effects.release()
        self._water.release()
        for texture in (self._noise, *self._grains.values(), self._clouds):
            texture.release()
        for array in (self._below_vao, self._sky_vao, self._rain_vao, self._snow_vao):
            array.release()
        self._corners.release()
        for program in self._programs:
            program.release()

    def _target(self, size: tuple[int, int], depth: bool) -> Target:
        key = size, depth
        if key not in self._targets:
            if len(self._targets) >= MAX_TARGETS:
                self._targets.pop(next(iter(self._targets))).release()
            self._targets[key] = Target(self.context, size, depth)
        return self._targets[key]

    def _pair(self, vertex: str, fragment: str, *defined: str) -> tuple[moderngl.Program, moderngl.Program]:
        """Return the programs of objects without and with shadows from the shadow map."""
        program = self.context.program  # flat varyings cost many small triangles more than uniforms do
        plain, shaded = (
            program(vertex_shader=source(vertex, *more), fragment_shader=source(fragment, *more))
            for more in (defined, ("SHADED", *defined))
        )
        return plain, shaded

    def _program(self, vertex: str, fragment: str, *defined: str) -> moderngl.Program:
        return build(self.context, source(vertex), source(fragment, *defined))

    def _land(self, land: LandSurface, level: float, shaded: bool = False) -> Model:
        program = self._grounds.get(land.cls, self._grounds[CLASSES["concrete"]])[shaded]
        index = np.concatenate([patch.triangles.ravel() for patch in land.patches])
        return upload_still(self.context, (program, self._shadow), (land.vertices, index), level, land.cls)

    def _prepare(self, pose: CameraPose, scenery: Scenery, light: Light, view: TownView | None, near_m: float) -> None:
        self._water.prepare(pose, scenery.sea)
        self._noise.use(NOISE_UNIT)
        self._clouds.use(CLOUD_UNIT)
        for unit, texture in enumerate(self._grains.values(), GRAIN_UNIT):
            texture.use(unit)
        self._noise.filter = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR
        values: dict[str, object] = {**uniforms.air(light, scenery.time_s, scenery.weather.wind_mps)}
        values |= {
            **self._water.values(),
            "u_noise": NOISE_UNIT,
            "u_clouds": CLOUD_UNIT,
            **{name: unit for unit, name in enumerate(GRAINS, GRAIN_UNIT)},
            "u_level": self._level,
            "u_layer": 0.0,
            "u_rain": light.rain,
            "u_snow": light.snow,
            "u_blow": wind_of(scenery.weather.wind_mps, scenery.weather.wind_from_deg)[:2],
            "u_ridge": float(self._town is not None),
            **self._floor(),
            "u_silt": float(not self._has_sea),
        }
        programs: tuple[moderngl.Program, ...] = (*self._programs, *self._water.programs, *self._effects.programs)
        if self._town is not None and view is not None:
            self._town.bind(view, pose, SHADE_UNIT, MAP_UNIT)
            self._noise.filter = moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR
            for texture in self._grains.values():
                texture.filter = _grain_filter(pose)
            values |= {**self._town.values(view), "u_shadow": SHADE_UNIT, "u_map": MAP_UNIT}
            programs = (*programs, *self._town.programs(light.wet, light.lamps, view.reaching, view.high))
        values |= uniforms.view(pose, near_m)
        for program in programs:
            own = {**values, **uniforms.space(light, pose.position[2])} if program is self._sky else values
            for name in program:
                if name in own:
                    program[name] = own[name]

    def _floor(self) -> dict[str, object]:
        """Return the uniforms of the horizon for an eye high above."""
        if self._has_sea:
            return {"u_floor": (*SEA_FLOOR, 1.0), "u_floor_is": (self._level, float(CLASSES["water"]))}
        return {"u_floor": (*GROUND_FLOOR, 0.0), "u_floor_is": (0.0, float(CLASSES["grass"]))}

    def _fill(self, pose: CameraPose, scenery: Scenery, light: Light) -> list[tuple[Model, int, int]]:
        """Return for each mesh: model, number of instances with visible shadows, and how many of these are visible.

        The visible ones come first in the model.
        """
        drawn = []
        slack = 1.0 + 2.0 / max(light.sun[2], 0.2)
        for batch in (part for whole in scenery.batches for part in by_detail(whole, pose)):
            near = visible(batch.rows, batch.radius, pose, slack) | _casts_far(batch)
            if not near.any():
                continue
            rows = afloat(batch, scenery.sea[0])
            seen = visible(rows, batch.radius, pose) & near
            ordered: Rows = np.concatenate([rows[seen], rows[near & ~seen]])
            drawn += self._placed(batch, ordered, int(seen.sum()))
        return drawn

    def _placed(self, batch: Batch, ordered: Rows, seen: int) -> list[tuple[Model, int, int]]:
        """Return the models of a batch as in `_fill`. The coarsest level of detail casts the shadows of all levels."""
        model = self._loaded(batch.key, batch.mesh, len(batch.rows))
        model.place(ordered)
        if batch.coarsest is batch.mesh:
            return [(model, len(ordered), seen)]
        caster = self._loaded(f"{batch.key}/shadow", batch.coarsest, len(batch.rows))
        caster.place(ordered)
        return [(model, 0, seen), (caster, len(ordered), 0)]

    def _loaded(self, key: str, mesh: npt.NDArray[np.float32], needed: int, dull: bool = False) -> Model:
        model = self._models.get(key)
        if model is None or model.capacity < needed:
            if model is not None:
                model.release()
            lit = (self._dull if dull else self._objects)[self._town is not None]
            room = needed if self._town is None else max(64, 2 * needed)
            model = self._models[key] = upload(self.context, (lit, self._shadow), indexed(mesh), room)
        return model

    def _blend(self, target: Target, drawn: list[tuple[Model, int, int]], scenery: Scenery, light: Light) -> None:
        self.context.enable(moderngl.BLEND)
        self._marks(target, scenery)
        if len(scenery.decals):
            target.write(colour=True, alpha=False, rest=False)
            self._effects.decals(scenery.decals)
            self.context.enable(moderngl.BLEND)
        casters = [(model, count) for model, count, _ in drawn] + [(model, 1) for model in self._solids]
        target.write(colour=False, alpha=True, rest=False)
        self._cast(casters, _shade(light), (moderngl.ONE, moderngl.ZERO))
        target.write(colour=True, alpha=True, rest=False)
        self._cast(casters, 1.0, (moderngl.ZERO, moderngl.DST_ALPHA, moderngl.ONE, moderngl.ZERO))
        target.write(colour=True, alpha=True, rest=True)
        self.context.disable(moderngl.BLEND)

    def _cast(self, casters: list[tuple[Model, int]], alpha: float, blend: tuple[int, ...]) -> None:
        self._shadow["u_shade_left"] = alpha
        self.context.blend_func = blend  # type: ignore[assignment] # two or four factors
        for model, count in ((model, count) for model, count in casters if count):
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


def _grain_filter(pose: CameraPose) -> tuple[int, int]:
    """Return the filter of the grain. If a pixel of the ground spans most of a texel, the nearest texel suffices.

    A software renderer then takes a third of the time of interpolation.
    """
    coarse = pose.position[2] / focal_px(pose) > 0.6 * GRAIN_M / GRAIN
    return (
        (moderngl.NEAREST_MIPMAP_NEAREST, moderngl.NEAREST)
        if coarse
        else (moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR)
    )


def _draw_land(land: LandSurface, model: Model, pose: CameraPose) -> None:
    """Draw the patches that the picture can show, neighbours in one call."""
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
    """Return which instances are high over their shadow's plane, so that their shadow lies far away from them."""
    high = batch.rows["rows"][:, 2, 3] - batch.rows["plane"]
    return np.asarray(high > 2.0 * batch.radius)


def _shade(light: Light) -> float:
    """Return the share of the developed colour that remains in a shadow."""
    return 0.60 + 0.32 * light.cloud + (0.40 - 0.32 * light.cloud) * light.dark


def _closest(scenery: Scenery, pose: CameraPose) -> float:
    """Return the distance of the nearest thing of the scenery in sight, metres."""
    eye, nearest = np.array(pose.position), np.inf
    for batch in scenery.batches:
        at = batch.rows["rows"][:, :, 3].astype(np.float64)
        seen = in_sight(at, batch.radius, pose)
        away = np.linalg.norm(at - eye, axis=1)[seen] - batch.radius[seen]
        nearest = min(nearest, float(away.min(initial=np.inf)))
    return max(nearest, 0.0)


def _prop_billboards(rows: npt.NDArray[np.void]) -> npt.NDArray[np.void]:
    """Return billboards of a prop; rows of a body get the id of props."""
    rows = rows.copy()
    rows["id"] *= CLASSES["prop"]
    return rows
