"""What a picture of an episode needs, gathered from its trace by entity and by tick; no drawing here."""

from __future__ import annotations

from dataclasses import dataclass

from lingjing.analysis.completion import asked_groups, completion_ticks
from lingjing.analysis.detection import Report, detect
from lingjing.analysis.spoken import Spoken, spoken
from lingjing.mission.instance import Instance
from lingjing.trace.reader import Trace
from lingjing.trace.records import FrameInfo


@dataclass(frozen=True, slots=True)
class Track:
    """Where one entity was at every macro-step: times (s), (east, north) in metres, and its battery where it has
    one (0..1 of what it began with)."""

    entity: str
    role: str
    times: tuple[float, ...]
    points: tuple[tuple[float, float], ...]
    battery: tuple[float, ...]
    status: str


@dataclass(frozen=True, slots=True)
class Happened:
    """One adjudicated event: its rule, tick, and the entity it is about ("" if none)."""

    kind: str
    tick: int
    entity: str


@dataclass(frozen=True, slots=True)
class Story:
    """Everything the overview draws. `fate` is `completed`, `found` or `missed` for each target, `aside` for one that
    success asks nothing of and nobody reported (a depot, a jam); `completed` says at which tick."""

    instance: Instance
    tracks: dict[str, Track]
    reports: tuple[Report, ...]
    frames: dict[str, FrameInfo]
    said: tuple[Spoken, ...]
    happened: tuple[Happened, ...]
    refusals: tuple[tuple[int, str], ...]
    visited: frozenset[str]
    fate: dict[str, str]
    completed: dict[str, int]
    ticks: int

    def tracks_of(self, role: str) -> tuple[Track, ...]:
        """The tracks of assets or of targets in declaration order."""
        return tuple(track for track in self.tracks.values() if track.role == role)


def tell(trace: Trace) -> Story:
    """Gather the story of one trace, whole or cut."""
    instance = trace.header.instance
    reports = detect(trace).reports
    return Story(
        instance=instance,
        tracks={entity.id: _track(trace, entity.id, entity.role) for entity in instance.entities},
        reports=reports,
        frames=dict(trace.frames),
        said=spoken(trace),
        happened=_happened(trace),
        refusals=tuple(
            (receipt.tick, receipt.sender)
            for record in trace.boundaries
            for receipt in record.receipts
            if receipt.status in ("rejected", "timed_out", "substituted")
        ),
        visited=frozenset(
            view.name
            for record in trace.boundaries
            for seen in record.observations
            for view in seen.cells
            if view.visited_tick is not None
        ),
        fate=_fate(trace, reports),
        completed=completion_ticks(trace),
        ticks=trace.boundaries[-1].tick if trace.boundaries else 0,
    )


def _track(trace: Trace, entity: str, role: str) -> Track:
    states = [
        (snapshot.time_s, state)
        for record in trace.boundaries
        for snapshot in record.snapshots
        for state in snapshot.states
        if state.id == entity
    ]
    stocks = [
        stock
        for _, state in states
        if (stock := state.resources.get("battery", state.resources.get("battery_wh"))) is not None
    ]
    return Track(
        entity=entity,
        role=role,
        times=tuple(time_s for time_s, _ in states),
        points=tuple((state.position[0], state.position[1]) for _, state in states),
        battery=tuple(stock / stocks[0] for stock in stocks) if stocks and stocks[0] > 0 else (),
        status=states[-1][1].status if states else "",
    )


def _happened(trace: Trace) -> tuple[Happened, ...]:
    entities = {entity.id for entity in trace.header.instance.entities}
    return tuple(
        Happened(event.kind, event.tick, next((name for name in event.bindings if name in entities), ""))
        for record in trace.boundaries
        for event in record.events
    )


def _fate(trace: Trace, reports: tuple[Report, ...]) -> dict[str, str]:
    completed, found = completion_ticks(trace), {report.target for report in reports}
    asked = asked_groups(trace.header.instance)
    return {
        entity.id: "completed"
        if entity.id in completed
        else "found"
        if entity.id in found
        else "missed"
        if entity.group in asked
        else "aside"
        for entity in trace.header.instance.entities
        if entity.role == "target"
    }
