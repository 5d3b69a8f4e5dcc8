"""Whose map an episode was played on, for every place that shows the map or speaks of the episode."""

from __future__ import annotations

UNCREDITED = ("", "procedural")
"""Attributions of cities that nobody has to be named for."""


def credit(attribution: str) -> str:
    """`map: © …`, or nothing for a city that was made up."""
    return "" if attribution in UNCREDITED else f"map: {attribution}"
