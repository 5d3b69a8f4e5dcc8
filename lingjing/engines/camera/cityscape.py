"""`Cityscape`: the static city on the GPU.

For each picture, `view` selects tiles by pose. `shade` draws their shadow map unless the last one still fits. Then
`structures` and `floors` draw the materials near to far and top to bottom. The latest `KEPT_TILES` tiles stay loaded. A
dropped tile is built again, identically, when it is needed.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import moderngl
import numpy as np
import numpy.typing as npt

from lingjing.engines.camera import programs
from lingjing.engines.camera.classes import FIRST_ENTITY
from lingjing.engines.camera.culling import ShadowWindow, boxes_in_sight, distances, light_matrix, near_plane
from lingjing.engines.camera.effects import SHOWING, TownChanges
from lingjing.engines.camera.far_country import build_far_country
from lingjing.engines.camera.instances import Batch, prop_batches
from lingjing.engines.camera.lamps import lamp_heads
from lingjing.engines.camera.light import Light
from lingjing.engines.camera.mesh_cache import MeshCache
from lingjing.engines.camera.mesh_chunks import Chunks, chunks_of
from lingjing.engines.camera.mesh_rows import LAYOUT, MeshPart, VertexIndex, empty
from lingjing.engines.camera.road_meshes import middles_of
from lingjing.engines.camera.skyline import Skyline, build_skyline, with_tiles
from lingjing.engines.camera.structure_meshes import GroundBelow
from lingjing.engines.camera.tile_mesh import CASTERS, TileMesh, crossings_of, mesh_tile
from lingjing.engines.camera.town_ground import build_town_ground
from lingjing.engines.camera.view import MAPPED_FROM, TownView, choose
from lingjing.engines.camera.wall_order import Walls, planes_of, walls_of
from lingjing.scene.camera_geometry import focal_px
from lingjing.scene.city import City, Pieces, Prop, Tile
from lingjing.scene.tiles import TileKey, Tiles
from lingjing.trace.records import CameraPose

KEPT_TILES, KEPT_PIECES = 48, 12
"""Tiles that stay ready to draw, and tiles with city data in memory to build further ones (chosen)."""
WARM_M = 400.0
"""Distance from a place within which tiles are loaded before the first picture, metres (chosen)."""
ALOFT_M, TOUCHING_M = 5.0, 0.8
"""Height of a camera above which the near plane ignores moving things closer than the second value, metres (chosen)."""

SHADE_PX, SHADE_RIM_PX = 3072, 2
"""Side of the shadow map, and width of its unshaded rim; texels (chosen)."""

CROSSINGS_REACH_M = 60.0
"""Distance around a tile within which junctions and roads affect its meshes, metres (chosen)."""

STEEP_DEG, NEAREST_PX = 80.0, 1.4
"""Tilt (degrees) and texels per pixel from which the shadow map is read without interpolation (chosen)."""
LAYER = 2.0e-6
"""Clip-space step (of w) between coplanar layers. The near plane is chosen so that the step stays below a decimetre."""

LARGE_BACK = 1.0
"""Offset of lands near the eye, depth units per pixel; the ground has twice as much.

Near the eye the depth of such large triangles is not exact enough to separate layers. Farther away it is, and an offset
ground would lie below the water beside it.
"""
LAYERED = ("road", "paving", "soil")
"""Materials of which several layers may lie on each other."""
MATERIALS = {
    "wall": "wall.frag",
    "plain": "plain.frag",
    "road": "road.frag",
    "paving": "soil.frag",
    "soil": "soil.frag",
    "ground": "ground_of_town.frag",
}
"""Fragment shader of each material. A program is one material in one `Mode`, with the switches of both defined."""


class Mode(NamedTuple):
    """A variant of a material's program: the switches of its shaders."""

    wet: bool
    """True if surfaces are wet with rain."""
    night: bool
    """True after dark."""
    sunlit: bool
    """True within the reach of the shadow map."""
    mapped: bool = False
    """True if the ground shows the painted map."""
    averted: bool = False
    """Turned away from the sun."""
    even: bool = False
    """Too far away to show its grain."""
    blunt: bool = False
    """Too far away to show its windows."""
    aloft: bool = False
    """Country seen from high above."""


@dataclass(frozen=True, slots=True)
class _UploadedPart:
    """A part of a mesh on the GPU."""

    buffers: tuple[moderngl.Buffer, ...]
    """Vertices and indices."""
    lit: dict[Mode, moderngl.VertexArray]
    """Vertex arrays that draw it, by `Mode`."""
    cast: moderngl.VertexArray | None
    """Vertex array for the shadow map; None if it casts no shadow."""
    count: int
    """Number of indices."""

    def release(self) -> None:
        """Free the GL objects."""
        for array in self.lit.values():
            array.release()
        if self.cast is not None:
            self.cast.release()
        for buffer in self.buffers:
            buffer.release()


@dataclass(frozen=True, slots=True)
class _LoadedTile:
    """A tile that is ready to draw."""

    mesh: TileMesh
    """Boxes and extent of the tile; its vertices are in `sheets`."""
    sheets: Mapping[str, _UploadedPart]
    """Parts on the GPU, by material."""
    walls: Walls | None
    """Walls and their planes, for their order; None without walls."""
    chunks: Chunks | None
    """Chunks of the part "plain", for their culling; None without it."""
    props: tuple[Batch, ...]
    """Batches of props."""
    lively: tuple[Prop, ...]
    """Props with effects."""
    lamps: npt.NDArray[np.float64]
    """Positions of the lamps' lights, (n, 3) metres."""


class Cityscape:
    """Owner of the GL objects of one city; `release` frees them."""

    def __init__(self, context: moderngl.Context, city: City, under: GroundBelow) -> None:
        self._context, self._city, self._under = context, city, under
        self._variants: tuple[TownChanges, ...] = (TownChanges(),)
        self._programs: dict[tuple[str, Mode], moderngl.Program] = {}
        self._caster = context.program(
            vertex_shader=programs.source("caster.vert"), fragment_shader=programs.source("caster.frag")
        )
        self.tiles = Tiles(city, KEPT_PIECES)
        self._cache = MeshCache(city)
        self._skyline: Skyline = build_skyline(city, self.tiles)
        self._number = {key: k for k, key in enumerate(self._skyline.keys)}
        self._residents: OrderedDict[tuple[TileKey, int], _LoadedTile] = OrderedDict()
        self._differing: tuple[frozenset[TileKey], ...] = (frozenset(),)
        self.variant = 0
        self.town_ground = build_town_ground(city)
        self._blocks = self._upload("wall", self._skyline.blocks, casts=False)
        self._block_planes = planes_of(self._skyline.blocks)
        self._skyline = replace(self._skyline, blocks=empty())
        self._ground = self._upload("ground", self.town_ground.ground, casts=False)
        self._quays = self._upload("plain", self.town_ground.quays, casts=False)
        self._lands = self._upload("paving", self.town_ground.lands, casts=False)
        self.far_country = build_far_country(city, self.town_ground)
        self._far_lands = self._upload("paving", self.far_country.lands, casts=False)
        self._map = context.texture(self._skyline.map.shape[1::-1], 3, self._skyline.map.tobytes())
        self._map.repeat_x = self._map.repeat_y = False
        self._map.build_mipmaps()
        self._map.filter = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR
        self._shade = context.depth_texture((SHADE_PX, SHADE_PX))
        self._shade.compare_func = "<="
        self._shade.filter = moderngl.LINEAR, moderngl.LINEAR
        self._shade.repeat_x = self._shade.repeat_y = False
        self._shade_frame = context.framebuffer(depth_attachment=self._shade)
        self._shade_is: tuple[ShadowWindow, tuple[TileKey, ...]] | None = None
        self.shade_matrix = np.eye(4)
        self.light_uniform: tuple[float, ...] = ()

    def set_variants(self, variants: tuple[TownChanges, ...]) -> None:
        """Take over the changes of a mission; tiles that may have changed are built again.

        The first variant is drawn, or the one of the index in the attribute `variant`.
        """
        old, self._variants, self.variant = self._variants, variants, 0
        if [(d.tiles, d.entity_buildings) for d in old] == [(d.tiles, d.entity_buildings) for d in variants]:
            return
        for key, number in list(self._residents):
            if (
                number
                or old[0].entity_buildings != variants[0].entity_buildings
                or key in {*old[0].tiles, *variants[0].tiles}
            ):
                self._drop(self._residents.pop((key, number)))
        self._shade_is = None
        keys = {key for d in variants for key in (*d.tiles, *d.places.values())}
        self._differing = tuple(
            frozenset(key for key in keys if d.content(key) != variants[0].content(key)) for d in variants
        )

    def replace_props(self, city: City, under: GroundBelow) -> None:
        """Take over a city that differs from the present one only in its props, which are in no mesh.

        Its pictures are those of a `Cityscape` that was built for that city.
        """
        old, tiles = self.tiles, Tiles(city, KEPT_PIECES)
        self.tiles, self._city, self._under, self._shade_is = tiles, city, under, None
        self._skyline = with_tiles(self._skyline, city, tiles)
        self._number = {key: k for k, key in enumerate(tiles.keys)}
        changed = {key for variant in self._variants for key in variant.tiles}
        for (key, number), resident in list(self._residents.items()):
            if number or key in changed or key not in self._number:
                self._drop(self._residents.pop((key, number)))
            elif (tile := tiles.load(key)).props != old.load(key).props:
                self._residents[key, number] = _LoadedTile(
                    resident.mesh, resident.sheets, resident.walls, resident.chunks, *_props_of(tile)
                )

    # -- choosing

    def view(self, pose: CameraPose, visibility_m: float, light: Light) -> TownView:
        """Return the view of a picture: tiles, blocks and levels of detail."""
        return choose(self._skyline, self.town_ground, pose, visibility_m, light)

    def _closest(self, full: tuple[TileKey, ...], pose: CameraPose) -> float:
        """Return a lower bound of the distance to every static thing in sight, metres."""
        nearest = [max(pose.position[2] - 0.15, 0.1)]
        sky = self._skyline
        if len(sky.boxes):
            nearest.append(float(distances(sky.boxes[:, :], pose.position).min()) if not full else np.inf)
        for key in full:
            boxes = self.resident(key).mesh.boxes
            if len(boxes):
                shown = boxes[boxes_in_sight(boxes, pose)]
                nearest.append(float(distances(shown, pose.position).min(initial=np.inf)))
        return min(nearest)

    def near_plane(self, view: TownView, pose: CameraPose, others_m: float) -> float:
        """Return the near plane of a picture, metres; `others_m` is the distance of the closest moving thing.

        For a camera in the air a moving thing that almost touches it does not count: layers of the ground far below
        would no longer be separated.
        """
        if pose.position[2] > ALOFT_M:
            others_m = max(others_m, TOUCHING_M)
        return near_plane(pose, min(self._closest(view.full, pose), others_m))

    def resident(self, key: TileKey) -> _LoadedTile:
        """Return a tile, loaded if it was not."""
        slot = key, self.variant if key in self._differing[self.variant] else 0
        loaded = self._residents.get(slot)
        if loaded is None:
            loaded = self._residents[slot] = self._ready(key)
        self._residents.move_to_end(slot)
        return loaded

    def warm(self, places: Sequence[tuple[float, float, float]]) -> None:
        """Load the tiles around some places, those of the first place first."""
        for place in places:
            away = distances(self._skyline.boxes, place)
            for k in np.argsort(away, kind="stable").tolist():
                if away[k] > WARM_M or len(self._residents) >= KEPT_TILES:
                    break
                self.resident(self._skyline.keys[k])

    def trim(self) -> None:
        """Drop the least recently used tiles; call it between pictures."""
        while len(self._residents) > KEPT_TILES:
            self._drop(self._residents.popitem(last=False)[1])

    def _drop(self, resident: _LoadedTile) -> None:
        for sheet in resident.sheets.values():
            sheet.release()

    def _ready(self, key: TileKey) -> _LoadedTile:
        changed, entity_buildings = self._variants[self.variant].content(key)
        pieces: Pieces = changed or self.tiles.load(key)
        is_unchanged = changed is None and not entity_buildings
        meshed = partial(self._meshed, key, pieces, entity_buildings)
        mesh = self._cache.tile(key, meshed) if is_unchanged else meshed()
        sheets = {name: self._upload(name, part, casts=name in CASTERS) for name, part in mesh.parts.items()
                  if len(part.index)}  # fmt: skip
        bare = TileMesh({}, mesh.coarse, mesh.boxes, mesh.low, mesh.high)
        walls = walls_of(mesh.parts["wall"]) if "wall" in sheets else None
        chunks = chunks_of(mesh.parts["plain"]) if "plain" in sheets else None
        return _LoadedTile(bare, sheets, walls, chunks, *_props_of(pieces))

    def _meshed(self, key: TileKey, pieces: Pieces, entity_buildings: Mapping[str, int]) -> TileMesh:
        near = self._around(key)
        crossings = crossings_of(tuple(junction for tile in near for junction in tile.junctions))
        ways = tuple(road for tile in near for road in tile.roads)
        drawn_as = {building: FIRST_ENTITY + number for building, number in entity_buildings.items()}
        return mesh_tile(pieces, crossings, drawn_as, self._under, middles_of(ways))

    def _around(self, key: TileKey) -> tuple[Tile, ...]:
        west, south, _, east, north, _ = self._skyline.boxes[self._number[key]].tolist()
        radius = float(np.hypot(east - west, north - south)) / 2.0 + CROSSINGS_REACH_M
        return self.tiles.near((west + east) / 2.0, (south + north) / 2.0, radius)

    # -- drawing

    def shade(self, view: TownView) -> bool:
        """Begin the shadow map of a view with everything except props. Return False if the last map still fits.

        The caller draws the props with the matrix `light_uniform`.
        """
        wanted = view.window, view.casters
        if self._shade_is == wanted:
            return False
        sky = self._skyline
        boxes = sky.boxes[[self._number[key] for key in view.casters]]
        matrix = light_matrix(view.window, boxes)
        self._shade_frame.use()
        self._shade_frame.scissor = 0, 0, SHADE_PX, SHADE_PX
        self._shade_frame.clear(depth=1.0)
        inner = SHADE_PX - 2 * SHADE_RIM_PX  # points outside of the map read its rim, which must stay unshaded
        self._shade_frame.scissor = SHADE_RIM_PX, SHADE_RIM_PX, inner, inner
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.depth_func = "<"
        self.light_uniform = tuple(matrix.T.ravel().tolist())
        self._caster["u_light"] = self.light_uniform
        for key in view.casters:
            for name in CASTERS:
                sheet = self.resident(key).sheets.get(name)
                if sheet is not None and sheet.cast is not None:
                    sheet.cast.render(moderngl.TRIANGLES)
        half = np.array([[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1.0]])
        self.shade_matrix = half @ matrix
        self._shade_is = wanted
        return True

    def values(self, view: TownView) -> dict[str, object]:
        """Return the uniforms of the city's programs, and of any program with shadows."""
        texel = view.window.side_m / SHADE_PX
        matrix = self.shade_matrix
        west, south, east, north = self._city.bounds
        return {
            "u_shade": tuple(matrix.T.ravel().tolist()),
            "u_shade_step": 1.8 * texel + 0.02,
            "u_layer": LAYER,
            "u_map_bounds": (west, south, 1.0 / (east - west), 1.0 / (north - south)),
            "u_map_range": (MAPPED_FROM * view.reach_m, view.reach_m),
        }

    def bind(self, view: TownView, pose: CameraPose, shade_unit: int, map_unit: int) -> None:
        """Bind the textures. If a texel of the shadow map is about a pixel, the nearest texel replaces
        interpolation."""
        steep = pose.tilt_deg > STEEP_DEG
        pixel = pose.position[2] / focal_px(pose)
        coarse = steep and view.window.side_m / SHADE_PX < NEAREST_PX * pixel
        self._shade.filter = (moderngl.NEAREST,) * 2 if coarse else (moderngl.LINEAR,) * 2
        self._shade.use(shade_unit)
        self._map.use(map_unit)

    def programs(self, wet: bool, night: bool, blunt: bool, high: bool) -> tuple[moderngl.Program, ...]:
        """Return the programs of one kind of weather.

        `blunt` adds those of distant things, `high` those of country seen from high above.
        """
        modes = [Mode(wet, night, sunlit) for sunlit in (False, True)]
        needed = [self._program(name, mode) for name in MATERIALS for mode in modes]
        mapped, averted = Mode(wet, night, True, mapped=True), Mode(wet, night, False, averted=True)
        if blunt:
            even = [mode._replace(even=True) for mode in (*modes, averted)]
            wanted = [*(("wall", mode) for mode in even), *(("plain", mode) for mode in even[:2])]
            needed += [self._program(name, mode) for name, mode in wanted]
            needed.append(self._program("wall", even[0]._replace(blunt=True)))
        if high:
            aloft = [mode._replace(aloft=True) for mode in (modes[1], mapped)]
            needed += [self._program("paving", mode) for mode in aloft]
        return (
            *needed,
            *(self._program(name, mapped) for name in ("ground", "paving")),
            self._program("wall", averted),
        )

    def structures(self, view: TownView, pose: CameraPose, wet: bool, night: bool) -> None:
        """Draw walls and everything else that stands on the ground."""
        eye = pose.position
        for key in view.full:
            mode = Mode(wet, night, key in view.shaded, even=key in view.blunt)
            resident = self.resident(key)
            if resident.walls is not None:
                order = resident.walls.ordered(eye, view.window.sun)
                self._draw_walls(resident.sheets["wall"], *order, mode)
            if resident.chunks is not None:
                most = None if key in view.detailed else resident.mesh.coarse
                self._context.disable(moderngl.CULL_FACE)
                _draw_runs(resident.sheets["plain"].lit[mode], resident.chunks.in_sight(pose, most))
        for blunt, ranges in ((False, view.far), (True, view.farther)):
            if ranges:
                self._draw_blocks(ranges, eye, Mode(wet, night, False, even=view.reaching, blunt=blunt))
        self._context.disable(moderngl.CULL_FACE)

    def floors(self, view: TownView, wet: bool, night: bool) -> None:
        """Draw roads, pavings and the ground, top to bottom."""
        for name in ("road", "paving", "soil"):
            for key in view.full:
                mode = Mode(wet, night, key in view.shaded)
                self._draw(self.resident(key).sheets, name, mode)
        mode = Mode(wet, night, True)
        if self._quays.count:
            self._quays.lit[mode].render(moderngl.TRIANGLES)
        aloft = mode._replace(aloft=view.high)
        layers = (1.0, self._lands, view.lands, aloft), (2.0, self._ground, view.ground, mode)
        for back, sheet, cells, look in layers:
            if not sheet.count:
                continue
            for some in cells:
                self._context.polygon_offset = back * LARGE_BACK * some.close, 0.0
                _draw_runs(sheet.lit[look._replace(mapped=some.mapped)], some.runs)
        self._context.polygon_offset = 0.0, 0.0
        if view.high and self._far_lands.count:
            self._far_lands.lit[aloft].render(moderngl.TRIANGLES)
        self._context.disable(moderngl.CULL_FACE)

    def _draw(self, sheets: Mapping[str, _UploadedPart], name: str, mode: Mode) -> None:
        if name in sheets:
            self._one_sided()
            sheets[name].lit[mode].render(moderngl.TRIANGLES)

    def _draw_walls(self, sheet: _UploadedPart, index: VertexIndex, lit: int, seen: int, mode: Mode) -> None:
        self._one_sided()
        sheet.buffers[1].write(index.tobytes())
        if not mode.sunlit:
            if seen:
                sheet.lit[mode].render(moderngl.TRIANGLES, vertices=seen)
            return
        if lit:
            sheet.lit[mode].render(moderngl.TRIANGLES, vertices=lit)
        if lit < seen:
            averted = mode._replace(sunlit=False, averted=True)
            sheet.lit[averted].render(moderngl.TRIANGLES, vertices=seen - lit, first=lit)

    def _draw_blocks(self, ranges: Sequence[tuple[int, int]], eye: tuple[float, float, float], mode: Mode) -> None:
        self._one_sided()
        index = self._block_planes.among(ranges, eye)
        if not len(index):
            return
        self._blocks.buffers[1].write(index.tobytes())
        self._blocks.lit[mode].render(moderngl.TRIANGLES, vertices=len(index))

    def _one_sided(self) -> None:
        """Cull back faces. Pictures are upside down in GL terms, so front faces are clockwise."""
        self._context.front_face = "cw"
        self._context.enable(moderngl.CULL_FACE)

    # -- GL objects

    def release(self) -> None:
        """Free all GL objects."""
        sheets = [sheet for resident in self._residents.values() for sheet in resident.sheets.values()]
        for sheet in (*sheets, self._blocks, self._ground, self._lands, self._quays, self._far_lands):
            sheet.release()
        for program in (self._caster, *self._programs.values()):
            program.release()
        self._shade_frame.release()
        for texture in (self._map, self._shade):
            texture.release()
        self._residents.clear()

    def _program(self, name: str, mode: Mode) -> moderngl.Program:
        if (name, mode) not in self._programs:
            switches = {"layered": name in LAYERED, "jointed": name == "paving", name: True, **mode._asdict()}
            defined = [switch.upper() for switch, on in switches.items() if on]
            self._programs[name, mode] = programs.build(
                self._context,
                programs.source("city.vert", *defined),
                programs.source(MATERIALS[name], *defined),
            )
        return self._programs[name, mode]

    def _upload(self, name: str, part: MeshPart, casts: bool) -> _UploadedPart:
        if not len(part.index):
            return _UploadedPart((), {}, None, 0)
        vertices, index = self._context.buffer(part.vertices.tobytes()), self._context.buffer(part.index.tobytes())
        cast = None
        if casts:
            layout = _layout(self._caster)
            cast = self._context.vertex_array(self._caster, [(vertices, *layout)], index, 4)
        return _UploadedPart((vertices, index), _Lit(self, name, vertices, index), cast, len(part.index))

    def array_of(
        self, name: str, vertices: moderngl.Buffer, index: moderngl.Buffer, mode: Mode
    ) -> moderngl.VertexArray:
        """Return a vertex array of a material for one mode."""
        program = self._program(name, mode)
        return self._context.vertex_array(program, [(vertices, *_layout(program))], index, 4)


class _Lit(dict[Mode, moderngl.VertexArray]):
    """Vertex arrays by mode, built on first use."""

    def __init__(self, owner: Cityscape, name: str, vertices: moderngl.Buffer, index: moderngl.Buffer) -> None:
        super().__init__()
        self._make = owner, name, vertices, index

    def __missing__(self, key: Mode) -> moderngl.VertexArray:
        owner, name, vertices, index = self._make
        self[key] = owner.array_of(name, vertices, index, key)
        return self[key]


def _props_of(pieces: Pieces) -> tuple[tuple[Batch, ...], tuple[Prop, ...], npt.NDArray[np.float64]]:
    """Return the props of a tile for a `_LoadedTile`: batches, props with effects, positions of lamps."""
    lively = tuple(prop for prop in pieces.props if prop.model in SHOWING)
    return prop_batches(pieces), lively, lamp_heads(pieces.props)


def _layout(program: moderngl.Program) -> tuple[str, ...]:
    sizes = [size if name in program else f"{4 * int(size[0])}x" for size, name in LAYOUT]
    return (" ".join(sizes), *(name for _, name in LAYOUT if name in program))


def _draw_runs(array: moderngl.VertexArray, runs: Iterable[tuple[int, int]]) -> None:
    for first, count in runs:
        array.render(moderngl.TRIANGLES, vertices=count, first=first)
