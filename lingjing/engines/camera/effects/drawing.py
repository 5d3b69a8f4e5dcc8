"""`EffectPass`: draws rows of billboards and decals with the camera's uniforms.

The owner of the GL context sets the uniforms of `programs` as it does for its own, and binds the noise texture. It
chooses what drawing may write: ids and depth for `bodies`; colour alone (no alpha) for `clouds` and `decals`.
"""

from __future__ import annotations

import moderngl
import numpy as np

from lingjing.engines.camera.effects.particles import POOL, Rows
from lingjing.engines.camera.programs import source

_BODY = ("3f 3f 1f 16x 4f 1u/i", "in_place", "in_axis", "in_size", "in_style", "in_id")
_CLOUD = ("3f 3f 1f 4f 4f 4x/i", "in_place", "in_axis", "in_size", "in_paint", "in_style")
_DECAL = ("3f 3f 4f 2f/i", "in_place", "in_lie", "in_paint", "in_style")
LIFT = 0.09
"""Amount that a light adds to the developed colour at its middle (chosen)."""


class EffectPass:
    """Owner of three programs and a unit quad; `release` frees them."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._body = self._program("billboard.vert", "body.frag")
        self._cloud = self._program("billboard.vert", "cloud.frag")
        self._decal = self._program("decal.vert", "decal.frag")
        corners = np.array([-1, -1, 1, -1, 1, 1, -1, -1, 1, 1, -1, 1], "f4")
        self._corners = context.buffer(corners.tobytes())

    def _program(self, vertex: str, fragment: str) -> moderngl.Program:
        return self._context.program(vertex_shader=source(vertex), fragment_shader=source(fragment))

    @property
    def programs(self) -> tuple[moderngl.Program, ...]:
        """Programs that need uniforms of the owner before each picture."""
        return self._body, self._cloud, self._decal

    def bodies(self, rows: Rows) -> None:
        """Draw ids and depth of flames and spray; `rows["id"]` holds the values for the id buffer."""
        self._context.disable(moderngl.BLEND)
        self._draw(self._body, rows[rows["id"] > 0], _BODY)

    def clouds(self, rows: Rows, eye: tuple[float, float, float]) -> None:
        """Draw flames, spray, smoke, mist and glow, farthest first."""
        soft = rows[rows["id"] == 0]
        away = np.linalg.norm(soft["place"] - np.asarray(eye, np.float32), axis=1)
        self._context.enable(moderngl.BLEND)
        self._context.blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        self._draw(self._cloud, soft[np.argsort(-away, kind="stable")], _CLOUD)
        self._context.disable(moderngl.BLEND)

    def decals(self, rows: Rows) -> None:
        """Draw wet and scorched ground, in order, then the light on it, which brightens the picture."""
        shining = rows["kind"] >= POOL
        self._decal["u_lift"] = 1.0
        self._blended(self._decal, rows[~shining], _DECAL)
        if shining.any():
            self._shine(rows[shining])

    def _shine(self, rows: Rows) -> None:
        """Draw light on the ground.

        It doubles the colour at most twice, so that dark ground keeps its texture, and adds a little, so that black
        ground shows it.
        """
        self._context.enable(moderngl.BLEND)
        for lift, factor in ((1.0, moderngl.DST_COLOR), (1.0, moderngl.DST_COLOR), (LIFT, moderngl.ONE)):
            self._decal["u_lift"] = lift
            self._context.blend_func = factor, moderngl.ONE
            self._draw(self._decal, rows, _DECAL)
        self._context.disable(moderngl.BLEND)

    def release(self) -> None:
        """Free the GL objects."""
        for program in self.programs:
            program.release()
        self._corners.release()

    def _blended(self, program: moderngl.Program, rows: Rows, layout: tuple[str, ...]) -> None:
        self._context.enable(moderngl.BLEND)
        self._context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self._draw(program, rows, layout)
        self._context.disable(moderngl.BLEND)

    def _draw(self, program: moderngl.Program, rows: Rows, layout: tuple[str, ...]) -> None:
        if not len(rows):
            return
        buffer = self._context.buffer(rows.tobytes())
        array = self._context.vertex_array(program, [(self._corners, "2f", "in_corner"), (buffer, *layout)])
        array.render(instances=len(rows))
        array.release()
        buffer.release()
