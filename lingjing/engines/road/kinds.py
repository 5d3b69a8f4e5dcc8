"""Kinds of vehicles: dimensions, masses, accelerations and the effect of a load.

A loaded vehicle accelerates less, because the same force moves more mass: a = a0 · m / (m + load). Its top speed falls
by 15 % at full payload and in proportion below it, as an approximation of power and handling.
"""

from __future__ import annotations

from dataclasses import dataclass

from lingjing.engines.road.simulation import Simulation
from lingjing.mission.appearance import MEASURES
from lingjing.mission.instance import Entity
from lingjing.plugins.bodies import entity_size
from lingjing.scene.sizes import SIZES, Size

FULL_LOAD_SLOWDOWN = 0.15
"""Reduction of the top speed at full payload, as a share (chosen)."""

SPEED_MPS = 13.9
"""Top speed of an entity without the property `speed_mps`, m/s: 50 km/h."""

EMERGENCY_MPS2 = 8.0
"""Hardest braking on a dry road, m/s^2: a friction of 0.8."""

TAU_S = 1.0
"""Time headway of drivers on a dry road, seconds: SUMO's default."""


@dataclass(frozen=True, slots=True)
class _VehicleKind:
    """A kind of vehicle."""

    name: str
    """Name."""
    size: Size
    """Outer dimensions."""
    mass_kg: float
    """Kerb mass, kg."""
    accel_mps2: float
    """Acceleration without load, m/s^2."""
    decel_mps2: float = 4.5
    """Comfortable braking, m/s^2."""
    top_mps: float = 22.0
    """Top speed in background traffic, m/s."""

    def acceleration(self, load_kg: float) -> float:
        """Return the acceleration under a load, m/s^2."""
        return self.accel_mps2 * self.mass_kg / (self.mass_kg + max(load_kg, 0.0))


VEHICLE_KINDS = {
    kind.name: kind
    for kind in (
        _VehicleKind("car", SIZES["car"], 1500.0, 2.6),
        _VehicleKind("delivery_van", SIZES["delivery_van"], 2200.0, 2.2),
        _VehicleKind("truck", SIZES["truck"], 12000.0, 1.3, 4.0),
        _VehicleKind("bus", SIZES["bus"], 12500.0, 1.2, 4.0),
        _VehicleKind("motorcycle", SIZES["motorcycle"], 220.0, 4.0, 6.0),
        _VehicleKind("bicycle", SIZES["bicycle"], 90.0, 1.2, 3.0, 5.5),
    )
}
"""Kinds of background vehicles. Masses are those of common models; accelerations follow SUMO's vehicle classes."""


def vehicle_kind(entity: Entity) -> _VehicleKind:
    """Return the kind of an entity from its dimensions, mass, acceleration and braking; undeclared ones are a car's."""
    usual = VEHICLE_KINDS["car"]
    measured = any(entity.number(f"{name}_m") for name in MEASURES)
    return _VehicleKind(
        entity.type,
        entity_size(entity) if measured else usual.size,
        entity.number("mass_kg") or usual.mass_kg,
        entity.number("acceleration_mps2") or usual.accel_mps2,
        entity.number("braking_mps2") or usual.decel_mps2,
    )


def top_speed(speed_mps: float, load_kg: float, payload_kg: float) -> float:
    """Return the top speed under a load, m/s."""
    share = min(max(load_kg / payload_kg, 0.0), 1.0) if payload_kg > 0.0 else 0.0
    return speed_mps * (1.0 - FULL_LOAD_SLOWDOWN * share)


def declare(
    sim: Simulation, name: str, kind: _VehicleKind, top_mps: float, *, blue_light: bool = False, reaction_s: float = 0.0
) -> None:
    """Declare a vehicle type in SUMO.

    A vehicle with blue light drives through red lights and makes others give way. `reaction_s` is the time between two
    decisions of its driver; 0 means one in each step.
    """
    types, size = sim.vehicletype, kind.size
    types.copy("DEFAULT_VEHTYPE", name)
    types.setLength(name, size.length_m)
    types.setWidth(name, size.width_m)
    types.setHeight(name, size.height_m)
    types.setMass(name, kind.mass_kg)
    types.setAccel(name, kind.accel_mps2)
    types.setDecel(name, kind.decel_mps2)
    types.setEmergencyDecel(name, EMERGENCY_MPS2)
    types.setMaxSpeed(name, top_mps)
    if reaction_s > 0.0:
        types.setActionStepLength(name, reaction_s)
    if blue_light:
        types.setVehicleClass(name, "emergency")
        types.setParameter(name, "has.bluelight.device", "true")
