"""The city that an episode was played in: built again, and whom to name for its map."""

from __future__ import annotations

from lingjing.errors import LingjingError
from lingjing.plugins.building import build_city
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City, content_sha256
from lingjing.scene.surroundings import surroundings
from lingjing.trace.reader import Trace
from lingjing.trace.surroundings import NO_SURROUNDINGS, Surroundings

UNCREDITED = ("", "procedural")
"""Attributions of cities that nobody has to be named for."""


def city_of(trace: Trace) -> City | None:
    """The city a trace was played in, built again; None if it is no longer to be had exactly as it was."""
    try:
        city = build_city(trace.header.instance.scene, PluginHost())
    except LingjingError:
        return None  # another machine's map, or a plug-in that is not here: the trace is drawn without
    return city if content_sha256(city) == trace.header.city_sha256 else None


def surroundings_of(trace: Trace) -> Surroundings:
    """What a trace shows beside its records, made again; without the city if that is no longer to be had."""
    city = city_of(trace)
    return NO_SURROUNDINGS if city is None else surroundings(city, trace.header.instance)


def credit(attribution: str) -> str:
    """`map: © …`, or nothing for a city that was made up."""
    return "" if attribution in UNCREDITED else f"map: {attribution}"
