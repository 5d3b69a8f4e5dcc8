"""Cameras and compass: pixel → ray → point on a horizontal plane, and back.

Pure functions over floats, without numpy. The camera engine draws with the same functions. So a policy that turns a box
into a world position uses exactly the geometry of the picture.

Frames. World: east, north, elevation (m). Camera: pinhole with square pixels, optical centre `pose.position`,
`right`/`down`/`forward` axes. Pixel coordinates are continuous: (0, 0) is the top-left *corner* of the image, (width,
height) the bottom-right one, so pixel column c is centred at c + 0.5. A normalised box coordinate times the image size
is such a pixel coordinate. Angles are degrees, headings clockwise from north.

Mounts. A body's type declares the positions of its cameras, one for each view (`mount` in docs/language.md). `MOUNTS`
holds for views without such a declaration. A camera with a gimbal follows the body's heading and ignores its pitch and
roll; one without a gimbal pitches and rolls with the body. Above 100 km there is no gimbal: a satellite turns as a
whole, and every camera looks along its nose.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import asin, atan2, cos, degrees, hypot, radians, sin, tan

import msgspec

from lingjing.decoding import converted
from lingjing.mission.instance import CameraSpec, Vector
from lingjing.mission.model import CameraMount
from lingjing.scene.outlines import compass
from lingjing.trace.records import BodyState, CameraPose

MOUNTS: dict[str, CameraMount] = {
    "nadir": CameraMount(view="nadir", ahead_m=0.0, above_m=-0.10, tilt_deg=90.0),
    "front": CameraMount(view="front", ahead_m=0.30, above_m=-0.05, tilt_deg=10.0),
    "oblique": CameraMount(view="oblique", ahead_m=0.30, above_m=-0.05, tilt_deg=45.0),
}
"""View → mount of a camera if its body's type declares none for that view (chosen)."""

SPACE_M = 100_000.0
"""Elevation at which space begins, metres (the Kármán line). Above it every camera looks along its body's nose."""

PLACEMENT_LIMITS: dict[str, tuple[str, float, float]] = {
    "ahead": ("m", -100.0, 100.0),
    "right": ("m", -100.0, 100.0),
    "above": ("m", -100.0, 100.0),
    "yaw": ("deg", -360.0, 360.0),
    "pitch": ("deg", -90.0, 90.0),
    "roll": ("deg", -360.0, 360.0),
    "hfov": ("deg", 1.0, 170.0),
}
"""Argument of a `takePhoto` that moves a camera → its unit, least and largest value (chosen)."""


class CameraPlacement(msgspec.Struct, frozen=True, kw_only=True):
    """A place and a lens of a camera that replace those of its mount. Such a camera has no gimbal."""

    ahead_m: float
    """Offset from the body's middle in the body's frame, as `right_m` and `above_m`."""
    right_m: float
    above_m: float
    yaw_deg: float
    """Turn against the body: first yaw (clockwise from above), then pitch (nose up), then roll (right side down)."""
    pitch_deg: float
    roll_deg: float
    hfov_deg: float

    @classmethod
    def of_arguments(cls, arguments: Mapping[str, object]) -> CameraPlacement | None:
        """The placement in the arguments of a `takePhoto`; None if the camera stays on its mount."""
        if "hfov" not in arguments:
            return None
        values = {f"{name}_{unit}": arguments.get(name, 0.0) for name, (unit, _, _) in PLACEMENT_LIMITS.items()}
        return converted(values, cls)

    @property
    def arguments(self) -> dict[str, float]:
        """The arguments of a `takePhoto` with this placement."""
        return {name: getattr(self, f"{name}_{unit}") for name, (unit, _, _) in PLACEMENT_LIMITS.items()}


CameraAxes = tuple[Vector, Vector, Vector]
"""Unit vectors of image-right, image-down and the optical axis."""


def bearing_deg(origin: tuple[float, ...], target: tuple[float, ...]) -> float:
    """Compass bearing in [0, 360) from `origin` to `target`; 0 where they coincide. Elevations are ignored."""
    return compass(degrees(atan2(target[0] - origin[0], target[1] - origin[1])))


def distance_xy(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    """Horizontal distance, metres."""
    return hypot(b[0] - a[0], b[1] - a[1])


def turn_deg(from_deg: float, to_deg: float) -> float:
    """The signed turn in [-180, 180) that brings heading `from_deg` to `to_deg`; positive is clockwise."""
    return (to_deg - from_deg + 180.0) % 360.0 - 180.0


def heading_vector(heading_deg: float) -> tuple[float, float]:
    """(east, north) of the unit vector along a compass heading."""
    angle = radians(heading_deg)
    return sin(angle), cos(angle)


def offset_xy(origin: tuple[float, ...], heading_deg: float, distance_m: float) -> tuple[float, float]:
    """The point `distance_m` from `origin` along a compass heading."""
    east, north = heading_vector(heading_deg)
    return origin[0] + east * distance_m, origin[1] + north * distance_m


def camera_pose(position: Vector, heading_deg: float, camera: CameraSpec) -> CameraPose:
    """Pose of a camera on a level body of a type without mounts. `position` in metres."""
    return mounted_camera_pose(BodyState(id="", position=position, heading_deg=heading_deg), camera, ())


def mounted_camera_pose(
    state: BodyState, camera: CameraSpec, mounts: Sequence[CameraMount], placement: CameraPlacement | None = None
) -> CameraPose:
    """Pose of a body's camera, from the body's state and the mounts of its type, or from a placement."""
    if placement is not None:
        return _placed(state, camera, placement)
    if state.position[2] > SPACE_M:
        return _posed(camera, state.position, state.heading_deg, -state.pitch_deg)
    mount = next((declared for declared in mounts if declared.view == camera.view), MOUNTS[camera.view])
    pitch, roll = (0.0, 0.0) if mount.gimbal else (state.pitch_deg, state.roll_deg)
    rise, reach = sin(radians(pitch)), cos(radians(pitch))
    east, north = offset_xy(state.position, state.heading_deg, mount.ahead_m * reach - mount.above_m * rise)
    up = state.position[2] + mount.above_m * reach + mount.ahead_m * rise
    return _posed(camera, (east, north, up), state.heading_deg, mount.tilt_deg - pitch, roll)


def _posed(
    camera: CameraSpec, position: Vector, heading_deg: float, tilt_deg: float, roll_deg: float = 0.0
) -> CameraPose:
    return CameraPose(
        position=position,
        heading_deg=heading_deg % 360.0,
        tilt_deg=tilt_deg,
        roll_deg=roll_deg,
        hfov_deg=camera.hfov_deg,
        width=camera.width,
        height=camera.height,
    )


def _placed(state: BodyState, camera: CameraSpec, placement: CameraPlacement) -> CameraPose:
    """Pose of a camera that is fixed to the body at a placement."""
    body = _turned(_WORLD, state.heading_deg, state.pitch_deg, state.roll_deg)
    offset = (placement.ahead_m, placement.right_m, placement.above_m)
    east, north, up = (
        place + sum(length * axis[k] for length, axis in zip(offset, body, strict=True))
        for k, place in enumerate(state.position)
    )
    forward, right, above = _turned(body, placement.yaw_deg, placement.pitch_deg, placement.roll_deg)
    tilt = degrees(asin(min(max(-forward[2], -1.0), 1.0)))
    level = hypot(forward[0], forward[1])
    # an axis that points straight down or up has no heading of its own: that of the picture's top edge is taken
    top = forward if level > _VERTICAL else above if tilt > 0.0 else (-above[0], -above[1], 0.0)
    heading = degrees(atan2(top[0], top[1]))
    sh, ch, st, ct = sin(radians(heading)), cos(radians(heading)), sin(radians(tilt)), cos(radians(tilt))
    cosine = right[0] * ch - right[1] * sh
    sine = -right[0] * sh * st - right[1] * ch * st - right[2] * ct
    lens = msgspec.structs.replace(camera, hfov_deg=placement.hfov_deg)
    return _posed(lens, (east, north, up), heading, tilt, degrees(atan2(sine, cosine)))


_VERTICAL = 1e-9
"""Length in plan below which an axis of length 1 is vertical."""
_WORLD: CameraAxes = ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
"""Forward, right and above of a body that points north."""


def _turned(frame: CameraAxes, yaw_deg: float, pitch_deg: float, roll_deg: float) -> CameraAxes:
    """Forward, right and above of a frame after a yaw (clockwise from above), a pitch (nose up) and a roll (right side
    down), each about the axes of the frame that the one before has made."""
    (sy, cy), (sp, cp), (sr, cr) = ((sin(radians(a)), cos(radians(a))) for a in (yaw_deg, pitch_deg, roll_deg))
    forward, right, above = frame
    forward, right = _mix(forward, right, cy, sy), _mix(right, forward, cy, -sy)
    forward, above = _mix(forward, above, cp, sp), _mix(above, forward, cp, -sp)
    right, above = _mix(right, above, cr, -sr), _mix(above, right, cr, sr)
    return forward, right, above


def focal_px(pose: CameraPose) -> float:
    """Focal length in pixels."""
    return pose.width / 2.0 / tan(radians(pose.hfov_deg) / 2.0)


def camera_axes(pose: CameraPose) -> CameraAxes:
    """World vectors of image-right, image-down and the optical axis. Positive roll lowers the image's right side."""
    heading, tilt, roll = radians(pose.heading_deg), radians(pose.tilt_deg), radians(pose.roll_deg)
    sh, ch, st, ct, sr, cr = sin(heading), cos(heading), sin(tilt), cos(tilt), sin(roll), cos(roll)
    level, sunk = (ch, -sh, 0.0), (-sh * st, -ch * st, -ct)
    right = _mix(level, sunk, cr, sr)
    down = _mix(sunk, level, cr, -sr)
    return right, down, (sh * ct, ch * ct, -st)


def pixel_ray(pose: CameraPose, u: float, v: float) -> Vector:
    """World direction of the ray through pixel (u, v), scaled to 1 along the optical axis.

    So `position + depth * ray` is the point that a depth image gives.
    """
    right, down, forward = camera_axes(pose)
    focal = focal_px(pose)
    x, y = (u - pose.width / 2.0) / focal, (v - pose.height / 2.0) / focal
    return (
        forward[0] + x * right[0] + y * down[0],
        forward[1] + x * right[1] + y * down[1],
        forward[2] + x * right[2] + y * down[2],
    )


def pixel_to_world(pose: CameraPose, u: float, v: float, depth_m: float) -> Vector:
    """The world point at pixel (u, v) and `depth_m` along the optical axis."""
    ray = pixel_ray(pose, u, v)
    x, y, z = pose.position
    return x + depth_m * ray[0], y + depth_m * ray[1], z + depth_m * ray[2]


def pixel_to_plane(pose: CameraPose, u: float, v: float, elevation_m: float) -> Vector | None:
    """The point at which the ray through pixel (u, v) meets the horizontal plane at `elevation_m`; None if it misses
    it.
    """
    rise = pixel_ray(pose, u, v)[2]
    fall = elevation_m - pose.position[2]
    if rise == 0.0 or fall / rise <= 0.0:
        return None
    x, y, _ = pixel_to_world(pose, u, v, fall / rise)
    return x, y, elevation_m


def world_to_pixel(pose: CameraPose, point: Vector) -> tuple[float, float, float] | None:
    """(u, v, depth in metres) of a point, also outside of the image's borders; None behind the camera."""
    offset = (point[0] - pose.position[0], point[1] - pose.position[1], point[2] - pose.position[2])
    right, down, forward = camera_axes(pose)
    depth = _dot(offset, forward)
    if depth <= 0.0:
        return None
    scale = focal_px(pose) / depth
    return pose.width / 2.0 + scale * _dot(offset, right), pose.height / 2.0 + scale * _dot(offset, down), depth


def in_image(pose: CameraPose, u: float, v: float) -> bool:
    """True if pixel (u, v) lies inside the picture."""
    return 0.0 <= u <= pose.width and 0.0 <= v <= pose.height


def box_to_plane(pose: CameraPose, box: tuple[float, float, float, float], elevation_m: float) -> Vector | None:
    """The point at which the centre of a normalised box (x0, y0, x1, y1) meets the horizontal plane at
    `elevation_m`."""
    u = (box[0] + box[2]) / 2.0 * pose.width
    v = (box[1] + box[3]) / 2.0 * pose.height
    return pixel_to_plane(pose, u, v, elevation_m)


def ground_footprint(pose: CameraPose, elevation_m: float) -> tuple[tuple[float, float], ...] | None:
    """The picture's four corners (east, north) on a horizontal plane, clockwise from top left.

    None if the horizon is in the picture.
    """
    corners = ((0.0, 0.0), (pose.width, 0.0), (pose.width, pose.height), (0.0, pose.height))
    points = [pixel_to_plane(pose, float(u), float(v), elevation_m) for u, v in corners]
    places = [(point[0], point[1]) for point in points if point is not None]
    return tuple(places) if len(places) == len(points) else None


def _mix(a: Vector, b: Vector, ka: float, kb: float) -> Vector:
    return a[0] * ka + b[0] * kb, a[1] * ka + b[1] * kb, a[2] * ka + b[2] * kb


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
