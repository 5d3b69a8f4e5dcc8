"""Displacement: the distance by which `anchor` has moved entities from their declared places; reports and limits.

A place that is drawn from a region is not declared, and the entity stays in its region. A change of elevation counts if
the mission declares an elevation.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import dist, hypot

from lingjing.errors import MissionError
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.kinds import DISPLACEMENT
from lingjing.trace.records import MovedBody

NOTED_M = 1.0
"""Moves shorter than this are not reported, metres (chosen). It also stands for an undeclared length of an entity."""

SHOWN = 5
"""Most moved entities that a summary names."""

MOST_M = 50.0
"""Farthest permitted move in a mission without the option `displacement`, metres (chosen: half a block of houses)."""


def moved_bodies(before: Instance, after: Instance) -> tuple[MovedBody, ...]:
    """The entities that begin farther from their declared places than their own length."""
    moves = (_moved(declared, placed, before) for declared, placed in zip(before.entities, after.entities, strict=True))
    return tuple(moved for moved in moves if moved is not None)


def check_displacements(declared: Instance, placed: Sequence[Entity]) -> None:
    """Raise `MissionError` for the first entity that is moved farther than the mission permits."""
    option = declared.scene.options.get(DISPLACEMENT, MOST_M)
    most_m = float(option) if isinstance(option, int | float) else MOST_M
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
    """One line for a summary; none without moves. Places of hidden entities are left out."""
    if not moved:
        return ()
    shown = [f"`{body.entity}` {body.moved_m:.1f} m ({body.on or 'clear of what is there'})" for body in moved[:SHOWN]]
    more = f" and {len(moved) - SHOWN} more" if len(moved) > SHOWN else ""
    return (f"moved from their declared places by more than their own length: {', '.join(shown)}{more}",)


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


def _moved(entity: Entity, placed: Entity, declared: Instance) -> MovedBody | None:
    moved_m = 0.0 if entity.drawn_in else _distance_m(entity, placed, declared)
    if moved_m <= (entity.number("length_m") or NOTED_M):
        return None
    on = entity.properties.get("on")
    return MovedBody(
        entity=entity.id, declared=entity.position, placed=placed.position, moved_m=round(moved_m, 3),
        on=on if isinstance(on, str) else "",
    )  # fmt: skip


def _distance_m(entity: Entity, placed: Entity, declared: Instance) -> float:
    """Distance of a move: in space if the mission declares the elevation, else in plan. Metres."""
    if entity.position[2] == declared.scene.datum_m:
        return dist(entity.position[:2], placed.position[:2])
    return dist(entity.position, placed.position)
