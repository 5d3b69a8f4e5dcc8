"""Roaming: the way of a target that flees, wanders or follows by itself.

A body looks at the others at the beginning of a macro-step and moves in short straight steps. Where a step is barred it
turns aside, to the same side until the straight way is free again, and stays where every turn is barred.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from lingjing.mission.geometry2d import Polygon, bounds, contains
from lingjing.mission.instance import BehaviourSpec, Vector
from lingjing.mission.seeding import Stream
from lingjing.scene.city import City
from lingjing.scene.footing import Footing
from lingjing.scene.terrain import Terrain

Place = tuple[float, float]
"""East and north, metres."""
FreePlaces = Callable[[float, float], bool]
"""True for a place that a body can stand on."""

MARGIN_M = 0.5
"""Distance that a body on foot keeps from obstacles, metres (chosen)."""
_TURN_DEG = 22.5
"""Difference of the courses that are tried at an obstacle, degrees (chosen)."""
_FLIGHT_DEG = 90.0
"""Largest turn of a fleeing body at an obstacle, degrees: it never runs towards its pursuer."""
_DETOUR_DEG = 135.0
"""Largest turn of other bodies at an obstacle, degrees (chosen)."""
_TRIES = 20
"""Most draws of one way point (chosen)."""
_REST_S = 10.0
"""Time that a wanderer rests if no way point was found, seconds (chosen)."""
_PAUSE_S = 1.0
"""Time that a wanderer pauses where no step is possible, seconds (chosen)."""
_ARRIVED_M = 1e-6
"""Distance at which a place is reached, metres: more than rounding errors."""
_DETOUR = 2.0
"""A wanderer gives a way point up after the time in which it could have gone this many times as far (chosen)."""


class Roaming:
    """The way of one target. Its draws come from a stream of its own."""

    def __init__(self, behaviour: BehaviourSpec, is_free: FreePlaces, region: Polygon, stream: Stream) -> None:
        self._behaviour = behaviour
        self._is_free = is_free
        self._region = region
        self._stream = stream
        self._side = 1.0
        self._others: tuple[Place, ...] = ()
        self._way_point: Place | None = None
        self._patience_s = 0.0
        self.velocity: Place = (0.0, 0.0)
        """Velocity over the last step, m/s."""

    def look(self, places: Mapping[str, Vector]) -> None:
        """Take over the places of the present bodies, by id."""
        self._others = tuple(places[name][:2] for name in self._behaviour.of if name in places)

    def halt(self) -> None:
        """Stand still."""
        self.velocity = (0.0, 0.0)

    def step(self, x: float, y: float, seconds: float) -> Place:
        """The place after a step of `seconds` from a place."""
        self._patience_s -= seconds
        goal = self._goal(x, y)
        reach = 0.0 if goal is None else min(self._behaviour.speed_mps * seconds, goal[2])
        place = None if goal is None or reach <= 0.0 else self._next(x, y, (goal[0], goal[1]), reach)
        if place is None:
            self.velocity = (0.0, 0.0)
            if self._way_point is not None:
                self._way_point, self._patience_s = None, _PAUSE_S
            return x, y
        self.velocity = ((place[0] - x) / seconds, (place[1] - y) / seconds)
        return place

    # -- private

    def _goal(self, x: float, y: float) -> tuple[float, float, float] | None:
        """The direction as a unit vector, and the length of the way, metres; None to stay."""
        if self._behaviour.kind == "wander":
            return self._wandering(x, y)
        if not self._others:
            return None
        near = min(self._others, key=lambda place: math.dist(place, (x, y)))
        apart = math.dist(near, (x, y))
        if self._behaviour.kind == "follow":
            left = apart - self._behaviour.distance_m
            return ((near[0] - x) / apart, (near[1] - y) / apart, left) if left > _ARRIVED_M else None
        if apart >= self._behaviour.distance_m:
            return None
        return ((x - near[0]) / apart, (y - near[1]) / apart, math.inf) if apart > 0.0 else (0.0, 1.0, math.inf)

    def _wandering(self, x: float, y: float) -> tuple[float, float, float] | None:
        if self._way_point is None and self._patience_s > 0.0:
            return None
        if self._way_point is None or self._patience_s <= 0.0 or math.dist(self._way_point, (x, y)) <= _ARRIVED_M:
            self._way_point = self._drawn_way_point()
            if self._way_point is None:
                self._patience_s = _REST_S
                return None
            self._patience_s = _REST_S + _DETOUR * math.dist(self._way_point, (x, y)) / self._behaviour.speed_mps
        left = math.dist(self._way_point, (x, y))
        return ((self._way_point[0] - x) / left, (self._way_point[1] - y) / left, left) if left > 0.0 else None

    def _drawn_way_point(self) -> Place | None:
        west, south, east, north = bounds(self._region)
        for _ in range(_TRIES):
            place = self._stream.uniform(west, east), self._stream.uniform(south, north)
            if contains(self._region, *place) and self._is_free(*place):
                return place
        return None

    def _next(self, x: float, y: float, course: Place, reach: float) -> Place | None:
        """The next place on a course or, at an obstacle, beside it; None if every turn is barred."""
        most_deg = _FLIGHT_DEG if self._behaviour.kind == "flee" else _DETOUR_DEG
        for side in (self._side, -self._side):
            for turn in range(round(most_deg / _TURN_DEG) + 1):
                angle = math.radians(side * turn * _TURN_DEG)
                east = course[0] * math.cos(angle) + course[1] * math.sin(angle)
                north = course[1] * math.cos(angle) - course[0] * math.sin(angle)
                place = x + reach * east, y + reach * north
                if self._may_enter(place, (x, y)):
                    self._side = side
                    return place
        return None

    def _may_enter(self, place: Place, before: Place) -> bool:
        """True for a free place. A wanderer that has reached its region stays in it."""
        kept = self._behaviour.kind == "wander" and contains(self._region, *before)
        return (not kept or contains(self._region, *place)) and self._is_free(*place)


class GroundPlaces:
    """The places of a city that a body on foot can stand on, and their elevations."""

    def __init__(self, city: City, terrain: Terrain) -> None:
        self._footing = Footing(city)
        self._terrain = terrain

    def is_free(self, x: float, y: float) -> bool:
        """True for a place in the city, on dry ground and away from obstacles."""
        return self._terrain.holds(x, y) and self._footing.is_clear(x, y, MARGIN_M)

    def is_free_road(self, x: float, y: float) -> bool:
        """True for a free place on a road."""
        return self._footing.is_road(x, y) and self.is_free(x, y)

    def height(self, x: float, y: float) -> float:
        """Elevation of the ground at a place."""
        return self._footing.height(x, y)
