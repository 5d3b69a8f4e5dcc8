"""People in pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lingjing.plugins.policy import CameraPose


@dataclass(frozen=True, slots=True)
class Find:
    """One found person: a normalised box (x0, y0, x1, y1), origin top left, and how sure (0..1)."""

    box: tuple[float, float, float, float]
    confidence: float


def find_people(rgb: npt.NDArray[np.uint8], pose: CameraPose, water_level_m: float) -> tuple[Find, ...]:
    return ()
