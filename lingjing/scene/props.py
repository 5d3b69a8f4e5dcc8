"""Sizes of the props that a robot dog collides with, metres.

They are the sizes of the drawn models, rounded. Thin things (cones, paint, pads), soft ones (steam) and floating ones
are left out.
"""

from __future__ import annotations

from lingjing.scene.sizes import SIZES, Size

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
"""Round things by model: radius and height, metres."""

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
"""Box-shaped things by model: length along the prop's heading, width and height, metres."""
