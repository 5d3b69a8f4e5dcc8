"""Where a dog can set its feet: what lies ahead of it, over the shapes that it can touch and the waters of the city."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lingjing.engines.quadruped.dog_model import DogModel, DogState
from lingjing.engines.quadruped.physics import Floor
from lingjing.mission.instance import Vector
from lingjing.scene.terrain import Terrain

NOSE_M = 0.45
"""From the trunk's centre to where the next step lands."""

_BRAKE_MPS2 = 1.2
_REACTION_S = 0.1
_EDGE_M, _STEP_M, _DROP_M = 0.3, 0.07, 0.5
_ABOVE_M = 0.5
_FILM_M = 0.02
_STANDING_M = 0.5


@dataclass(frozen=True, slots=True)
class WayAhead:
    """What is ahead: a `hazard` (`water`, `drop` or nothing) and how far away the last step before it is, metres (minus
    infinity: there is none)."""

    hazard: str
    step_m: float


class GroundAhead:
    """Looks at the ground around the dogs of one model."""

    def __init__(self, terrain: Terrain, model: DogModel) -> None:
        self._terrain = terrain
        self._model = model

    def look(self, here: DogState, yaw: float, remaining_m: float) -> WayAhead:
        """What a dog that goes on along `yaw` comes to before it could stop: every edge of the way there."""
        speed = max(here.ahead_mps, 0.0)
        far = NOSE_M + min(speed * speed / (2.0 * _BRAKE_MPS2) + _REACTION_S * speed, max(remaining_m, 0.0))
        count = math.ceil((far - NOSE_M) / _EDGE_M) + 1
        x, y, z = here.position
        east, north = math.cos(yaw), math.sin(yaw)
        before, step_m = math.inf, -math.inf
        for ahead in (far - _EDGE_M * (count - number) for number in range(count + 1)):
            point = x + ahead * east, y + ahead * north
            floor = self._model.floor(*point, z + _ABOVE_M)
            if floor.z == math.inf:  # inside of something that stands there: a wall, not a hole
                break
            if self._wet(*point, floor):
                return WayAhead("water", step_m)
            if math.isfinite(before):
                if before - floor.z > _DROP_M:
                    return WayAhead("drop", step_m)
                if abs(before - floor.z) > _STEP_M:
                    step_m = ahead
            before = floor.z
        return WayAhead("", step_m)

    def height(self, at: Vector) -> float:
        """How high a trunk is over what is below it."""
        return at[2] - self._model.floor(*at).z

    def drowns(self, at: Vector) -> bool:
        """Whether a dog at a place is in the water."""
        x, y, z = at
        if self._terrain.water_level(x, y) is None:
            return False
        floor = self._model.floor(x, y, z)
        return z < floor.z + _STANDING_M and self._wet(x, y, floor)

    def _wet(self, x: float, y: float, floor: Floor) -> bool:
        # Where the map has water it has no ground, although the model's plane goes on below.
        level = self._terrain.water_level(x, y)
        return level is not None and (floor.bare or floor.z < level + _FILM_M)
