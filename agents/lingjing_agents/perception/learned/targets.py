"""The scale at which each class of target is searched for.

A network covers about 60 pixels around a cell. A picture is first reduced by whole factors until its targets are about
10 to 40 pixels long: one factor for a nadir camera at a known height, several for a front camera, where near and far
targets share a picture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lingjing.plugins.geometry import focal_px
from lingjing.plugins.policy import CameraPose
from lingjing_agents.perception.images import ByteImage


@dataclass(frozen=True, slots=True)
class TargetScale:
    """The scale of one class: a ground resolution for nadir cameras, or fixed factors for front cameras."""

    metres_per_px: float = 0.0
    """Metres per pixel of the reduced picture on the ground; 0 with fixed factors."""
    factors: tuple[int, ...] = ()
    """Fixed factors; empty with a ground resolution."""

    def factors_for(self, pose: CameraPose, level_m: float) -> tuple[int, ...]:
        """Return the factors by which a picture is reduced; none for a camera below the ground's elevation."""
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
"""The scales by class name."""


def reduced(rgb: ByteImage, factor: int) -> ByteImage:
    """Return a picture (height, width, 3) reduced by a whole factor: means of squares, rounded in whole numbers.

    Pixels beyond the last whole square at the right and lower edge are cut off.
    """
    if factor == 1:
        return rgb
    height, width = rgb.shape[0] // factor, rgb.shape[1] // factor
    cut = rgb[: height * factor, : width * factor]
    # Rows first: numpy adds contiguous rows of bytes fastest.
    rows = cut.reshape(height, factor, -1).sum(axis=1, dtype=np.uint32).reshape(height, width, factor, 3)
    total = rows.sum(axis=2, dtype=np.uint32)
    area = factor * factor
    small: ByteImage = ((total + area // 2) // area).astype(np.uint8)
    return small
