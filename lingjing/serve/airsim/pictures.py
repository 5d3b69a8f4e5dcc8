"""Pictures as AirSim encodes them, from pictures of the camera engine.

A picture is taken by `takePhoto`, so it costs a tick. All image types of one camera come from one picture: depth and
normals from its depth channel, segmentation from its class ids.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image

from lingjing.engines.camera.classes import entity_class
from lingjing.mission.instance import CameraSpec, Entity
from lingjing.plugins.policy import Picture
from lingjing.scene.camera_geometry import camera_axes, focal_px
from lingjing.serve.airsim.arguments import CallError
from lingjing.serve.airsim.distortion import Distortion, distorted
from lingjing.serve.airsim.frames import camera_turn, quaternionr, vector3
from lingjing.serve.airsim.vehicles import Vehicle, stamp
from lingjing.trace.records import CameraPose

SCENE, DEPTH_PLANAR, DEPTH_PERSPECTIVE, DEPTH_VIS, SEGMENTATION, NORMALS, INFRARED = 0, 1, 2, 3, 5, 6, 7
"""The served values of AirSim's `ImageType`."""

_CHANNELS = {
    SCENE: "rgb",
    DEPTH_PLANAR: "depth",
    DEPTH_PERSPECTIVE: "depth",
    DEPTH_VIS: "depth",
    SEGMENTATION: "semantic",
    NORMALS: "depth",
    INFRARED: "semantic",
}
"""Image type → the channel that it needs."""

_FAR_M = 65_504.0
"""Depth where a ray hits nothing, metres: the largest half-precision number, which AirSim sends for the sky."""
_VISIBLE_M = 100.0
"""Depth that `DepthVis` shows as white, metres (AirSim)."""

_ALIASES = {
    "0": "front", "front_center": "front", "1": "front", "front_right": "front", "2": "front", "front_left": "front",
    "3": "nadir", "bottom_center": "nadir",
}  # fmt: skip
"""AirSim's standard cameras → the view of a mount."""

_PALETTE = np.array([[(67 * k) % 256, (131 * k) % 256, (199 * k) % 256] for k in range(256)], np.uint8)
"""Class id → colour (red, green, blue). The factors are odd, so that each channel alone identifies the class."""


class ImageWish(NamedTuple):
    """One requested image."""

    camera: CameraSpec
    type: int
    as_float: bool
    compressed: bool
    requested_name: str
    """Name of the camera in the request."""


def camera_of(entity: Entity, name: str) -> CameraSpec:
    """Return the camera of a name or of one of AirSim's standard names. Raises `CallError`."""
    for camera in entity.cameras:
        if camera.name == name or (not name and camera is entity.cameras[0]):
            return camera
    for camera in entity.cameras:
        if camera.view == _ALIASES.get(name):
            return camera
    known = ", ".join(camera.name for camera in entity.cameras) or "none"
    raise CallError(f"`{entity.id}` has no camera `{name[:60]}`: {known}")


def image_wish(
    vehicle: Vehicle, camera_name: str, image_type: object, *, as_float: bool, compressed: bool
) -> ImageWish:
    """Return a checked request of an image. Raises `CallError`."""
    camera = camera_of(vehicle.entity, camera_name)
    if type(image_type) is not int or image_type not in _CHANNELS:
        raise CallError(f"image type {image_type!r:.20} is not served: {', '.join(map(str, _CHANNELS))}")
    channel = _CHANNELS[image_type]
    if channel not in camera.channels:
        raise CallError(f"camera `{camera.name}` of `{vehicle.name}` has no channel `{channel}` in this mission")
    if not vehicle.agent.receives_pictures(vehicle.entity.id, camera.name):
        raise CallError(f"agent `{vehicle.agent.id}` does not observe camera `{camera.name}` in this mission")
    if not any(verb.name == "takePhoto" for verb in vehicle.entity.verbs):
        raise CallError(f"`{vehicle.name}` may not take pictures in this mission")
    return ImageWish(camera, image_type, as_float, compressed, camera_name)


def class_number(entity: Entity) -> int:
    """Return the id of an object's class in segmentations."""
    return entity_class(entity)


def image_response(
    wish: ImageWish,
    picture: Picture,
    vehicle: Vehicle,
    numbers: Mapping[str, int] | None = None,
    distortion: Distortion | None = None,
) -> dict[str, Any]:
    """Return an `ImageResponse`. `numbers`: ids in segmentations that replace those of classes, by entity."""
    floats: list[float] = []
    data = b""
    if wish.as_float:
        values, outside = _floats(wish.type, picture, numbers or {})
        floats = distorted(values, distortion, picture.pose, outside).ravel().tolist()
    else:
        pixels = distorted(_pixels(wish.type, picture, numbers or {}), distortion, picture.pose, 0)
        data = png(pixels) if wish.compressed else np.ascontiguousarray(pixels[..., ::-1]).tobytes()
    return {
        "image_data_uint8": data,
        "image_data_float": floats,
        "camera_name": wish.requested_name,
        "camera_position": vector3(vehicle.local(picture.pose.position)),
        "camera_orientation": quaternionr(camera_turn(picture.pose)),
        "time_stamp": stamp(picture.time_s),
        "message": "",
        "pixels_as_float": wish.as_float,
        "compress": wish.compressed,
        "width": picture.pose.width,
        "height": picture.pose.height,
        "image_type": wish.type,
        "annotation_name": "",
    }


def png(pixels: npt.NDArray[np.uint8]) -> bytes:
    """Return (height, width, 3) pixels as a PNG file."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "PNG", compress_level=1)
    return file.getvalue()


def _floats(image_type: int, picture: Picture, numbers: Mapping[str, int]) -> tuple[npt.NDArray[np.float64], float]:
    """Return depth in metres, or for the other types red from 0 to 1; and the value beyond the picture's border."""
    if _CHANNELS[image_type] == "depth" and image_type != NORMALS:
        return _depth(image_type, picture).astype(np.float64), _FAR_M
    return _pixels(image_type, picture, numbers)[..., 0].astype(np.float64) / 255.0, 0.0


def _pixels(image_type: int, picture: Picture, numbers: Mapping[str, int]) -> npt.NDArray[np.uint8]:
    if image_type == SCENE:
        return picture.rgb
    if image_type == SEGMENTATION:
        return _PALETTE[_ids(picture, numbers)]
    if image_type == INFRARED:
        return np.repeat(_ids(picture, numbers)[..., None], 3, axis=2)
    if image_type == NORMALS:
        return _normals(picture)
    depth = _depth(DEPTH_PLANAR if image_type == DEPTH_VIS else image_type, picture)
    scale = 255.0 / _VISIBLE_M if image_type == DEPTH_VIS else 1.0
    grey = np.clip(depth * scale, 0.0, 255.0).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def _ids(picture: Picture, numbers: Mapping[str, int]) -> npt.NDArray[np.uint8]:
    """Return the id of each pixel: that of its class, or the one that a client has given to the object."""
    assert picture.semantic is not None  # the camera has the channel
    if picture.instance is None or not numbers:
        return picture.semantic
    ids = picture.semantic.copy()
    for name, number in numbers.items():
        if name in picture.instance_ids:
            ids[picture.instance == picture.instance_ids[name]] = number
    return ids


def _depth(image_type: int, picture: Picture) -> npt.NDArray[np.float32]:
    """Return the depth in metres: along the optical axis (planar) or along each ray (perspective)."""
    assert picture.depth is not None  # the camera has the channel
    depth = picture.depth.astype(np.float32)
    if image_type == DEPTH_PERSPECTIVE:
        x, y = _slopes(picture.pose)
        depth = (depth * np.sqrt(1.0 + x * x + y * y)).astype(np.float32)
    return np.where(np.isfinite(depth), depth, np.float32(_FAR_M))


def _slopes(pose: CameraPose) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Return right and down of each pixel's ray, for 1 along the optical axis: (1, width) and (height, 1)."""
    focal = focal_px(pose)
    x = (np.arange(pose.width, dtype=np.float32) + 0.5 - pose.width / 2.0) / focal
    y = (np.arange(pose.height, dtype=np.float32) + 0.5 - pose.height / 2.0) / focal
    return x[None, :].astype(np.float32), y[:, None].astype(np.float32)


def _normals(picture: Picture) -> npt.NDArray[np.uint8]:
    """Return the normals of the surfaces (north, east, down), -1 to 1 as 0 to 255, from differences of the depth."""
    depth = _depth(DEPTH_PLANAR, picture).astype(np.float64)
    x, y = _slopes(picture.pose)
    points = np.stack([depth * x, depth * y, depth], axis=2)
    normal = np.cross(np.gradient(points, axis=0), np.gradient(points, axis=1))
    length = np.linalg.norm(normal, axis=2, keepdims=True)
    unit = normal / np.where(length > 0.0, length, 1.0)
    east, north, up = (unit @ np.array(camera_axes(picture.pose))).transpose(2, 0, 1)
    return np.clip(np.stack([north, east, -up], axis=2) * 127.5 + 127.5, 0, 255).astype(np.uint8)


def projection(pose: CameraPose) -> list[list[float]]:
    """Return the matrix of a pinhole camera with near plane 0.1 m and no far plane, row by row."""
    focal = 1.0 / math.tan(math.radians(pose.hfov_deg) / 2.0)
    aspect = pose.width / pose.height
    return [[focal, 0.0, 0.0, 0.0], [0.0, focal * aspect, 0.0, 0.0], [0.0, 0.0, 0.0, 0.1], [0.0, 0.0, 1.0, 0.0]]
