"""Ground-truth boxes from the id buffer: of entities, and of other things that can be taken for a target.

An entity has the tight box around its pixels. A thing without an entity (a buoy, a parked car, a vehicle of the
traffic, a passer-by) has no number in the id buffer, only its class. Its box is that of a connected patch of pixels of
one class. Two things of a class that touch in the picture share a box, and one that is cut in two has two boxes.

All boxes come from the *strips* of a picture: the longest pieces of rows with one id. A picture has a hundred times
fewer strips than pixels.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.classes import CLASSES, FIRST_ENTITY
from lingjing.mission.instance import Entity
from lingjing.trace.records import Box

_SURFACES = frozenset(
    "sky water sand grass rock concrete structure building road bridge pipe tree entity sidewalk plaza".split()  # noqa: SIM905 - one word each
)
"""Classes that are no single things."""

THINGS = {number: name for name, number in CLASSES.items() if name not in _SURFACES}
"""Names of the classes with a box for each patch, by class id."""

LEAST_PIXELS = 6
"""Least number of pixels of a patch with a box. Chosen: fewer are the rim of something else."""

_IS_THING = np.zeros(2**16, bool)
_IS_THING[list(THINGS)] = True

Ints = npt.NDArray[np.int64]


class _Strips(NamedTuple):
    """Pieces of rows with one id, by row and then from the left; each field is an array (n,)."""

    number: Ints
    """Their ids."""
    row: Ints
    """Their rows."""
    left: Ints
    """Their first columns."""
    end: Ints
    """The columns after their last ones."""

    def which(self, chosen: npt.NDArray[np.bool_] | Ints) -> _Strips:
        """Return some of the strips, or all in another order."""
        return _Strips(*(field[chosen] for field in self))


class _Extent(NamedTuple):
    """The extent of strips."""

    box: tuple[float, float, float, float]
    """Normalised x0, y0, x1, y1 around whole pixels."""
    pixels: int
    """Number of pixels."""


def all_boxes(ids: npt.NDArray[np.uint16], entities: Sequence[Entity]) -> tuple[tuple[Box, ...], tuple[Box, ...]]:
    """Return `entity_boxes` and `other_boxes` of a picture."""
    strips = _strips(ids)
    return _entity_boxes(strips, entities, ids.shape), _other_boxes(strips, ids.shape)


def entity_boxes(ids: npt.NDArray[np.uint16], entities: Sequence[Entity]) -> tuple[Box, ...]:
    """Return the boxes of all entities with pixels, in declaration order.

    A box is (x0, y0, x1, y1) around whole pixels, each 0..1, with its count of pixels.
    """
    return _entity_boxes(_strips(ids), entities, ids.shape)


def other_boxes(ids: npt.NDArray[np.uint16]) -> tuple[Box, ...]:
    """Return the boxes of things without an entity, by class and then from above. Their `entity` is empty."""
    return _other_boxes(_strips(ids), ids.shape)


def _entity_boxes(strips: _Strips, entities: Sequence[Entity], shape: tuple[int, ...]) -> tuple[Box, ...]:
    strips = strips.which(strips.number >= FIRST_ENTITY)
    numbers, extents = _extents(strips, strips.number, shape)
    owners = [entities[number - FIRST_ENTITY] for number in numbers]
    return tuple(
        Box(entity=owner.id, cls=owner.type, box=extent.box, pixels=extent.pixels)
        for owner, extent in zip(owners, extents, strict=True)
    )


def _other_boxes(strips: _Strips, shape: tuple[int, ...]) -> tuple[Box, ...]:
    strips = strips.which(_IS_THING[strips.number])
    boxes = []
    for number in np.unique(strips.number).tolist():
        mine = strips.which(strips.number == number)
        _, extents = _extents(mine, _patches(mine, shape[1]), shape)
        boxes += [
            Box(entity="", cls=THINGS[number], box=extent.box, pixels=extent.pixels)
            for extent in extents
            if extent.pixels >= LEAST_PIXELS
        ]
    return tuple(boxes)


def _strips(ids: npt.NDArray[np.uint16]) -> _Strips:
    height, width = ids.shape
    begins = np.empty((height, width), bool)
    begins[:, 0] = True
    np.not_equal(ids[:, 1:], ids[:, :-1], out=begins[:, 1:])
    starts = np.flatnonzero(begins)
    row, left = np.divmod(starts, width)
    return _Strips(ids.ravel()[starts].astype(np.int64), row, left, left + np.diff(starts, append=ids.size))


def _extents(strips: _Strips, groups: Ints, shape: tuple[int, ...]) -> tuple[list[int], list[_Extent]]:
    """Return the groups that occur, in order, and the extent of each; `groups` (n,) holds the group of each strip."""
    if not len(groups):
        return [], []
    height, width = shape
    order = np.argsort(groups, kind="stable")
    names, first = np.unique(groups[order], return_index=True)
    sorted_strips = strips.which(order)
    west, north = np.minimum.reduceat(sorted_strips.left, first), np.minimum.reduceat(sorted_strips.row, first)
    east, south = np.maximum.reduceat(sorted_strips.end, first), np.maximum.reduceat(sorted_strips.row, first) + 1
    pixels = np.add.reduceat(sorted_strips.end - sorted_strips.left, first)
    edges = zip(west.tolist(), north.tolist(), east.tolist(), south.tolist(), pixels.tolist(), strict=True)
    return names.tolist(), [
        _Extent((a / width, b / height, c / width, d / height), count) for a, b, c, d, count in edges
    ]


def _patches(strips: _Strips, width: int) -> Ints:
    """Return the patch of each strip (n,) of one id: the number of its first strip. Strips that touch at an edge or a
    corner belong to one patch."""
    stride = width + 2  # columns of neighbouring rows must not meet
    above = strips.row * stride
    first = np.searchsorted(above + strips.end, above + stride + strips.left)
    last = np.searchsorted(above + strips.left, above + stride + strips.end, side="right")
    count = np.maximum(last - first, 0)
    upper = np.repeat(np.arange(len(count)), count)
    lower = np.arange(len(upper)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)
    patch = np.arange(len(count))
    while True:
        least = np.minimum(patch[upper], patch[lower])
        joined = patch.copy()
        for side in (upper, lower):
            np.minimum.at(joined, side, least)
            np.minimum.at(joined, patch[side], least)
        joined = joined[joined]
        if np.array_equal(joined, patch):
            return patch
        patch = joined
