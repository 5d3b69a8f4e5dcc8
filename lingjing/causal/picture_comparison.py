"""The comparison of a picture that a trace holds with the same picture drawn anew.

One renderer draws the same pixels again, so that each pixel that differs is a difference. Another renderer places edges
and rounds colours its own way: there the tolerance below decides, block by block, so that a thing that was painted out
or in shows however large the picture is.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from lingjing.errors import LingjingError, UsageError
from lingjing.kernel.world.contract import StoredFrame
from lingjing.trace.images import Depth, RgbPixels, Semantic, decode_jpeg, quantise_depth
from lingjing.trace.reader import StoredPicture, Trace
from lingjing.trace.records import FrameInfo

BLOCK = 16
"""Side of the squares in which pictures of two renderers are compared, pixels. Chosen: a person in the water has about
this size in the pictures of a search from 100 m."""

LEVELS_MOST = 24.0
"""By how much a block may differ between two renderers: mean of the absolute differences, of 255 levels."""

OTHERS_MOST = 0.5
"""The share of a block's pixels that may have another class, or a depth that differs by more than `DEPTH_MOST`."""

DEPTH_MOST = 0.05
"""Relative difference of two depths that counts as the same."""

EDGES_MOST = 0.005
"""By how much an edge of a true box may differ between two renderers, of the picture's width or height: 10 pixels at
1920, the size of a `BLOCK` with its blurred edge."""

LEAST_PIXELS = 64
"""Visible pixels of an entity below which another renderer may draw none of it."""

Mask = npt.NDArray[np.bool_]


class PictureWitness:
    """Compares each picture that a replay draws with the trace's, and hands it on to the kernel.

    `differing` is the first picture that shows something else: what the trace and the drawing know of it, and what
    differs. `tolerated` names the first one that another renderer drew otherwise within the tolerance. Such a picture
    is handed on with the true boxes of the trace, since they count single pixels and are part of the digest.
    """

    def __init__(self, trace: Trace) -> None:
        self._trace = trace
        self.differing: tuple[FrameInfo, FrameInfo, str] | None = None
        self.tolerated = ""

    def __call__(self, drawn: StoredFrame) -> StoredFrame:
        """The picture as the kernel receives it."""
        recorded = self._trace.frames.get(drawn.info.id)
        if recorded is None:  # the record of its boundary differs, which the digest says
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
    """What differs between a picture of the trace and `drawn`, the same picture drawn anew; "" if nothing does.

    For pictures of two renderers only what exceeds the tolerance counts.
    """
    recorded = trace.frames[drawn.info.id]
    try:
        jpeg = trace.jpeg(recorded.id)
        held = trace.picture(recorded.id)
    except (UsageError, LingjingError) as error:
        return f"{error}"
    if hashlib.sha256(jpeg).hexdigest() != recorded.sha256:
        return "the stored picture is not the one whose hash was recorded"
    if recorded.renderer != drawn.info.renderer:
        return _beyond_tolerance(held, drawn)
    return "" if jpeg == drawn.jpeg and _same_channels(held, drawn) else _counted(held, drawn)


def _same_channels(held: StoredPicture, drawn: StoredFrame) -> bool:
    depth = None if drawn.depth is None else quantise_depth(drawn.depth)
    return _same(held.depth, depth) and _same(held.semantic, drawn.semantic)


def _same(one: npt.NDArray[np.generic] | None, other: npt.NDArray[np.generic] | None) -> bool:
    if one is None or other is None:
        return one is other
    return bool(np.array_equal(one, other))


def _counted(held: StoredPicture, drawn: StoredFrame) -> str:
    """How many pixels differ, for pictures of one renderer."""
    rgb = decode_jpeg(drawn.jpeg)
    if held.rgb.shape != rgb.shape:
        return f"it has the shape {held.rgb.shape}, drawn anew {rgb.shape}"
    differing = int((held.rgb != rgb).any(axis=2).sum())
    if differing:
        return f"{differing} of {rgb.shape[0] * rgb.shape[1]} pixels differ on the same renderer"
    return "" if _same_channels(held, drawn) else "depth or classes differ on the same renderer"


def _beyond_tolerance(held: StoredPicture, drawn: StoredFrame) -> str:
    """The first channel that differs more than two renderers may."""
    rgb = decode_jpeg(drawn.jpeg)
    if held.rgb.shape != rgb.shape:
        return f"it has the shape {held.rgb.shape}, drawn anew {rgb.shape}"
    levels = worst_levels(held.rgb, rgb)
    if levels > LEVELS_MOST:
        return (
            f"a block of {BLOCK} by {BLOCK} pixels differs by {levels:.0f} levels; two renderers may by {LEVELS_MOST:g}"
        )
    boxes = _other_boxes(held.info, drawn.info)
    if boxes:
        return boxes
    for name, others in (("depth", _other_depth(held, drawn)), ("class", _other_class(held, drawn))):
        if others > OTHERS_MOST:
            return f"{others:.0%} of a block has another {name}; two renderers may make {OTHERS_MOST:.0%}"
    return ""


def _other_boxes(one: FrameInfo, other: FrameInfo) -> str:
    """The first entity whose true box differs more than two renderers may; "" if there is none."""
    if (one.pose, one.channels) != (other.pose, other.channels):
        return "its pose or its channels differ"
    here, there = ({box.entity: box for box in info.boxes} for info in (one, other))
    for entity in dict.fromkeys((*here, *there)):
        first, second = here.get(entity), there.get(entity)
        if first is None or second is None:
            if (first or there[entity]).pixels >= LEAST_PIXELS:
                return f"`{entity}` is visible in only one of the two"
        elif max(abs(a - b) for a, b in zip(first.box, second.box, strict=True)) > EDGES_MOST:
            return f"the true box of `{entity}` differs by more than {EDGES_MOST:.1%} of the picture"
    return ""


def worst_levels(one: RgbPixels, other: RgbPixels) -> float:
    """The largest mean absolute difference of a block, of 255 levels."""
    return _worst(np.abs(one.astype(np.int16) - other.astype(np.int16)).mean(axis=2, dtype=np.float32))


def _other_depth(held: StoredPicture, drawn: StoredFrame) -> float:
    if held.depth is None or drawn.depth is None:
        return float(held.depth is not drawn.depth)
    return 0.0 if held.depth.shape != drawn.depth.shape else _worst(_depths_differ(held.depth, drawn.depth))


def _depths_differ(one: Depth, other: Depth) -> Mask:
    both = np.isfinite(one) & np.isfinite(other)
    near = np.minimum(np.where(both, one, 0.0), np.where(both, other, 0.0))
    apart = np.abs(np.where(both, one, 0.0) - np.where(both, other, 0.0))
    differ: Mask = np.where(both, apart > DEPTH_MOST * near, np.isfinite(one) != np.isfinite(other))
    return differ


def _other_class(held: StoredPicture, drawn: StoredFrame) -> float:
    one: Semantic | None = held.semantic
    if one is None or drawn.semantic is None:
        return float(one is not drawn.semantic)
    return _worst(one != drawn.semantic)


def _worst(values: npt.NDArray[np.generic]) -> float:
    """The largest mean of a block; blocks at the right and lower edge are whole ones, too."""
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
