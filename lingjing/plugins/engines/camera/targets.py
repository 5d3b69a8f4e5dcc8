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

    def write(self, colour: bool, alpha: bool, rest: bool) -> None:
        """Choose what drawing changes: colour, its alpha, and the rest (ids, depth picture, depth test buffer)."""
        others = [(rest,) * 4] * (len(self._textures) - 1)
        self.frame.color_mask = [(colour, colour, colour, alpha), *others]  # type: ignore[assignment] # per target
        self.frame.depth_mask = rest

    def clear(self, colour: tuple[float, float, float]) -> None:
        """Begin a picture with nothing in it: haze, id 0, no distance."""
        values = [(*colour, 1.0), (0.0, 0.0, 0.0, 0.0), (np.inf, 0.0, 0.0, 0.0)][: len(self._textures)]
        self.frame.depth_mask = True
        for number, value in enumerate(values):  # the first one forgets the distances of the depth test as well
            masks = [(k == number,) * 4 for k in range(len(values))]
            self.frame.color_mask = masks  # type: ignore[assignment] # per target
            self.frame.clear(*value)
            self.frame.depth_mask = False
        self.write(colour=True, alpha=True, rest=True)

    def read(self) -> Buffers:
        """Fresh arrays of the last drawing."""
        width, height = self.size
        rgb = np.empty((height, width, 3), np.uint8)
        ids = np.empty((height, width), np.uint16)
        self.frame.read_into(rgb, components=3)
        self.frame.read_into(ids, components=1, attachment=1, dtype="u2")
        depth = None
        if self.has_depth:
            depth = np.empty((height, width), np.float32)
            self.frame.read_into(depth, components=1, attachment=2, dtype="f4")
        return Buffers(rgb, ids, depth)

    def release(self) -> None:
        """Free the GL objects."""
        self.frame.release()
        self._z.release()
        for texture in self._textures:
            texture.release()
