"""Semantic classes, and their relation to the id buffer.

The id buffer holds the class id (0..255) of a pixel with a static surface, and `FIRST_ENTITY + k` for the k-th entity
of the instance. One table look-up turns it into the semantic picture.
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
    "ambulance": 43,
    "police_car": 44,
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
"""Class ids by name. `prop` and `entity` stand for things without a class of their own."""

FIRST_ENTITY = 256
"""Id of the instance's first entity in the id buffer."""


def prop_class(cls: str) -> int:
    """Return the class id of a prop or surface."""
    return CLASSES.get(cls, CLASSES["prop"])


def entity_class(entity: Entity) -> int:
    """Return the class id of an entity: that of its look, or that of `entity`."""
    return CLASSES.get(look_of(entity), CLASSES["entity"])


def semantic_table(entities: Sequence[Entity]) -> npt.NDArray[np.uint8]:
    """Return the table from drawn id to class id, for ids below `FIRST_ENTITY + len(entities)`."""
    kinds = [entity_class(entity) for entity in entities]
    return np.array([*range(FIRST_ENTITY), *kinds], dtype=np.uint8)


def instance_numbers(entities: Sequence[Entity]) -> dict[str, int]:
    """Return the number of each entity without a hidden value: 1 for the first.

    Hidden ones are not counted: a gap would show that there is one.
    """
    public = [entity.id for entity in entities if not entity.hidden]
    return {name: number for number, name in enumerate(public, 1)}


def instance_picture(ids: npt.NDArray[np.uint16], entities: Sequence[Entity]) -> npt.NDArray[np.uint16]:
    """Return the numbers of entities of drawn ids; 0 for static things, background bodies and hidden entities."""
    numbers = instance_numbers(entities)
    table = np.array([0] * FIRST_ENTITY + [numbers.get(entity.id, 0) for entity in entities], dtype=np.uint16)
    picture = np.zeros_like(ids)
    moving = np.flatnonzero(ids.ravel() >= FIRST_ENTITY)
    picture.ravel()[moving] = table[ids.ravel()[moving]]
    return picture


def semantic_picture(ids: npt.NDArray[np.uint16], entities: Sequence[Entity]) -> npt.NDArray[np.uint8]:
    """Return the class ids of drawn ids. Static ids are class ids already, so only entities are looked up."""
    classes = ids.astype(np.uint8)
    moving = np.flatnonzero(ids.ravel() >= FIRST_ENTITY)
    classes.ravel()[moving] = semantic_table(entities)[ids.ravel()[moving]]
    return classes
