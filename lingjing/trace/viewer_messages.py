"""The messages for viewers of one episode, derived from its records boundary by boundary.

The map and the city are written once. Each boundary adds the frames of bodies and cameras, geographic positions and a
log. It also adds typed records of this project: thoughts, commands, receipts and the score.

Boxes that agents reported have the time of their picture. They are written one boundary later, because the agents
answer to a picture at the next boundary.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from lingjing.mission.instance import Datum, Instance
from lingjing.trace import foxglove
from lingjing.trace.admitted_messages import admitted_at, categories_of
from lingjing.trace.encoding import to_json
from lingjing.trace.foxglove import ViewerMessage
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

TimedMessage = tuple[float, ViewerMessage]
"""A simulation time in seconds and a message."""

_FAR = 1e3
"""Largest accepted coordinate of a reported box, in widths or heights of the picture. Chosen: far outside the picture,
and small enough for every viewer."""


class ViewerMessages:
    """The messages for viewers of one episode. Boundaries must be passed in order."""

    def __init__(self, instance: Instance, surroundings: Surroundings) -> None:
        self._instance = instance
        self._surroundings = surroundings
        self._frames: dict[str, FrameInfo] = {}
        self._reports = ReportedBoxes(instance)
        self._unanswered: list[str] = []
        self._subtasks = 0

    def beginning(self, *, hidden: bool) -> Iterator[TimedMessage]:
        """Yield the map and the city; with `hidden`, also the part of the map that is hidden from policies."""
        if self._surroundings.meshes:
            yield 0.0, foxglove.city(self._surroundings.meshes)
        yield 0.0, foxglove.scene(self._instance)
        if hidden:
            yield 0.0, foxglove.scene(self._instance, hidden=True)

    def boundary(self, record: BoundaryRecord) -> Iterator[TimedMessage]:
        """Yield the messages of one boundary, without its pictures."""
        now = record.time_s
        for snapshot in record.snapshots:
            yield snapshot.time_s, foxglove.transforms(snapshot)
        placed = list(cameras_at(self._instance, self._surroundings, record))
        if placed:
            yield now, foxglove.cameras(((body, f"{entity}/{name}", pose) for body, entity, name, pose in placed), now)
        if record.snapshots:
            yield from ((now, message) for message in foxglove.positions(self._instance, record.snapshots[-1]))
        yield from self._reported_boxes(record)
        yield from ((now, message) for message in foxglove.logs(record))
        yield from ((now, message) for message in self._notes(record))

    def ending(self) -> Iterator[TimedMessage]:
        """Yield the boxes that were reported in the last pictures."""
        yield from self._boxes(self._unanswered)
        self._unanswered = []

    # -- parts

    def _reported_boxes(self, record: BoundaryRecord) -> Iterator[TimedMessage]:
        """Yield the boxes reported in the pictures of the previous boundary, and in older pictures with new reports."""
        late = sorted(self._reports.take(record) - {*self._unanswered, *(frame.id for frame in record.frames)})
        yield from self._boxes((*late, *self._unanswered))
        self._unanswered = [frame.id for frame in record.frames]
        self._frames |= {frame.id: frame for frame in record.frames}

    def _boxes(self, frames: Iterable[str]) -> Iterator[TimedMessage]:
        for name in frames:
            frame = self._frames.get(name)
            if frame is not None:  # an agent may report a picture id that does not exist
                yield frame.time_s, foxglove.reported_boxes(frame, self._reports.of(name))

    def _notes(self, record: BoundaryRecord) -> Iterator[ViewerMessage]:
        for entry in record.decisions:
            usage, thought = entry.decision.usage, entry.decision.thought
            if thought or entry.substituted:
                yield _note(
                    agent_topic(entry.agent, "thought"),
                    "thought",
                    Thought(
                        agent=entry.agent,
                        tick=record.tick,
                        time_s=record.time_s,
                        text=thought,
                        tokens=usage.prompt_tokens + usage.completion_tokens if usage else 0,
                        replaced=f"{entry.substituted}: {entry.detail}" if entry.substituted else "",
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
    """The boxes that agents have reported so far, by picture, labelled with agent and class."""

    def __init__(self, instance: Instance) -> None:
        self._categories = categories_of(instance)
        self._boxes: dict[str, list[tuple[str, UnitBox]]] = {}

    def take(self, record: BoundaryRecord) -> set[str]:
        """Add the reports of one boundary, and return the ids of their pictures, which need not exist."""
        frames = set()
        for message in admitted_at(record, self._categories):
            body = message.body
            frame, box, cls = body.get("frame"), _unit_box(body.get("box")), body.get("class")
            if isinstance(frame, str) and box is not None:
                label = f"{message.sender}: {cls}" if isinstance(cls, str) and cls else message.sender
                self._boxes.setdefault(frame, []).append((label, box))
                frames.add(frame)
        return frames

    def of(self, frame: str) -> Sequence[tuple[str, UnitBox]]:
        """Return labels and boxes of one picture."""
        return self._boxes.get(frame, ())


def cameras_at(
    instance: Instance, surroundings: Surroundings, record: BoundaryRecord
) -> Iterator[tuple[BodyState | None, str, str, CameraPose]]:
    """Yield body, entity id, camera name and pose of every camera.

    The pose is that of the camera's picture at this boundary, else it follows from the mount. Reference pictures come
    from no mounted camera. Their poses are yielded last, without a body.
    """
    captured = {(frame.entity, frame.camera): frame.pose for frame in record.frames}
    bodies = {state.id: state for state in record.snapshots[-1].states} if record.snapshots else {}
    for entity in instance.entities:
        body = bodies.get(entity.id)
        if body is None:
            continue
        for camera in entity.cameras:
            pose = captured.pop((entity.id, camera.name), None)
            if pose is None and surroundings.camera is not None:
                pose = surroundings.camera(body, camera, entity.mounts)
            if pose is not None:
                yield body, entity.id, camera.name, pose
    for (name, camera_name), pose in captured.items():
        yield None, name, camera_name, pose


def _note(topic: str, name: str, record: TraceRecord) -> ViewerMessage:
    return topic, container_schema(name), to_json(record)


def _unit_box(value: Datum) -> UnitBox | None:
    """Return a box of four numbers below `_FAR`, or None. The value comes from an agent and may be anything."""
    if not isinstance(value, tuple) or len(value) != 4:
        return None
    numbers = [float(item) for item in value if isinstance(item, int | float) and abs(item) < _FAR]
    return (numbers[0], numbers[1], numbers[2], numbers[3]) if len(numbers) == 4 else None
