"""Incidents: collisions, falls, drownings, groundings and empty energy stores, with time and place.

There are two sources, both in the trace: the task events of engines, and states in which an asset cannot act any more.
Such a state is no incident of its own if an event at its macro-step or an earlier empty store explains it. A collision
that both sides report is one incident. A declared interaction of the mission is no incident, whatever its name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile

import msgspec

from lingjing.analysis.memo import cache_by_trace
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
"""Statuses of assets that cannot act, or not until they have recovered."""

_SAME_S = 1.0
"""Longest time, seconds, between the two reports of one collision, one from each side. It is at least two macro-steps,
because engines exchange states at macro-steps only. Chosen."""

_TOLERANCE_S = 1e-6
"""Tolerance of comparisons of times, seconds. It covers the rounding of sums of macro-steps."""


class Incident(msgspec.Struct, frozen=True, kw_only=True):
    """A collision, fall or other mishap of a body."""

    kind: str
    """`collided`, `battery_empty`, `fuel_empty`, `fell`, `drowned`, or a status without an event that explains it:
    `dead`, `aground`, `fallen`."""
    entities: tuple[str, ...]
    """The affected entity first, then the others."""
    tick: int
    """The first boundary after the incident."""
    time_s: float
    text: str
    """The incident in words."""
    position: Vector | None = None
    """Position, metres, of the first entity that has a state, at the end of the macro-step. None if unknown."""
    speed_mps: float | None = None
    """Speed of the impact. None if unknown."""

    @property
    def line(self) -> str:
        """The incident in words with its place: `uav[1] and uav[2] collided at 12.2 m/s, at (61, -700, 11)`."""
        where = "" if self.position is None else f", at ({', '.join(f'{part:.0f}' for part in self.position)})"
        return self.text + where


@cache_by_trace
def incidents(trace: Trace) -> tuple[Incident, ...]:
    """Return all incidents of a trace, whole or cut, in order of time."""
    search = incident_search(trace.header.instance)
    for record in trace.boundaries:
        search.take(record)
    return tuple(search.incidents)


def incident_search(instance: Instance) -> IncidentSearch:
    """Return a search without any boundary."""
    return IncidentSearch(
        entities={entity.id: entity for entity in instance.entities},
        same_s=max(_SAME_S, 2.0 * instance.clock.sync_s) + _TOLERANCE_S,
    )


@dataclass(slots=True)
class IncidentSearch:
    """Search for incidents, boundary by boundary."""

    entities: Mapping[str, Entity]
    same_s: float
    """Longest time between the two reports of one collision."""
    incidents: list[Incident] = field(default_factory=list)
    """The incidents up to the last boundary, in order of time."""
    status: dict[str, str] = field(default_factory=dict)
    """The status of each entity at `since_s`."""
    since_s: float = -1.0
    """Time of the last macro-step."""

    def take(self, record: BoundaryRecord) -> None:
        """Add the incidents of one boundary."""
        first = len(self.incidents)
        reported = [_incident(event, record, self.entities) for event in record.task_events if self._counts(event)]
        for incident in sorted(reported, key=lambda incident: incident.time_s):
            if not self._is_other_side(incident):
                self.incidents.append(incident)
        for snapshot in record.snapshots:
            for state in snapshot.states:
                if self.status.get(state.id) != state.status:
                    self._check_state(state, snapshot, record.tick)
            self.since_s = snapshot.time_s
        self.incidents[first:] = sorted(self.incidents[first:], key=lambda incident: incident.time_s)

    def _counts(self, event: TaskEvent) -> bool:
        known = [self.entities[name] for name in event.entities if name in self.entities]
        declared = any(interaction.name == event.kind for entity in known for interaction in entity.interactions)
        return event.kind in (COLLIDED, *_WORDS) and not event.name and bool(known) and not declared

    def _is_other_side(self, incident: Incident) -> bool:
        recent = takewhile(lambda other: incident.time_s - other.time_s <= self.same_s, reversed(self.incidents))
        return incident.kind == COLLIDED and any(
            other.kind == COLLIDED and other.entities[:2] == incident.entities[1::-1] for other in recent
        )

    def _check_state(self, state: BodyState, snapshot: Snapshot, tick: int) -> None:
        """Add an incident if an asset has entered one of the statuses `LOST` and no earlier incident explains it."""
        self.status[state.id] = state.status
        entity = self.entities.get(state.id)
        if entity is None or entity.role != "asset" or state.status not in LOST:
            return
        if not any(self._explains(earlier, state.id, snapshot.time_s) for earlier in self.incidents):
            self.incidents.append(
                Incident(
                    kind=state.status,
                    entities=(state.id,),
                    tick=tick,
                    time_s=snapshot.time_s,
                    text=f"{state.id} is {state.status}",
                    position=state.position,
                )
            )

    def _explains(self, incident: Incident, entity: str, now_s: float) -> bool:
        if entity not in incident.entities[:2] or incident.time_s > now_s + _TOLERANCE_S:
            return False
        return incident.kind in _EMPTY or incident.time_s > self.since_s + _TOLERANCE_S


def _incident(event: TaskEvent, record: BoundaryRecord, entities: Mapping[str, Entity]) -> Incident:
    body, *others = event.entities
    speed = event.values.get("speed_mps")
    if event.kind == COLLIDED:
        both = others and others[0] in entities
        text = f"{body} and {others[0]} collided" if both else f"{body} hit {_obstacle(others)}"
        text += "" if speed is None else f" at {speed:.1f} m/s"
    else:
        text = _WORDS[event.kind].format(body)
    return Incident(
        kind=event.kind,
        entities=event.entities,
        tick=record.tick,
        time_s=event.time_s,
        text=text,
        position=_place(event, record.snapshots),
        speed_mps=speed,
    )


def _obstacle(others: Sequence[str]) -> str:
    """Return the obstacle in words. Engines write `ground` and `water` for these; anything else is a name."""
    if not others:
        return "something"
    return f"the {others[0]}" if others[0] in ("ground", "water") else others[0]


def _place(event: TaskEvent, snapshots: Sequence[Snapshot]) -> Vector | None:
    """Return the position, at the end of the macro-step, of the event's first entity that has a state, or None."""
    if not snapshots:
        return None
    later = (snapshot for snapshot in snapshots if snapshot.time_s >= event.time_s - _TOLERANCE_S)
    after = next(later, snapshots[-1])
    states = {state.id: state.position for state in (*after.states, *after.ambient)}
    return next((states[name] for name in event.entities if name in states), None)
