"""The data of a trace by entity and by tick, as input for drawing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from lingjing.analysis.completion import completion_ticks, required_target_groups
from lingjing.analysis.detection import MatchedReport, detect, judged_kinds, shots
from lingjing.analysis.incidents import Incident, incidents
from lingjing.analysis.messages import admitted_messages
from lingjing.mission.instance import Instance
from lingjing.mission.schedule import OCCURRED, UNDONE
from lingjing.trace.admitted_messages import AdmittedMessage
from lingjing.trace.reader import Trace
from lingjing.trace.records import REFUSED, FrameInfo


@dataclass(frozen=True, slots=True)
class Track:
    """The track of one entity over all macro-steps."""

    entity: str
    role: str
    times: tuple[float, ...]
    """Times of the macro-steps, seconds."""
    points: tuple[tuple[float, float], ...]
    """(east, north) in metres at `times`."""
    battery: tuple[float, ...]
    """The charge as a share of the first one. Empty if the entity has no battery."""
    status: str
    """The last status."""


@dataclass(frozen=True, slots=True)
class HistoryEvent:
    """One adjudicated event, or one scheduled event of the mission such as `weather`."""

    kind: str
    tick: int
    entity: str
    """The first entity of the event; "" if it has none."""


@dataclass(frozen=True, slots=True)
class EventSpan:
    """One time for which an event of the mission was in force."""

    name: str
    """The event's name."""
    begin: int
    """The tick at which it occurred."""
    end: int
    """The tick at which it was undone, or the last one before it occurred again or the episode ended."""
    undone: bool = False
    """True if it was undone."""


@dataclass(frozen=True, slots=True)
class History:
    """The data of one episode that the overview draws."""

    instance: Instance
    tracks: dict[str, Track]
    reports: tuple[MatchedReport, ...]
    frames: dict[str, FrameInfo]
    shots: tuple[FrameInfo, ...]
    """The frames without reference pictures."""
    reporting: bool
    """True if the mission declares a kind of report."""
    judging: bool
    """True if a rule compares reports with the truth."""
    messages: tuple[AdmittedMessage, ...]
    events: tuple[HistoryEvent, ...]
    spans: tuple[EventSpan, ...]
    """The times for which events with a condition, an end or a pause were in force."""
    incidents: tuple[Incident, ...]
    refusals: tuple[tuple[int, str], ...]
    """Tick and sender of each request that was not carried out."""
    visited: frozenset[str]
    """Names of the visited search cells."""
    fate: dict[str, str]
    """The state of each target at the end: `completed`, `found` or `missed`. `aside` is a target that success does not
    require and no asset interacted with, such as a depot or an unseen jam."""
    deeds: dict[str, str]
    """The result of an interaction with a target, such as `recorded` for a jam."""
    completed: dict[str, int]
    """Tick of completion of each completed target."""
    ticks: int

    def tracks_of(self, role: str) -> tuple[Track, ...]:
        """Return the tracks of assets or of targets in declaration order."""
        return tuple(track for track in self.tracks.values() if track.role == role)


def history_of(trace: Trace) -> History:
    """Return the history of one trace, whole or cut."""
    instance = trace.header.instance
    reports = detect(trace).reports
    deeds = _deeds(trace)
    return History(
        instance=instance,
        tracks={entity.id: _track(trace, entity.id, entity.role) for entity in instance.entities},
        reports=reports,
        frames=dict(trace.frames),
        shots=shots(trace),
        reporting=any(kind.category == "report" for kind in instance.messages),
        judging=bool(judged_kinds(trace)),
        messages=admitted_messages(trace),
        events=_events(trace),
        spans=tuple(_spans(trace)),
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
            for observation in record.observations
            for view in observation.cells
            if view.visited_tick is not None
        ),
        fate=_fate(trace, reports, deeds),
        deeds=deeds,
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


def _events(trace: Trace) -> tuple[HistoryEvent, ...]:
    """Return the scheduled events, then the adjudicated ones."""
    entities = {entity.id for entity in trace.header.instance.entities}
    scheduled = [
        HistoryEvent(event.kind, record.tick, name)
        for record in trace.boundaries
        for event in record.task_events
        if event.name and event.kind not in (OCCURRED, UNDONE)
        for name in event.entities or ("",)
    ]
    adjudicated = (
        HistoryEvent(event.kind, event.tick, next((name for name in event.bindings if name in entities), ""))
        for record in trace.boundaries
        for event in record.events
    )
    return (*scheduled, *adjudicated)


def _spans(trace: Trace) -> Iterator[EventSpan]:
    """Yield the times of events, in the order in which they ended; those in force at the end come last."""
    began: dict[str, int] = {}
    for record in trace.boundaries:
        for event in record.task_events:
            if event.name and event.kind == OCCURRED:
                if event.name in began:
                    yield EventSpan(event.name, began[event.name], record.tick)
                began[event.name] = record.tick
            elif event.name and event.kind == UNDONE:
                yield EventSpan(event.name, began.pop(event.name), record.tick, undone=True)
    last = trace.boundaries[-1].tick if trace.boundaries else 0
    yield from (EventSpan(name, tick, last) for name, tick in began.items())


def _deeds(trace: Trace) -> dict[str, str]:
    """Return the result of the interactions with each target. Interactions in which the target gives are left out."""
    acts = [task for record in trace.boundaries for task in record.task_events if not task.name]
    done = {(task.kind, name) for task in acts for name in task.entities}
    deeds: dict[str, str] = {}
    for entity in trace.header.instance.entities:
        for interaction in entity.interactions:
            if not interaction.gives and (interaction.name, entity.id) in done:
                deeds[entity.id] = interaction.done_word
    return deeds


def _fate(trace: Trace, reports: tuple[MatchedReport, ...], deeds: Iterable[str]) -> dict[str, str]:
    completed, noticed = completion_ticks(trace), {report.target for report in reports}.union(deeds)
    required = required_target_groups(trace.header.instance)
    return {
        entity.id: "completed"
        if entity.id in completed
        else "found"
        if entity.id in noticed
        else "missed"
        if entity.group in required
        else "aside"
        for entity in trace.header.instance.entities
        if entity.role == "target"
    }
