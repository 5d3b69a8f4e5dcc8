"""What the programs of a picture are told: the camera, the air and the light, as uniform values."""

from __future__ import annotations

from math import hypot

import numpy as np

from lingjing.plugins.engines.camera.light import Light
from lingjing.plugins.geometry import camera_axes, focal_px
from lingjing.trace.records import CameraPose

FAR_M = 40_000.0


def bay_near(pose: CameraPose) -> float:
    """The near plane where nothing is known of what is close."""
    return 0.05 if pose.position[2] < 10.0 else 0.4


def view(pose: CameraPose, near: float) -> dict[str, object]:
    """The camera. From orbit the far plane lies beyond the ground."""
    right, down, axis = camera_axes(pose)
    focal = focal_px(pose)
    far = max(FAR_M, 1.5 * hypot(*pose.position))
    a, b = (far + near) / (far - near), -2.0 * far * near / (far - near)
    sx, sy = 2.0 * focal / pose.width, 2.0 * focal / pose.height
    clip = np.zeros((4, 4))
    clip[:, :3] = np.array([right, down, axis, axis]) * np.array([[sx], [sy], [a], [1.0]])
    clip[2, 3] = b
    return {
        "u_clip": tuple(clip.T.ravel().tolist()),
        "u_eye": pose.position,
        "u_right": right,
        "u_down": down,
        "u_axis": axis,
        "u_lens": (pose.width / 2.0, pose.height / 2.0, focal),
    }


def air(light: Light, time_s: float, wind_mps: float) -> dict[str, object]:
    """The light and the air."""
    return {
        "u_sun": light.sun,
        "u_sunlight": light.sunlight,
        "u_skylight": light.skylight,
        "u_haze": light.haze,
        "u_fog": light.fog,
        "u_time": time_s % 3600.0,
        "u_cloud": light.cloud,
        "u_wind": wind_mps,
        "u_dark": light.dark,
        "u_gloom": light.gloom,
        "u_dusk": light.dusk,
    }
