"""`WaterPass`: the open sea and the lakes of a town, with waves, ripples and shore as textures.

The owner of the GL context sets the uniforms of `programs` as it does for its own, with `values`, and chooses what
drawing may write. From high above, simpler fragment shaders draw the sea to the horizon.
"""

from __future__ import annotations

from collections.abc import Iterable

import moderngl
import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.context import mipmapped
from lingjing.engines.camera.far_country import SPAN_M
from lingjing.engines.camera.ground import SHORE_REACH_M, Ground
from lingjing.engines.camera.mesh_rows import MeshPart
from lingjing.engines.camera.noise import lace_texture
from lingjing.engines.camera.ocean import RIPPLE_M, SeaSurface
from lingjing.engines.camera.ocean import SIZE as SEA_SIZE
from lingjing.engines.camera.programs import build, source
from lingjing.scene.camera_geometry import focal_px
from lingjing.trace.records import CameraPose

SEA_SPAN_M = 30_000.0
"""Distance to which `water.vert.glsl` spreads the sea, metres."""

SWELL_UNIT, RIPPLE_UNIT, SHORE_UNIT = 0, 1, 2
"""Texture units of swell, ripples and shore."""

Lake = tuple[float, moderngl.VertexArray, tuple[moderngl.Buffer, ...]]
"""Level (m), vertex array and its buffers."""


class WaterPass:
    """Owner of four programs, the textures of waves and shore, and the lakes.

    `unload` frees the lakes and the shore, `release` the rest.
    """

    def __init__(self, context: moderngl.Context, corners: npt.NDArray[np.float32]) -> None:
        """Compile the programs; `corners` are those of a quad of two triangles, -1 to 1."""
        self._context = context
        self._near_sea, self._near_lake = self._program("water.vert"), self._program("lake.vert")
        self._far_sea, self._far_lake = self._program("water.vert", "ALOFT"), self._program("lake.vert", "ALOFT")
        self._corners = context.buffer(corners.tobytes())
        self._far_corners = context.buffer((corners * np.float32(SPAN_M / SEA_SPAN_M)).tobytes())
        self._near_array = context.vertex_array(self._near_sea, [(self._corners, "2f", "in_corner")])
        self._far_array = context.vertex_array(self._far_sea, [(self._far_corners, "2f", "in_corner")])
        self._lace = lace_texture()
        empty = np.zeros((SEA_SIZE, SEA_SIZE, 4), np.uint8)
        self._waves = (mipmapped(context, empty), mipmapped(context, empty))
        self._scales = ((1.0, 1.0), (1.0, 1.0))
        self._sea: tuple[SeaSurface, SeaSurface] | None = None
        self._shore = context.texture((1, 1), 2, b"\xff\x80")
        self._level = 0.0
        self._bounds = (0.0, 0.0, 1.0, 1.0)
        self._lakes: list[Lake] = []
        self._far_lakes: list[Lake] = []

    @property
    def programs(self) -> tuple[moderngl.Program, ...]:
        """Programs that need uniforms of the owner before each picture."""
        return self._near_sea, self._near_lake, self._far_sea, self._far_lake

    def load(self, ground: Ground) -> None:
        """Take over the shore of a ground, after `unload`."""
        rows, columns, parts = ground.shore.shape
        self._shore = self._context.texture((columns, rows), parts, ground.shore.tobytes())
        self._shore.repeat_x = self._shore.repeat_y = False
        west, south, east, north = ground.bounds
        self._level, self._bounds = ground.level_m, (west, south, 1.0 / (east - west), 1.0 / (north - south))

    def load_lakes(self, near: Iterable[tuple[float, MeshPart]], far: Iterable[tuple[float, MeshPart]]) -> None:
        """Take over a town's waters, (level, surface); those in `far` are drawn only from high above."""
        near = tuple(near)
        self._lakes = [self._lake(self._near_lake, *water) for water in near]
        self._far_lakes = [self._lake(self._far_lake, *water) for water in (*near, *far)]

    def prepare(self, pose: CameraPose, sea: tuple[SeaSurface, SeaSurface]) -> None:
        """Upload swell and ripples of the present time, and bind the textures."""
        if self._sea is not sea:
            packed = [sea[0].packed(), sea[1].packed(self._lace)]
            for texture, (pixels, _) in zip(self._waves, packed, strict=True):
                texture.write(pixels.tobytes())
                texture.build_mipmaps()
            self._scales = packed[0][1], packed[1][1]
            self._sea = sea
        for unit, texture in zip((SWELL_UNIT, RIPPLE_UNIT, SHORE_UNIT), (*self._waves, self._shore), strict=True):
            texture.use(unit)
        for texture in self._waves:
            smallest = moderngl.LINEAR if _close(pose, self._level) else moderngl.LINEAR_MIPMAP_LINEAR
            texture.filter = smallest, moderngl.LINEAR

    def values(self) -> dict[str, object]:
        """Return the uniforms of the waters, after `prepare`."""
        assert self._sea is not None
        return {
            "u_swell": SWELL_UNIT,
            "u_ripple": RIPPLE_UNIT,
            "u_shore": SHORE_UNIT,
            "u_swell_scale": self._scales[0],
            "u_ripple_scale": self._scales[1],
            "u_lengths": (self._sea[0].length_m, self._sea[1].length_m),
            "u_bounds": self._bounds,
            "u_reach": SHORE_REACH_M,
        }

    def draw(self, *, sea: bool, high: bool) -> None:
        """Draw the open sea, if there is one, then the lakes; `high` is true for an eye high above."""
        if sea:
            (self._far_array if high else self._near_array).render()
        lake = self._far_lake if high else self._near_lake
        for level, array, _ in self._far_lakes if high else self._lakes:
            lake["u_level"] = level
            array.render()

    def unload(self) -> None:
        """Free everything that belongs to a ground and its town."""
        for _, array, buffers in (*self._lakes, *self._far_lakes):
            array.release()
            for buffer in buffers:
                buffer.release()
        self._lakes, self._far_lakes = [], []
        self._shore.release()

    def release(self) -> None:
        """Free the other GL objects, after `unload`."""
        for array in (self._near_array, self._far_array):
            array.release()
        for buffer in (self._corners, self._far_corners):
            buffer.release()
        for texture in self._waves:
            texture.release()
        for program in self.programs:
            program.release()

    # -- private

    def _program(self, vertex: str, *defined: str) -> moderngl.Program:
        return build(self._context, source(vertex), source("water.frag", *defined))

    def _lake(self, program: moderngl.Program, level: float, part: MeshPart) -> Lake:
        vertices = self._context.buffer(np.ascontiguousarray(part.vertices["position"]).tobytes())
        index = self._context.buffer(part.index.tobytes())
        array = self._context.vertex_array(program, [(vertices, "3f", "in_position")], index, 4)
        return level, array, (vertices, index)


def _close(pose: CameraPose, level: float) -> bool:
    """Return whether no pixel spans much more than a texel of the ripples.

    The sea then needs no mipmaps, which double the look-ups of a software renderer.
    """
    steepest = pose.tilt_deg > 80.0 and pose.hfov_deg < 100.0
    return steepest and (pose.position[2] - level) / focal_px(pose) < 1.7 * RIPPLE_M / SEA_SIZE
