"""Cameras and compass: pixel → ray → point on a horizontal plane, and back.

Pure functions over floats, the same ones that the camera engine draws with, so a policy that turns a box into a
world position uses the very geometry that made the picture. No numpy.

Frames. World: east, north, elevation (m). Camera: pinhole with square pixels, optical centre `pose.position`,
`right`/`down`/`forward` axes. Pixels are continuous: (0, 0) is the top-left *corner* of the image, (width, height) the
bottom-right one, so pixel column c is centred at c + 0.5; a normalised box coordinate times the image size is such a
pixel. Angles are degrees, headings clockwise from north.

Mounts. Cameras are gimballed: they follow the body's heading and ignore its pitch and roll. `nadir` looks straight
down with image-up along the heading, from 0.10 m under the body's origin; `front` looks along the heading, 10 deg
below the horizon, from 0.30 m ahead of it and 0.05 m under it; `oblique` looks 45 deg down from the same place.
Other bodies than multirotors have mounts of their own (`BODY_MOUNTS`): a dog's eye 0.4 m over its feet, fixed to its
body, so its pictures tilt and roll with it; a car's behind the windscreen. `mounted_camera_pose` knows them. Above
100 km there is no gimbal: a satellite turns as a whole, and every camera looks along its nose.
"""

from __future__ import annotations

from math import atan2, cos, degrees, hypot, radians, sin, tan

from lingjing.mission.instance import CameraSpec, Vector
from lingjing.trace.records import BodyState, CameraPose

MOUNTS: dict[str, tuple[float, float, float]] = {
    "nadir": (0.0, -0.10, 90.0),
    "front": (0.30, -0.05, 10.0),
    "oblique": (0.30, -0.05, 45.0),
}
"""View → (metres ahead of the body's origin, metres above it, tilt below the horizon in degrees)."""

BODY_MOUNTS: dict[str, dict[str, tuple[float, float, float]]] = {
    "robot_dog": {"front": (0.34, 0.08, 5.0), "oblique": (0.34, 0.08, 35.0), "nadir": (0.30, 0.0, 90.0)},
    "car": {"front": (0.75, 1.30, 3.0), "oblique": (0.75, 1.45, 30.0), "nadir": (2.4, 1.0, 90.0)},
    "delivery_van": {"front": (2.0, 1.75, 4.0), "oblique": (2.0, 1.9, 30.0), "nadir": (3.1, 1.2, 90.0)},
    "truck": {"front": (3.7, 2.2, 5.0), "oblique": (3.7, 2.3, 30.0), "nadir": (4.7, 1.2, 90.0)},
    "bus": {"front": (5.6, 2.2, 5.0), "oblique": (5.6, 2.3, 30.0), "nadir": (6.2, 1.2, 90.0)},
    "fire_truck": {"front": (3.5, 2.2, 5.0), "oblique": (3.5, 2.3, 30.0), "nadir": (4.5, 1.2, 90.0)},
    "lifeboat": {"front": (0.2, 2.6, 4.0), "oblique": (0.2, 2.8, 30.0), "nadir": (4.4, 1.5, 90.0)},
    "fixed_wing": {"front": (3.2, -0.2, 8.0), "oblique": (1.0, -1.2, 45.0), "nadir": (0.0, -1.4, 90.0)},
}
"""Kind of body → its mounts. A satellite has none: above `SPACE_M` every camera looks along the body's nose."""

FIXED_TO_BODY = frozenset({"robot_dog"})
"""Kinds whose cameras pitch and roll with the body."""

SPACE_M = 100_000.0
"""Where space begins: bodies above it are satellites."""

Axes = tuple[Vector, Vector, Vector]


def bearing_deg(origin: tuple[float, ...], target: tuple[float, ...]) -> float:
    """Compass bearing in [0, 360) from `origin` to `target`; 0 where they coincide. Elevations are ignored."""
    return degrees(atan2(target[0] - origin[0], target[1] - origin[1])) % 360.0


def distance_xy(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    """Horizontal distance in metres."""
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
    """Pose of a mounted camera for a body at `position` (m) with `heading_deg`."""
    ahead, above, tilt = MOUNTS[camera.view]
    east, north = offset_xy(position, heading_deg, ahead)
    return CameraPose(
        position=(east, north, position[2] + above),
        heading_deg=heading_deg % 360.0,
        tilt_deg=tilt,
        hfov_deg=camera.hfov_deg,
        width=camera.width,
        height=camera.height,
    )


def body_camera_pose(state: BodyState, camera: CameraSpec) -> CameraPose:
    """Pose of a mounted camera from its body's state; the body's pitch and roll are ignored (gimbal), but for a
    satellite's."""
    if state.position[2] > SPACE_M:
        return orbital_pose(state, camera)
    return camera_pose(state.position, state.heading_deg, camera)


def orbital_pose(state: BodyState, camera: CameraSpec) -> CameraPose:
    """Pose of a camera that is fixed to its body and looks along its nose."""
    return CameraPose(
        position=state.position,
        heading_deg=state.heading_deg % 360.0,
        tilt_deg=-state.pitch_deg,
        hfov_deg=camera.hfov_deg,
        width=camera.width,
        height=camera.height,
    )


def mounted_camera_pose(state: BodyState, camera: CameraSpec, kind: str, bases: tuple[str, ...] = ()) -> CameraPose:
    """Pose of a camera on a body of a type (`kind`, extending `bases`); a multirotor's mounts where none are known."""
    known = next((name for name in (kind, *bases) if name in BODY_MOUNTS), None)
    if known is None or state.position[2] > SPACE_M:
        return body_camera_pose(state, camera)
    ahead, above, tilt = BODY_MOUNTS[known][camera.view]
    pitch, roll = (state.pitch_deg, state.roll_deg) if known in FIXED_TO_BODY else (0.0, 0.0)
    rise, reach = sin(radians(pitch)), cos(radians(pitch))
    east, north = offset_xy(state.position, state.heading_deg, ahead * reach - above * rise)
    return CameraPose(
        position=(east, north, state.position[2] + above * reach + ahead * rise),
        heading_deg=state.heading_deg % 360.0,
        tilt_deg=tilt - pitch,
        roll_deg=roll,
        hfov_deg=camera.hfov_deg,
        width=camera.width,
        height=camera.height,
    )


def focal_px(pose: CameraPose) -> float:
    """Focal length in pixels."""
    return pose.width / 2.0 / tan(radians(pose.hfov_deg) / 2.0)


def camera_axes(pose: CameraPose) -> Axes:
    """World vectors of image-right, image-down and the optical axis; positive roll lowers the image's right side."""
    heading, tilt, roll = radians(pose.heading_deg), radians(pose.tilt_deg), radians(pose.roll_deg)
    sh, ch, st, ct, sr, cr = sin(heading), cos(heading), sin(tilt), cos(tilt), sin(roll), cos(roll)
    level, sunk = (ch, -sh, 0.0), (-sh * st, -ch * st, -ct)
    right = _mix(level, sunk, cr, sr)
    down = _mix(sunk, level, cr, -sr)
    return right, down, (sh * ct, ch * ct, -st)


def pixel_ray(pose: CameraPose, u: float, v: float) -> Vector:
    """World direction of the ray through pixel (u, v), scaled to 1 along the optical axis, so that
    `position + depth * ray` is the point a depth image says."""
    right, down, forward = camera_axes(pose)
    focal = focal_px(pose)
    x, y = (u - pose.width / 2.0) / focal, (v - pose.height / 2.0) / focal
    return (
        forward[0] + x * right[0] + y * down[0],
        forward[1] + x * right[1] + y * down[1],
        forward[2] + x * right[2] + y * down[2],
    )


def pixel_to_world(pose: CameraPose, u: float, v: float, depth_m: float) -> Vector:
    """The point seen at pixel (u, v) at `depth_m` along the optical axis."""
    ray = pixel_ray(pose, u, v)
    x, y, z = pose.position
    return x + depth_m * ray[0], y + depth_m * ray[1], z + depth_m * ray[2]


def pixel_to_plane(pose: CameraPose, u: float, v: float, elevation_m: float) -> Vector | None:
    """Where the ray through pixel (u, v) meets the horizontal plane at `elevation_m`; None if it never does."""
    rise = pixel_ray(pose, u, v)[2]
    fall = elevation_m - pose.position[2]
    if rise == 0.0 or fall / rise <= 0.0:
        return None
    x, y, _ = pixel_to_world(pose, u, v, fall / rise)
    return x, y, elevation_m


def world_to_pixel(pose: CameraPose, point: Vector) -> tuple[float, float, float] | None:
    """(u, v, depth in metres) of a point, also outside the image's borders; None behind the camera."""
    offset = (point[0] - pose.position[0], point[1] - pose.position[1], point[2] - pose.position[2])
    right, down, forward = camera_axes(pose)
    depth = _dot(offset, forward)
    if depth <= 0.0:
        return None
    scale = focal_px(pose) / depth
    return pose.width / 2.0 + scale * _dot(offset, right), pose.height / 2.0 + scale * _dot(offset, down), depth


def in_image(pose: CameraPose, u: float, v: float) -> bool:
    """Whether pixel (u, v) lies inside the picture."""
    return 0.0 <= u <= pose.width and 0.0 <= v <= pose.height


def box_to_plane(pose: CameraPose, box: tuple[float, float, float, float], elevation_m: float) -> Vector | None:
    """Where the centre of a normalised box (x0, y0, x1, y1) lies on the horizontal plane at `elevation_m`."""
    u = (box[0] + box[2]) / 2.0 * pose.width
    v = (box[1] + box[3]) / 2.0 * pose.height
    return pixel_to_plane(pose, u, v, elevation_m)


def ground_footprint(pose: CameraPose, elevation_m: float) -> tuple[tuple[float, float], ...] | None:
    """The picture's four corners (east, north) on a horizontal plane, clockwise from top left; None if the horizon
    is in the picture."""
    corners = ((0.0, 0.0), (pose.width, 0.0), (pose.width, pose.height), (0.0, pose.height))
    points = [pixel_to_plane(pose, float(u), float(v), elevation_m) for u, v in corners]
    found = [(point[0], point[1]) for point in points if point is not None]
    return tuple(found) if len(found) == len(points) else None


def _mix(a: Vector, b: Vector, ka: float, kb: float) -> Vector:
    return a[0] * ka + b[0] * kb, a[1] * ka + b[1] * kb, a[2] * ka + b[2] * kb


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


__all__ = [
    "BODY_MOUNTS",
    "FIXED_TO_BODY",
    "MOUNTS",
    "SPACE_M",
    "bearing_deg",
    "body_camera_pose",
    "box_to_plane",
    "camera_axes",
    "camera_pose",
    "distance_xy",
    "focal_px",
    "ground_footprint",
    "heading_vector",
    "in_image",
    "mounted_camera_pose",
    "offset_xy",
    "orbital_pose",
    "pixel_ray",
    "pixel_to_plane",
    "pixel_to_world",
    "turn_deg",
    "world_to_pixel",
]
