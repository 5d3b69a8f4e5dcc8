"""Semantic classes and the ids that one pass draws.

The id buffer holds, for each pixel, the class id itself (0..255) where something static was drawn, and
`FIRST_ENTITY + k` for the k-th entity of the instance; one table look-up turns it into the semantic picture.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.models import look_of
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
    "building": 11,
    "road": 12,
    "bridge": 13,
    "pipe": 14,
    "prop": 15,
    "person_in_water": 16,
    "lifeboat": 17,
    "quadrotor": 18,
    "fixed_wing": 19,
    "robot_dog": 20,
    "car": 21,
    "delivery_van": 22,
    "truck": 23,
    "bus": 24,
    "fire_truck": 25,
    "motorcycle": 26,
    "bicycle": 27,
    "person": 28,
    "taxi": 29,
    "satellite": 30,
    "entity": 31,
    "building_fire": 32,
    "fire_source": 33,
    "pipeline_leak": 34,
    "bridge_fracture": 35,
    "congestion": 36,
    "destination": 37,
    "delivery_point": 38,
    "delivery_door": 39,
    "warehouse": 40,
    "reference_building": 41,
    "queue_of_people": 42,
    "sidewalk": 48,
    "plaza": 49,
    "container": 50,
    "lamp": 51,
    "bench": 52,
    "crates": 53,
    "parked_car": 54,
    "parked_truck": 55,
    "steam_vent": 56,
}
"""Class name → value in a `semantic` picture. `prop` and `entity` stand for what has no class of its own."""

FIRST_ENTITY = 256


def prop_class(cls: str) -> int:
    """Class id of a prop or surface name."""
    return CLASSES.get(cls, CLASSES["prop"])


def entity_class(entity: Entity) -> int:
    """Class id of an entity: its look's, `entity` for one without."""
    return CLASSES.get(look_of(entity), CLASSES["entity"])


def semantic_table(entities: Sequence[Entity]) -> npt.NDArray[np.uint8]:
    """Table from drawn id to class id, for ids below `FIRST_ENTITY + len(entities)`."""
    kinds = [entity_class(entity) for entity in entities]
    return np.array([*range(FIRST_ENTITY), *kinds], dtype=np.uint8)


def semantic_picture(ids: npt.NDArray[np.uint16], entities: Sequence[Entity]) -> npt.NDArray[np.uint8]:
    """Class ids of drawn ids. Most of a picture is static, whose ids are classes: only the rest is looked up."""
    classes = ids.astype(np.uint8)
    moving = np.flatnonzero(ids.ravel() >= FIRST_ENTITY)
    classes.ravel()[moving] = semantic_table(entities)[ids.ravel()[moving]]
    return classes
