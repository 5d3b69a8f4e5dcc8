"""Framebuffers and reading them back."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
import numpy.typing as npt

MAX_TARGETS = 4
"""Most framebuffers of different size that a renderer keeps (chosen)."""
PixelRect = tuple[int, int, int, int]
"""A rectangle of a picture: left, top, width, height; pixels."""


def overlap(first: PixelRect, second: PixelRect) -> PixelRect | None:
    """Return the intersection of two rectangles; None if it is empty."""
    left, top = max(first[0], second[0]), max(first[1], second[1])
    right, low = min(first[0] + first[2], second[0] + second[2]), min(first[1] + first[3], second[1] + second[3])
    return (left, top, right - left, low - top) if left < right and top < low else None


@dataclass(frozen=True, slots=True)
class Buffers:
    """The result of one drawing, top row first."""

    rgb: npt.NDArray[np.uint8]
    """Colours."""
    ids: npt.NDArray[np.uint16]
    """Ids: classes and entities."""
    depth: npt.NDArray[np.float32] | None
    """Distances along the axis, metres; None if not drawn."""
    near_m: float
    """Near plane of the drawing, metres."""


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
        """Choose what drawing changes: colour, its alpha, and the rest (ids, depth picture, depth buffer)."""
        others = [(rest,) * 4] * (len(self._textures) - 1)
        self.frame.color_mask = [(colour, colour, colour, alpha), *others]  # type: ignore[assignment] # per target
        self.frame.depth_mask = rest

    def clear(self, colour: tuple[float, float, float]) -> None:
        """Clear everything: haze, id 0, infinite distance."""
        values = [(*colour, 1.0), (0.0, 0.0, 0.0, 0.0), (np.inf, 0.0, 0.0, 0.0)][: len(self._textures)]
        self.frame.depth_mask = True
        for number, value in enumerate(values):  # only the first clear resets the depth buffer
            masks = [(k == number,) * 4 for k in range(len(values))]
            self.frame.color_mask = masks  # type: ignore[assignment] # per target
            self.frame.clear(*value)
            self.frame.depth_mask = False
        self.write(colour=True, alpha=True, rest=True)

    def read(self, near_m: float) -> Buffers:
        """Return new arrays of the last drawing."""
        return self.read_part((0, 0, *self.size), near_m)

    def read_part(self, place: PixelRect, near_m: float) -> Buffers:
        """Return new arrays of a part of the last drawing."""
        rgb, ids = np.empty((place[3], place[2], 3), np.uint8), np.empty(place[:1:-1], np.uint16)
        self.frame.read_into(rgb, viewport=place, components=3)
        self.frame.read_into(ids, viewport=place, components=1, attachment=1, dtype="u2")
        depth = None
        if self.has_depth:
            depth = np.empty(ids.shape, np.float32)
            self.frame.read_into(depth, viewport=place, components=1, attachment=2, dtype="f4")
        return Buffers(rgb, ids, depth, near_m)

    def release(self) -> None:
        """Free the GL objects."""
        self.frame.release()
        self._z.release()
        for texture in self._textures:
            texture.release()
