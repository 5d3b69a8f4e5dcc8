"""The vehicles: how large and heavy they are, how they accelerate, and what a load does to them.

A loaded vehicle pulls away more slowly, because the same force moves more mass: a = a0 · m / (m + load). Its top speed
falls by 15 % at its full payload and in proportion below it, a stand-in for power and handling.
"""

from __future__ import annotations

from dataclasses import dataclass

from lingjing.engines.road.simulation import Simulation
from lingjing.mission.appearance import MEASURES
from lingjing.mission.instance import Entity
from lingjing.plugins.bodies import entity_size
from lingjing.scene.sizes import SIZES, Size

FULL_LOAD_SLOWDOWN = 0.15
SPEED_MPS = 13.9
"""Top speed of a vehicle that says none: 50 km/h."""


@dataclass(frozen=True, slots=True)
class VehicleKind:
    """A kind of vehicle: outer dimensions, kerb mass in kg, acceleration and comfortable braking in m/s²."""

    name: str
    size: Size
    mass_kg: float
    accel_mps2: float
    decel_mps2: float = 4.5
    top_mps: float = 22.0

    def acceleration(self, load_kg: float) -> float:
        """What it accelerates with under a load."""
        return self.accel_mps2 * self.mass_kg / (self.mass_kg + max(load_kg, 0.0))


VEHICLE_KINDS = {
    kind.name: kind
    for kind in (
        VehicleKind("car", SIZES["car"], 1500.0, 2.6),
        VehicleKind("delivery_van", SIZES["delivery_van"], 2200.0, 2.2),
        VehicleKind("truck", SIZES["truck"], 12000.0, 1.3, 4.0),
        VehicleKind("bus", SIZES["bus"], 12500.0, 1.2, 4.0),
        VehicleKind("motorcycle", SIZES["motorcycle"], 220.0, 4.0, 6.0),
    )
}
"""The background traffic. Masses of common models; accelerations after SUMO's defaults of the vehicle classes."""


def vehicle_kind(entity: Entity) -> VehicleKind:
    """The vehicle that an entity is, by its measures, mass, acceleration and braking; a car where it declares none."""
    usual = VEHICLE_KINDS["car"]
    measured = any(entity.number(f"{name}_m") for name in MEASURES)
    return VehicleKind(
        entity.type,
        entity_size(entity) if measured else usual.size,
        entity.number("mass_kg") or usual.mass_kg,
        entity.number("acceleration_mps2") or usual.accel_mps2,
        entity.number("braking_mps2") or usual.decel_mps2,
    )


def top_speed(speed_mps: float, load_kg: float, payload_kg: float) -> float:
    """Top speed under a load, metres per second."""
    share = min(max(load_kg / payload_kg, 0.0), 1.0) if payload_kg > 0.0 else 0.0
    return speed_mps * (1.0 - FULL_LOAD_SLOWDOWN * share)


def declare(
    sim: Simulation, name: str, kind: VehicleKind, top_mps: float, *, blue_light: bool = False, reaction_s: float = 0.0
) -> None:
    """Make a vehicle type of the simulation. Blue lights drive through red and make others give way.

    `reaction_s` is how long a driver goes on before deciding anew; 0: decides in each step.
    """
    types, size = sim.vehicletype, kind.size
    types.copy("DEFAULT_VEHTYPE", name)
    types.setLength(name, size.length_m)
    types.setWidth(name, size.width_m)
    types.setHeight(name, size.height_m)
    types.setMass(name, kind.mass_kg)
    types.setAccel(name, kind.accel_mps2)
    types.setDecel(name, kind.decel_mps2)
    types.setEmergencyDecel(name, 8.0)
    types.setMaxSpeed(name, top_mps)
    if reaction_s > 0.0:
        types.setActionStepLength(name, reaction_s)
    if blue_light:
        types.setVehicleClass(name, "emergency")
        types.setParameter(name, "has.bluelight.device", "true")
