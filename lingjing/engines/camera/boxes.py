"""Ground-truth boxes from the id buffer: the tight box of every entity with at least one pixel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.classes import FIRST_ENTITY
from lingjing.mission.instance import Entity
from lingjing.trace.records import Box


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
