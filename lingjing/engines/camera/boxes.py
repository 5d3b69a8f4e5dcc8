"""Ground-truth boxes from the id buffer: of entities, and of other things that can be taken for a target.

An entity has the tight box around its pixels. A thing without an entity (a buoy, a parked car, a vehicle of the
traffic, a passer-by) has no number in the id buffer, only its class. Its box is that of a connected patch of pixels of
one class. Two things of a class that touch in the picture share a box, and one that is cut in two has two boxes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy import ndimage

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

_NEIGHBOURS = np.ones((3, 3), int)
"""Pixels of one patch touch at an edge or a corner."""

_IS_THING = np.zeros(2**16, bool)
_IS_THING[list(THINGS)] = True


def entity_boxes(ids: npt.NDArray[np.uint16], entities: Sequence[Entity]) -> tuple[Box, ...]:
    """Return the boxes of all entities with pixels, in declaration order.

    A box is (x0, y0, x1, y1) around whole pixels, each 0..1, with its count of pixels.
    """
    height, width = ids.shape
    where = np.flatnonzero(ids.ravel() >= FIRST_ENTITY)
    numbers = ids.ravel()[where].astype(np.int64) - FIRST_ENTITY
    rows, columns = np.divmod(where, width)
    boxes = []
    for number in np.unique(numbers).tolist():
        mine = numbers == number
        x, y = columns[mine], rows[mine]
        box = (int(x.min()) / width, int(y.min()) / height, (int(x.max()) + 1) / width, (int(y.max()) + 1) / height)
        entity = entities[number]
        boxes.append(Box(entity=entity.id, cls=entity.type, box=box, pixels=len(x)))
    return tuple(boxes)


def other_boxes(ids: npt.NDArray[np.uint16]) -> tuple[Box, ...]:
    """Return the boxes of things without an entity, by class and then from above. Their `entity` is empty."""
    height, width = ids.shape
    where = np.flatnonzero(_IS_THING[ids])
    numbers = ids.ravel()[where]
    boxes = []
    for number in np.unique(numbers).tolist():
        rows, columns = np.divmod(where[numbers == number], width)
        top, left = int(rows.min()), int(columns.min())
        shown = ids[top : int(rows.max()) + 1, left : int(columns.max()) + 1] == number
        patches, _ = ndimage.label(shown, structure=_NEIGHBOURS)
        pixels = np.bincount(patches.ravel())
        for patch, (down, across) in enumerate(ndimage.find_objects(patches), 1):
            if pixels[patch] >= LEAST_PIXELS:
                west, east = (left + across.start) / width, (left + across.stop) / width
                north, south = (top + down.start) / height, (top + down.stop) / height
                boxes.append(
                    Box(entity="", cls=THINGS[number], box=(west, north, east, south), pixels=int(pixels[patch]))
                )
    return tuple(boxes)
