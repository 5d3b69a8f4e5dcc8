"""The moving content of a picture: states at a boundary to batches, marks on the water and rows of effects."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.engines.bodies import is_afloat
from lingjing.engines.camera.classes import CLASSES, FIRST_ENTITY
from lingjing.engines.camera.effects import BILLBOARD, DECAL, Site, effects_of
from lingjing.engines.camera.effects.night import road_light
from lingjing.engines.camera.instances import Batch, DrawnPart, entity_batches, marks, matrix
from lingjing.engines.camera.lamps import SIGNAL_LAMPS, signal_rows, vehicle_rows, vehicles_lit
from lingjing.engines.camera.models import ModelPart, ambient_parts, entity_parts, look_of, prop_model
from lingjing.mission.instance import Entity, Weather
from lingjing.trace.records import BodyState

Support = Callable[[float, float, float], float]
"""Function from a point (east, north, elevation) to the elevation of the surface below it."""


@dataclass(frozen=True, slots=True)
class MovingThings:
    """Everything that moves in a picture."""

    batches: tuple[Batch, ...]
    """Instances of meshes."""
    marks: npt.NDArray[np.void]
    """Marks on the water."""
    billboards: npt.NDArray[np.void]
    """Sprites that face the camera, (n,) rows of the data type `BILLBOARD`."""
    decals: npt.NDArray[np.void]
    """Marks on the ground, (n,) rows of the data type `DECAL`."""


def stage(
    entities: Iterable[tuple[int, Entity, BodyState]],
    ambient: Sequence[BodyState],
    sites: Mapping[str, Site],
    time_s: float,
    weather: Weather,
    under: Support,
    level_m: float,
    own: tuple[BodyState, str] | None = None,
) -> MovingThings:
    """Return the moving things of a picture.

    `entities` come with their numbers in the instance, `ambient` is background traffic. `sites` holds the surroundings
    of some entities. `own` is the body that carries the camera, with its look. It is not drawn, but the road ahead of
    it lies in its headlights.
    """
    drawn: list[DrawnPart] = []
    wet = []
    billboards, decals = [np.zeros(0, BILLBOARD)], [np.zeros(0, DECAL)]
    cast = tuple(entities)
    for number, entity, state in cast:
        plane = under(*state.position)
        if is_afloat(entity) and plane == level_m:  # the drawn sea is flat: its waves exist only in the shading
            state = msgspec.structs.replace(state, position=(*state.position[:2], plane))
            wet.append((state, entity))
        site = sites.get(entity.id, Site(plane))
        parts = entity_parts(entity, state, time_s, site.kerb_m, site.radius_m, site.heading_deg)
        drawn += _placed(state, parts, "entity", FIRST_ENTITY + number, plane)
        effects = effects_of(entity, state, time_s, weather, site)
        drawn += [
            DrawnPart(s.rows, f"effect/{s.key}", (s.mesh,), FIRST_ENTITY + number, s.plane) for s in effects.solids
        ]
        rows = effects.billboards.copy()
        rows["id"] *= FIRST_ENTITY + number
        billboards.append(rows)
        decals.append(effects.decals)
    if vehicles_lit(weather):
        lit = [(state, look_of(entity)) for _, entity, state in cast] + [(state, state.kind) for state in ambient]
        billboards.append(vehicle_rows(lit))
        decals.append(road_light(lit if own is None else [*lit, own], weather))
    signals = [state for state in ambient if state.kind in SIGNAL_LAMPS]
    billboards.append(signal_rows(signals))
    for state in signals:
        pole = ModelPart(*prop_model("traffic_light", 0))
        drawn += _placed(state, (pole,), "prop", CLASSES["prop"], state.position[2])
    for state in (state for state in ambient if state.kind not in SIGNAL_LAMPS):
        number = CLASSES.get(state.kind, CLASSES["entity"])
        drawn += _placed(state, ambient_parts(state, time_s), "entity", number, state.position[2])
    return MovingThings(entity_batches(drawn), marks(wet), np.concatenate(billboards), np.concatenate(decals))


def _placed(state: BodyState, parts: Iterable[ModelPart], group: str, number: int, plane: float) -> list[DrawnPart]:
    body = matrix(state.position, state.heading_deg, state.pitch_deg, state.roll_deg)
    whole = np.vstack([np.eye(4)[:3], [0.0, 0.0, 0.0, 1.0]])
    placed = []
    for part in parts:
        whole[:3] = part.rows
        placed.append(DrawnPart(body @ whole, f"{group}/{part.key}", part.levels, number, plane))
    return placed


__all__ = ["MovingThings", "stage"]
