"""The methods of objects in pictures: detections, and the ids of the segmentation.

Objects are the bodies of the mission that are not hidden. Their pixels come from the channel `instance` of the camera.
"""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np

from lingjing.mission.instance import Entity, Vector
from lingjing.plugins.policy import Picture
from lingjing.scene.camera_geometry import camera_axes
from lingjing.scene.sizes import entity_size
from lingjing.serve.airsim.arguments import Arguments, CallError
from lingjing.serve.airsim.context import LATER, Context, DetectionFilter, Later, Method, PictureWait
from lingjing.serve.airsim.frames import attitude, ned, pose, quaternion, vector3
from lingjing.serve.airsim.pictures import SCENE, class_number, image_wish
from lingjing.serve.airsim.server import Call
from lingjing.serve.airsim.vehicles import geo_point, plain_name
from lingjing.trace.records import DEAD

_MOST_FILTERS = 100
"""Most names of one filter (chosen)."""
_LONGEST_PATTERN = 100
_UNKNOWN = -1
"""AirSim's id of an object that does not exist."""


def _filter(context: Context, arguments: Arguments, *before: str) -> tuple[DetectionFilter, list[Any]]:
    """Read the camera, the image type and the values of a filter's method."""
    camera, image_type = arguments.text("camera_name"), int(arguments.number("image_type"))
    values: list[Any] = [arguments.text(name) if name == "mesh_name" else arguments.number(name) for name in before]
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
    arguments.skip_external()
    arguments.text("annotation_name", "")
    arguments.end()
    wish = image_wish(vehicle, camera, SCENE, as_float=False, compressed=True)
    key = vehicle.name, wish.camera.name, image_type
    return context.filters.setdefault(key, DetectionFilter()), values


def _add_name(context: Context, call: Call, arguments: Arguments) -> None:
    chosen, (name,) = _filter(context, arguments, "mesh_name")
    if len(chosen.names) >= _MOST_FILTERS or len(name) > _LONGEST_PATTERN:
        raise CallError(f"a filter may have at most {_MOST_FILTERS} names of at most {_LONGEST_PATTERN} letters")
    chosen.names.append(name.lower())


def _set_radius(context: Context, call: Call, arguments: Arguments) -> None:
    chosen, (radius_cm,) = _filter(context, arguments, "radius_cm")
    chosen.radius_m = max(radius_cm, 0.0) / 100.0


def _clear_names(context: Context, call: Call, arguments: Arguments) -> None:
    chosen, _ = _filter(context, arguments)
    chosen.names.clear()


def _detections(context: Context, call: Call, arguments: Arguments) -> Later:
    camera, image_type = arguments.text("camera_name"), int(arguments.number("image_type"))
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
    arguments.skip_external()
    arguments.text("annotation_name", "")
    arguments.end()
    wish = image_wish(vehicle, camera, SCENE, as_float=False, compressed=True)
    if "instance" not in wish.camera.channels:
        raise CallError(f"camera `{wish.camera.name}` of `{vehicle.name}` has no channel `instance` in this mission")
    if vehicle.body.status == DEAD:
        raise CallError(f"`{vehicle.name}` has crashed and takes no pictures")
    chosen = context.filters.get((vehicle.name, wish.camera.name, image_type), DetectionFilter())

    def answer(pictures: dict[str, Picture]) -> object:
        return detected(context, chosen, pictures[wish.camera.name])

    context.waits.append(PictureWait(call, vehicle, (wish,), answer))
    return LATER


def detected(context: Context, chosen: DetectionFilter, picture: Picture) -> list[dict[str, Any]]:
    """Return a `DetectionInfo` of each object of a filter that a picture shows."""
    assert picture.instance is not None  # the camera has the channel
    entities = {entity.id: entity for entity in context.instance.entities}
    detections = []
    for name, number in picture.instance_ids.items():
        body = context.states[name]
        if not chosen.admits(plain_name(name), math.dist(body.position, picture.pose.position)):
            continue
        rows, columns = np.nonzero(picture.instance == number)
        if rows.size:
            box = (int(columns.min()), int(rows.min()), int(columns.max()) + 1, int(rows.max()) + 1)
            detections.append(_detection(context, entities[name], picture, box))
    return detections


def _detection(context: Context, entity: Entity, picture: Picture, box: tuple[int, int, int, int]) -> dict[str, Any]:
    body = context.states[entity.id]
    axes = camera_axes(picture.pose)  # right, down, forward in (east, north, up)
    away = np.subtract(body.position, picture.pose.position)
    right, down, forward = (float(np.dot(axis, away)) for axis in axes)
    centre: Vector = (forward, right, down)
    size = entity_size(entity)
    reach = 0.5 * math.hypot(size.length_m, size.width_m)
    half: Vector = (reach, reach, 0.5 * size.height_m)
    return {
        "name": plain_name(entity.id),
        "geo_point": geo_point(context.instance.scene.origin, body.position),
        "box2D": {
            "min": {"x_val": float(box[0]), "y_val": float(box[1])},
            "max": {"x_val": float(box[2]), "y_val": float(box[3])},
        },
        "box3D": {
            "min": vector3([c - h for c, h in zip(centre, half, strict=True)]),
            "max": vector3([c + h for c, h in zip(centre, half, strict=True)]),
        },
        "relative_pose": pose(centre, _relative_turn(context, entity, picture)),
    }


def _relative_turn(context: Context, entity: Entity, picture: Picture) -> tuple[float, float, float, float]:
    """Return the turn of a body from the heading of the camera."""
    roll, pitch, yaw = attitude(context.states[entity.id])
    return quaternion(roll, pitch, yaw - math.radians(picture.pose.heading_deg))


def _segmentation_names(context: Context, call: Call, arguments: Arguments) -> list[str]:
    arguments.end()
    return [plain_name(name) for name in context.objects]


def _segmentation_poses(context: Context, call: Call, arguments: Arguments) -> list[dict[str, object]]:
    if arguments.left and not arguments.flag("ned"):
        raise CallError("`simListInstanceSegmentationPoses` answers in north, east, down only: pass ned=True")
    if arguments.left:
        arguments.flag("only_visible")
    arguments.end()
    bodies = [context.states[name] for name in context.objects]
    return [pose(ned(body.position), quaternion(*attitude(body))) for body in bodies]


def _set_id(context: Context, call: Call, arguments: Arguments) -> bool:
    name, number = arguments.text("mesh_name"), arguments.number("object_id")
    is_pattern = arguments.flag("is_name_regex") if arguments.left else False
    arguments.end()
    if number not in range(256):
        raise CallError(f"`object_id` is a whole number from 0 to 255, not {number:g}")
    matches = _matcher(name, is_pattern=is_pattern)
    chosen = [entity for entity in context.objects if matches(plain_name(entity))]
    context.segmentation.update(dict.fromkeys(chosen, int(number)))
    return bool(chosen)


def _get_id(context: Context, call: Call, arguments: Arguments) -> int:
    name = arguments.text("mesh_name")
    arguments.end()
    for entity in context.instance.entities:
        if entity.id in context.objects and plain_name(entity.id).lower() == plain_name(name).lower():
            return context.segmentation.get(entity.id, class_number(entity))
    return _UNKNOWN


def _matcher(name: str, *, is_pattern: bool) -> Any:
    if not is_pattern:
        return lambda other: other.lower() == plain_name(name).lower()
    if len(name) > _LONGEST_PATTERN or re.search(r"[+*}]\)?[+*{]|\\[1-9]", name):
        raise CallError("`mesh_name` must be a short pattern without nested repetitions")
    try:
        return re.compile(name, re.IGNORECASE).fullmatch
    except re.error as error:
        raise CallError(f"`mesh_name` is no regular expression: {error}") from None


OBJECTS: dict[str, Method] = {
    "simAddDetectionFilterMeshName": _add_name,
    "simSetDetectionFilterRadius": _set_radius,
    "simClearDetectionMeshNames": _clear_names,
    "simGetDetections": _detections,
    "simListInstanceSegmentationObjects": _segmentation_names,
    "simListInstanceSegmentationPoses": _segmentation_poses,
    "simSetSegmentationObjectID": _set_id,
    "simGetSegmentationObjectID": _get_id,
}
"""The methods by name."""
