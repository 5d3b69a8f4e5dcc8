"""The city of an episode, built again from its trace."""

from __future__ import annotations

from lingjing.errors import LingjingError, UsageError, hint_of
from lingjing.mission.instance import Instance
from lingjing.plugins.building import build_city
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City, content_sha256
from lingjing.scene.own_models import model_credits
from lingjing.scene.surroundings import surroundings
from lingjing.trace.reader import Trace
from lingjing.trace.surroundings import NO_SURROUNDINGS, Surroundings

UNCREDITED = ("", "procedural")
"""Attributions of cities that need no credit."""
_MODELS = " · models: "
"""Separator of the map's and the models' part of an attribution."""


def city_of(trace: Trace) -> City | None:
    """Return the city of a trace, built again, or None if it cannot be rebuilt exactly."""
    try:
        return rebuilt_city(trace, PluginHost())
    except LingjingError:
        return None  # the map or the plug-in is on another machine: the trace is drawn without a city


def rebuilt_city(trace: Trace, host: PluginHost) -> City:
    """Return the city of a trace, built again. Raises `UsageError` with the reason if it cannot be rebuilt exactly."""
    try:
        city = build_city(trace.header.instance.scene, host)
    except LingjingError as error:
        raise UsageError(f"the city of {trace.path} cannot be built here: {error}", hint=hint_of(error)) from error
    if content_sha256(city) != trace.header.city_sha256:
        raise UsageError(
            f"the city of {trace.path} cannot be rebuilt: the result differs from the city of the trace",
            hint="its map, its plug-in or the version that built it has changed",
        )
    return city


def surroundings_of(trace: Trace) -> Surroundings:
    """Return the inputs for viewers of a trace, made again; without the city if it cannot be rebuilt exactly."""
    city = city_of(trace)
    return NO_SURROUNDINGS if city is None else surroundings(city, trace.header.instance)


def attribution_of(city: City, instance: Instance) -> str:
    """Return the attribution of a city's map and of the models of its own that an instance shows."""
    models = model_credits(instance)
    return f"{city.attribution}{_MODELS}{'; '.join(models)}" if models else city.attribution


def credit(attribution: str) -> str:
    """Return the credit for a map and for models, `map: © … · models: …`; "" without any."""
    maps, _, models = attribution.partition(_MODELS)
    parts = ("" if maps in UNCREDITED else f"map: {maps}", f"{_MODELS[3:]}{models}" if models else "")
    return " · ".join(part for part in parts if part)
