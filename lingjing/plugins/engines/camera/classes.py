"""Semantic classes and the ids that one pass draws.

The id buffer holds, for each pixel, the class id itself (0..255) where something static was drawn, and
`FIRST_ENTITY + k` for the k-th entity of the instance; one table look-up turns it into the semantic picture.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lingjing.mission.instance import Entity

CLASSES: dict[str, int] = {
    "sky": 0,
    "water": 1,
    "sand": 2,
    "grass": 3,
    "rock": 4,
    "concrete": 5,
    "structure": 6,
    "buoy": 7,
    "debris": 8,
    "moored_boat": 9,
    "tree": 10,
    "prop": 15,
    "person_in_water": 16,
    "lifeboat": 17,
    "quadrotor": 18,
    "entity": 31,
}
"""Class name → value in a `semantic` picture. `prop` and `entity` stand for what has no class of its own."""

FIRST_ENTITY = 256
MAX_ENTITIES = 4096


def prop_class(cls: str) -> int:
    """Class id of a prop or surface name."""
    return CLASSES.get(cls, CLASSES["prop"])


def semantic_table(entities: Sequence[Entity]) -> npt.NDArray[np.uint8]:
    """Table from drawn id to class id, for ids below `FIRST_ENTITY + len(entities)`."""
    kinds = [CLASSES.get(entity.type, CLASSES["entity"]) for entity in entities]
    return np.array([*range(FIRST_ENTITY), *kinds], dtype=np.uint8)
