"""Places where a body can begin as it does at its own: on the same roof or ground, afloat, or in the air."""

from __future__ import annotations

from lingjing.mission.footprint import footprint, stands
from lingjing.mission.instance import Entity
from lingjing.mission.kinds import engine_kind
from lingjing.scene.footing import STEP_M, Footing
from lingjing.scene.terrain import REACH_M, Terrain

LEVEL_M = 0.3
"""Surfaces whose elevations differ by no more than this are one: a kerb, a deck's slope."""

_SIDES = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))


class PlacesAlike:
    """The places that are like that of one entity, at its elevation.

    A place on a roof, a deck or the water is raised: there the level decides, and on the ground also what stands on it.
    """

    def __init__(self, entity: Entity, terrain: Terrain, footing: Footing) -> None:
        room = footprint(entity)
        self._terrain = terrain
        self._footing = footing
        self._x, self._y, self._z = entity.position
        self._low, self._high = (self._z, self._z) if room is None else (room.low, room.high)
        self._radius_m = 0.0 if room is None else min(max(room.half_length, room.half_width), REACH_M)
        self._surface_m = self._support(*entity.position[:2])
        self._above_ground = self._surface_m > self._terrain.surface(*entity.position[:2]) + STEP_M
        self._is_raised = self._above_ground or footing.is_water(*entity.position[:2])
        self._stands = stands(entity, self._surface_m)
        self._floats = engine_kind(entity.engine).stands_on == "water"

    def suits(self, x: float, y: float) -> bool:
        """True if the body can begin at a place as it does at its own."""
        around = [(x + self._radius_m * east, y + self._radius_m * north) for east, north in _SIDES]
        if self._floats:
            return all(self._footing.is_water(*point) for point in around) and not self._is_hit(x, y)
        if not self._stands:
            return not self._is_hit(x, y) and all(self._support(*point) < self._low for point in around)
        level = all(abs(self._support(*point) - self._surface_m) <= LEVEL_M for point in around)
        if self._is_raised:
            return level and not self._is_hit(x, y)
        return level and self._footing.is_clear(x, y, self._radius_m)

    def raised_m(self) -> float:
        """How far the body must rise to stand on a structure into whose top its position is sunk; 0 else."""
        is_sunk = self._stands and self._above_ground and self._z < self._surface_m
        return self._surface_m - self._low if is_sunk else 0.0

    def is_inside_structure(self) -> bool:
        """True if the body flies or floats and touches a structure at its own place."""
        return (self._floats or not self._stands) and self._is_hit(self._x, self._y)

    def _support(self, x: float, y: float) -> float:
        return self._terrain.support(x, y, self._high)

    def _is_hit(self, x: float, y: float) -> bool:
        low = max(self._low, self._surface_m + LEVEL_M) if self._stands else self._low
        return bool(self._terrain.solids_at(x, y, low, max(low, self._high), self._radius_m))
