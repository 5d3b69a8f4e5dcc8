"""Collisions of the mission's vehicles with other vehicles and with bodies of other engines, each reported once.

SUMO reports collisions between vehicles. A walking body is compared with the vehicle's own rectangle, because SUMO also
reports contacts with the stand-ins of its future positions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping

from lingjing.engines.road.foreign_bodies import ForeignBody, entity_of
from lingjing.engines.road.simulation import Simulation
from lingjing.engines.road.vehicle import Vehicle

Emit = Callable[[str, str, float], None]
"""Callback with the id of the mover, the id of what it hit, and the speed of the collision in m/s."""

_APART_S = 2.0
"""Time without contact after which a contact of the same pair is a new one, seconds (chosen)."""

_MOVING_MPS = 0.2
"""Speed below which a contact is no collision, m/s (chosen)."""

_LONGEST_M = 20.0
"""Distance along each axis beyond which no vehicle touches a body, metres: more than half the longest vehicle."""


class Contacts:
    """The contacts of an episode. It keeps the pairs in contact, so that each contact is reported once."""

    def __init__(self, sim: Simulation, emit: Emit, *, background: bool = False) -> None:
        """Create an empty set. With `background`, collisions of two vehicles of background traffic count too."""
        self._sim = sim
        self._background = background
        self._emit = emit
        self._touching: dict[tuple[str, str], float] = {}

    def step(
        self, vehicles: Mapping[str, Vehicle], bodies: Iterable[ForeignBody], ahead_s: float, time_s: float
    ) -> None:
        """Check for collisions after a step. `ahead_s` is the time since the bodies' mirrors, `time_s` the simulation
        time."""
        near = list(bodies)
        for collision in self._sim.simulation.getCollisions():
            if collision.victim in self._sim.person.getIDList():
                continue
            pair = (entity_of(collision.collider), entity_of(collision.victim))
            speed = abs(collision.colliderSpeed - collision.victimSpeed)
            counts = self._background or pair[0] in vehicles or pair[1] in vehicles
            if speed > _MOVING_MPS and counts:
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
