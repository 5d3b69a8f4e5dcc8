"""The methods of pictures and cameras."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from msgspec.structs import replace

from lingjing.mission.instance import CameraSpec
from lingjing.mission.vocabulary import PHOTO
from lingjing.plugins.policy import Picture
from lingjing.scene.camera_geometry import CameraPlacement, mounted_camera_pose
from lingjing.serve.airsim.arguments import Arguments, CallError
from lingjing.serve.airsim.context import LATER, Context, Later, Method, PictureWait
from lingjing.serve.airsim.distortion import LARGEST as MOST_DISTORTION
from lingjing.serve.airsim.distortion import Distortion
from lingjing.serve.airsim.frames import angles, camera_turn, pose
from lingjing.serve.airsim.pictures import ImageWish, camera_of, image_response, image_wish, projection
from lingjing.serve.airsim.server import Call
from lingjing.serve.airsim.vehicles import Vehicle
from lingjing.trace.records import DEAD, BodyState, CameraPose

_MOST_IMAGES = 32
"""Most images of one call (chosen)."""


def _images(context: Context, call: Call, arguments: Arguments) -> Later | list[Any]:
    requests = arguments.records("requests", _MOST_IMAGES)
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
    arguments.skip_external()
    arguments.end()
    wishes = tuple(
        image_wish(
            vehicle,
            str(request.get("camera_name", ""))[:100],
            request.get("image_type"),
            as_float=bool(request.get("pixels_as_float")),
            compressed=bool(request.get("compress")),
        )
        for request in requests
    )
    if not wishes:
        return []

    def answer(pictures: dict[str, Picture]) -> object:
        return [_response(context, vehicle, wish, pictures) for wish in wishes]

    return _wait(context, PictureWait(call, vehicle, wishes, answer))


def _image(context: Context, call: Call, arguments: Arguments) -> Later:
    camera, image_type = arguments.text("camera_name"), int(arguments.number("image_type"))
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
    arguments.skip_external()
    arguments.text("annotation_name", "")
    arguments.end()
    wish = image_wish(vehicle, camera, image_type, as_float=False, compressed=True)

    def answer(pictures: dict[str, Picture]) -> object:
        return _response(context, vehicle, wish, pictures)["image_data_uint8"]

    return _wait(context, PictureWait(call, vehicle, (wish,), answer))


def _response(context: Context, vehicle: Vehicle, wish: ImageWish, pictures: Mapping[str, Picture]) -> dict[str, Any]:
    lens = context.distortions.get((vehicle.entity.id, wish.camera.name))
    return image_response(wish, pictures[wish.camera.name], vehicle, context.segmentation, lens)


def _wait(context: Context, wait: PictureWait) -> Later:
    if wait.vehicle.body.status == DEAD:
        raise CallError(f"`{wait.vehicle.name}` has crashed and takes no pictures")
    context.waits.append(wait)
    return LATER


def _mount(context: Context, arguments: Arguments) -> tuple[Vehicle, CameraSpec]:
    """Read a camera and its vehicle, which are the only arguments."""
    name = arguments.text("camera_name")
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
    arguments.skip_external()
    arguments.end()
    return vehicle, camera_of(vehicle.entity, name)


def _pose(context: Context, vehicle: Vehicle, camera: CameraSpec) -> CameraPose:
    placement = context.placements.get((vehicle.entity.id, camera.name))
    return mounted_camera_pose(vehicle.body, camera, vehicle.entity.mounts, placement)


def _camera(context: Context, call: Call, arguments: Arguments) -> dict[str, Any]:
    vehicle, camera = _mount(context, arguments)
    where = _pose(context, vehicle, camera)
    return {
        "pose": pose(vehicle.local(where.position), camera_turn(where)),
        "fov": where.hfov_deg,
        "proj_mat": {"matrix": projection(where)},
    }


def _field_of_view(context: Context, call: Call, arguments: Arguments) -> str:
    vehicle, camera = _mount(context, arguments)
    return f"{_pose(context, vehicle, camera).hfov_deg:f}"


def _set_pose(context: Context, call: Call, arguments: Arguments) -> None:
    name, placed = arguments.text("camera_name"), arguments.pose("pose")
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
    arguments.skip_external()
    arguments.end()
    (ahead, right, down), turn = placed
    roll, pitch, yaw = angles(turn)
    offsets = {"ahead_m": ahead, "right_m": right, "above_m": -down}
    degrees = {"yaw_deg": math.degrees(yaw), "pitch_deg": math.degrees(pitch), "roll_deg": math.degrees(roll)}
    _place(context, vehicle, camera_of(vehicle.entity, name), offsets | degrees)


def _set_field_of_view(context: Context, call: Call, arguments: Arguments) -> None:
    name, degrees = arguments.text("camera_name"), arguments.number("fov_degrees")
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
    arguments.skip_external()
    arguments.end()
    _place(context, vehicle, camera_of(vehicle.entity, name), {"hfov_deg": degrees})


def _place(context: Context, vehicle: Vehicle, camera: CameraSpec, changes: Mapping[str, float]) -> None:
    """Change the placement of a camera. Raises `CallError` in a mission, and beyond the limits."""
    photo = next((verb for verb in vehicle.entity.verbs if verb.name == PHOTO), None)
    limits = {argument.name: argument for argument in photo.arguments} if photo is not None else {}
    if "hfov" not in limits:
        raise CallError(f"the mission declares the cameras of `{vehicle.name}`: a free flight (--scene) can move them")
    for name, value in changes.items():
        limit = limits[name.rpartition("_")[0]]
        assert limit.minimum is not None and limit.maximum is not None
        if not limit.minimum <= value <= limit.maximum:
            raise CallError(f"`{limit.name}` is {value:g} {limit.unit}: {limit.minimum:g} to {limit.maximum:g} here")
    key = vehicle.entity.id, camera.name
    context.placements[key] = replace(context.placements.get(key) or _at_mount(vehicle, camera), **changes)


def _at_mount(vehicle: Vehicle, camera: CameraSpec) -> CameraPlacement:
    """Return the placement of a camera on its mount, while the body is level."""
    level = BodyState(id=vehicle.entity.id, position=(0.0, 0.0, 0.0), heading_deg=0.0)
    where = mounted_camera_pose(level, camera, vehicle.entity.mounts)
    right, ahead, above = where.position
    return CameraPlacement(
        ahead_m=ahead,
        right_m=right,
        above_m=above,
        yaw_deg=0.0,
        pitch_deg=-where.tilt_deg,
        roll_deg=0.0,
        hfov_deg=camera.hfov_deg,
    )


def _distortion(context: Context, call: Call, arguments: Arguments) -> list[float]:
    """Return the parameters of the lens: K1, K2, K3, P1, P2."""
    vehicle, camera = _mount(context, arguments)
    return list(context.distortions.get((vehicle.entity.id, camera.name), Distortion()))


def _set_distortion(context: Context, call: Call, arguments: Arguments) -> None:
    name, parameter, value = arguments.text("camera_name"), arguments.text("param_name"), arguments.number("value")
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
    arguments.skip_external()
    arguments.end()
    camera = camera_of(vehicle.entity, name)
    if parameter not in Distortion._fields:
        raise CallError(f"there is no parameter `{parameter[:20]}`: {', '.join(Distortion._fields)}")
    if abs(value) > MOST_DISTORTION:
        raise CallError(f"`{parameter}` is {value:g}: -{MOST_DISTORTION:g} to {MOST_DISTORTION:g} here")
    key = vehicle.entity.id, camera.name
    context.distortions[key] = context.distortions.get(key, Distortion())._replace(**{parameter: value})


PICTURES: dict[str, Method] = {
    "simGetDistortionParams": _distortion,
    "simSetDistortionParam": _set_distortion,
    "simGetImages": _images,
    "simGetImage": _image,
    "simGetCameraInfo": _camera,
    "simGetCurrentFieldOfView": _field_of_view,
    "simSetCameraPose": _set_pose,
    "simSetCameraFov": _set_field_of_view,
}
"""The methods by name."""
