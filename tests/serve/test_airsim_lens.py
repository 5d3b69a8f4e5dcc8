"""Turns, placements of cameras and distortions, against independent computations."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lingjing.plugins.engine import CameraPlacement
from lingjing.plugins.geometry import camera_axes, mounted_camera_pose
from lingjing.plugins.policy import BodyState, CameraPose
from lingjing.serve.airsim import distortion, frames
from lingjing.testing.rescue import CAMERA

Turn = tuple[float, float, float, float]


def product(a: Turn, b: Turn) -> Turn:
    """Hamilton's product: the rotation `b` in the frame that `a` has rotated."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def rotated(turn: Turn, vector: tuple[float, float, float]) -> tuple[float, ...]:
    w, x, y, z = turn
    return product(product(turn, (0.0, *vector)), (w, -x, -y, -z))[1:]


ATTITUDES = [(0.0, 0.0, 0.0), (20.0, -35.0, 130.0), (-80.0, 60.0, -170.0), (10.0, 90.0, 0.0), (0.0, -90.0, 40.0)]


@pytest.mark.parametrize("degrees", ATTITUDES)
def test_a_quaternion_is_the_same_after_conversion_to_angles_and_back(degrees: tuple[float, float, float]) -> None:
    turn = frames.quaternion(*map(math.radians, degrees))
    again = frames.quaternion(*frames.angles(turn))
    assert abs(sum(a * b for a, b in zip(turn, again, strict=True))) == pytest.approx(1.0)


@pytest.mark.parametrize("body", ATTITUDES[:3])
@pytest.mark.parametrize("camera", ATTITUDES)
def test_a_placed_camera_is_turned_by_the_body_and_then_by_its_placement(
    body: tuple[float, float, float], camera: tuple[float, float, float]
) -> None:
    roll, pitch, yaw = body
    state = BodyState(id="b", position=(5.0, 7.0, 30.0), heading_deg=yaw, pitch_deg=pitch, roll_deg=roll)
    placement = CameraPlacement(
        ahead_m=1.0, right_m=2.0, above_m=-0.5, roll_deg=camera[0], pitch_deg=camera[1], yaw_deg=camera[2], hfov_deg=50
    )
    pose = mounted_camera_pose(state, CAMERA, (), placement)
    whole = frames.quaternion(*map(math.radians, body))
    north, east, down = rotated(whole, (1.0, 2.0, 0.5))
    assert pose.position == pytest.approx((5.0 + east, 7.0 + north, 30.0 - down))
    turn = product(whole, frames.quaternion(*map(math.radians, camera)))
    right, below, forward = camera_axes(pose)
    for axis, own in ((forward, (1.0, 0.0, 0.0)), (right, (0.0, 1.0, 0.0)), (below, (0.0, 0.0, 1.0))):
        north, east, down = rotated(turn, own)
        assert axis == pytest.approx((east, north, -down), abs=1e-6)
    assert abs(sum(a * b for a, b in zip(turn, frames.camera_turn(pose), strict=True))) == pytest.approx(1.0)
    assert pose.hfov_deg == 50.0
    assert CameraPlacement.of_arguments({"camera": "front", **placement.arguments}) == placement


def test_a_distorted_picture_agrees_with_the_distortion_model() -> None:
    pose = CameraPose(position=(0.0, 0.0, 0.0), heading_deg=0.0, tilt_deg=0.0, hfov_deg=90.0, width=400, height=300)
    columns, rows = np.meshgrid(np.arange(400), np.arange(300))
    places = np.stack([columns, rows], axis=2).astype(np.float32)
    lens = distortion.Distortion(K1=-0.2, K2=0.05, P1=0.01, P2=-0.02)
    seen = distortion.distorted(places, lens, pose, -1.0)
    focal = 200.0
    for column, row in ((200, 150), (60, 40), (330, 260), (120, 200)):
        x, y = (column + 0.5 - 200) / focal, (row + 0.5 - 150) / focal
        squared = x * x + y * y
        scale = 1 - 0.2 * squared + 0.05 * squared**2
        u = x * scale + 0.02 * x * y - 0.02 * (squared + 2 * x * x)
        v = y * scale + 0.01 * (squared + 2 * y * y) - 0.04 * x * y
        at = int(u * focal + 200), int(v * focal + 150)
        assert seen[at[1], at[0]] == pytest.approx((column, row), abs=1.6)
    assert (seen[0, 0] == -1.0).all() and distortion.distorted(places, distortion.Distortion(), pose, 0.0) is places
    wild = distortion.distorted(places, distortion.Distortion(K1=1.0, K2=-1.0, K3=1.0, P1=1.0, P2=1.0), pose, -1.0)
    assert np.isfinite(wild).all()
