"""Synthetic frames, and pictures for them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable

import numpy as np

from lingjing.bench.frame_sets.labelled import LabelledFrame
from lingjing.testing import encode_jpeg
from lingjing.trace.records import Box, CameraPose

POSE = CameraPose(position=(0.0, 0.0, 50.0), heading_deg=0.0, tilt_deg=90.0, width=64, height=48)
VICTIM = Box(entity="victim[1]", cls="person_in_water", box=(0.25, 0.5, 0.375, 0.75), pixels=60, contrast=80.0)
BOAT = Box(entity="boat", cls="lifeboat", box=(0.5, 0.5, 0.75, 0.75), pixels=90)


def picture(number: int) -> bytes:
    """Return a different picture for each number."""
    return encode_jpeg(np.full((48, 64, 3), number * 16 % 256, np.uint8))


def made_frame(number: int, seed: int = 2000, **changes: object) -> LabelledFrame:
    """Return an empty frame of open water with these changes."""
    plain = {
        "name": f"ssr-star-{seed}-00000000-f{number}.jpg", "mission": "ssr", "mode": "star", "seed": seed,
        "policy": "heuristic", "frame": f"f{number}", "tick": number, "camera": "nadir", "pose": POSE, "level_m": -3.5,
        "sha256": hashlib.sha256(picture(number)).hexdigest(), "targets": ("person_in_water",),
    }  # fmt: skip
    return LabelledFrame(**{**plain, **changes})  # type: ignore[arg-type]


def pictures_of(frames: Iterable[LabelledFrame]) -> Callable[[str], bytes]:
    """Return the function that maps the name of a frame to its picture."""
    made = {frame.name: picture(frame.tick) for frame in frames}
    return made.__getitem__
