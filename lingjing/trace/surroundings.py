"""What viewers are shown of an episode that its records do not say: the city, and where a body's cameras are.

Made above this package (`lingjing.scene.surroundings`), which knows cities; a trace without them is written and read
all the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lingjing.mission.instance import CameraSpec
from lingjing.mission.model import CameraMount
from lingjing.trace.records import BodyState, CameraPose

CameraPlacing = Callable[[BodyState, CameraSpec, Sequence[CameraMount]], CameraPose]
"""Where a camera of a body is, from the body's state and the mounts of its type."""


@dataclass(frozen=True, slots=True)
class CityMesh:
    """A part of the city that has one colour: `points` (n, 3) in metres, `triangles` (m, 3) indices of them,
    anticlockwise seen from outside, `colour` red, green, blue in 0..1; `layer` is that of the plan."""

    layer: str
    points: npt.NDArray[np.float64]
    triangles: npt.NDArray[np.uint32]
    colour: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Surroundings:
    """The city in and around what is played in, and where cameras are mounted."""

    meshes: tuple[CityMesh, ...] = ()
    camera: CameraPlacing | None = None


NO_SURROUNDINGS = Surroundings()
