"""Comparison of a recorded picture with the same picture rendered again.

One renderer reproduces pixels exactly, so every different pixel counts. Another renderer places edges and rounds
colours differently. Then the tolerances below apply to each block, so that a missing or added object is found in a
picture of any size.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from lingjing.errors import LingjingError, UsageError
from lingjing.kernel.world.contract import StoredFrame
from lingjing.trace.images import Depth, Instances, RgbPixels, Semantic, decode_jpeg
from lingjing.trace.reader import StoredPicture, Trace
from lingjing.trace.records import FrameInfo

BLOCK = 16
"""Side of the blocks in which pictures of two renderers are compared, pixels. Chosen: the size of a person in the
water in pictures of a search from 100 m.
"""

LEVELS_MOST = 24.0
"""The greatest mean absolute difference of a block between two renderers, of 255 levels. Chosen."""

OTHERS_MOST = 0.5
"""The greatest share of a block's pixels with another class or instance, or with a depth beyond `DEPTH_MOST`.
Chosen."""

DEPTH_MOST = 0.05
"""Relative difference up to which two depths are equal. Chosen."""

EDGES_MOST = 0.005
"""The greatest distance of an edge of a true box between two renderers, of the picture's width or height. Chosen: 10
pixels at 1920, the size of a `BLOCK` with its blurred edge.
"""

LEAST_PIXELS = 64
"""Visible pixels below which another renderer may omit an entity. Chosen."""

Mask = npt.NDArray[np.bool_]
"""Pixels for which a condition holds."""


class PictureWitness:
    """Compares each rendered picture of a replay with the trace's, and passes it on to the kernel.

    `differing`: metadata of the first different picture, recorded and rendered, and the difference. `tolerated`: the
    first picture that another renderer drew differently within the tolerance. Such a picture is passed on with the
    recorded true boxes, because boxes count single pixels and are part of the digest.
    """

    def __init__(self, trace: Trace) -> None:
        self._trace = trace
        self.differing: tuple[FrameInfo, FrameInfo, str] | None = None
        self.tolerated = ""

    def __call__(self, drawn: StoredFrame) -> StoredFrame:
        """Return the picture for the kernel."""
        recorded = self._trace.frames.get(drawn.info.id)
        if recorded is None:  # the record of this boundary differs, which the digest shows
            return drawn
        differing = picture_difference(self._trace, drawn)
        if differing:
            self.differing = self.differing or (recorded, drawn.info, differing)
        if differing or recorded.renderer == drawn.info.renderer:
            return drawn
        if recorded.sha256 != drawn.info.sha256 and not self.tolerated:
            self.tolerated = f"{recorded.id} (recorded with {recorded.renderer}, drawn with {drawn.info.renderer})"
        return replace(drawn, info=recorded)


def picture_difference(trace: Trace, drawn: StoredFrame) -> str:
    """Return the difference between a picture of the trace and `drawn`, the same picture rendered again; "" if there
    is none.

    Between two renderers, only differences beyond the tolerance count.
    """
    recorded = trace.frames[drawn.info.id]
    try:
        jpeg = trace.jpeg(recorded.id)
        held = trace.picture(recorded.id)
    except (UsageError, LingjingError) as error:
        return f"{error}"
    if hashlib.sha256(jpeg).hexdigest() != recorded.sha256:
        return "the stored picture does not match the recorded hash"
    if recorded.renderer != drawn.info.renderer:
        return _beyond_tolerance(held, drawn)
    return "" if jpeg == drawn.jpeg and _same_channels(held, drawn) else _pixel_difference(held, drawn)


def _same_channels(held: StoredPicture, drawn: StoredFrame) -> bool:
    layers = ((held.depth, drawn.depth), (held.semantic, drawn.semantic), (held.instance, drawn.instance))
    return all(_same(first, second) for first, second in layers)


def _same(first: npt.NDArray[np.generic] | None, second: npt.NDArray[np.generic] | None) -> bool:
    if first is None or second is None:
        return first is second
    return bool(np.array_equal(first, second))


def _pixel_difference(held: StoredPicture, drawn: StoredFrame) -> str:
    """Return the number of different pixels in words, for pictures of one renderer."""
    rgb = decode_jpeg(drawn.jpeg)
    if held.rgb.shape != rgb.shape:
        return f"it has the shape {held.rgb.shape}, rendered again {rgb.shape}"
    differing = int((held.rgb != rgb).any(axis=2).sum())
    if differing:
        return f"{differing} of {rgb.shape[0] * rgb.shape[1]} pixels differ on the same renderer"
    return "" if _same_channels(held, drawn) else "depth, classes or instances differ on the same renderer"


def _beyond_tolerance(held: StoredPicture, drawn: StoredFrame) -> str:
    """Return the first channel that differs beyond the tolerance of two renderers, or ""."""
    rgb = decode_jpeg(drawn.jpeg)
    if held.rgb.shape != rgb.shape:
        return f"it has the shape {held.rgb.shape}, rendered again {rgb.shape}"
    levels = worst_levels(held.rgb, rgb)
    if levels > LEVELS_MOST:
        return f"a block of {BLOCK} by {BLOCK} pixels differs by {levels:.0f} levels; the tolerance is {LEVELS_MOST:g}"
    boxes = _box_difference(held.info, drawn.info)
    if boxes:
        return boxes
    shares = {
        "depth": _depth_share(held, drawn),
        "class": _differing_share(held.semantic, drawn.semantic),
        "instance": _differing_share(held.instance, drawn.instance),
    }
    for name, others in shares.items():
        if others > OTHERS_MOST:
            return f"{others:.0%} of a block has another {name}; the tolerance is {OTHERS_MOST:.0%}"
    return ""


def _box_difference(recorded: FrameInfo, drawn: FrameInfo) -> str:
    """Return the first entity with a true box that differs beyond the tolerance; "" if there is none."""
    if (recorded.pose, recorded.channels) != (drawn.pose, drawn.channels):
        return "its pose or its channels differ"
    here, there = ({box.entity: box for box in info.boxes} for info in (recorded, drawn))
    for entity in dict.fromkeys((*here, *there)):
        first, second = here.get(entity), there.get(entity)
        if first is None or second is None:
            if (first or there[entity]).pixels >= LEAST_PIXELS:
                return f"`{entity}` is visible in only one of the two"
        elif max(abs(a - b) for a, b in zip(first.box, second.box, strict=True)) > EDGES_MOST:
            return f"the true box of `{entity}` differs by more than {EDGES_MOST:.1%} of the picture"
    return ""


def worst_levels(first: RgbPixels, second: RgbPixels) -> float:
    """Return the greatest mean absolute difference of a block, of 255 levels."""
    return _worst(np.abs(first.astype(np.int16) - second.astype(np.int16)).mean(axis=2, dtype=np.float32))


def _depth_share(held: StoredPicture, drawn: StoredFrame) -> float:
    if held.depth is None or drawn.depth is None:
        return float(held.depth is not drawn.depth)
    return 0.0 if held.depth.shape != drawn.depth.shape else _worst(_depths_differ(held.depth, drawn.depth))


def _depths_differ(first: Depth, second: Depth) -> Mask:
    both = np.isfinite(first) & np.isfinite(second)
    near = np.minimum(np.where(both, first, 0.0), np.where(both, second, 0.0))
    apart = np.abs(np.where(both, first, 0.0) - np.where(both, second, 0.0))
    differ: Mask = np.where(both, apart > DEPTH_MOST * near, np.isfinite(first) != np.isfinite(second))
    return differ


def _differing_share(held: Semantic | Instances | None, drawn: Semantic | Instances | None) -> float:
    if held is None or drawn is None:
        return float(held is not drawn)
    return _worst(held != drawn)


def _worst(values: npt.NDArray[np.generic]) -> float:
    """Return the greatest mean of a block. The last blocks of a row and of a column are larger, so that no block is
    smaller than `BLOCK`.
    """
    height, width = values.shape
    rows = np.add.reduceat(values.astype(np.float32), _starts(height), axis=0)
    sums = np.add.reduceat(rows, _starts(width), axis=1)
    high = np.diff(np.append(_starts(height), height))
    wide = np.diff(np.append(_starts(width), width))
    return float((sums / np.outer(high, wide)).max())


def _starts(length: int) -> npt.NDArray[np.intp]:
    return np.arange(0, max(1, length - BLOCK + 1), BLOCK)


__all__ = [
    "BLOCK", "DEPTH_MOST", "EDGES_MOST", "LEAST_PIXELS", "LEVELS_MOST", "OTHERS_MOST", "PictureWitness",
    "picture_difference", "worst_levels",
]  # fmt: skip
