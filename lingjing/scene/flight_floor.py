"""The lowest points to which flying bodies may be sent, for the engine that flies them and for the kernel that clips.

The clearance of each engine stands in its `kinds.json` (`lingjing.mission.kinds_format.FlightFloorKind`). The engine
refuses what lies lower, and the kernel clips commands to the same points, so no clipped command is refused for its
height.
"""

from __future__ import annotations

import math

from lingjing.mission.instance import Entity
from lingjing.mission.kinds_format import FlightFloorKind
from lingjing.scene.sizes import entity_size, sunk_m
from lingjing.scene.terrain import REACH_M, Terrain

SWING_M = 0.3
"""So far below its lowest point a body that hovers there may be by its controller's swing, in strong wind too (chosen;
the multirotor's stays within 0.3 m of its goal in 10 m/s)."""


class FlightFloor:
    """The lowest points of one body over one city.

    `clearance_m`: metres that its position keeps over what lies below. `margin_m`: metres around its position in which
    things count as below it.
    """

    def __init__(self, terrain: Terrain, entity: Entity, rule: FlightFloorKind) -> None:
        size = entity_size(entity)
        self.clearance_m = max(rule.clearance_m, sunk_m(entity) + SWING_M)
        self.margin_m = min(max(rule.clearance_m, size.length_m / 2.0, size.width_m / 2.0), REACH_M)
        self._terrain = terrain
        self._over_everything = rule.over == "everything"

    def at(self, x: float, y: float) -> float:
        """Elevation of the lowest destination at a place, metres."""
        if self._over_everything:
            return self._terrain.support(x, y, math.inf) + self.clearance_m
        return self._terrain.surface(x, y) + self.clearance_m

    def beneath(self, x: float, y: float, z: float) -> float:
        """Elevation of the lowest point that a straight descent from (x, y, z) reaches, metres: over the roof, the
        deck or the ground that is met first."""
        met = self._terrain.support(x, y, z, self.margin_m) + self.clearance_m
        return max(met, self.at(x, y))
