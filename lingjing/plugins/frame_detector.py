"""What says whether a frame shows a target, and where: a rule, a trained network, a chat model; outside of episodes.

`lingjing frames probe` asks detectors about exported frames. The core knows none: plug-ins bring them through the hook
`lingjing_detectors`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from lingjing.trace.records import CameraPose, UnitBox


@dataclass(frozen=True, slots=True)
class FrameQuestion:
    """Whether a picture shows a target of the class `cls`. `rgb` is the decoded `jpeg` (or another image file's bytes),
    (height, width, 3); `level_m` is the elevation of the ground or water. It says nothing of what is true."""

    cls: str
    jpeg: bytes
    rgb: npt.NDArray[np.uint8]
    pose: CameraPose
    level_m: float


@dataclass(frozen=True, slots=True)
class FrameAnswer:
    """What a detector says: whether a target is there, and normalised boxes (x0, y0, x1, y1) if it gives any. `failure`
    says why there is no answer, which counts as no detection."""

    present: bool
    boxes: tuple[UnitBox, ...] = ()
    failure: str = ""


class FrameDetector(Protocol):
    """One detector."""

    def answer(self, question: FrameQuestion) -> FrameAnswer:
        """What the picture shows. Raises `InfrastructureError` if nothing can be answered at all."""
        ...


@dataclass(frozen=True, slots=True)
class DetectorPlugin:
    """How a detector is declared. `factory` makes one of its options as text, and raises `UsageError` for wrong ones;
    `knows` says whether it can tell a class."""

    name: str
    factory: Callable[[Mapping[str, str]], FrameDetector]
    knows: Callable[[str], bool] = lambda cls: True
    summary: str = ""


__all__ = ["DetectorPlugin", "FrameAnswer", "FrameDetector", "FrameQuestion", "UnitBox"]
