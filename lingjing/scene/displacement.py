"""Displacement: the distance by which `anchor` has moved entities from their declared places; reports and limits.

A place that is drawn from a region is not declared, and the entity stays in its region (ADR 0023). A change of
elevation counts if the mission declares an elevation.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import dist, hypot

from lingjing.errors import MissionError
from lingjing.mission.footprint import STANDS_M
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.instance_entities import DISPLACED_M
from lingjing.mission.kinds import DISPLACEMENT, engine_kind
from lingjing.trace.records import MovedBody

NOTED_M = 1.0
"""Moves shorter than this are not reported, metres (chosen). It also stands for an undeclared length of an entity."""

LOWERED_M = 0.3
"""Shortest reported move straight down of an aircraft that is put onto the surface below it, metres (chosen: as high as
a kerb)."""

BELOW = "surface below"
"""The surface in the report of an aircraft that is put down."""

SHOWN = 5
"""Most moved entities that a summary names."""


def moved_bodies(before: Instance, after: Instance) -> tuple[MovedBody, ...]:
    """The entities that begin farther from their declared places than their own length, or that were put down."""
    moves = (_moved(declared, placed, before) for declared, placed in zip(before.entities, after.entities, strict=True))
    return tuple(moved for moved in moves if moved is not None)


def check_displacements(declared: Instance, placed: Sequence[Entity]) -> None:
    """Raise `MissionError` for the first entity that is moved farther than the mission permits."""
    option = declared.scene.options.get(DISPLACEMENT, DISPLACED_M)
    most_m = float(option) if isinstance(option, int | float) else DISPLACED_M
    for entity, moved in zip(declared.entities, placed, strict=True):
        moved_m = 0.0 if entity.drawn_in else _distance_m(entity, moved, declared)
        if moved_m > max(most_m, NOTED_M):
            on = entity.properties.get("on")
            place = f"{on} that suits it" if isinstance(on, str) else "place that is clear"
            more = 10 * (int(moved_m / 10) + 1)
            raise MissionError(
                f"`{entity.id}` cannot begin where it is declared: the nearest {place} lies {moved_m:.1f} m away, "
                f"and a body is moved by {most_m:g} m at most",
                hint=f"declare a place nearer to one that suits, or allow more: scene … {{ displacement = {more} m }}",
            )


def in_words(moved: Sequence[MovedBody]) -> tuple[str, ...]:
    """Lines for a summary; none without moves. Places of hidden entities are left out."""
    aside = [
        f"`{body.entity}` {body.moved_m:.1f} m ({body.on or 'clear of what is there'})"
        for body in moved
        if body.on != BELOW
    ]
    lowered = [f"`{body.entity}` {body.moved_m:.1f} m" for body in moved if body.on == BELOW]
    lines = (
        ("moved from their declared places by more than their own length", aside),
        ("put down onto the surface below, because they begin close above it", lowered),
    )
    return tuple(f"{words}: {_shortened(bodies)}" for words, bodies in lines if bodies)


def displacements(before: Instance, after: Instance, places: Mapping[str, str]) -> Iterator[str]:
    """Yield a line for each entity with a place that differs from its document. `places`: JSON paths by entity id."""
    for declared, placed in zip(before.entities, after.entities, strict=True):
        east, north, up = (b - a for a, b in zip(declared.position, placed.position, strict=True))
        away, higher = hypot(east, north), abs(up)
        if declared.id not in places or max(away, higher) < NOTED_M:
            continue
        ways = [f"{away:.0f} m away"] * (away >= NOTED_M)
        ways += [f"{higher:.0f} m {'higher' if up > 0 else 'lower'}"] * (higher >= NOTED_M)
        on = declared.properties.get("on")
        where = f"on the nearest {on} that suits" if isinstance(on, str) else "clear of what stands there"
        yield f"{places[declared.id]}: `{declared.id}` is put {' and '.join(ways)}, {where}"


# -- private


def _shortened(bodies: Sequence[str]) -> str:
    more = f" and {len(bodies) - SHOWN} more" if len(bodies) > SHOWN else ""
    return ", ".join(bodies[:SHOWN]) + more


def _moved(entity: Entity, placed: Entity, declared: Instance) -> MovedBody | None:
    moved_m = 0.0 if entity.drawn_in else _distance_m(entity, placed, declared)
    on = entity.properties.get("on")
    if _is_put_down(entity, placed) and moved_m > LOWERED_M:
        on = BELOW
    elif moved_m <= (entity.number("length_m") or NOTED_M):
        return None
    return MovedBody(
        entity=entity.id, declared=entity.position, placed=placed.position, moved_m=round(moved_m, 3),
        on=on if isinstance(on, str) else "",
    )  # fmt: skip


def _is_put_down(entity: Entity, placed: Entity) -> bool:
    """True for an aircraft that was moved straight down onto the surface close below it."""
    flies = engine_kind(entity.engine).floor is not None
    straight = entity.position[:2] == placed.position[:2]
    return flies and straight and 0.0 < entity.position[2] - placed.position[2] <= STANDS_M


def _distance_m(entity: Entity, placed: Entity, declared: Instance) -> float:
    """Distance of a move: in space if the mission declares the elevation, else in plan. Metres."""
    if entity.position[2] == declared.scene.datum_m:
        return dist(entity.position[:2], placed.position[:2])
    return dist(entity.position, placed.position)
