"""Who is hit: a vehicle of the mission that touches another vehicle or a foreign body, reported once a contact.

Vehicles among themselves are SUMO's to say. Who walks is compared with the vehicle's own rectangle, because SUMO also
reports those stand-ins that only herald where somebody is going to be.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping

from lingjing.engines.road.foreign_bodies import ForeignBody, entity_of
from lingjing.engines.road.simulation import Simulation
from lingjing.engines.road.vehicle import Vehicle

Emit = Callable[[str, str, float], None]
"""Called with the mover, what it hit, and the speed of the collision in metres per second."""

_APART_S = 2.0
_MOVING_MPS = 0.2
_LONGEST_M = 20.0


class Contacts:
    """Remembers which pairs are in touch, so that each contact is told once."""

    def __init__(self, sim: Simulation, emit: Emit) -> None:
        self._sim = sim
        self._emit = emit
        self._touching: dict[tuple[str, str], float] = {}

    def step(
        self, vehicles: Mapping[str, Vehicle], bodies: Iterable[ForeignBody], ahead_s: float, time_s: float
    ) -> None:
        """After a step: `ahead_s` since the bodies' states were taken, simulation time `time_s`."""
        near = list(bodies)
        for collision in self._sim.simulation.getCollisions():
            if collision.victim in self._sim.person.getIDList():
                continue
            pair = (entity_of(collision.collider), entity_of(collision.victim))
            speed = abs(collision.colliderSpeed - collision.victimSpeed)
            if speed > _MOVING_MPS and (pair[0] in vehicles or pair[1] in vehicles):
                self._touch(pair, speed, time_s)
        for vehicle in vehicles.values() if near else ():
            self._against(vehicle, near, ahead_s, time_s)

    def _against(self, vehicle: Vehicle, bodies: list[ForeignBody], ahead_s: float, time_s: float) -> None:
        speed = vehicle.speed_mps
        if speed < _MOVING_MPS:
            return
        state = vehicle.state(0.0)
        angle = math.radians(state.heading_deg)
        for body in bodies:
            if body.drives:
                continue
            x, y = body.at(ahead_s)
            east, north = x - state.position[0], y - state.position[1]
            if abs(east) > _LONGEST_M or abs(north) > _LONGEST_M:
                continue
            along = east * math.sin(angle) + north * math.cos(angle)
            across = east * math.cos(angle) - north * math.sin(angle)
            reach = min(body.size.length_m, body.size.width_m) / 2.0
            if abs(along) < vehicle.size.length_m / 2.0 + reach and abs(across) < vehicle.size.width_m / 2.0 + reach:
                self._touch((vehicle.id, body.state.id), speed, time_s)

    def _touch(self, pair: tuple[str, str], speed_mps: float, time_s: float) -> None:
        last = max(self._touching.get(pair, -math.inf), self._touching.get((pair[1], pair[0]), -math.inf))
        self._touching[pair] = time_s
        if time_s - last > _APART_S:
            self._emit(*pair, speed_mps)
