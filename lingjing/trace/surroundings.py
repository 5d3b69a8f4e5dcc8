"""Inputs for viewers that the records do not contain: the meshes of the city and the mounts of cameras.

`lingjing.scene.surroundings` makes them, because this package does not know cities. They are optional.
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
"""A function that returns the pose of a camera from the state of its body, the camera, and the mounts of its type."""


@dataclass(frozen=True, slots=True)
class CityMesh:
    """A part of the city with one colour."""

    layer: str
    """The layer of the plan."""
    points: npt.NDArray[np.float64]
    """(n, 3), metres in the world frame."""
    triangles: npt.NDArray[np.uint32]
    """(m, 3), indices of points, anticlockwise seen from outside."""
    colour: tuple[float, float, float]
    """Red, green, blue in 0..1."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """The city around the episode and the placing of cameras."""

    meshes: tuple[CityMesh, ...] = ()
    """The meshes of the city; empty if the city is not shown."""
    camera: CameraPlacing | None = None
    """The placing of cameras on bodies; None if camera poses are known from pictures only."""


NO_SURROUNDINGS = Surroundings()
"""Neither a city nor camera mounts."""
