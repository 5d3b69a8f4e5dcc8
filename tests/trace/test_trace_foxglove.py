"""Messages in Foxglove's schemas: directions, projections and positions agree with the world frame."""

import math
from pathlib import Path

import numpy as np
import pytest
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from mcap.reader import make_reader

from lingjing import Trace
from lingjing.trace import foxglove
from lingjing.trace.records import BodyState, CameraPose, FrameInfo, Snapshot
from lingjing.trace.topics import camera_topic, entity_topic


def rotate(quaternion, vector) -> np.ndarray:  # type: ignore[no-untyped-def]
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    axis = np.array([x, y, z])
    return vector + 2 * np.cross(axis, np.cross(axis, vector) + w * np.asarray(vector))


@pytest.mark.parametrize("heading", range(0, 360, 45))
@pytest.mark.parametrize("tilt", [(0, 0), (20, 0), (0, 30), (-40, 100), (10, -170)])
def test_the_forward_axis_of_a_body_follows_its_heading_and_pitch(heading: int, tilt: tuple[int, int]) -> None:
    state = BodyState(id="a", position=(1.0, 2.0, 3.0), heading_deg=heading, pitch_deg=tilt[0], roll_deg=tilt[1])
    _, _, data = foxglove.transforms(Snapshot(time_s=1.5, states=(state,)))
    (transform,) = FrameTransforms.FromString(data).transforms
    forward = rotate(transform.rotation, [1, 0, 0])
    level = math.cos(math.radians(tilt[0]))
    expected = [math.sin(math.radians(heading)) * level, math.cos(math.radians(heading)) * level]
    assert np.allclose(forward, [*expected, math.sin(math.radians(tilt[0]))], atol=1e-9)
    left = rotate(transform.rotation, [0, 1, 0])
    assert left[2] == pytest.approx(math.sin(math.radians(tilt[1])) * level, abs=1e-9)
    assert transform.timestamp.seconds == 1 and transform.timestamp.nanos == 500_000_000


@pytest.mark.parametrize("body", [(30, 0, 0), (120, 20, -35), (275, -80, 100), (0, 5, 180)])
@pytest.mark.parametrize("camera", [(30, 90, 0), (215, 5, 12), (0, 0, -170)])
def test_the_parent_frame_of_a_camera_is_its_body(body: tuple[int, int, int], camera: tuple[int, int, int]) -> None:
    state = BodyState(id="uav[1]", position=(1.0, 2.0, 3.0), heading_deg=body[0], pitch_deg=body[1], roll_deg=body[2])
    pose = CameraPose(position=(1.3, 1.8, 2.9), heading_deg=camera[0], tilt_deg=camera[1], roll_deg=camera[2])
    _, _, data = foxglove.transforms(Snapshot(time_s=1.5, states=(state,)))
    (parent,) = FrameTransforms.FromString(data).transforms
    _, _, data = foxglove.cameras([(state, "uav[1]/front", pose)], 1.5)
    (child,) = FrameTransforms.FromString(data).transforms
    assert (child.parent_frame_id, child.child_frame_id) == (parent.child_frame_id, "uav[1]/front")
    assert child.timestamp == parent.timestamp
    away = np.array([child.translation.x, child.translation.y, child.translation.z])
    assert np.allclose(np.array(state.position) + rotate(parent.rotation, away), pose.position, atol=1e-9)
    axes = [rotate(parent.rotation, rotate(child.rotation, unit)) for unit in np.eye(3)]
    assert np.allclose(axes, foxglove.camera_axes(pose), atol=1e-9)


def test_other_readers_read_depth_in_metres_and_a_tree_of_frames(trace: Trace, episode_path: Path) -> None:
    """The plain `mcap` reader returns depth as ROS's `32FC1`, and for each camera its body as parent frame."""
    parents: dict[str, str] = {}
    depths = 0
    with episode_path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            if channel.topic == "/tf":
                transforms = FrameTransforms.FromString(message.data).transforms
                parents |= {transform.child_frame_id: transform.parent_frame_id for transform in transforms}
            elif channel.topic.endswith("/depth"):
                image = RawImage.FromString(message.data)
                metres = np.frombuffer(image.data, "<f4").reshape(image.height, image.width)
                assert (image.encoding, image.step) == ("32FC1", 4 * image.width)
                frame = next(f for f in trace.frames.values() if f"{f.entity}/{f.camera}" == image.frame_id)
                assert metres.max() == pytest.approx(frame.pose.position[2], rel=0.05)
                depths += 1
    assert depths
    cameras = {name: parent for name, parent in parents.items() if "/" in name}
    assert cameras and all(parent == name.rpartition("/")[0] for name, parent in cameras.items())
    assert all(parents[parent] == foxglove.WORLD for parent in cameras.values())


def test_a_depth_image_has_the_bytes_that_protobuf_writes(trace: Trace) -> None:
    frame, data = next(iter(trace.frames.values())), bytes(range(256)) * 700
    messages = {topic: message for topic, _, message in foxglove.frame_messages(frame, b"", data)}
    message = messages[camera_topic(frame, "depth")]
    read = RawImage.FromString(message)
    assert read.data == data and read.SerializeToString(deterministic=True) == message


def test_the_parent_frame_of_a_camera_without_a_body_is_the_world() -> None:
    pose = CameraPose(position=(5.0, 6.0, 7.0), heading_deg=0.0, tilt_deg=10.0)
    _, _, data = foxglove.cameras([(None, "house/reference", pose)], 0.0)
    (transform,) = FrameTransforms.FromString(data).transforms
    assert transform.parent_frame_id == foxglove.WORLD
    assert (transform.translation.x, transform.translation.z) == (5.0, 7.0)


def test_a_target_projects_into_its_true_box(trace: Trace) -> None:
    """Camera frame, focal length and boxes are consistent: a victim projects into its own true box."""
    checked = 0
    for frame in trace.frames.values():
        states = {state.id: state for state in trace.boundaries[frame.tick].snapshots[-1].states}
        for truth in frame.boxes:
            right, down, ahead = (np.array(axis) for axis in foxglove.camera_axes(frame.pose))
            offset = np.array(states[truth.entity].position) - np.array(frame.pose.position)
            focal = 0.5 / math.tan(math.radians(frame.pose.hfov_deg / 2))
            u = 0.5 + focal * (offset @ right) / (offset @ ahead)
            v = 0.5 + focal * (offset @ down) / (offset @ ahead) * frame.pose.width / frame.pose.height
            assert truth.box[0] <= u <= truth.box[2] and truth.box[1] <= v <= truth.box[3]
            checked += 1
    assert checked >= 3


def test_boxes_are_drawn_in_pixels(trace: Trace) -> None:
    frame = next(frame for frame in trace.frames.values() if frame.boxes)
    messages = {topic: data for topic, _, data in foxglove.frame_messages(frame, b"jpeg")}
    drawn = ImageAnnotations.FromString(messages[camera_topic(frame, "truth")])
    assert drawn.points[0].points[2].x == pytest.approx(frame.boxes[0].box[2] * frame.pose.width)
    assert drawn.texts[0].text == frame.boxes[0].entity
    assert foxglove.image_bytes(messages[camera_topic(frame)]) == b"jpeg"


@pytest.mark.parametrize(("east", "north"), [(0, 0), (5000, 0), (0, -5000), (3500, 3500), (-3500, 3500)])
def test_geodetic_agrees_with_the_transverse_mercator_frame(east: float, north: float) -> None:
    """The reference is the forward projection of Snyder, Map Projections: A Working Manual, eq. 8-9, 8-10, 3-21."""
    origin = (31.2, 121.5)
    latitude, longitude = foxglove.geodetic(origin, east, north)
    back = _transverse_mercator(origin, latitude, longitude)
    assert math.dist(back, (east, north)) < 0.02


def _transverse_mercator(origin: tuple[float, float], latitude: float, longitude: float) -> tuple[float, float]:
    a, e2 = 6378137.0, 6.69437999014e-3
    second = e2 / (1 - e2)

    def arc(phi: float) -> float:
        return a * (
            (1 - e2 / 4 - 3 * e2**2 / 64 - 5 * e2**3 / 256) * phi
            - (3 * e2 / 8 + 3 * e2**2 / 32 + 45 * e2**3 / 1024) * math.sin(2 * phi)
            + (15 * e2**2 / 256 + 45 * e2**3 / 1024) * math.sin(4 * phi)
            - 35 * e2**3 / 3072 * math.sin(6 * phi)
        )

    phi = math.radians(latitude)
    n = a / math.sqrt(1 - e2 * math.sin(phi) ** 2)
    t, c = math.tan(phi) ** 2, second * math.cos(phi) ** 2
    x = math.radians(longitude - origin[1]) * math.cos(phi)
    east = n * (x + (1 - t + c) * x**3 / 6)
    north = arc(phi) - arc(math.radians(origin[0])) + n * math.tan(phi) * (x**2 / 2 + (5 - t + 9 * c) * x**4 / 24)
    return east, north


def test_a_nadir_camera_looks_down_with_its_heading_up() -> None:
    pose = CameraPose(position=(0.0, 0.0, 100.0), heading_deg=90.0, tilt_deg=90.0)
    frame = FrameInfo(id="f", entity="uav[1]", camera="nadir", tick=0, time_s=0.0, pose=pose, channels=("rgb",))
    right, down, ahead = foxglove.camera_axes(pose)
    assert np.allclose([right, down, ahead], [[0, -1, 0], [-1, 0, 0], [0, 0, -1]], atol=1e-12)
    assert entity_topic("uav[1]") == "uav_1" and camera_topic(frame) == "/camera/uav_1/nadir"
