"""Flight floor: the lowest points to which flying bodies may be sent.

The clearance of each engine is in its `kinds.json` (`lingjing.mission.kinds_format.FlightFloorKind`). The engine
rejects lower destinations. The kernel clips commands to the same points, so no clipped command is rejected for its
height.
"""

from __future__ import annotations

import math

from lingjing.mission.instance import Entity
from lingjing.mission.kinds_format import FlightFloorKind
from lingjing.scene.sizes import entity_size, sunk_m
from lingjing.scene.terrain import REACH_M, Terrain

SWING_M = 0.3
"""Overshoot of a hovering body below its goal, metres (chosen; the multirotor stays within 0.3 m of its goal in wind of
10 m/s)."""


class FlightFloor:
    """The lowest points of one body over one city."""

    def __init__(self, terrain: Terrain, entity: Entity, rule: FlightFloorKind) -> None:
        size = entity_size(entity)
        self.clearance_m = max(rule.clearance_m, sunk_m(entity) + SWING_M)
        """Distance of its position over the surface below, metres."""
        self.margin_m = min(max(rule.clearance_m, size.length_m / 2.0, size.width_m / 2.0), REACH_M)
        """Radius around its position in which surfaces count as below it, metres."""
        self._terrain = terrain
        self._over_everything = rule.over == "everything"

    def at(self, x: float, y: float) -> float:
        """Elevation of the lowest destination at a place, metres."""
        if self._over_everything:
            return self._terrain.support(x, y, math.inf) + self.clearance_m
        return self._terrain.surface(x, y) + self.clearance_m

    def beneath(self, x: float, y: float, z: float) -> float:
        """Elevation of the lowest point of a straight descent from (x, y, z), metres: over the first roof, deck or
        ground.
        """
        met = self._terrain.support(x, y, z, self.margin_m) + self.clearance_m
        return max(met, self.at(x, y))
