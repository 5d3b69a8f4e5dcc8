"""The methods of pictures and cameras."""

from __future__ import annotations

from typing import Any

from lingjing.plugins.policy import Picture
from lingjing.scene.camera_geometry import mounted_camera_pose
from lingjing.serve.airsim.arguments import Arguments, CallError
from lingjing.serve.airsim.context import LATER, Context, Later, Method, PictureWait
from lingjing.serve.airsim.frames import camera_turn, pose
from lingjing.serve.airsim.pictures import camera_of, image_response, image_wish, projection
from lingjing.serve.airsim.server import Call
from lingjing.trace.records import DEAD

_MOST_IMAGES = 32
"""Most images of one call (chosen)."""


def _images(context: Context, call: Call, arguments: Arguments) -> Later | list[Any]:
    requests = arguments.records("requests", _MOST_IMAGES)
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
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
        numbers = context.segmentation
        return [image_response(wish, pictures[wish.camera.name], vehicle, numbers) for wish in wishes]

    return _wait(context, PictureWait(call, vehicle, wishes, answer))


def _image(context: Context, call: Call, arguments: Arguments) -> Later:
    camera, image_type = arguments.text("camera_name"), int(arguments.number("image_type"))
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
    arguments.text("annotation_name", "")
    arguments.end()
    wish = image_wish(vehicle, camera, image_type, as_float=False, compressed=True)

    def answer(pictures: dict[str, Picture]) -> object:
        return image_response(wish, pictures[wish.camera.name], vehicle, context.segmentation)["image_data_uint8"]

    return _wait(context, PictureWait(call, vehicle, (wish,), answer))


def _wait(context: Context, wait: PictureWait) -> Later:
    if wait.vehicle.body.status == DEAD:
        raise CallError(f"`{wait.vehicle.name}` has crashed and takes no pictures")
    context.waits.append(wait)
    return LATER


def _camera(context: Context, call: Call, arguments: Arguments) -> dict[str, Any]:
    name = arguments.text("camera_name")
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
    arguments.end()
    camera = camera_of(vehicle.entity, name)
    where = mounted_camera_pose(vehicle.body, camera, vehicle.entity.mounts)
    return {
        "pose": pose(vehicle.local(where.position), camera_turn(where)),
        "fov": camera.hfov_deg,
        "proj_mat": {"matrix": projection(camera)},
    }


def _field_of_view(context: Context, call: Call, arguments: Arguments) -> str:
    name = arguments.text("camera_name")
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
    arguments.end()
    return f"{camera_of(vehicle.entity, name).hfov_deg:f}"


def _distortion(context: Context, call: Call, arguments: Arguments) -> list[float]:
    """Return the parameters of a pinhole: K1, K2, K3, P1, P2."""
    name = arguments.text("camera_name")
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
    arguments.end()
    camera_of(vehicle.entity, name)
    return [0.0] * 5


def _set_distortion(context: Context, call: Call, arguments: Arguments) -> None:
    name, parameter, value = arguments.text("camera_name"), arguments.text("param_name"), arguments.number("value")
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
    arguments.end()
    camera_of(vehicle.entity, name)
    if value != 0.0:
        raise CallError(f"`{parameter[:20]}` is 0 here: cameras are pinholes without distortion")


PICTURES: dict[str, Method] = {
    "simGetDistortionParams": _distortion,
    "simSetDistortionParam": _set_distortion,
    "simGetImages": _images,
    "simGetImage": _image,
    "simGetCameraInfo": _camera,
    "simGetCurrentFieldOfView": _field_of_view,
}
"""The methods by name."""
