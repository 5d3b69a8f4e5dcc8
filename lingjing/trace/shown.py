"""`ShownEpisode`: what of an episode is shown to viewers, made of its records as they come.

The map and the city once; then at each boundary where bodies and their cameras are, positions, a log, and as typed
records of this project: thoughts, commands, receipts and the score. Boxes that agents reported lie beside the true
ones, at the time of their picture: they are told one boundary later, when those who saw the picture have answered.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from lingjing.mission.instance import Datum, Instance
from lingjing.trace import foxglove
from lingjing.trace.admitted import admitted_at, categories_of
from lingjing.trace.encoding import to_json
from lingjing.trace.foxglove import Derived
from lingjing.trace.records import (
    BodyState,
    BoundaryRecord,
    CameraPose,
    FrameInfo,
    Score,
    Thought,
    TraceRecord,
    UnitBox,
)
from lingjing.trace.schemas import container_schema
from lingjing.trace.surroundings import Surroundings
from lingjing.trace.topics import SCORE, agent_topic

Timed = tuple[float, Derived]
"""A message and its simulation time in seconds."""

_FAR = 1e3
"""A box is drawn as far beyond its picture, in pictures."""


class ShownEpisode:
    """The messages of one episode; boundaries are taken in order."""

    def __init__(self, instance: Instance, surroundings: Surroundings) -> None:
        self._instance = instance
        self._surroundings = surroundings
        self._frames: dict[str, FrameInfo] = {}
        self._reports = ReportedBoxes(instance)
        self._unanswered: list[str] = []
        self._subtasks = 0

    def beginning(self, *, hidden: bool) -> Iterator[Timed]:
        """The map and the city; with `hidden` what policies must not know as well."""
        if self._surroundings.meshes:
            yield 0.0, foxglove.city(self._surroundings.meshes)
        yield 0.0, foxglove.scene(self._instance)
        if hidden:
            yield 0.0, foxglove.scene(self._instance, hidden=True)

    def boundary(self, record: BoundaryRecord) -> Iterator[Timed]:
        """All that a boundary adds but its pictures."""
        now = record.time_s
        for snapshot in record.snapshots:
            yield snapshot.time_s, foxglove.transforms(snapshot)
        placed = list(cameras_at(self._instance, self._surroundings, record))
        if placed:
            yield now, foxglove.cameras(((body, f"{entity}/{name}", pose) for body, entity, name, pose in placed), now)
        if record.snapshots:
            yield from ((now, one) for one in foxglove.positions(self._instance, record.snapshots[-1]))
        yield from self._answered(record)
        yield from ((now, one) for one in foxglove.logs(record))
        yield from ((now, one) for one in self._notes(record))

    def ending(self) -> Iterator[Timed]:
        """What was reported in the last pictures."""
        yield from self._boxes(self._unanswered)
        self._unanswered = []

    # -- parts

    def _answered(self, record: BoundaryRecord) -> Iterator[Timed]:
        """The boxes reported in the pictures of the boundary before, and in older ones that are spoken of anew."""
        late = sorted(self._reports.take(record) - {*self._unanswered, *(frame.id for frame in record.frames)})
        yield from self._boxes((*late, *self._unanswered))
        self._unanswered = [frame.id for frame in record.frames]
        self._frames |= {frame.id: frame for frame in record.frames}

    def _boxes(self, frames: Iterable[str]) -> Iterator[Timed]:
        for name in frames:
            frame = self._frames.get(name)
            if frame is not None:  # an agent may speak of a picture that is none
                yield frame.time_s, foxglove.reported(frame, self._reports.of(name))

    def _notes(self, record: BoundaryRecord) -> Iterator[Derived]:
        for made in record.decisions:
            usage, thought = made.decision.usage, made.decision.thought
            if thought or made.substituted:
                yield _note(
                    agent_topic(made.agent, "thought"),
                    "thought",
                    Thought(
                        agent=made.agent,
                        tick=record.tick,
                        time_s=record.time_s,
                        text=thought,
                        tokens=usage.prompt_tokens + usage.completion_tokens if usage else 0,
                        replaced=f"{made.substituted}: {made.detail}" if made.substituted else "",
                    ),
                )
        for command in record.commands:
            yield _note(agent_topic(command.sender, "command"), "command", command)
        for receipt in record.receipts:
            yield _note(agent_topic(receipt.sender, "receipt"), "receipt", receipt)
        self._subtasks += len(record.stages)
        score = Score(
            tick=record.tick,
            time_s=record.time_s,
            score=record.reward,
            scr=record.scr,
            subtasks=self._subtasks,
            done=record.done,
        )
        yield _note(SCORE, "score", score)


class ReportedBoxes:
    """The boxes that agents have reported so far, by picture, each with who reported what."""

    def __init__(self, instance: Instance) -> None:
        self._categories = categories_of(instance)
        self._boxes: dict[str, list[tuple[str, UnitBox]]] = {}

    def take(self, record: BoundaryRecord) -> set[str]:
        """One more boundary; the ids of pictures that something was reported in. Nobody says that these exist."""
        named = set()
        for said in admitted_at(record, self._categories):
            frame, box, what = said.body.get("frame"), _unit_box(said.body.get("box")), said.body.get("class")
            if isinstance(frame, str) and box is not None:
                label = f"{said.sender}: {what}" if isinstance(what, str) and what else said.sender
                self._boxes.setdefault(frame, []).append((label, box))
                named.add(frame)
        return named

    def of(self, frame: str) -> Sequence[tuple[str, UnitBox]]:
        """Labels and boxes."""
        return self._boxes.get(frame, ())


def cameras_at(
    instance: Instance, surroundings: Surroundings, record: BoundaryRecord
) -> Iterator[tuple[BodyState | None, str, str, CameraPose]]:
    """Body, entity, camera and pose of every camera of every body, where its picture says it was if there is one; and
    of pictures for which nobody stood anywhere (reference pictures), without a body."""
    taken = {(frame.entity, frame.camera): frame.pose for frame in record.frames}
    bodies = {state.id: state for state in record.snapshots[-1].states} if record.snapshots else {}
    for entity in instance.entities:
        body = bodies.get(entity.id)
        if body is None:
            continue
        for camera in entity.cameras:
            pose = taken.pop((entity.id, camera.name), None)
            if pose is None and surroundings.camera is not None:
                pose = surroundings.camera(body, camera, entity.mounts)
            if pose is not None:
                yield body, entity.id, camera.name, pose
    for (name, camera_name), pose in taken.items():
        yield None, name, camera_name, pose


def _note(topic: str, name: str, record: TraceRecord) -> Derived:
    return topic, container_schema(name), to_json(record)


def _unit_box(value: Datum) -> UnitBox | None:
    """Four numbers within reason; None for anything else: an agent may say anything."""
    if not isinstance(value, tuple) or len(value) != 4:
        return None
    numbers = [float(one) for one in value if isinstance(one, int | float) and abs(one) < _FAR]
    return (numbers[0], numbers[1], numbers[2], numbers[3]) if len(numbers) == 4 else None
