"""The path that is being walked. It is kept as long as it is open, so that equally long paths do not alternate."""

from __future__ import annotations

import math
from itertools import pairwise

from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.paths.obstacle_grid import ObstacleGrid

SAME_GOAL_M = 2.0
"""Distance in metres between two goals below which they count as the same. Chosen."""


class KeptPath:
    """Corners on the path to successive goals over one map. A corner nearer than `passed_m` metres has been passed."""

    def __init__(self, known: ObstacleGrid, passed_m: float) -> None:
        self._map, self._passed_m = known, passed_m
        self._corners: tuple[GroundPoint, ...] = ()
        self._goal: GroundPoint | None = None
        self._forgot_for: GroundPoint | None = None

    def ahead(self, here: GroundPoint, goal: GroundPoint, reach_m: float) -> tuple[GroundPoint, ...]:
        """Return the remaining corners to within `reach_m` of `goal`; empty on arrival or without a known path.

        If no path is open, the map is cleared once for each goal: the obstacles may have moved.
        """
        if math.dist(here, goal) <= reach_m:
            return ()
        kept = self._kept(here)
        if kept and self._goal is not None and math.dist(self._goal, goal) < SAME_GOAL_M and self._open(here, kept):
            self._corners = kept
            return kept
        self._corners, self._goal = self._map.route(here, goal, reach_m=reach_m), goal
        if not self._corners and self._forgot_for != goal:
            self._forgot_for = goal
            self._map.forget()
            self._corners = self._map.route(here, goal, reach_m=reach_m)
        return self._corners

    def _kept(self, here: GroundPoint) -> tuple[GroundPoint, ...]:
        """Return the corners after the last one that has been passed."""
        passed = [index for index, corner in enumerate(self._corners) if math.dist(corner, here) <= self._passed_m]
        return self._corners[passed[-1] + 1 :] if passed else self._corners

    def _open(self, here: GroundPoint, corners: tuple[GroundPoint, ...]) -> bool:
        return all(self._map.clear(a, b) for a, b in pairwise((here, *corners)))
