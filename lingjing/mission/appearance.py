"""Properties of a body that a type may declare: size, colour, shape, model. The checker, the camera and the engines use
these constants.
"""

from __future__ import annotations

from collections.abc import Mapping

LinearRgb = tuple[float, float, float]
"""Linear red, green and blue, 0..1."""

COLOURS: Mapping[str, LinearRgb] = {
    "white": (0.82, 0.82, 0.80),
    "red": (0.55, 0.06, 0.05),
    "yellow": (0.72, 0.52, 0.06),
    "blue": (0.08, 0.18, 0.50),
    "green": (0.08, 0.34, 0.12),
    "grey": (0.30, 0.30, 0.30),
    "orange": (0.75, 0.26, 0.04),
    "brown": (0.22, 0.10, 0.05),
    "black": (0.03, 0.03, 0.03),
    "pink": (0.72, 0.30, 0.36),
    "amber": (0.85, 0.13, 0.02),
    "teal": (0.011, 0.040, 0.060),
}
"""The colours that a type, a part or a building can have, by name."""

SHAPES = ("box", "cylinder", "sphere", "cone")
"""Shapes of a part or of a whole body. Each fills the box of its length, width and height."""

ORIGINS = ("base", "middle")
"""Points of a body that an entity's position may refer to."""

BARE = "none"
"""The `look` of a body that shows only its parts, and the `shape` of a body without collisions."""

MODELS = (
    "ambulance",
    "bicycle",
    "bridge_fracture",
    "building_fire",
    "bus",
    "car",
    "congestion",
    "delivery_door",
    "delivery_point",
    "delivery_van",
    "destination",
    "fire_source",
    "fire_truck",
    "fixed_wing",
    "lifeboat",
    "motorcycle",
    "person",
    "person_in_water",
    "pipeline_leak",
    "police_car",
    "quadrotor",
    "queue_of_people",
    "reference_building",
    "robot_dog",
    "satellite",
    "taxi",
    "truck",
    "warehouse",
)
"""The models that the built-in camera offers as a `look` (a test compares them with what it draws)."""

GLB = ".glb"
"""Ending of the file of a model of one's own, which a `look` may name as a text."""

MEASURES = ("length", "width", "height")
"""A body's measures along, across and up, in the author's words."""

LEAST_M = 0.001
"""The smallest size of a body or a part, metres (chosen): a smaller one has no surface that can be drawn."""

MOST_M = 1000.0
"""The largest size of a body or a part, and the largest distance of a part from its body's position, metres (chosen).
"""

UNSAID_M = 0.5
"""The default of each measure that a type with a body leaves out, metres (chosen)."""

VARIANT = "look_variant"
"""The whole number that selects the variant of a look: clothes, paint, shape of flames. Without it the variant follows
from the entity's name or index, which is the same for every seed."""

VARIANT_MOST = 9999
"""The greatest number of a variant (chosen)."""

RESHAPING = frozenset((*MEASURES, "shape"))
"""Properties that define another body: a type with one of them and without a `look` does not inherit its base's look.
"""

PHYSICAL = frozenset(
    (
        "length_m",
        "width_m",
        "height_m",
        "mass_kg",
        "colour",
        "shape",
        "origin",
        "look",
        "look_sha256",
        "look_credit",
        "look_variant",
        "acceleration_mps2",
        "braking_mps2",
    )
)
"""Properties for engines alone: they are left out of what agents receive."""
