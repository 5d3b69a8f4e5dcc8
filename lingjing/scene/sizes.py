"""How large things are that a scene and its traffic put up by kind: length, width and height, metres.

What a mission's own entities measure their types declare (`lingjing.plugins.bodies`).
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Size:
    """Outer dimensions along, across and up, metres."""

    length_m: float
    width_m: float
    height_m: float


SIZES: dict[str, Size] = {
    "car": Size(4.5, 1.8, 1.5),
    "delivery_van": Size(5.9, 2.1, 2.6),
    "truck": Size(9.0, 2.5, 3.6),
    "bus": Size(12.0, 2.55, 3.1),
    "fire_truck": Size(8.6, 2.5, 3.3),
    "motorcycle": Size(2.2, 0.8, 1.5),
    "bicycle": Size(1.7, 0.6, 1.6),
    "person": Size(0.4, 0.5, 1.75),
}
"""Cars after the traffic simulator's defaults, the rest as drawn."""
