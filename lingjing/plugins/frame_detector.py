"""The detector contract: a detector finds targets of one class in exported frames, outside of episodes.

A detector is a rule, a trained network or a chat model. `lingjing frames probe` runs detectors. Plug-ins bring them
through the hook `lingjing_detectors`.
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
    """One picture and the class of target to find. It holds no ground truth."""

    cls: str
    """The class of the target."""
    jpeg: bytes
    """The bytes of the image file."""
    rgb: npt.NDArray[np.uint8]
    """The decoded image, (height, width, 3)."""
    pose: CameraPose
    level_m: float
    """The elevation of the ground or water, metres."""


@dataclass(frozen=True, slots=True)
class FrameAnswer:
    """The answer of a detector."""

    present: bool
    """True if the picture shows a target."""
    boxes: tuple[UnitBox, ...] = ()
    """Boxes (x0, y0, x1, y1) as shares of the picture; () if the detector gives none."""
    failure: str = ""
    """The reason for which there is no answer. It counts as no detection."""


class FrameDetector(Protocol):
    """A detector of targets in single pictures."""

    def answer(self, question: FrameQuestion) -> FrameAnswer:
        """Return the answer for a picture. Raises `InfrastructureError` if no picture can be answered."""
        ...


@dataclass(frozen=True, slots=True)
class DetectorPlugin:
    """The declaration of a detector through the hook `lingjing_detectors`."""

    name: str
    factory: Callable[[Mapping[str, str]], FrameDetector]
    """Returns a detector with the given options, which are texts. Raises `UsageError` for wrong ones."""
    knows: Callable[[str], bool] = lambda cls: True
    """Returns True for a class that the detector can find."""
    summary: str = ""


__all__ = ["DetectorPlugin", "FrameAnswer", "FrameDetector", "FrameQuestion", "UnitBox"]
