"""How far `anchor` has moved entities from their declared places: what is reported, and what is too far.

A place that is drawn from a region is not declared: the entity stays in its region. An elevation counts if the mission
gives one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import dist, hypot

from lingjing.errors import MissionError
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.kinds import DISPLACEMENT
from lingjing.trace.records import MovedBody

NOTED_M = 1.0
"""Moves shorter than this are not reported. It is also the length of what declares none."""

SHOWN = 5
"""Moved entities that a summary names."""

MOST_M = 50.0
"""The farthest that a declared place may be moved in a mission that names no `displacement`, metres (chosen: half a
block of houses)."""


def moved_bodies(before: Instance, after: Instance) -> tuple[MovedBody, ...]:
    """The entities that begin farther from their declared places than they are long."""
    found = (_moved(one, other, before) for one, other in zip(before.entities, after.entities, strict=True))
    return tuple(moved for moved in found if moved is not None)


def check_displacements(declared: Instance, placed: Sequence[Entity]) -> None:
    """Raise `MissionError` for the first entity that is moved farther than the mission allows."""
    given = declared.scene.options.get(DISPLACEMENT, MOST_M)
    most_m = float(given) if isinstance(given, int | float) else MOST_M
    for one, other in zip(declared.entities, placed, strict=True):
        moved_m = 0.0 if one.drawn_in else _distance_m(one, other, declared)
        if moved_m > max(most_m, NOTED_M):
            on = one.properties.get("on")
            place = f"{on} that suits it" if isinstance(on, str) else "place that is clear"
            more = 10 * (int(moved_m / 10) + 1)
            raise MissionError(
                f"`{one.id}` cannot begin where it is declared: the nearest {place} lies {moved_m:.1f} m away, "
                f"and a body is moved by {most_m:g} m at most",
                hint=f"declare a place nearer to one that suits, or allow more: scene … {{ displacement = {more} m }}",
            )


def in_words(moved: Sequence[MovedBody]) -> tuple[str, ...]:
    """One line for a summary, none if nothing was moved. The places of hidden entities are not in it."""
    if not moved:
        return ()
    shown = [f"`{one.entity}` {one.moved_m:.1f} m ({one.on or 'clear of what is there'})" for one in moved[:SHOWN]]
    more = f" and {len(moved) - SHOWN} more" if len(moved) > SHOWN else ""
    return (f"moved from their declared places by more than their own length: {', '.join(shown)}{more}",)


def displacements(before: Instance, after: Instance, places: Mapping[str, str]) -> Iterator[str]:
    """In words, each entity that stands elsewhere than its document says; `places` are JSON paths by entity id."""
    for one, other in zip(before.entities, after.entities, strict=True):
        east, north, up = (b - a for a, b in zip(one.position, other.position, strict=True))
        away, higher = hypot(east, north), abs(up)
        if one.id not in places or max(away, higher) < NOTED_M:
            continue
        ways = [f"{away:.0f} m away"] * (away >= NOTED_M)
        ways += [f"{higher:.0f} m {'higher' if up > 0 else 'lower'}"] * (higher >= NOTED_M)
        on = one.properties.get("on")
        where = f"on the nearest {on} that suits" if isinstance(on, str) else "clear of what stands there"
        yield f"{places[one.id]}: `{one.id}` is put {' and '.join(ways)}, {where}"


# -- private


def _moved(one: Entity, other: Entity, declared: Instance) -> MovedBody | None:
    moved_m = 0.0 if one.drawn_in else _distance_m(one, other, declared)
    if moved_m <= (one.number("length_m") or NOTED_M):
        return None
    on = one.properties.get("on")
    return MovedBody(
        entity=one.id, declared=one.position, placed=other.position, moved_m=round(moved_m, 3),
        on=on if isinstance(on, str) else "",
    )  # fmt: skip


def _distance_m(one: Entity, other: Entity, declared: Instance) -> float:
    """How far an entity was moved: in space if its mission gives its elevation, else in plan."""
    if one.position[2] == declared.scene.datum_m:
        return dist(one.position[:2], other.position[:2])
    return dist(one.position, other.position)
