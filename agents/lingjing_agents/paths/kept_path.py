"""The way that is being walked: kept as long as it is open, so that two ways of equal length are not taken in turns."""

from __future__ import annotations

import math
from itertools import pairwise

from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.paths.obstacle_grid import ObstacleGrid

SAME_GOAL_M = 2.0


class KeptPath:
    """Corners on the way to one goal after another over one map; a corner nearer than `passed_m` has been passed."""

    def __init__(self, known: ObstacleGrid, passed_m: float) -> None:
        self._map, self._passed_m = known, passed_m
        self._corners: tuple[GroundPoint, ...] = ()
        self._goal: GroundPoint | None = None
        self._forgot_for: GroundPoint | None = None

    def ahead(self, here: GroundPoint, goal: GroundPoint, reach_m: float) -> tuple[GroundPoint, ...]:
        """The corners ahead to within `reach_m` of `goal`; empty if it is reached or no way is known. Where everything
        is closed the map forgets once for each goal: what stood there may have gone."""
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
        """What is left of the corners: those up to the last that has been passed are behind."""
        passed = [index for index, corner in enumerate(self._corners) if math.dist(corner, here) <= self._passed_m]
        return self._corners[passed[-1] + 1 :] if passed else self._corners

    def _open(self, here: GroundPoint, corners: tuple[GroundPoint, ...]) -> bool:
        return all(self._map.clear(a, b) for a, b in pairwise((here, *corners)))
