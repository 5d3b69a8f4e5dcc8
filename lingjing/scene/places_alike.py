"""Alternative starting places of the same kind as an entity's own: on the same roof or ground, afloat, or in the
air."""

from __future__ import annotations

from lingjing.mission.footprint import footprint, stands
from lingjing.mission.instance import Entity
from lingjing.mission.kinds import engine_kind
from lingjing.scene.footing import STEP_M, Footing
from lingjing.scene.terrain import REACH_M, Terrain

LEVEL_M = 0.3
"""Greatest difference in elevation of surfaces that count as level, metres: a kerb, the slope of a deck (chosen)."""

_SIDES = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))
"""The centre and four points around it at which a body's support is compared, in units of its radius."""


class PlacesAlike:
    """The places where an entity could begin in the same way, at its elevation.

    On a roof, a deck or the water the level of the surface decides. On the ground, obstacles decide too.
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
        self._flies = engine_kind(entity.engine).floor is not None

    def suits(self, x: float, y: float) -> bool:
        """True if the body can begin at a place in the same way as at its own."""
        around = [(x + self._radius_m * east, y + self._radius_m * north) for east, north in _SIDES]
        if self._floats:
            return all(self._footing.is_water(*point) for point in around) and not self._is_hit(x, y)
        if not self._stands:
            return not self._is_hit(x, y) and all(self._support(*point) < self._low for point in around)
        level = all(abs(self._support(*point) - self._surface_m) <= LEVEL_M for point in around)
        if self._is_raised:
            return level and not self._is_hit(x, y)
        return level and self._footing.is_clear(x, y, self._radius_m)

    def rise_m(self) -> float:
        """Rise that puts the body onto its surface, metres; 0 if it begins there or in the air.

        A body that is sunk into the top of a structure is raised. An aircraft that stands close above its surface is
        lowered, because it would otherwise hang in the air without flying.
        """
        is_sunk = self._stands and self._above_ground and self._z < self._surface_m
        hangs = self._stands and self._flies and self._low > self._surface_m
        return self._surface_m - self._low if is_sunk or hangs else 0.0

    def is_inside_structure(self) -> bool:
        """True if the body flies or floats and touches a structure at its own place."""
        return (self._floats or not self._stands) and self._is_hit(self._x, self._y)

    def _support(self, x: float, y: float) -> float:
        return self._terrain.support(x, y, self._high)

    def _is_hit(self, x: float, y: float) -> bool:
        low = max(self._low, self._surface_m + LEVEL_M) if self._stands else self._low
        return bool(self._terrain.solids_at(x, y, low, max(low, self._high), self._radius_m))
