"""Uniform values of the programs of a picture: camera, air and light."""

from __future__ import annotations

from math import hypot

import numpy as np

from lingjing.engines.camera.far_country import HIGH_M, SPAN_M
from lingjing.engines.camera.light import Light
from lingjing.engines.camera.meshes import vector_of
from lingjing.scene.camera_geometry import SPACE_M, camera_axes, focal_px
from lingjing.trace.records import CameraPose

FAR_M = 40_000.0
"""Far plane of a camera in the air, metres (chosen)."""

# Linear colours of the sky (chosen): by day without and with clouds, and at night.
HORIZON, ZENITH = np.array([0.42, 0.53, 0.62]), np.array([0.075, 0.20, 0.47])
GREY, GREY_ABOVE = np.array([0.46, 0.49, 0.52]), np.array([0.40, 0.44, 0.49])
NIGHT = np.array([0.011, 0.015, 0.026])


def bay_near(pose: CameraPose) -> float:
    """Return the near plane if the distances of nearby things are not known, metres."""
    return 0.05 if pose.position[2] < 10.0 else 0.4


def view(pose: CameraPose, near: float) -> dict[str, object]:
    """Return the uniforms of the camera. From high above the far plane lies beyond all country and sea."""
    right, down, axis = camera_axes(pose)
    focal = focal_px(pose)
    far = max(FAR_M, 1.5 * hypot(*pose.position))
    if pose.position[2] > HIGH_M:
        far = max(far, 2.0 * SPAN_M)
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
    """Return the uniforms of light and air."""
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
        "u_clear": light.clear,
        "u_dusk": light.dusk,
        **_sky(light),
    }


def space(light: Light, height_m: float) -> dict[str, object]:
    """Return the uniforms of the sky that differ for an eye in space; empty below `HIGH_M`.

    From orbit the sky is black except for the haze at the horizon, and it has no clouds.
    """
    if height_m <= HIGH_M:
        return {}
    left = 1.0 - min((height_m - HIGH_M) / (SPACE_M - HIGH_M), 1.0)
    dimmed = {name: tuple(left * c for c in colour) for name, colour in _sky(light).items()}
    return {**dimmed, "u_cloud": light.cloud * left, "u_gloom": light.gloom * left}


def haze(light: Light) -> tuple[float, float, float]:
    """Return the haze as a developed colour, equal to the sky's at the horizon (`common.glsl`)."""
    v = np.sqrt(1.0 - np.exp(-1.9 * np.maximum(light.haze, 0.0)))
    return vector_of(v + 0.55 * (v * v * (3.0 - 2.0 * v) - v))


def _sky(light: Light) -> dict[str, tuple[float, float, float]]:
    """Return the coefficients of the sky's colour, top + rise h + low (1 - h)^2 over the sine h of the elevation.

    They mix blue, grey and night, and add the glow of dusk.
    """
    day = light.gloom * (1.0 - light.dark)
    clear, grey = day * (1.0 - light.cloud), day * light.cloud
    dusk = np.array(light.dusk)
    return {
        "u_sky_top": vector_of(clear * ZENITH + grey * GREY + light.dark * NIGHT),
        "u_sky_rise": vector_of(grey * (GREY_ABOVE - GREY)),
        "u_sky_low": vector_of(clear * (HORIZON - ZENITH) + 0.7 * dusk),
    }
