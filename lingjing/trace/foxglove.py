"""Messages of an episode in Foxglove's published schemas, so that Foxglove and Rerun can open a trace directly.

Only this module and `foxglove_city` import `foxglove_schemas_protobuf`. Every message is derived from the project's own
records. Only the bytes of stored pictures are read back.

Frames of reference:

- `world`: x east, y north, z up
- an entity's frame: x forward, y left, z up; its parent is `world`
- a camera's frame: x right, y down, z along the optical axis; its parent is the entity that carries it
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Iterator
from functools import cache, lru_cache
from typing import Any

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf import descriptor_pb2
from google.protobuf.message import DecodeError
from google.protobuf.timestamp_pb2 import Timestamp

from lingjing.errors import LingjingError
from lingjing.mission.instance import Entity, Instance
from lingjing.trace.container import ContainerSchema
from lingjing.trace.foxglove_city import city_update
from lingjing.trace.records import REFUSED, BodyState, BoundaryRecord, CameraPose, FrameInfo, Snapshot, UnitBox
from lingjing.trace.surroundings import CityMesh
from lingjing.trace.topics import CITY, HIDDEN, SCENE, TRANSFORMS, camera_topic, entity_topic
from lingjing.trace.wire import field, field_head

Topic = str
ViewerMessage = tuple[Topic, ContainerSchema, bytes]
"""A message for the container: topic, schema, encoded bytes."""

WORLD = "world"
"""Name of the root frame of reference."""
_COLOURS = {"asset": (0.10, 0.45, 0.90), "target": (0.95, 0.35, 0.10)}
"""Colour of an entity's marker by role: red, green, blue in 0..1. Chosen."""


def scene(instance: Instance, *, hidden: bool = False) -> ViewerMessage:
    """Return the map of the mission: regions, cells, and a named marker that follows each entity.

    With `hidden`, the map holds only what is hidden from policies, else only what is not hidden.
    """
    update = SceneUpdate()
    for region in instance.regions:
        if region.hidden == hidden:
            _outline(update, f"region/{region.name}", region.polygon, instance.scene.datum_m, (0.1, 0.7, 0.3, 0.9), 3.0)
    for cell in instance.cells:
        if cell.hidden == hidden:
            _outline(update, f"cell/{cell.name}", cell.polygon, instance.scene.datum_m, (0.5, 0.6, 0.7, 0.5), 1.0)
    for entity in instance.entities:
        if ("position" in entity.hidden) == hidden:
            _marker(update, entity)
    return HIDDEN if hidden else SCENE, _schema(SceneUpdate), update.SerializeToString(deterministic=True)


def markers(entities: Iterable[Entity]) -> ViewerMessage:
    """Return markers for further entities, in the form of those of `scene`."""
    update = SceneUpdate()
    for entity in entities:
        _marker(update, entity)
    return SCENE, _schema(SceneUpdate), update.SerializeToString(deterministic=True)


def city(meshes: Iterable[CityMesh]) -> ViewerMessage:
    """Return the buildings, roads, water and ground."""
    return CITY, _schema(SceneUpdate), city_update(meshes, WORLD)


def transforms(snapshot: Snapshot) -> ViewerMessage:
    """Return the frames of all entities at one macro-step."""
    seconds, nanos = _timestamp(snapshot.time_s)
    stamp = field(1, Timestamp(seconds=seconds, nanos=nanos).SerializeToString())
    frames = b"".join(field(1, stamp + _frame_ids(state.id) + _placing(state)) for state in snapshot.states)
    return TRANSFORMS, _schema(FrameTransforms), frames


def cameras(bodies: Iterable[tuple[BodyState | None, str, CameraPose]], time_s: float) -> ViewerMessage:
    """Return the frames of cameras at an instant.

    Each item of `bodies` is a body, the name `<entity>/<camera>` and the pose in the world. The parent of the frame is
    the body's frame, or `world` if the body is None.
    """
    message = FrameTransforms()
    for body, camera, pose in bodies:
        _attach(message.transforms.add(), time_s, camera, pose, body)
    return TRANSFORMS, _schema(FrameTransforms), message.SerializeToString(deterministic=True)


def positions(instance: Instance, snapshot: Snapshot) -> Iterator[ViewerMessage]:
    """Yield the WGS84 positions of all entities at a boundary."""
    for state in snapshot.states:
        message = LocationFix()
        _stamp(message.timestamp, snapshot.time_s)
        message.frame_id = state.id
        message.latitude, message.longitude = geodetic(instance.scene.origin, state.position[0], state.position[1])
        message.altitude = state.position[2]
        message.position_covariance_type = LocationFix.UNKNOWN
        yield f"/geo/{entity_topic(state.id)}", _schema(LocationFix), message.SerializeToString(deterministic=True)


def logs(record: BoundaryRecord) -> Iterator[ViewerMessage]:
    """Yield the log of a boundary, one message per line: messages, refused requests, events, completed stages."""
    for level, name, text in log_lines(record):
        message = Log()
        _stamp(message.timestamp, record.time_s)
        message.level = Log.Level.Value(level)
        message.name = name
        message.message = text
        yield "/log", _schema(Log), message.SerializeToString(deterministic=True)


def frame_messages(
    frame: FrameInfo,
    jpeg: bytes,
    depth: bytes | None = None,
    semantic: bytes | None = None,
    instance: bytes | None = None,
) -> Iterator[ViewerMessage]:
    """Yield the messages of a picture: calibration, colour, ground-truth boxes, and the other channels if given."""
    camera = camera_name(frame)
    yield calibration(frame)
    yield camera_topic(frame), _schema(CompressedImage), _image(frame, camera, jpeg, "jpeg")
    yield true_boxes(frame)
    if depth is not None:
        yield camera_topic(frame, "depth"), _schema(RawImage), _raw(frame, camera, depth, "32FC1", 4)
    if semantic is not None:
        yield camera_topic(frame, "semantic"), _schema(CompressedImage), _image(frame, camera, semantic, "png")
    if instance is not None:
        yield camera_topic(frame, "instance"), _schema(RawImage), _raw(frame, camera, instance, "mono16", 2)


_RAW = ("depth", "instance")
"""Channels that are stored without an image format."""


def stored_channel(frame: FrameInfo, channel: str, message: bytes) -> ViewerMessage:
    """Return a stored message with its topic and schema. `channel` is "" for colour, or one of `topics.CHANNELS`."""
    return camera_topic(frame, channel), _schema(RawImage if channel in _RAW else CompressedImage), message


def calibration(frame: FrameInfo) -> ViewerMessage:
    """Return the intrinsic calibration of the camera of a picture."""
    return camera_topic(frame, "calibration"), _schema(CameraCalibration), _calibration(frame, camera_name(frame))


def true_boxes(frame: FrameInfo) -> ViewerMessage:
    """Return the ground-truth boxes of a picture."""
    boxes = ((truth.entity, truth.box) for truth in frame.boxes)
    return camera_topic(frame, "truth"), _schema(ImageAnnotations), _boxes(frame, boxes, (0.2, 1.0, 0.4))


def reported_boxes(frame: FrameInfo, boxes: Iterable[tuple[str, UnitBox]]) -> ViewerMessage:
    """Return the boxes that agents reported in a picture: a label and a normalised box for each report."""
    return camera_topic(frame, "reported"), _schema(ImageAnnotations), _boxes(frame, boxes, (1.0, 0.45, 0.75))


def camera_name(frame: FrameInfo) -> str:
    """Return the name of the camera's frame of reference."""
    return f"{frame.entity}/{frame.camera}"


def image_bytes(message: bytes) -> bytes:
    """Return the JPEG or PNG inside a `foxglove.CompressedImage`. Raises `LingjingError` for other bytes."""
    return bytes(_parsed(CompressedImage, message).data)


def raw_bytes(message: bytes) -> tuple[bytes, int, int]:
    """Return the data inside a `foxglove.RawImage`, with width and height in pixels.

    Raises `LingjingError` for other bytes.
    """
    image = _parsed(RawImage, message)
    return bytes(image.data), image.width, image.height


def _parsed(kind: Any, message: bytes) -> Any:
    try:
        return kind.FromString(message)
    except DecodeError as error:
        raise LingjingError(f"a picture of {len(message)} bytes is no {kind.DESCRIPTOR.full_name}") from error


def geodetic(origin: tuple[float, float], east: float, north: float) -> tuple[float, float]:
    """Return (latitude, longitude) in degrees of a point `east`, `north` metres from `origin`, for display only.

    The series in the WGS84 radii of curvature agrees with the transverse Mercator world frame within 2 cm over 5 km.
    """
    a, e2 = 6378137.0, 6.69437999014e-3  # WGS84: semi-major axis in metres, first eccentricity squared
    latitude = math.radians(origin[0])
    w = 1.0 - e2 * math.sin(latitude) ** 2
    meridian, normal = a * (1.0 - e2) / w**1.5, a / math.sqrt(w)
    middle = latitude + 0.5 * north / meridian
    meridian = a * (1.0 - e2) / (1.0 - e2 * math.sin(middle) ** 2) ** 1.5
    foot = latitude + north / meridian
    normal = a / math.sqrt(1.0 - e2 * math.sin(foot) ** 2)
    lat = foot - math.tan(foot) * east**2 / (2.0 * meridian * normal)
    lon = math.radians(origin[1]) + east / (normal * math.cos(foot))
    return math.degrees(lat), math.degrees(lon)


Quaternion = tuple[float, float, float, float]
"""x, y, z, w."""
Matrix3 = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
"""Three column vectors."""


_PLACING = struct.Struct("<BB BdBdBd BB BdBdBdBd")
"""Encoded `translation` and `rotation` of a `foxglove.FrameTransform` (fields 4 and 5), each with tag, length and
doubles."""


def _placing(state: BodyState) -> bytes:
    """Return the encoded pose of a body.

    The bytes equal those of `_set_vector` and `_set_quaternion`. An episode has hundreds of thousands of poses, and
    this function is faster.
    """
    (x, y, z), (i, j, k, w) = state.position, body_turn(state)
    return _PLACING.pack(0x22, 27, 0x09, x, 0x11, y, 0x19, z, 0x2A, 36, 0x09, i, 0x11, j, 0x19, k, 0x21, w)


@lru_cache(maxsize=4096)
def _frame_ids(child: str) -> bytes:
    """Return the encoded ids of a frame and of its parent `world`."""
    return bytes(FrameTransform(parent_frame_id=WORLD, child_frame_id=child).SerializeToString(deterministic=True))


def body_turn(state: BodyState) -> Quaternion:
    """Return the rotation from a body's frame to the world.

    It is the product of yaw from east, pitch about the left axis (negative for nose up), and roll, in this order.
    """
    yaw = math.radians(90.0 - state.heading_deg) / 2.0
    if state.pitch_deg == state.roll_deg == 0.0:
        return 0.0, 0.0, math.sin(yaw), math.cos(yaw)
    pitch, roll = math.radians(-state.pitch_deg) / 2.0, math.radians(state.roll_deg) / 2.0
    sy, cy, sp, cp = math.sin(yaw), math.cos(yaw), math.sin(pitch), math.cos(pitch)
    sr, cr = math.sin(roll), math.cos(roll)
    x, y = sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy
    return x, y, cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy


def camera_axes(pose: CameraPose) -> Matrix3:
    """Return the right, down and forward unit vectors of a camera in the world frame."""
    heading, tilt, roll = (math.radians(v) for v in (pose.heading_deg, pose.tilt_deg, pose.roll_deg))
    sh, ch, st, ct, sr, cr = (f(v) for v in (heading, tilt, roll) for f in (math.sin, math.cos))
    level_right, level_down = (ch, -sh, 0.0), (-sh * st, -ch * st, -ct)
    right = tuple(cr * a + sr * b for a, b in zip(level_right, level_down, strict=True))
    down = tuple(cr * b - sr * a for a, b in zip(level_right, level_down, strict=True))
    return (right[0], right[1], right[2]), (down[0], down[1], down[2]), (sh * ct, ch * ct, -st)


def _quaternion(axes: Matrix3) -> Quaternion:
    """Return the rotation of the matrix with the columns `axes` (Shepperd's method)."""
    (m00, m10, m20), (m01, m11, m21), (m02, m12, m22) = axes
    squares = (1 + m00 - m11 - m22, 1 - m00 + m11 - m22, 1 - m00 - m11 + m22, 1 + m00 + m11 + m22)
    largest = squares.index(max(squares))
    s = 2.0 * math.sqrt(squares[largest])
    if largest == 0:
        return s / 4, (m01 + m10) / s, (m02 + m20) / s, (m21 - m12) / s
    if largest == 1:
        return (m01 + m10) / s, s / 4, (m12 + m21) / s, (m02 - m20) / s
    if largest == 2:
        return (m02 + m20) / s, (m12 + m21) / s, s / 4, (m10 - m01) / s
    return (m21 - m12) / s, (m02 - m20) / s, (m10 - m01) / s, s / 4


def _attach(transform: Any, time_s: float, camera: str, pose: CameraPose, body: BodyState | None) -> None:
    """Fill in the transform of a camera relative to its body, or to the world if `body` is None."""
    _stamp(transform.timestamp, time_s)
    transform.child_frame_id = camera
    turn = _quaternion(camera_axes(pose))
    if body is None:
        transform.parent_frame_id = WORLD
        _set_vector(transform.translation, pose.position)
        _set_quaternion(transform.rotation, turn)
    else:
        east, north, up = (there - here for there, here in zip(pose.position, body.position, strict=True))
        back = _inverse(body_turn(body))
        transform.parent_frame_id = body.id
        _set_vector(transform.translation, _product(_product(back, (east, north, up, 0.0)), _inverse(back))[:3])
        _set_quaternion(transform.rotation, _product(back, turn))


def _inverse(turn: Quaternion) -> Quaternion:
    x, y, z, w = turn
    return -x, -y, -z, w


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the Hamilton product `a` `b`: the rotation by `b` followed by the rotation by `a`."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _calibration(frame: FrameInfo, camera: str) -> bytes:
    pose = frame.pose
    focal = pose.width / 2.0 / math.tan(math.radians(pose.hfov_deg) / 2.0)
    middle = (pose.width / 2.0, pose.height / 2.0)
    message = CameraCalibration(frame_id=camera, width=pose.width, height=pose.height)
    _stamp(message.timestamp, frame.time_s)
    message.K.extend((focal, 0, middle[0], 0, focal, middle[1], 0, 0, 1))
    message.R.extend((1, 0, 0, 0, 1, 0, 0, 0, 1))
    message.P.extend((focal, 0, middle[0], 0, 0, focal, middle[1], 0, 0, 0, 1, 0))
    return bytes(message.SerializeToString(deterministic=True))


def _image(frame: FrameInfo, camera: str, data: bytes, kind: str) -> bytes:
    message = CompressedImage(frame_id=camera, data=data, format=kind)
    _stamp(message.timestamp, frame.time_s)
    return bytes(message.SerializeToString(deterministic=True))


def _boxes(frame: FrameInfo, boxes: Iterable[tuple[str, UnitBox]], colour: tuple[float, float, float]) -> bytes:
    """Return rectangles in pixels, each with a label at its top left corner.

    A message without boxes is needed too: it clears the boxes of the previous picture in a viewer.
    """
    message = ImageAnnotations()
    _stamp(message.timestamp, frame.time_s)
    for name, (x0, y0, x1, y1) in boxes:
        points = message.points.add(type=PointsAnnotation.LINE_LOOP, thickness=2.0)
        _stamp(points.timestamp, frame.time_s)
        for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1)):
            points.points.add(x=x * frame.pose.width, y=y * frame.pose.height)
        label = message.texts.add(text=name, font_size=18.0)
        _stamp(label.timestamp, frame.time_s)
        label.position.x, label.position.y = x0 * frame.pose.width, y0 * frame.pose.height
        for ink in (points.outline_color, label.text_color):
            ink.r, ink.g, ink.b, ink.a = (*colour, 1.0)
    return bytes(message.SerializeToString(deterministic=True))


def _raw(frame: FrameInfo, camera: str, data: bytes, encoding: str, pixel_bytes: int) -> bytes:
    """Return an image without compression. Depth in metres has the encoding `32FC1`, which ROS (REP 118), Foxglove and
    Rerun read.

    The parts are joined by their field numbers, because protobuf would copy the 8 MB of a picture three times.
    """
    pose = frame.pose
    before = RawImage(width=pose.width, height=pose.height, encoding=encoding, step=pixel_bytes * pose.width)
    _stamp(before.timestamp, frame.time_s)
    after = RawImage(frame_id=camera)
    return b"".join(
        (before.SerializeToString(deterministic=True), field_head(6, len(data)), data, after.SerializeToString())
    )


def log_lines(record: BoundaryRecord) -> Iterator[tuple[str, str, str]]:
    """Yield level, name and text of each line of a boundary's log."""
    for envelope in record.messages:
        text = ", ".join(f"{key}={value}" for key, value in envelope.body.items())
        yield "INFO", f"{envelope.sender} -> {envelope.recipient}", f"{envelope.kind} {envelope.id}: {text}"
    for receipt in record.receipts:
        if receipt.status in REFUSED:
            text = f"{receipt.request} on {receipt.resource}: {receipt.status}, {receipt.reason} {receipt.detail}"
            yield "WARNING", receipt.sender, text.rstrip()
    for task in record.task_events:
        yield "INFO", "mission" if task.name else "engine", f"{task.line} at {task.time_s:g} s"
    for event in record.events:
        yield "INFO", "kernel", f"{event.kind}({', '.join(event.bindings)})"
    for stage in record.stages:
        yield "INFO", "kernel", f"stage {stage.stage} {stage.subject} done".replace("  ", " ")


def _outline(
    update: Any,
    name: str,
    polygon: tuple[tuple[float, float], ...],
    level: float,
    colour: tuple[float, float, float, float],
    thickness: float,
) -> None:
    entity = update.entities.add(id=name, frame_id=WORLD)
    _stamp(entity.timestamp, 0.0)
    line = entity.lines.add(type=1, thickness=thickness, scale_invariant=True)  # LINE_LOOP
    line.pose.orientation.w = 1.0
    line.color.r, line.color.g, line.color.b, line.color.a = colour
    for east, north in polygon:
        line.points.add(x=east, y=north, z=level)


def _marker(update: Any, entity: Entity) -> None:
    marker = update.entities.add(id=f"entity/{entity.id}", frame_id=entity.id, frame_locked=True)
    _stamp(marker.timestamp, 0.0)
    cube = marker.cubes.add()
    cube.pose.orientation.w = 1.0
    cube.size.x, cube.size.y, cube.size.z = 4.0, 2.0, 1.0
    cube.color.r, cube.color.g, cube.color.b, cube.color.a = (*_COLOURS[entity.role], 1.0)
    text = marker.texts.add(text=entity.id, billboard=True, font_size=14.0, scale_invariant=True)
    text.pose.position.z = 4.0
    text.pose.orientation.w = 1.0
    text.color.r, text.color.g, text.color.b, text.color.a = 1, 1, 1, 1


def _stamp(timestamp: Any, time_s: float) -> None:
    timestamp.seconds, timestamp.nanos = _timestamp(time_s)


def _timestamp(time_s: float) -> tuple[int, int]:
    """Return whole seconds and nanoseconds."""
    seconds = math.floor(time_s)
    return seconds, min(999_999_999, round((time_s - seconds) * 1e9))


def _set_vector(vector: Any, position: tuple[float, float, float]) -> None:
    vector.x, vector.y, vector.z = position


def _set_quaternion(quaternion: Any, turn: Quaternion) -> None:
    quaternion.x, quaternion.y, quaternion.z, quaternion.w = turn


@cache
def _schema(message: Any) -> ContainerSchema:
    return ContainerSchema(message.DESCRIPTOR.full_name, "protobuf", _file_set(message.DESCRIPTOR.file))


def _file_set(file: Any) -> bytes:
    """Return the file and its imports as a serialised FileDescriptorSet, imports first, as MCAP requires."""
    files: dict[str, Any] = {}

    def collect(descriptor: Any) -> None:
        for dependency in descriptor.dependencies:
            collect(dependency)
        files.setdefault(descriptor.name, descriptor)

    collect(file)
    descriptors = descriptor_pb2.FileDescriptorSet()
    for descriptor in files.values():
        descriptor.CopyToProto(descriptors.file.add())
    return bytes(descriptors.SerializeToString(deterministic=True))
