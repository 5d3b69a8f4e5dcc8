"""What a picture of an episode needs, gathered from its trace by entity and by tick; no drawing here."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from lingjing.analysis.completion import asked_groups, completion_ticks
from lingjing.analysis.detection import MatchedReport, detect, judged_kinds, shots
from lingjing.analysis.incidents import Incident, incidents
from lingjing.analysis.messages import admitted
from lingjing.mission.instance import Instance
from lingjing.trace.admitted import AdmittedMessage
from lingjing.trace.reader import Trace
from lingjing.trace.records import REFUSED, FrameInfo


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
class HistoryEvent:
    """One adjudicated event, or one of the mission's own (`weather`): its kind, tick, and the entity it is about ("" if
    none)."""

    kind: str
    tick: int
    entity: str


@dataclass(frozen=True, slots=True)
class History:
    """Everything the overview draws. `fate` is `completed`, `found` or `missed` for each target, `aside` for one that
    success asks nothing of and with which nobody did anything (a depot, a jam not seen); `completed` says at which
    tick. `deeds` are the words of those that somebody dealt with beside what success asks (a jam `recorded`). `shots`
    are the frames without reference pictures; `reporting` if anybody may report, `judging` if a rule compares reports
    with the truth."""

    instance: Instance
    tracks: dict[str, Track]
    reports: tuple[MatchedReport, ...]
    frames: dict[str, FrameInfo]
    shots: tuple[FrameInfo, ...]
    reporting: bool
    judging: bool
    said: tuple[AdmittedMessage, ...]
    happened: tuple[HistoryEvent, ...]
    incidents: tuple[Incident, ...]
    refusals: tuple[tuple[int, str], ...]
    visited: frozenset[str]
    fate: dict[str, str]
    deeds: dict[str, str]
    completed: dict[str, int]
    ticks: int

    def tracks_of(self, role: str) -> tuple[Track, ...]:
        """The tracks of assets or of targets in declaration order."""
        return tuple(track for track in self.tracks.values() if track.role == role)


def history_of(trace: Trace) -> History:
    """Gather the history of one trace, whole or cut."""
    instance = trace.header.instance
    reports = detect(trace).reports
    dealt = _dealt_with(trace)
    return History(
        instance=instance,
        tracks={entity.id: _track(trace, entity.id, entity.role) for entity in instance.entities},
        reports=reports,
        frames=dict(trace.frames),
        shots=shots(trace),
        reporting=any(kind.category == "report" for kind in instance.messages),
        judging=bool(judged_kinds(trace)),
        said=admitted(trace),
        happened=_happened(trace),
        incidents=incidents(trace),
        refusals=tuple(
            (receipt.tick, receipt.sender)
            for record in trace.boundaries
            for receipt in record.receipts
            if receipt.status in REFUSED
        ),
        visited=frozenset(
            view.name
            for record in trace.boundaries
            for seen in record.observations
            for view in seen.cells
            if view.visited_tick is not None
        ),
        fate=_fate(trace, reports, dealt),
        deeds=dealt,
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


def _happened(trace: Trace) -> tuple[HistoryEvent, ...]:
    entities = {entity.id for entity in trace.header.instance.entities}
    by_itself = [
        HistoryEvent(event.kind, record.tick, name)
        for record in trace.boundaries
        for event in record.task_events
        if event.name
        for name in event.entities or ("",)
    ]
    judged = (
        HistoryEvent(event.kind, event.tick, next((name for name in event.bindings if name in entities), ""))
        for record in trace.boundaries
        for event in record.events
    )
    return (*by_itself, *judged)


def _dealt_with(trace: Trace) -> dict[str, str]:
    """What assets did, as the engines say, with each target but take what it hands out: `recorded`."""
    acts = [task for record in trace.boundaries for task in record.task_events if not task.name]
    done = {(task.kind, name) for task in acts for name in task.entities}
    found: dict[str, str] = {}
    for entity in trace.header.instance.entities:
        for one in entity.interactions:
            if not one.gives and (one.name, entity.id) in done:
                found[entity.id] = one.done_word
    return found


def _fate(trace: Trace, reports: tuple[MatchedReport, ...], dealt: Iterable[str]) -> dict[str, str]:
    completed, found = completion_ticks(trace), {report.target for report in reports}.union(dealt)
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
