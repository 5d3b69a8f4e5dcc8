"""The data of a page for each boundary: a `ViewStep` for the view, and a `StepDetail` for the texts beside it."""

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
from lingjing.trace.admitted_messages import admitted_at, categories_of
from lingjing.trace.records import REFUSED, BodyState, BoundaryRecord, FrameInfo, Receipt
from lingjing.viewer.head import EntityCard, card_of
from lingjing.viewer.state import EpisodeState, command_words, message_text, status_words

SAMPLES = 5
"""Most macro-steps of a boundary that are shown. There are fewer if an episode exceeds `MOST_SAMPLES`. Chosen."""

MOST_SAMPLES = 400_000
"""Most positions of entities in a page. Chosen."""

MOST_AMBIENT = 300
"""Most background bodies (traffic) at one boundary. Chosen."""

STILL_M, STILL_DEG = 0.1, 2.0
"""Smallest change of position and of heading that counts as a movement. Chosen."""

LONGEST_TEXT = 4_000
"""Most characters of a thought or a message. A longer text ends with the number of the others. Chosen."""

_NormalisedBox = tuple[float, float, float, float]
"""A normalised box: left, top, right, bottom."""
Sample = tuple[float, float, float, float, float]
"""Time (s), east, north, elevation (m), heading (degrees)."""


class PictureView(msgspec.Struct, frozen=True, omit_defaults=True):
    """The pose of the camera of a picture, as in `CameraPose`."""

    position: tuple[float, float, float]
    heading: float
    tilt: float
    hfov: float


class PictureNote(msgspec.Struct, frozen=True, omit_defaults=True):
    """A picture of a boundary, as the page shows it."""

    id: str
    entity: str
    camera: str
    agents: tuple[str, ...]
    """The agents that received it."""
    width: int
    height: int
    view: PictureView | None = None
    """The pose of its camera; None if the pose would reveal a hidden entity."""
    truth: tuple[tuple[str, str, _NormalisedBox], ...] = ()
    """Entity, class and true box of each visible entity. Empty unless the truth is shown."""


class ReportNote(msgspec.Struct, frozen=True, omit_defaults=True):
    """A box that an agent reported in a picture."""

    id: str
    """The id of the message."""
    frame: str
    sender: str
    cls: str
    box: _NormalisedBox
    confidence: float | None = None


class EventNote(msgspec.Struct, frozen=True):
    """An event of a boundary, as the page shows it."""

    kind: str
    """`good` (an adjudicated event or a completed stage), `bad` (an incident or a substituted decision) or `plain`."""
    text: str


class ViewStep(msgspec.Struct, omit_defaults=True):
    """One boundary for the view. Values that have not changed since the previous step are left out."""

    tick: int
    time: float
    """Simulated seconds."""
    score: float
    scr: float
    """Subtask completion rate, 0 to 1."""
    done: bool = False
    cards: list[EntityCard] = []
    """Entities that are shown from this step on."""
    moves: dict[str, list[Sample]] = {}
    """Samples of each entity that moved."""
    status: dict[str, tuple[str, float | None]] = {}
    """Status word and charge of the battery (0 to 1, None without a battery) of each entity."""
    sights: dict[str, str] = {}
    """Status of each target: `known`, `found`, `completed` or `truth`."""
    pictures: list[PictureNote] = []
    reports: list[ReportNote] = []
    matched: dict[str, str] = {}
    """The matched target of each report, by message id."""
    events: list[EventNote] = []
    stages: list[tuple[str, int, int]] = []
    """Name, number of subjects that completed it, and number of all subjects, of each stage."""
    relations: list[tuple[str, str, str]] = []
    """Kind, source and target of each occurrence of a coordination relation."""
    routes: dict[str, list[Vector2]] = {}
    ambient: list[tuple[float, float, float]] = []
    """East, north (m) and heading (degrees) of background bodies."""
    said: int = 0
    """Number of messages."""
    refused: int = 0
    """Number of rejected requests."""


class AgentNote(msgspec.Struct, omit_defaults=True):
    """The decision of an agent at a boundary and the receipts for its requests."""

    command: str = ""
    thought: str = ""
    replaced: str = ""
    """The reason for a substituted decision; "" if the decision is the policy's own."""
    receipts: list[tuple[str, bool]] = []
    """Receipts in words, each with True if the request was not carried out."""
    tokens: int = 0


class MessageNote(msgspec.Struct, omit_defaults=True):
    """A message that the bus admitted."""

    sender: str
    recipients: tuple[str, ...]
    kind: str
    category: str
    text: str


class StepDetail(msgspec.Struct, omit_defaults=True):
    """The texts of one boundary."""

    agents: dict[str, AgentNote] = {}
    messages: list[MessageNote] = []


class StepMaker:
    """Builder of the steps of one episode. Boundaries must be passed in order.

    Without `truth`, steps contain nothing hidden. `boundaries` is the expected number of boundaries.
    """

    def __init__(self, instance: Instance, boundaries: int, *, truth: bool) -> None:
        self.state = EpisodeState(instance, truth=truth)
        self._truth = truth
        self._instance = instance
        self._categories = categories_of(instance)
        self._search = incident_search(instance)
        self._matching = {rule.name for rule in instance.rules if rule.matching}
        self._entities = {entity.id: entity for entity in instance.entities}
        self._colours = {entity.id: place for place, entity in enumerate(self.state.assets)}
        movers = max(1, len(instance.entities)) * max(1, boundaries)
        self._samples = max(1, min(SAMPLES, MOST_SAMPLES // movers))
        self._shown: dict[str, Sample] = {}
        self._status: dict[str, tuple[str, float | None]] = {}
        self._sights: dict[str, str] = {}
        self._stages: list[tuple[str, int, int]] = []
        self._full: dict[str, float] = {}

    def step(self, record: BoundaryRecord) -> tuple[ViewStep, StepDetail]:
        """Return the step and the texts of the next boundary."""
        self.state.take(record)
        known = len(self._search.incidents)
        self._search.take(record)
        step = ViewStep(record.tick, _short(record.time_s), round(record.reward, 4), round(record.scr, 4), record.done)
        entities = [entity for entity in self._instance.entities if self._is_visible(entity)]
        fresh = [entity for entity in entities if entity.id not in self._shown]
        step.cards = [card_of(entity, self._colours.get(entity.id, -1)) for entity in fresh]
        step.moves = dict(self._moves(record, entities))
        step.status = dict(self._statuses(entities))
        step.sights = dict(self._changed_sights())
        step.pictures = [self._picture(frame, record) for frame in record.frames]
        step.matched = dict(self._matches(record))
        step.events = [*self._incidents(known), *self._replaced(record), *self._events(record, known)]
        counts = self.state.stage_counts()
        if counts != self._stages:
            step.stages = self._stages = counts
        step.relations = [(relation.kind, relation.source, relation.target) for relation in record.relations]
        movers = [route.entity for route in record.routes if route.entity in self._shown]
        step.routes = {name: self._route(name) for name in movers}
        step.refused = sum(receipt.status in ("rejected", "timed_out") for receipt in record.receipts)
        if record.snapshots:
            bodies = record.snapshots[-1].ambient[:MOST_AMBIENT]
            step.ambient = [(_short(b.position[0]), _short(b.position[1]), _short(b.heading_deg)) for b in bodies]
        detail = StepDetail(agents=dict(_decided(record)))
        for message in admitted_at(record, self._categories):
            body, text = message.body, shorten(message_text(message.body))
            note = MessageNote(message.sender, message.recipients, message.kind, message.category, text)
            detail.messages.append(note)
            box, frame = numbers(body.get("box"), 4), body.get("frame")
            if box is not None and isinstance(frame, str):
                confidence = body.get("confidence")
                step.reports.append(
                    ReportNote(
                        message.id,
                        frame,
                        message.sender,
                        shorten(str(body.get("class") or ""), 60),
                        (box[0], box[1], box[2], box[3]),
                        float(confidence) if isinstance(confidence, int | float) else None,
                    )
                )
        step.said = len(detail.messages)
        return step, detail

    # -- parts

    def _is_visible(self, entity: Entity) -> bool:
        return entity.role != "target" or self.state.sight(entity) is not None

    def _moves(self, record: BoundaryRecord, entities: Sequence[Entity]) -> Iterator[tuple[str, list[Sample]]]:
        """Yield the samples of each entity that moved or is shown for the first time."""
        every = max(1, math.ceil(len(record.snapshots) / self._samples))
        chosen = record.snapshots[::-1][::every][::-1]
        now = [(snapshot.time_s, {state.id: state for state in snapshot.states}) for snapshot in chosen]
        for entity in entities:
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

    def _statuses(self, entities: Iterable[Entity]) -> Iterator[tuple[str, tuple[str, float | None]]]:
        for entity in entities:
            state = self.state.states.get(entity.id)
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
        for entity, _, sight in self.state.visible_targets():
            if self._sights.get(entity.id) != sight:
                self._sights[entity.id] = sight
                yield entity.id, sight

    def _picture(self, frame: FrameInfo, record: BoundaryRecord) -> PictureNote:
        """Return the note of a picture. The pose of a reference picture is hidden, because it reveals its object."""
        pose = frame.pose
        view = PictureView(pose.position, pose.heading_deg, pose.tilt_deg, pose.hfov_deg)
        return PictureNote(
            id=frame.id,
            entity=frame.entity,
            camera=frame.camera,
            agents=tuple(observed.agent for observed in record.observations if frame.id in observed.frames),
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
        for incident in self._search.incidents[known:]:
            entity = self._entities.get(incident.entities[0]) if incident.entities else None
            if entity is None or self._is_visible(entity):
                yield EventNote("bad", visible(incident.line))

    @staticmethod
    def _replaced(record: BoundaryRecord) -> Iterator[EventNote]:
        for entry in record.decisions:
            if entry.substituted:
                yield EventNote("bad", visible(f"{entry.agent}: its answer was replaced ({entry.substituted})"))

    def _events(self, record: BoundaryRecord, known: int) -> Iterator[EventNote]:
        """Yield the events that are not shown as incidents."""
        kinds = {incident.kind for incident in self._search.incidents[known:]} | {COLLIDED}
        for line in self.state.event_lines(record):
            if line.good or line.text.split(" ", 1)[0] not in kinds:
                yield EventNote("good" if line.good else "plain", visible(line.text))

    def _route(self, entity: str) -> list[Vector2]:
        return [(_short(x), _short(y)) for x, y in self.state.routes.get(entity, ())]


def shorten(text: str, most: int = LONGEST_TEXT) -> str:
    """Return the text of a policy or a service without marks that reorder it, and with at most `most` characters."""
    cut = f"{text[:most]}… ({len(text) - most} characters more)" if len(text) > most else text
    return visible(cut)


def _decided(record: BoundaryRecord) -> Iterator[tuple[str, AgentNote]]:
    receipts: dict[str, list[Receipt]] = {}
    for receipt in record.receipts:
        receipts.setdefault(receipt.sender, []).append(receipt)
    entries = {entry.agent: entry for entry in record.decisions}
    for agent in dict.fromkeys([*entries, *receipts]):
        note = AgentNote(receipts=[_receipt(receipt) for receipt in receipts.get(agent, ())])
        if agent in entries:
            entry, decision = entries[agent], entries[agent].decision
            note.thought = shorten(decision.thought)
            note.command = "" if decision.command is None else shorten(command_words(decision.command), 300)
            note.replaced = shorten(f"{entry.substituted}: {entry.detail}", 300) if entry.substituted else ""
            note.tokens = decision.usage.prompt_tokens + decision.usage.completion_tokens if decision.usage else 0
        if note != AgentNote():
            yield agent, note


def _receipt(receipt: Receipt) -> tuple[str, bool]:
    """Return a receipt in words, and True if the request was not carried out."""
    detail = f" – {receipt.detail}" if receipt.detail else ""
    refused = receipt.status in REFUSED
    return shorten(f"{receipt.request} {status_words(receipt)}{detail}", 300), refused


def _sample(state: BodyState, time_s: float) -> Sample:
    x, y, z = state.position
    return _short(time_s), _short(x), _short(y), _short(z), _short(state.heading_deg)


def _placed(entity: Entity, time_s: float) -> Sample:
    x, y, z = entity.position
    return _short(time_s), _short(x), _short(y), _short(z), _short(entity.heading_deg)


def _short(value: float) -> float:
    """Return a value rounded to one decimal, which suffices for the view."""
    return round(value, 1)


def _has_moved(before: Sample, now: Sample) -> bool:
    turned = abs((now[4] - before[4] + 180.0) % 360.0 - 180.0)
    return math.dist(before[1:4], now[1:4]) >= STILL_M or turned >= STILL_DEG
