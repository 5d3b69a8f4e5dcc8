"""Approaches: the commands that bring a body to a stop, by its kind of motion."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

from lingjing.plugins.policy import Action, Entity, Resource
from lingjing_agents.capability import speed, straight_to
from lingjing_agents.ground_plane import GroundPoint, between
from lingjing_agents.oracle.aircraft import AircraftControl
from lingjing_agents.oracle.detours import next_place
from lingjing_agents.oracle.dogs import DogPath
from lingjing_agents.oracle.privileged_state import InstanceIndex, PrivilegedState
from lingjing_agents.oracle.stops import Stop
from lingjing_agents.oracle.vehicles import SHORT, mover

_SURE = 0.8
"""The share of a stop's radius within which a body counts as arrived. Chosen: bodies roll on, and targets drift."""
_IN_REGION_M = 3.0
"""Distance in metres from the place in a region within which a body counts as arrived. Chosen."""
_TRIES = 2
"""Approaches to a stop after which places around it are tried. Chosen."""
_RING_M = 14.0
"""Radius in metres of these places. Chosen."""


class Approach(ABC):
    """Brings one body to stops."""

    @abstractmethod
    def towards(self, truth: PrivilegedState, stop: Stop) -> Action | None:
        """Return the next command, or None on arrival and while the mission forbids the motion."""


class PlaneApproach(Approach):
    """A road vehicle or a vessel."""

    def __init__(self, resource: Resource) -> None:
        self._resource, self._verb = resource, mover(resource)
        self._straight = bool(straight_to(resource, "x", "y"))
        self._sent: dict[str, int] = {}

    def towards(self, truth: PrivilegedState, stop: Stop) -> Action | None:
        """Return the command to the stop: for a vessel to its rim, for a vehicle by the roads."""
        here, name = truth.place(self._resource.id), stop.target or f"{stop.place}"
        near_m = stop.within_m if self._sent.get(name, 0) and stop.within_m else _near_m(stop)
        if math.dist(here, stop.place) <= near_m or truth.forbidden(self._resource.id, self._verb):
            return None
        self._sent[name] = self._sent.get(name, 0) + 1
        x, y = self._rim(truth, here, stop) if self._straight else self._by_road(truth, stop, self._sent[name])
        return Action(verb=self._verb, arguments={"x": x, "y": y}, resource=self._resource.id)

    def _rim(self, truth: PrivilegedState, here: GroundPoint, stop: Stop) -> GroundPoint:
        """Return the nearest place that is well within the radius, where a drifting target will be."""
        far_m = math.dist(here, stop.place)
        east, north = truth.drift(stop.target) if stop.target else (0.0, 0.0)
        lead_s = max(0.0, far_m - SHORT * stop.within_m) / speed(self._resource)
        x, y = between(stop.place, here, min(1.0, SHORT * stop.within_m / far_m))
        return x + lead_s * east, y + lead_s * north

    def _by_road(self, truth: PrivilegedState, stop: Stop, tries: int) -> GroundPoint:
        """Return the stop or a place on the way around a block; places around the stop after failed approaches."""
        place = next_place(truth, self._resource.id, stop.place)
        if place != stop.place or tries <= _TRIES:
            return place
        angle = math.radians(60.0 * tries)
        return place[0] + _RING_M * math.sin(angle), place[1] + _RING_M * math.cos(angle)


class FlightApproach(Approach):
    """An aircraft. Its elevation over the place is that of `AircraftControl`."""

    def __init__(self, aircraft: AircraftControl) -> None:
        self._aircraft = aircraft

    def towards(self, truth: PrivilegedState, stop: Stop) -> Action | None:
        """Return the next command of the flight."""
        body = self._aircraft.body
        verb = straight_to(body, "x", "y", "z")
        if math.dist(truth.place(body.id), stop.place) <= _near_m(stop) or truth.forbidden(body.id, verb):
            return None
        state = truth.state(stop.target)
        ground_m = state.position[2] if state is not None else truth.brief.water_level_m
        return self._aircraft.to(truth, *stop.place, self._aircraft.altitude(truth, stop.place, ground_m))


class DogApproach(Approach):
    """A walking body, along paths around obstacles."""

    def __init__(self, dog: Entity, plan: InstanceIndex) -> None:
        self._path = DogPath(dog, plan)

    def towards(self, truth: PrivilegedState, stop: Stop) -> Action | None:
        """Return the next step or turn."""
        dog = self._path.dog.id
        if truth.forbidden(dog, "forward"):
            return None
        task = stop.task
        step = self._path.step(truth, task) if task else self._path.step_to(truth, stop.place, _near_m(stop))
        return self._path.command(truth, step) if step is not None else None


def _near_m(stop: Stop) -> float:
    return _SURE * stop.within_m if stop.within_m > 0.0 else _IN_REGION_M
