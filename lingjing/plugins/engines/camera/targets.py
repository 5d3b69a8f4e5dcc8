"""Framebuffers and their read-back."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
import numpy.typing as npt

MAX_TARGETS = 4


@dataclass(frozen=True, slots=True)
class Buffers:
    """What one pass drew, top row first: `rgb` uint8, `ids` uint16, `depth` float32 metres or None."""

    rgb: npt.NDArray[np.uint8]
    ids: npt.NDArray[np.uint16]
    depth: npt.NDArray[np.float32] | None


class Target:
    """A framebuffer of one size, with or without a depth picture."""

    def __init__(self, context: moderngl.Context, size: tuple[int, int], depth: bool) -> None:
        self.size = size
        self._textures = [context.texture(size, 4), context.texture(size, 1, dtype="u2")]
        if depth:
            self._textures.append(context.texture(size, 1, dtype="f4"))
        self._z = context.depth_renderbuffer(size)
        self.frame = context.framebuffer(self._textures, self._z)
        self.has_depth = depth

    def read(self) -> Buffers:
        """Fresh arrays of the last drawing."""
        width, height = self.size
        rgba = np.empty((height, width, 4), np.uint8)
        ids = np.empty((height, width), np.uint16)
        self.frame.read_into(rgba, components=4)
        self.frame.read_into(ids, components=1, attachment=1, dtype="u2")
        depth = None
        if self.has_depth:
            depth = np.empty((height, width), np.float32)
            self.frame.read_into(depth, components=1, attachment=2, dtype="f4")
        return Buffers(np.ascontiguousarray(rgba[..., :3]), ids, depth)

    def release(self) -> None:
        """Free the GL objects."""
        for thing in (self.frame, self._z, *self._textures):
            thing.release()
