"""The messages for viewers of an episode, read with the plain `mcap` reader."""

from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from mcap.reader import make_reader
from mcap.writer import Writer

from lingjing import Trace
from lingjing import read as read_trace
from lingjing.errors import UsageError
from lingjing.testing import TraceWriter, sea_rescue
from lingjing.trace import foxglove
from lingjing.trace.container import ContainerWriter
from lingjing.trace.copying import copy_trace
from lingjing.trace.records import BodyState, BoundaryRecord, CameraPose, Envelope
from lingjing.trace.surroundings import NO_SURROUNDINGS, CityMesh, Surroundings
from lingjing.trace.topics import CITY, HIDDEN, SCENE, SCORE, agent_topic, camera_topic
from lingjing.trace.viewer_messages import ViewerMessages
from lingjing.trace.writer import nanoseconds

SQUARE = CityMesh(
    "building",
    np.array([(0, 0, 5), (10.004, 0, 5), (10, 20, 5), (0, 20, -5.5)], float),
    np.array([(0, 1, 2), (0, 2, 3)], np.uint32),
    (0.5, 0.25, 0.75),
)


def messages_of(path: Path) -> dict[str, list[tuple[Any, Any, Any]]]:
    messages = defaultdict(list)
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            messages[channel.topic].append((schema, channel, message))
    return messages


def test_thoughts_commands_receipts_and_the_score_are_those_of_the_records(trace: Trace, episode_path: Path) -> None:
    messages_by_topic = messages_of(episode_path)
    notes = {
        topic: [json.loads(message.data) for *_, message in messages_by_topic[topic]]
        for topic in messages_by_topic
        if topic.startswith("/agent/")
    }
    record = trace.boundaries[12]
    made = record.decisions[1]
    (thought,) = [message for message in notes[agent_topic(made.agent, "thought")] if message["tick"] == 12]
    assert (thought["text"], thought["tokens"], thought["agent"]) == (made.decision.thought, 860, made.agent)
    (refused,) = [message for message in notes[agent_topic(made.agent, "receipt")] if message["status"] == "rejected"]
    assert refused == json.loads(msgspec.json.encode(next(r for r in record.receipts if r.status == "rejected")))
    commands = sum(len(messages) for topic, messages in notes.items() if topic.endswith("/command"))
    assert commands == sum(len(message.commands) for message in trace.boundaries)
    scores = [json.loads(message.data) for *_, message in messages_by_topic[SCORE]]
    assert [message["score"] for message in scores] == [message.reward for message in trace.boundaries]
    assert scores[-1]["subtasks"] == sum(len(message.stages) for message in trace.boundaries)


def test_reported_boxes_have_the_time_of_their_picture(trace: Trace, episode_path: Path) -> None:
    messages = messages_of(episode_path)
    reports: dict[str, list[tuple[str, tuple[float, ...]]]] = defaultdict(list)
    for record in trace.boundaries:
        for edge in {message.id: message for message in record.messages if "box" in message.body}.values():
            reports[str(edge.body["frame"])].append((edge.sender, edge.body["box"]))  # type: ignore[arg-type]
    assert sum(map(len, reports.values())) > 3
    for frame in trace.frames.values():
        (drawn,) = [
            ImageAnnotations.FromString(message.data)
            for *_, message in messages[camera_topic(frame, "reported")]
            if message.log_time == nanoseconds(frame.time_s)
        ]
        left = [points.points[0].x / frame.pose.width for points in drawn.points]
        bottom = [points.points[2].y / frame.pose.height for points in drawn.points]
        assert left == pytest.approx([box[0] for _, box in reports[frame.id]])
        assert bottom == pytest.approx([box[3] for _, box in reports[frame.id]])
        assert [text.text for text in drawn.texts] == [f"{sender}: person_in_water" for sender, _ in reports[frame.id]]


def report_message(record: BoundaryRecord, **body: Any) -> Envelope:
    return Envelope(
        id=f"m{record.tick}-99", tick=record.tick, sender="scout[1]", recipient="skipper", kind="detection",
        category="report", body=body, bytes=9, deliver_at=record.tick + 1,
    )  # fmt: skip


def test_a_late_report_updates_a_picture_and_invalid_ones_do_not(trace: Trace) -> None:
    frame = next(iter(trace.frames.values()))
    later = trace.boundaries[frame.tick + 4]
    box = (0.1, 0.2, 0.3, 0.4)
    nonsense = (None, "x", (), (1, 2, 3), (0.1, 0.2, 0.3, float("nan")), (10**400, 0, 0, 0), ("a", 0, 0, 0))
    extra = [report_message(later, frame=frame.id, box=item) for item in nonsense] + [
        report_message(later, frame="no such", box=box)
    ]
    extra = [msgspec.structs.replace(item, id=f"m{later.tick}-{90 + n}") for n, item in enumerate(extra)]
    shown = ViewerMessages(trace.header.instance, NO_SURROUNDINGS)
    drawn: list[tuple[int, ImageAnnotations]] = []
    for record in trace.boundaries[: later.tick + 1]:
        if record.tick == later.tick:
            late = report_message(later, frame=frame.id, box=box)
            record = msgspec.structs.replace(record, messages=(*record.messages, *extra, late))
        for time_s, (topic, _, data) in shown.boundary(record):
            if topic == camera_topic(frame, "reported") and time_s == frame.time_s:
                drawn.append((record.tick, ImageAnnotations.FromString(data)))
    assert [tick for tick, _ in drawn] == [frame.tick + 1, later.tick]
    before, after = (len(item.points) for _, item in drawn)
    assert after == before + 1 and drawn[-1][1].texts[-1].text == "scout[1]"


def test_the_parent_frames_of_cameras_are_their_bodies_at_every_boundary(trace: Trace) -> None:
    def camera(state: BodyState, spec: Any, mounts: Any) -> CameraPose:
        east, north, up = state.position
        return CameraPose(position=(east, north, up - 1.0), heading_deg=state.heading_deg, tilt_deg=90.0)

    shown = ViewerMessages(trace.header.instance, Surroundings(camera=camera))
    for record in trace.boundaries[:8]:
        cameras = {}
        for time_s, (topic, _, data) in shown.boundary(record):
            for transform in FrameTransforms.FromString(data).transforms if topic == "/tf" else ():
                if "/" in transform.child_frame_id:
                    assert time_s == record.time_s
                    cameras[transform.child_frame_id] = transform
        assert {name: transform.parent_frame_id for name, transform in cameras.items()} == {
            f"uav[{n}]/nadir": f"uav[{n}]" for n in (1, 2, 3)
        }
        if not record.frames:
            assert cameras["uav[1]/nadir"].translation.z == pytest.approx(-1.0)


def test_the_city_is_in_the_file_once_as_meshes(trace: Trace, tmp_path: Path) -> None:
    path = tmp_path / "trace.mcap"
    with TraceWriter(path, trace.header, surroundings=Surroundings(meshes=(SQUARE, SQUARE))) as writer:
        writer.boundary(trace.boundaries[0])
        writer.finish(sea_rescue.outcome_of(list(trace.boundaries[:1])))
    ((_, _, message),) = messages_of(path)[CITY]
    first, second = SceneUpdate.FromString(message.data).entities
    assert (first.id, second.id, first.frame_id) == ("city/building/0", "city/building/1", foxglove.WORLD)
    (mesh,) = first.triangles
    assert list(mesh.indices) == SQUARE.triangles.ravel().tolist() and mesh.pose.orientation.w == 1.0
    assert [(p.x, p.y, p.z) for p in mesh.points] == [(0, 0, 5), (10, 0, 5), (10, 20, 5), (0, 20, -5.5)]
    assert (mesh.color.r, mesh.color.g, mesh.color.b, mesh.color.a) == (0.5, 0.25, 0.75, 1.0)


def test_a_copy_contains_the_given_surroundings(trace: Trace, tmp_path: Path) -> None:
    copied = copy_trace(trace, trace.header, tmp_path / "copy.mcap", Surroundings(meshes=(SQUARE,)))
    assert copied.boundaries == trace.boundaries and copied.outcome == trace.outcome
    ((_, _, message),) = messages_of(copied.path)[CITY]
    assert [entity.id for entity in SceneUpdate.FromString(message.data).entities] == ["city/building/0"]


def test_hidden_entities_have_a_topic_of_their_own(trace: Trace, episode_path: Path) -> None:
    messages = messages_of(episode_path)
    shown = {
        topic: {
            entity.id for *_, message in messages[topic] for entity in SceneUpdate.FromString(message.data).entities
        }
        for topic in (SCENE, HIDDEN)
    }
    assert shown[HIDDEN] == {"entity/victim[1]", "entity/victim[2]", "entity/victim[3]"}
    assert "entity/boat" in shown[SCENE] and "region/search" in shown[SCENE] and not shown[SCENE] & shown[HIDDEN]


def test_a_trace_without_viewer_messages_has_the_same_records(trace: Trace, episode_path: Path, tmp_path: Path) -> None:
    """Older traces have neither notes nor a city nor reported boxes."""
    older = tmp_path / "older.mcap"
    new = ("/agent/", "/scene", SCORE)
    with episode_path.open("rb") as source, older.open("wb") as target:
        writer = Writer(target)
        writer.start()
        numbers: dict[str, int] = {}
        for schema, channel, message in make_reader(source).iter_messages(log_time_order=False):
            if channel.topic.startswith(new) or channel.topic.endswith("/reported"):
                continue
            if channel.topic not in numbers:
                kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                numbers[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, kind)
            writer.add_message(
                numbers[channel.topic], message.log_time, message.data, message.publish_time, message.sequence
            )
        writer.finish()
    read = read_trace(older)
    assert (read.header, read.boundaries, read.outcome) == (trace.header, trace.boundaries, trace.outcome)
    assert read.jpeg(next(iter(trace.frames))) == trace.jpeg(next(iter(trace.frames)))


def test_the_remaining_boxes_are_written_when_an_episode_ends_early(
    trace: Trace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The boxes of the last pictures are written at the end, and this write can fail too."""
    until = next(record.tick for record in trace.boundaries if record.frames)
    with TraceWriter(tmp_path / "trace.mcap", trace.header) as writer:
        for record in trace.boundaries[: until + 1]:
            writer.boundary(record)
    messages = messages_of(tmp_path / "trace.mcap.part")
    frame = trace.boundaries[until].frames[0]
    assert len(messages[camera_topic(frame, "reported")]) == 1
    monkeypatch.setattr(ContainerWriter, "add", _full)
    (tmp_path / "full").mkdir()
    with pytest.raises(UsageError, match="No space left"):
        TraceWriter(tmp_path / "full" / "trace.mcap", trace.header)


def _full(*_: object) -> None:
    raise OSError(28, "No space left on device")
