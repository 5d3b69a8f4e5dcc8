"""The ground around a dog: water, edges and steps ahead of it, in the shapes of the model and the waters of the
city."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lingjing.engines.quadruped.dog_model import DogModel, DogState
from lingjing.engines.quadruped.physics import Floor
from lingjing.mission.instance import Vector
from lingjing.scene.terrain import Terrain

NOSE_M = 0.45
"""Distance from the trunk's centre to the place of the next step, metres (chosen)."""

_BRAKE_MPS2 = 1.2
"""Deceleration of a dog that stops, m/s^2 (chosen)."""

_REACTION_S = 0.1
"""Time until a dog begins to stop, seconds (chosen: the interval of checks)."""

_EDGE_M, _STEP_M, _DROP_M = 0.3, 0.07, 0.5
"""Distance of samples ahead, least height of a step and least depth of a drop, metres (chosen)."""

_ABOVE_M = 0.5
"""Height above the trunk from which the ground is searched, metres (chosen)."""

_FILM_M = 0.02
"""Depth of water that does not count, metres (chosen)."""

_STANDING_M = 0.5
"""Height of the trunk over the ground below which a dog in water stands in it, metres (chosen)."""


@dataclass(frozen=True, slots=True)
class _WayAhead:
    """The result of a look ahead."""

    hazard: str
    """`water`, `drop` or empty."""
    step_m: float
    """Distance of the last step before the hazard, metres; minus infinity if there is none."""


class GroundAhead:
    """The ground around the dogs of one model."""

    def __init__(self, terrain: Terrain, model: DogModel) -> None:
        self._terrain = terrain
        self._model = model

    def look(self, here: DogState, yaw: float, remaining_m: float) -> _WayAhead:
        """Return the hazards and steps that a dog would reach along `yaw` before it could stop.

        `remaining_m` is the rest of the walk. A sample is taken every 0.3 m.
        """
        speed = max(here.ahead_mps, 0.0)
        far = NOSE_M + min(speed * speed / (2.0 * _BRAKE_MPS2) + _REACTION_S * speed, max(remaining_m, 0.0))
        count = math.ceil((far - NOSE_M) / _EDGE_M) + 1
        x, y, z = here.position
        east, north = math.cos(yaw), math.sin(yaw)
        before, step_m = math.inf, -math.inf
        for ahead in (far - _EDGE_M * (count - number) for number in range(count + 1)):
            point = x + ahead * east, y + ahead * north
            floor = self._model.floor(*point, z + _ABOVE_M)
            if floor.z == math.inf:  # inside a solid, which is a wall and not a drop
                break
            if self._wet(*point, floor):
                return _WayAhead("water", step_m)
            if math.isfinite(before):
                if before - floor.z > _DROP_M:
                    return _WayAhead("drop", step_m)
                if abs(before - floor.z) > _STEP_M:
                    step_m = ahead
            before = floor.z
        return _WayAhead("", step_m)

    def height(self, at: Vector) -> float:
        """Return the height of a trunk over the surface below it, metres."""
        return at[2] - self._model.floor(*at).z

    def drowns(self, at: Vector) -> bool:
        """Return whether a dog at a place is in the water."""
        x, y, z = at
        if self._terrain.water_level(x, y) is None:
            return False
        floor = self._model.floor(x, y, z)
        return z < floor.z + _STANDING_M and self._wet(x, y, floor)

    def _wet(self, x: float, y: float, floor: Floor) -> bool:
        # The map has no ground below water, but the model's plane continues there.
        level = self._terrain.water_level(x, y)
        return level is not None and (floor.bare or floor.z < level + _FILM_M)
