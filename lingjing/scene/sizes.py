"""Sizes of things: length, width and height, metres.

Objects of scenes and traffic have the size of their kind, from the table here. A mission's entities have the size and
the shape that their types declare: `length`, `width`, `height`, `shape` and `origin` (docs/language.md).
"""

from __future__ import annotations

from dataclasses import dataclass

from lingjing.mission.appearance import BARE, MEASURES, UNSAID_M
from lingjing.mission.footprint import sunk_below_m
from lingjing.mission.instance import Entity


@dataclass(frozen=True, slots=True)
class Size:
    """Outer dimensions of a thing."""

    length_m: float
    """Along its heading, metres."""
    width_m: float
    """Across its heading, metres."""
    height_m: float
    """Upwards, metres."""


SIZES: dict[str, Size] = {
    "car": Size(4.5, 1.8, 1.5),
    "police_car": Size(4.5, 1.8, 1.65),
    "delivery_van": Size(5.9, 2.1, 2.6),
    "ambulance": Size(5.9, 2.1, 2.75),
    "truck": Size(9.0, 2.5, 3.6),
    "bus": Size(12.0, 2.55, 3.1),
    "fire_truck": Size(8.6, 2.5, 3.3),
    "motorcycle": Size(2.2, 0.8, 1.5),
    "bicycle": Size(1.7, 0.6, 1.6),
    "person": Size(0.4, 0.5, 1.75),
}
"""Sizes by kind: vehicles after the defaults of SUMO, the others as drawn."""


def entity_size(entity: Entity) -> Size:
    """Dimensions of an entity; half a metre for each that it does not declare."""
    return Size(*((entity.number(f"{name}_m") or UNSAID_M) for name in MEASURES))


def solid_size(entity: Entity) -> Size | None:
    """Dimensions of an entity that bodies collide with; None for other entities.

    Every asset is solid. A target is solid if it declares its length, width and height; a fire or a leak does not. An
    entity of the shape `none` is not solid.
    """
    measured = all(entity.number(f"{name}_m") for name in MEASURES)
    if entity.properties.get("shape") == BARE or not (entity.role == "asset" or measured):
        return None
    return entity_size(entity)


def sunk_m(entity: Entity | None) -> float:
    """Distance that an entity reaches below its position, metres: half of its height if its origin is its centre."""
    return 0.0 if entity is None else sunk_below_m(entity)


RODS: dict[str, tuple[float, float]] = {
    "tree": (0.18, 4.0),
    "pine": (0.18, 4.0),
    "lamp": (0.12, 6.0),
    "park_lamp": (0.1, 3.5),
    "traffic_light": (0.1, 3.5),
    "bollard": (0.09, 0.8),
    "hydrant": (0.15, 0.7),
    "steam_vent": (0.4, 1.4),
    "fountain": (2.8, 1.0),
    "tank": (4.0, 6.9),
    "silo": (2.6, 15.6),
    "chimney": (1.5, 20.0),
}
"""Round props that a robot dog collides with, by model: radius and height, metres. They are the sizes of the drawn
models, rounded. Thin props (cones, paint, pads), soft ones (steam) and floating ones are left out."""

BOXES: dict[str, Size] = {
    "bench": Size(0.52, 1.8, 0.8),
    "bin": Size(0.74, 0.62, 1.1),
    "bus_stop": Size(1.5, 4.0, 2.5),
    "fence": Size(0.06, 3.0, 1.2),
    "container": Size(6.1, 2.48, 2.6),
    "container_long": Size(12.2, 2.48, 2.6),
    "crates": Size(0.85, 1.7, 1.4),
    "pallets": Size(0.9, 2.5, 1.3),
    "drums": Size(1.1, 1.2, 0.9),
    "rock": Size(2.0, 2.8, 1.0),
    "parked_car": SIZES["car"],
    "parked_truck": SIZES["truck"],
    "parked_van": SIZES["delivery_van"],
    **{name: SIZES[name] for name in ("car", "delivery_van", "truck", "bus", "fire_truck", "motorcycle", "person")},
}
"""Box-shaped props that a robot dog collides with, by model: length along the heading, width and height, metres."""
