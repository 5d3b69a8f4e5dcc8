"""The way that is being walked: kept as long as it is open, so that two ways of equal length are not taken in turns."""

from __future__ import annotations

import math
from itertools import pairwise

from lingjing_agents.heuristic.walker.occupancy import Place, WalkMap

SAME_GOAL_M = 2.0


class Way:
    """Corners on the way to one goal after another over one map; a corner nearer than `passed_m` has been passed."""

    def __init__(self, known: WalkMap, passed_m: float) -> None:
        self._map, self._passed_m = known, passed_m
        self._corners: tuple[Place, ...] = ()
        self._goal: Place | None = None
        self._forgot_for: Place | None = None

    def ahead(self, here: Place, goal: Place, reach_m: float) -> tuple[Place, ...]:
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

    def _kept(self, here: Place) -> tuple[Place, ...]:
        """What is left of the corners: those up to the last that has been passed are behind."""
        passed = [index for index, corner in enumerate(self._corners) if math.dist(corner, here) <= self._passed_m]
        return self._corners[passed[-1] + 1 :] if passed else self._corners

    def _open(self, here: Place, corners: tuple[Place, ...]) -> bool:
        return all(self._map.clear(a, b) for a, b in pairwise((here, *corners)))
