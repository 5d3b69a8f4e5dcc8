"""What went wrong in the world: who crashed, collided, fell, drowned, ran aground or ran out of energy, when and where.

Two sources, both of the trace: the engines' task events, and states in which an asset has become unable to act. A
state that an event at its macro-step explains, or an empty store before, is no incident of its own. A collision that
both sides report is one. What a mission declares as an interaction is none, whatever it is called.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile

import msgspec

from lingjing.analysis.memo import once_per_trace
from lingjing.mission.instance import Entity, Instance, Vector
from lingjing.mission.vocabulary import BATTERY_EMPTY, COLLIDED, DROWNED, FELL, FUEL_EMPTY
from lingjing.trace.reader import Trace
from lingjing.trace.records import AGROUND, DEAD, FALLEN, BodyState, BoundaryRecord, Snapshot, TaskEvent

_EMPTY = (BATTERY_EMPTY, FUEL_EMPTY)
_WORDS = {
    BATTERY_EMPTY: "the battery of {} is empty",
    FUEL_EMPTY: "the fuel of {} is used up",
    FELL: "{} fell",
    DROWNED: "{} drowned",
}
LOST = (DEAD, AGROUND, FALLEN)
"""Statuses of assets that cannot act any more, or not until they have recovered."""

_SAME_S = 1.0
"""Two reports of one pair, one from each side, are one collision if they are no further apart than this or two
macro-steps: the sides' engines meet at macro-steps only."""

_TOLERANCE_S = 1e-6


class Incident(msgspec.Struct, frozen=True, kw_only=True):
    """One incident. `kind` is `collided`, `battery_empty`, `fuel_empty`, `fell`, `drowned`, or the status that an asset
    has come into for no reason that an engine gave (`dead`, `aground`, `fallen`).

    `entities` begins with who it happened to, `text` says it in words. `tick` is the boundary by which it had happened;
    `position` is where the first of them that has a state was at the end of that macro-step, metres.
    """

    kind: str
    entities: tuple[str, ...]
    tick: int
    time_s: float
    text: str
    position: Vector | None = None
    speed_mps: float | None = None

    @property
    def line(self) -> str:
        """`uav[1] and uav[2] collided at 12.2 m/s, at (61, -700, 11)`."""
        where = "" if self.position is None else f", at ({', '.join(f'{part:.0f}' for part in self.position)})"
        return self.text + where


@once_per_trace
def incidents(trace: Trace) -> tuple[Incident, ...]:
    """All incidents of a trace, whole or cut, in order of time."""
    search = incident_search(trace.header.instance)
    for record in trace.boundaries:
        search.take(record)
    return tuple(search.found)


def incident_search(instance: Instance) -> IncidentSearch:
    """A search that has seen no boundary yet."""
    return IncidentSearch(
        entities={entity.id: entity for entity in instance.entities},
        same_s=max(_SAME_S, 2.0 * instance.clock.sync_s) + _TOLERANCE_S,
    )


@dataclass(slots=True)
class IncidentSearch:
    """Incidents, found boundary by boundary.

    `found` are those up to the boundary that was taken last, in order of time; `status` is everybody's at the
    macro-step `since_s`.
    """

    entities: Mapping[str, Entity]
    same_s: float
    found: list[Incident] = field(default_factory=list)
    status: dict[str, str] = field(default_factory=dict)
    since_s: float = -1.0

    def take(self, record: BoundaryRecord) -> None:
        """One more boundary."""
        first = len(self.found)
        told = [_told(event, record, self.entities) for event in record.task_events if self._counts(event)]
        for one in sorted(told, key=lambda each: each.time_s):
            if not self._is_other_side(one):
                self.found.append(one)
        for snapshot in record.snapshots:
            for state in snapshot.states:
                if self.status.get(state.id) != state.status:
                    self._look(state, snapshot, record.tick)
            self.since_s = snapshot.time_s
        self.found[first:] = sorted(self.found[first:], key=lambda one: one.time_s)

    def _counts(self, event: TaskEvent) -> bool:
        known = [self.entities[name] for name in event.entities if name in self.entities]
        declared = any(one.name == event.kind for entity in known for one in entity.interactions)
        return event.kind in (COLLIDED, *_WORDS) and not event.name and bool(known) and not declared

    def _is_other_side(self, one: Incident) -> bool:
        recent = takewhile(lambda other: one.time_s - other.time_s <= self.same_s, reversed(self.found))
        return one.kind == COLLIDED and any(
            other.kind == COLLIDED and other.entities[:2] == one.entities[1::-1] for other in recent
        )

    def _look(self, state: BodyState, snapshot: Snapshot, tick: int) -> None:
        """An asset that has come into one of the statuses `LOST`, if nothing else says why."""
        self.status[state.id] = state.status
        entity = self.entities.get(state.id)
        if entity is None or entity.role != "asset" or state.status not in LOST:
            return
        if not any(self._explains(one, state.id, snapshot.time_s) for one in self.found):
            self.found.append(
                Incident(
                    kind=state.status,
                    entities=(state.id,),
                    tick=tick,
                    time_s=snapshot.time_s,
                    text=f"{state.id} is {state.status}",
                    position=state.position,
                )
            )

    def _explains(self, one: Incident, entity: str, now_s: float) -> bool:
        if entity not in one.entities[:2] or one.time_s > now_s + _TOLERANCE_S:
            return False
        return one.kind in _EMPTY or one.time_s > self.since_s + _TOLERANCE_S


def _told(event: TaskEvent, record: BoundaryRecord, entities: Mapping[str, Entity]) -> Incident:
    who, *others = event.entities
    speed = event.values.get("speed_mps")
    if event.kind == COLLIDED:
        text = f"{who} and {others[0]} collided" if others and others[0] in entities else f"{who} hit {_thing(others)}"
        text += "" if speed is None else f" at {speed:.1f} m/s"
    else:
        text = _WORDS[event.kind].format(who)
    return Incident(
        kind=event.kind,
        entities=event.entities,
        tick=record.tick,
        time_s=event.time_s,
        text=text,
        position=_place(event, record.snapshots),
        speed_mps=speed,
    )


def _thing(others: Sequence[str]) -> str:
    """`ground` and `water` are the engines' words; anything else is a name."""
    if not others:
        return "something"
    return f"the {others[0]}" if others[0] in ("ground", "water") else others[0]


def _place(event: TaskEvent, snapshots: Sequence[Snapshot]) -> Vector | None:
    """Where the first of the event's entities that has a state was when its macro-step ended."""
    if not snapshots:
        return None
    after = next((one for one in snapshots if one.time_s >= event.time_s - _TOLERANCE_S), snapshots[-1])
    states = {state.id: state.position for state in (*after.states, *after.ambient)}
    return next((states[name] for name in event.entities if name in states), None)
