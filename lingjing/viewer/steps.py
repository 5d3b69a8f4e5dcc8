"""What a page is told of each boundary: a `ViewStep` for the view, a `StepDetail` for what is read beside it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

import msgspec

from lingjing.analysis.detection import numbers
from lingjing.analysis.incidents import incident_search
from lingjing.mission.geometry2d import Vector2
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.vocabulary import COLLIDED
from lingjing.plugins.policy import REFERENCE
from lingjing.terminal import visible
from lingjing.trace.admitted import admitted_at, categories_of
from lingjing.trace.records import REFUSED, BodyState, BoundaryRecord, FrameInfo, Receipt
from lingjing.viewer.head import EntityCard, card_of
from lingjing.viewer.state import Watched, command_words, spoken, status_words

SAMPLES = 5
"""Of a boundary's macro-steps, so many are shown; all of an episode together keep to `MOST_SAMPLES`."""

MOST_SAMPLES = 400_000
"""Places of entities in an episode that a page gets."""

MOST_AMBIENT = 300
"""Bodies of nobody (traffic) at one boundary."""

STILL_M, STILL_DEG = 0.1, 2.0
"""A smaller motion is none."""

LONGEST_TEXT = 4_000
"""Characters of a thought or a message; how many more there are is said."""

Boxed = tuple[float, float, float, float]
Sample = tuple[float, float, float, float, float]
"""Time (s), east, north, elevation (m), heading (degrees)."""


class PictureView(msgspec.Struct, frozen=True, omit_defaults=True):
    """Where the camera of a picture was, as in `CameraPose`."""

    position: tuple[float, float, float]
    heading: float
    tilt: float
    hfov: float


class PictureNote(msgspec.Struct, frozen=True, omit_defaults=True):
    """A picture and the agents that were shown it. `truth` are the true boxes (entity, class, box), where asked for."""

    id: str
    entity: str
    camera: str
    agents: tuple[str, ...]
    width: int
    height: int
    view: PictureView | None = None
    truth: tuple[tuple[str, str, Boxed], ...] = ()


class ReportNote(msgspec.Struct, frozen=True, omit_defaults=True):
    """A box that an agent reported in a picture; `id` is the message."""

    id: str
    frame: str
    sender: str
    cls: str
    box: Boxed
    confidence: float | None = None


class EventNote(msgspec.Struct, frozen=True):
    """Something that happened: `kind` is `good` (the mission is about it), `bad` (a crash, a replaced answer) or
    `plain`."""

    kind: str
    text: str


class ViewStep(msgspec.Struct, omit_defaults=True):
    """One boundary for the view; what has not changed since the step before is left out.

    `moves` are samples by entity, `status` words and what is left of the battery (0..1), `sights` how much is known of
    a target, `matched` reports that a rule found true by message and target, `said` and `refused` numbers of messages
    and of refused commands.
    """

    tick: int
    time: float
    score: float
    scr: float
    done: bool = False
    cards: list[EntityCard] = []
    moves: dict[str, list[Sample]] = {}
    status: dict[str, tuple[str, float | None]] = {}
    sights: dict[str, str] = {}
    pictures: list[PictureNote] = []
    reports: list[ReportNote] = []
    matched: dict[str, str] = {}
    events: list[EventNote] = []
    stages: list[tuple[str, int, int]] = []
    relations: list[tuple[str, str, str]] = []
    routes: dict[str, list[Vector2]] = {}
    ambient: list[tuple[float, float, float]] = []
    said: int = 0
    refused: int = 0


class AgentNote(msgspec.Struct, omit_defaults=True):
    """What an agent decided at a boundary and what became of its commands; `replaced` says why its answer was."""

    command: str = ""
    thought: str = ""
    replaced: str = ""
    receipts: list[tuple[str, bool]] = []
    tokens: int = 0


class MessageNote(msgspec.Struct, omit_defaults=True):
    """A message that the bus admitted."""

    sender: str
    recipients: tuple[str, ...]
    kind: str
    category: str
    text: str


class StepDetail(msgspec.Struct, omit_defaults=True):
    """One boundary for reading."""

    agents: dict[str, AgentNote] = {}
    messages: list[MessageNote] = []


class StepMaker:
    """Makes the steps of one episode, boundary by boundary. Without `truth` nothing hidden gets into them.

    `boundaries` is how many there will be at most.
    """

    def __init__(self, instance: Instance, boundaries: int, *, truth: bool) -> None:
        self.watched = Watched(instance, truth=truth)
        self._truth = truth
        self._instance = instance
        self._categories = categories_of(instance)
        self._search = incident_search(instance)
        self._matching = {rule.name for rule in instance.rules if rule.matching}
        self._entities = {entity.id: entity for entity in instance.entities}
        self._colours = {entity.id: place for place, entity in enumerate(self.watched.assets)}
        movers = max(1, len(instance.entities)) * max(1, boundaries)
        self._samples = max(1, min(SAMPLES, MOST_SAMPLES // movers))
        self._shown: dict[str, Sample] = {}
        self._status: dict[str, tuple[str, float | None]] = {}
        self._sights: dict[str, str] = {}
        self._stages: list[tuple[str, int, int]] = []
        self._full: dict[str, float] = {}

    def step(self, record: BoundaryRecord) -> tuple[ViewStep, StepDetail]:
        """The next boundary."""
        self.watched.take(record)
        known = len(self._search.found)
        self._search.take(record)
        step = ViewStep(record.tick, _short(record.time_s), round(record.reward, 4), round(record.scr, 4), record.done)
        seen = [entity for entity in self._instance.entities if self._is_seen(entity)]
        step.cards = [card_of(one, self._colours.get(one.id, -1)) for one in seen if one.id not in self._shown]
        step.moves = dict(self._moves(record, seen))
        step.status = dict(self._statuses(seen))
        step.sights = dict(self._changed_sights())
        step.pictures = [self._picture(frame, record) for frame in record.frames]
        step.matched = dict(self._matches(record))
        step.events = [*self._incidents(known), *self._replaced(record), *self._events(record, known)]
        counts = self.watched.stage_counts()
        if counts != self._stages:
            step.stages = self._stages = counts
        step.relations = [(one.kind, one.source, one.target) for one in record.relations]
        step.routes = {one.entity: self._route(one.entity) for one in record.routes if one.entity in self._shown}
        step.refused = sum(receipt.status in ("rejected", "timed_out") for receipt in record.receipts)
        if record.snapshots:
            bodies = record.snapshots[-1].ambient[:MOST_AMBIENT]
            step.ambient = [(_short(b.position[0]), _short(b.position[1]), _short(b.heading_deg)) for b in bodies]
        detail = StepDetail(agents=dict(_decided(record)))
        for said in admitted_at(record, self._categories):
            text = clipped(spoken(said.body))
            detail.messages.append(MessageNote(said.sender, said.recipients, said.kind, said.category, text))
            box, frame = numbers(said.body.get("box"), 4), said.body.get("frame")
            if box is not None and isinstance(frame, str):
                sure = said.body.get("confidence")
                step.reports.append(
                    ReportNote(
                        said.id,
                        frame,
                        said.sender,
                        clipped(str(said.body.get("class") or ""), 60),
                        (box[0], box[1], box[2], box[3]),
                        float(sure) if isinstance(sure, int | float) else None,
                    )
                )
        step.said = len(detail.messages)
        return step, detail

    # -- parts

    def _is_seen(self, entity: Entity) -> bool:
        return entity.role != "target" or self.watched.sight(entity) is not None

    def _moves(self, record: BoundaryRecord, seen: Sequence[Entity]) -> Iterator[tuple[str, list[Sample]]]:
        """The samples of each entity that moved or is shown for the first time."""
        every = max(1, math.ceil(len(record.snapshots) / self._samples))
        chosen = record.snapshots[::-1][::every][::-1]
        now = [(snapshot.time_s, {state.id: state for state in snapshot.states}) for snapshot in chosen]
        for entity in seen:
            first = entity.id not in self._shown
            samples: list[Sample] = []
            for time_s, states in now[-1:] if first and entity.role == "target" else now:
                state = states.get(entity.id)
                sample = _placed(entity, time_s) if state is None else _sample(state, time_s)
                if entity.id not in self._shown or _has_moved(self._shown[entity.id], sample):
                    self._shown[entity.id] = sample
                    samples.append(sample)
            if not now and first:
                samples = [_placed(entity, record.time_s)]
                self._shown[entity.id] = samples[0]
            if samples:
                yield entity.id, samples

    def _statuses(self, seen: Iterable[Entity]) -> Iterator[tuple[str, tuple[str, float | None]]]:
        for entity in seen:
            state = self.watched.states.get(entity.id)
            if state is None:
                continue
            stock = state.resources.get("battery", state.resources.get("battery_wh"))
            left = None
            if stock is not None:
                full = self._full.setdefault(entity.id, stock)
                left = round(stock / full, 2) if full > 0 else None
            if self._status.get(entity.id) != (state.status, left):
                self._status[entity.id] = (state.status, left)
                yield entity.id, (visible(state.status), left)

    def _changed_sights(self) -> Iterator[tuple[str, str]]:
        for entity, _, sight in self.watched.seen_targets():
            if self._sights.get(entity.id) != sight:
                self._sights[entity.id] = sight
                yield entity.id, sight

    def _picture(self, frame: FrameInfo, record: BoundaryRecord) -> PictureNote:
        """A reference picture is taken where the hidden thing is: its view is part of the truth."""
        pose = frame.pose
        view = PictureView(pose.position, pose.heading_deg, pose.tilt_deg, pose.hfov_deg)
        return PictureNote(
            id=frame.id,
            entity=frame.entity,
            camera=frame.camera,
            agents=tuple(seen.agent for seen in record.observations if frame.id in seen.frames),
            width=pose.width,
            height=pose.height,
            view=None if frame.camera == REFERENCE and not self._truth else view,
            truth=tuple((box.entity, box.cls, box.box) for box in frame.boxes if box.pixels > 0) if self._truth else (),
        )

    def _matches(self, record: BoundaryRecord) -> Iterator[tuple[str, str]]:
        for event in record.events:
            if event.kind in self._matching:
                targets = [name for name in event.bindings if name in self._entities]
                reports = [name for name in event.bindings if name not in self._entities]
                if targets and reports:
                    yield reports[0], targets[0]

    def _incidents(self, known: int) -> Iterator[EventNote]:
        for one in self._search.found[known:]:
            entity = self._entities.get(one.entities[0]) if one.entities else None
            if entity is None or self._is_seen(entity):
                yield EventNote("bad", visible(one.line))

    @staticmethod
    def _replaced(record: BoundaryRecord) -> Iterator[EventNote]:
        for made in record.decisions:
            if made.substituted:
                yield EventNote("bad", visible(f"{made.agent}: its answer was replaced ({made.substituted})"))

    def _events(self, record: BoundaryRecord, known: int) -> Iterator[EventNote]:
        """What happened but for what is told as an incident."""
        told = {one.kind for one in self._search.found[known:]} | {COLLIDED}
        for line in self.watched.happened(record):
            if line.good or line.text.split(" ", 1)[0] not in told:
                yield EventNote("good" if line.good else "plain", visible(line.text))

    def _route(self, entity: str) -> list[Vector2]:
        return [(_short(x), _short(y)) for x, y in self.watched.routes.get(entity, ())]


def clipped(text: str, most: int = LONGEST_TEXT) -> str:
    """Text of a policy or a service as a page may show it: no marks that reorder it, and not longer than `most`."""
    cut = f"{text[:most]}… ({len(text) - most} characters more)" if len(text) > most else text
    return visible(cut)


def _decided(record: BoundaryRecord) -> Iterator[tuple[str, AgentNote]]:
    receipts: dict[str, list[Receipt]] = {}
    for receipt in record.receipts:
        receipts.setdefault(receipt.sender, []).append(receipt)
    made = {one.agent: one for one in record.decisions}
    for agent in dict.fromkeys([*made, *receipts]):
        note = AgentNote(receipts=[_receipt(one) for one in receipts.get(agent, ())])
        if agent in made:
            decided = made[agent].decision
            note.thought = clipped(decided.thought)
            note.command = "" if decided.command is None else clipped(command_words(decided.command), 300)
            told = f"{made[agent].substituted}: {made[agent].detail}"
            note.replaced = clipped(told, 300) if made[agent].substituted else ""
            note.tokens = decided.usage.prompt_tokens + decided.usage.completion_tokens if decided.usage else 0
        if note != AgentNote():
            yield agent, note


def _receipt(receipt: Receipt) -> tuple[str, bool]:
    """In words, and whether something was refused."""
    detail = f" – {receipt.detail}" if receipt.detail else ""
    refused = receipt.status in REFUSED
    return clipped(f"{receipt.request} {status_words(receipt)}{detail}", 300), refused


def _sample(state: BodyState, time_s: float) -> Sample:
    x, y, z = state.position
    return _short(time_s), _short(x), _short(y), _short(z), _short(state.heading_deg)


def _placed(entity: Entity, time_s: float) -> Sample:
    x, y, z = entity.position
    return _short(time_s), _short(x), _short(y), _short(z), _short(entity.heading_deg)


def _short(value: float) -> float:
    """Decimetres, tenths of a degree or of a second."""
    return round(value, 1)


def _has_moved(before: Sample, now: Sample) -> bool:
    turned = abs((now[4] - before[4] + 180.0) % 360.0 - 180.0)
    return math.dist(before[1:4], now[1:4]) >= STILL_M or turned >= STILL_DEG
