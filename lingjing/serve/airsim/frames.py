"""AirSim's coordinates: north, east, down in metres, and quaternions (w, x, y, z) from the body's frame to it.

The body's frame is forward, right, down. World positions are relative to the city's origin, elevation 0. Positions of a
vehicle are relative to its own start, as AirSim documents.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from lingjing.mission.instance import Vector
from lingjing.trace.records import BodyState, CameraPose

Quaternion = tuple[float, float, float, float]
"""(w, x, y, z) of unit length."""


def ned(enu: Sequence[float]) -> Vector:
    """Return (north, east, down) of (east, north, up), and the reverse."""
    return enu[1], enu[0], -enu[2]


def less(first: Vector, second: Vector) -> Vector:
    """Return the difference of two vectors."""
    return first[0] - second[0], first[1] - second[1], first[2] - second[2]


def quaternion(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the turn by yaw, then pitch, then roll (rad): positive yaw is to the right, positive pitch nose up."""
    cr, sr = math.cos(roll / 2.0), math.sin(roll / 2.0)
    cp, sp = math.cos(pitch / 2.0), math.sin(pitch / 2.0)
    cy, sy = math.cos(yaw / 2.0), math.sin(yaw / 2.0)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def angles(turn: Quaternion) -> Vector:
    """Return roll, pitch and yaw of a turn, rad: the reverse of `quaternion`."""
    w, x, y, z = turn
    sine = min(max(2.0 * (w * y - z * x), -1.0), 1.0)
    if abs(sine) > 1.0 - 1e-12:  # the nose points straight up or down: roll and yaw are one turn
        return 0.0, math.copysign(math.pi / 2.0, sine), wrapped(-math.copysign(2.0, sine) * math.atan2(x, w))
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, math.asin(sine), yaw


def attitude(state: BodyState) -> Vector:
    """Return roll, pitch and yaw of a body, rad; yaw is in (-pi, pi]."""
    yaw = math.radians(state.heading_deg)
    return math.radians(state.roll_deg), math.radians(state.pitch_deg), math.atan2(math.sin(yaw), math.cos(yaw))


def to_body(angles: Vector, vector: Vector) -> Vector:
    """Return a vector (north, east, down) in the frame of a body with these angles (roll, pitch, yaw)."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle), math.sin(angle)) for angle in angles)
    north, east, down = vector
    return (
        cp * cy * north + cp * sy * east - sp * down,
        (sr * sp * cy - cr * sy) * north + (sr * sp * sy + cr * cy) * east + sr * cp * down,
        (cr * sp * cy + sr * sy) * north + (cr * sp * sy - sr * cy) * east + cr * cp * down,
    )


def camera_turn(pose: CameraPose) -> Quaternion:
    """Return the turn of a camera; its x axis is the optical axis, its y axis points right in the picture."""
    return quaternion(math.radians(pose.roll_deg), -math.radians(pose.tilt_deg), math.radians(pose.heading_deg))


def wrapped(angle: float) -> float:
    """Return an angle in (-pi, pi], rad."""
    return math.atan2(math.sin(angle), math.cos(angle))


def vector3(values: Sequence[float]) -> dict[str, float]:
    """Return a `Vector3r`."""
    return {"x_val": values[0], "y_val": values[1], "z_val": values[2]}


def quaternionr(turn: Quaternion) -> dict[str, float]:
    """Return a `Quaternionr`."""
    return {"w_val": turn[0], "x_val": turn[1], "y_val": turn[2], "z_val": turn[3]}


def pose(position: Vector, turn: Quaternion) -> dict[str, object]:
    """Return a `Pose`."""
    return {"position": vector3(position), "orientation": quaternionr(turn)}
