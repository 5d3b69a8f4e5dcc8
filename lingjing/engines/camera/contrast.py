"""Contrast of targets in a picture, from a second drawing of a part of it without them.

The contrast of a target is a root mean square over its own pixels. Each pixel counts with the largest of the three
differences of colour between the picture and the same picture without the target, in steps of 1/255. Below
`LEAST_CONTRAST` the target counts as invisible and has no visible pixels in the sense of the paper's adjudication (ADR
0012).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import sqrt

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.classes import FIRST_ENTITY
from lingjing.engines.camera.render_targets import PixelRect
from lingjing.scene.camera_geometry import camera_axes, focal_px
from lingjing.trace.records import Box, CameraPose

LEAST_CONTRAST = 5.0
"""Least contrast of a visible target, steps of 1/255.

On the grey of fog it is about the 5 % of luminance at which a dark body ceases to be visible by day. Meteorology
defines visibility in this way (WMO-No. 8, meteorological optical range).
"""


def split_by_contrast(
    boxes: Sequence[Box],
    numbers: dict[str, int],
    rgb: npt.NDArray[np.uint8],
    ids: npt.NDArray[np.uint16],
    place: PixelRect,
    without: npt.NDArray[np.uint8],
) -> tuple[tuple[Box, ...], tuple[Box, ...]]:
    """Return the boxes of visible entities, with their contrast, and the boxes of those that are too faint.

    `numbers` holds the entities (id to index) that the part `place` was drawn without; `without` are the colours of
    that drawing. Boxes of all other entities stay as they are.
    """
    visible: list[Box] = []
    faint: list[Box] = []
    height, width = ids.shape
    for box in boxes:
        if box.entity not in numbers:
            visible.append(box)
            continue
        left, top, wide, high = pixels_of((box,), width, height)
        with_it = np.s_[top : top + high, left : left + wide]
        without_it = np.s_[top - place[1] : top - place[1] + high, left - place[0] : left - place[0] + wide]
        mine = ids[with_it] == FIRST_ENTITY + numbers[box.entity]
        value = contrast(rgb[with_it][mine], without[without_it][mine])
        measured = msgspec.structs.replace(box, contrast=value)
        (visible if value >= LEAST_CONTRAST else faint).append(measured)
    return tuple(visible), tuple(faint)


def contrast(with_it: npt.NDArray[np.uint8], without_it: npt.NDArray[np.uint8]) -> float:
    """Return the root mean square over pixels (n, 3) of their largest differences, to a tenth of a step."""
    if not len(with_it):
        return 0.0
    off = np.abs(with_it.astype(np.int64) - without_it).max(axis=1)
    return round(sqrt(int((off * off).sum()) / len(off)), 1)


def pixels_of(boxes: Iterable[Box], width: int, height: int) -> PixelRect:
    """Return the smallest rectangle of a picture that holds all boxes."""
    sides = [box.box for box in boxes]
    left, top = round(min(s[0] for s in sides) * width), round(min(s[1] for s in sides) * height)
    right, low = round(max(s[2] for s in sides) * width), round(max(s[3] for s in sides) * height)
    return left, top, right - left, low - top


def projected_rect(volume: tuple[float, float, float, float, float, float], pose: CameraPose) -> PixelRect | None:
    """Return the rectangle of a picture that can show a part of a box in the world.

    It is the whole picture if the box comes close to the plane of the lens, and None if no part is in sight.
    """
    west, south, low, east, north, high = volume
    corners = np.array([(x, y, z) for x in (west, east) for y in (south, north) for z in (low, high)])
    right, down, axis = (np.array(a) for a in camera_axes(pose))
    offset = corners - np.array(pose.position)
    along = offset @ axis
    if (along <= 0.0).all():
        return None
    if (along < 0.1).any():
        return 0, 0, pose.width, pose.height
    x = pose.width / 2.0 + focal_px(pose) * (offset @ right) / along
    y = pose.height / 2.0 + focal_px(pose) * (offset @ down) / along
    left, top = max(int(np.floor(x.min())) - 1, 0), max(int(np.floor(y.min())) - 1, 0)
    end, foot = min(int(np.ceil(x.max())) + 1, pose.width), min(int(np.ceil(y.max())) + 1, pose.height)
    return (left, top, end - left, foot - top) if left < end and top < foot else None


def bounding_rect(places: Iterable[PixelRect]) -> PixelRect | None:
    """Return the smallest rectangle around all rectangles; None without any."""
    known = list(places)
    if not known:
        return None
    left, top = min(p[0] for p in known), min(p[1] for p in known)
    right, low = max(p[0] + p[2] for p in known), max(p[1] + p[3] for p in known)
    return left, top, right - left, low - top


__all__ = ["LEAST_CONTRAST", "bounding_rect", "contrast", "pixels_of", "projected_rect", "split_by_contrast"]
