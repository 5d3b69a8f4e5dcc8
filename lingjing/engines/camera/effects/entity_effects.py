"""The effects of each look of entities and of each prop."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lingjing.engines.camera.effects import fire, lights, night, water
from lingjing.engines.camera.effects.fracture import fracture
from lingjing.engines.camera.effects.particles import Effects, seed_of
from lingjing.engines.camera.effects.town_changes import Site, gap_of
from lingjing.engines.camera.mesh_rows import Floats
from lingjing.engines.camera.models import look_of, variant_of
from lingjing.mission.instance import Entity, Weather
from lingjing.scene.city import Prop
from lingjing.trace.records import BodyState

NOTHING = Effects()
HERE = Site()


def effects_of(entity: Entity, state: BodyState, time_s: float, weather: Weather, site: Site = HERE) -> Effects:
    """Return the effects of an entity in a state at a time; `site` holds its surroundings (`site_of`)."""
    build = EFFECTS.get(look_of(entity))
    return NOTHING if build is None else build(entity, state, time_s, weather, site)


SHOWING = frozenset({"steam", "steam_vent", "fountain"})
"""Prop models that have an effect."""


def prop_effects(prop: Prop, time_s: float, weather: Weather) -> Effects:
    """Return the effects of a prop."""
    place = np.array(prop.position, float)
    if prop.model in ("steam", "steam_vent"):
        return water.steam(seed_of(prop.id), place, 1.4 * prop.scale, time_s, weather)
    if prop.model == "fountain":
        return water.fountain(seed_of(prop.id), place, time_s)
    return NOTHING


def _seed(entity: Entity) -> int:
    """Return the number from which an entity's effect takes its random values: that of its variant, or its name's."""
    return variant_of(entity, seed_of(entity.id))


def _place(state: BodyState) -> Floats:
    return np.array(state.position, float)


def _share(state: BodyState, entity: Entity, name: str) -> float:
    """Return a stock of 0..1: that of the state, or else the declared initial one, or else 1."""
    for value in (state.resources.get(name), entity.properties.get(name), entity.properties.get(f"{name}_share")):
        if isinstance(value, int | float):
            return min(max(float(value), 0.0), 1.0)
    return 1.0


def _fire(blaze: fire.FireScale) -> Callable[[Entity, BodyState, float, Weather, Site], Effects]:
    def show(entity: Entity, state: BodyState, time_s: float, weather: Weather, site: Site) -> Effects:
        heat = 0.0 if state.status in ("out", "extinguished") else _share(state, entity, "heat")
        return fire.fire(_seed(entity), _place(state), blaze, heat, time_s, weather, site.inward)

    return show


def _leak(entity: Entity, state: BodyState, time_s: float, weather: Weather, site: Site) -> Effects:
    flow = 0.0 if state.status == "sealed" else _share(state, entity, "flow")
    heading = state.heading_deg if site.heading_deg is None else site.heading_deg
    return water.leak(_seed(entity), _place(state), heading, site.ground_m, flow, time_s, weather)


def _fracture(entity: Entity, state: BodyState, time_s: float, weather: Weather, site: Site) -> Effects:
    place = _place(state)
    if site.deck_m is not None:
        place[2] = site.deck_m
    heading = state.heading_deg if site.heading_deg is None else site.heading_deg
    drop = max(1.5, float(place[2]) - site.ground_m)
    return fracture(_seed(entity), place, heading, gap_of(entity), site.width_m, site.thickness_m, drop)


def _lights(entity: Entity, state: BodyState, time_s: float, weather: Weather, site: Site) -> Effects:
    return lights.blue_lights(_place(state), state.heading_deg, time_s, weather)


def _carried_lights(look: str) -> Callable[[Entity, BodyState, float, Weather, Site], Effects]:
    def show(entity: Entity, state: BodyState, time_s: float, weather: Weather, site: Site) -> Effects:
        return night.carried_lights(look, state, time_s, weather)

    return show


EFFECTS: dict[str, Callable[[Entity, BodyState, float, Weather, Site], Effects]] = {
    "building_fire": _fire(fire.BUILDING),
    "fire_source": _fire(fire.GROUND),
    "pipeline_leak": _leak,
    "bridge_fracture": _fracture,
    "fire_truck": _lights,
    **{look: _carried_lights(look) for look in night.CARRIED},
}
"""Functions that build the effects of each look."""
