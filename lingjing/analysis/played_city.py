"""The city that an episode was played in: built again, and whom to name for its map."""

from __future__ import annotations

from lingjing.errors import LingjingError, UsageError
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
        return rebuilt_city(trace, PluginHost())
    except LingjingError:
        return None  # another machine's map, or a plug-in that is not here: the trace is drawn without


def rebuilt_city(trace: Trace, host: PluginHost) -> City:
    """The city a trace was played in, built again. Raises `UsageError` that says why it is no longer to be had."""
    try:
        city = build_city(trace.header.instance.scene, host)
    except LingjingError as error:
        raise UsageError(f"the city of {trace.path} is not to be had here: {error}", hint=error.hint) from error
    if content_sha256(city) != trace.header.city_sha256:
        raise UsageError(
            f"the city of {trace.path} is not to be had here as it was: what is built now is another one",
            hint="its map, its plug-in or the version that built it has changed",
        )
    return city


def surroundings_of(trace: Trace) -> Surroundings:
    """What a trace shows beside its records, made again; without the city if that is no longer to be had."""
    city = city_of(trace)
    return NO_SURROUNDINGS if city is None else surroundings(city, trace.header.instance)


def credit(attribution: str) -> str:
    """`map: © …`, or nothing for a city that was made up."""
    return "" if attribution in UNCREDITED else f"map: {attribution}"
