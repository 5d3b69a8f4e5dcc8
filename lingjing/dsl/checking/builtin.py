"""The scenes and engines that the project brings, by name, so that checking a mission loads none of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

Offered = Literal["scene", "engine"]
"""What plug-ins offer and missions name."""

BUILTIN: Mapping[Offered, frozenset[str]] = {
    "scene": frozenset(
        ("bay", "campus", "city", "coastal", "commercial", "industrial", "logistics", "map", "residential")
    ),
    "engine": frozenset(("camera", "city", "multirotor", "plane", "quadruped", "road", "satellite", "vessel")),
}
"""What the project brings (a test compares it with what the plug-in host finds)."""
