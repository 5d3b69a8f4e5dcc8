"""At what scale each class of target is looked for.

A network sees some 60 pixels around a cell, so a picture is first made smaller by whole factors until its targets are
about 10 to 40 pixels long: one factor for a camera that looks straight down from a known height, several for one that
looks ahead, where near and far targets stand in one picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lingjing.plugins.geometry import focal_px
from lingjing.plugins.policy import CameraPose
from lingjing_agents.perception.images import ByteImage


@dataclass(frozen=True, slots=True)
class TargetScale:
    """Metres that a pixel of the reduced picture is to show on the ground, or the factors themselves (of a camera that
    looks ahead)."""

    metres_per_px: float = 0.0
    factors: tuple[int, ...] = ()

    def factors_for(self, pose: CameraPose, level_m: float) -> tuple[int, ...]:
        """By what the picture is to be made smaller; nothing for a camera below the ground's elevation."""
        if self.factors:
            return self.factors
        above = pose.position[2] - level_m
        return (max(1, round(self.metres_per_px * focal_px(pose) / above)),) if above > 0.0 else ()


SCALES = {
    "person_in_water": TargetScale(metres_per_px=0.09),
    "building_fire": TargetScale(metres_per_px=0.4),
    "pipeline_leak": TargetScale(metres_per_px=0.12),
    "bridge_fracture": TargetScale(metres_per_px=0.8),
    "fire_source": TargetScale(factors=(1, 2, 4)),
}
"""By the name of the class."""


def reduced(rgb: ByteImage, factor: int) -> ByteImage:
    """A picture (height, width, 3) made smaller by a whole factor: means of squares, rounded in whole numbers. What is
    left over at its right and lower edge is cut off."""
    if factor == 1:
        return rgb
    height, width = rgb.shape[0] // factor, rgb.shape[1] // factor
    cut = rgb[: height * factor, : width * factor]
    # Rows first: whole rows of bytes are added up in one go.
    rows = cut.reshape(height, factor, -1).sum(axis=1, dtype=np.uint32).reshape(height, width, factor, 3)
    total = rows.sum(axis=2, dtype=np.uint32)
    area = factor * factor
    small: ByteImage = ((total + area // 2) // area).astype(np.uint8)
    return small
