"""Payload: what must be brought does not fit into all the trips that there is time for.

A vehicle carries at most `capacity_kg` or `payload_kg`; a target lacks its state `demand_kg`; warehouses have an
interaction that `gives`, and may hold no more than their `stock_kg`. An order of 250 kg that does not fit into a
vehicle of 200 kg is split among loads: it is infeasible only if all vehicles together cannot make the trips.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from lingjing.mission.feasibility.limits import TimeLimit
from lingjing.mission.feasibility.needs import Leaf, Supply
from lingjing.mission.feasibility.outline import Body, Outline
from lingjing.mission.feasibility.proof import Proof, both, exceeds, spelled
from lingjing.mission.feasibility.spread import gap

CAPACITIES = ("capacity_kg", "payload_kg")
STOCK = "stock_kg"
LOAD = "load_kg"
_MASS = "_kg"
_TRIPS_MOST = 1e6


def refute_supplies(leaves: Sequence[Leaf], limit: TimeLimit, outline: Outline) -> list[Proof]:
    """Why the supplies that are all needed cannot be brought within the limit, if that is so."""
    supplies = list(
        {leaf.target.id: leaf for leaf in leaves if isinstance(leaf, Supply) and leaf.name.endswith(_MASS)}.values()
    )
    carriers = [(body, load) for body in outline.bodies.values() if (load := capacity_kg(body)) is not None]
    if not supplies or not carriers:
        return []
    return [proof for proof in (_stock(supplies, outline), _trips(supplies, carriers, limit, outline)) if proof]


def capacity_kg(body: Body) -> float | None:
    """What the vehicle carries at most; None if it is no carrier."""
    known = [body.bounds(name)[1] for name in CAPACITIES if name in body.entity.properties]
    return max(known) if known and body.entity.role == "asset" else None


def _stock(supplies: list[Supply], outline: Outline) -> Proof | None:
    """More demanded than all warehouses hold."""
    stores = [body for body in outline.bodies.values() if STOCK in body.entity.properties]
    held = sum(body.bounds(STOCK)[1] for body in stores)
    loaded = sum(body.bounds(LOAD)[1] for body in outline.bodies.values() if LOAD in body.entity.properties)
    wanted = sum(supply.amount for supply in supplies)
    if not stores or math.isinf(loaded) or not exceeds(wanted, held + loaded):
        return None
    return Proof(
        "LJ0604",
        supplies[0].at,
        f"{len(supplies)} orders ask for {spelled(wanted)} kg, the warehouses hold {spelled(held + loaded)} kg",
        "raise the stock or lower the demand",
        tuple((path, "a warehouse") for path in dict.fromkeys(body.path for body in stores)),
    )


def _trips(
    supplies: list[Supply], carriers: list[tuple[Body, float]], limit: TimeLimit, outline: Outline
) -> Proof | None:
    """More than all vehicles can bring if none ever rests: a first load, and another for each way there and back."""
    wanted = sum(supply.amount for supply in supplies)
    way = _shortest_way(supplies, outline)
    trips = {body.id: _loads(body, way, limit) for body, _ in carriers}
    brought = sum(load * trips[body.id] for body, load in carriers if load > 0)
    if not exceeds(wanted, brought):
        return None
    needed, most = both(wanted, brought)
    loads = sum(trips.values())
    return Proof(
        "LJ0604",
        supplies[0].at,
        f"{len(supplies)} orders ask for {needed} kg, but {len(carriers)} vehicles bring {most} kg at most: "
        f"{spelled(loads)} loads, with at least {spelled(round(2 * way, 3))} m there and back between two "
        f"of a vehicle's, {limit.words}",
        "raise the budget, add vehicles or capacity, or lower the demand",
        ((limit.at, "the budget"), (carriers[0][0].path, "a vehicle"), (supplies[0].target.path, "an order")),
    )


def _loads(body: Body, way: float, limit: TimeLimit) -> float:
    metres = body.speed_mps * min(limit.seconds, body.flight_s)
    if way <= 0 or math.isinf(metres):
        return _TRIPS_MOST
    return 1.0 + math.floor(metres / (2.0 * way) + 1e-9)


def _shortest_way(supplies: list[Supply], outline: Outline) -> float:
    """Metres between being able to load and being able to unload, at least; 0 if it is not known where that is."""
    stores = [body for body in outline.bodies.values() if _gives(body)]
    stops = [supply.target for supply in supplies]
    if not stores or not all(_reach(body) < math.inf for body in (*stores, *stops)):
        return 0.0
    if any(body.speed_mps > 0 for body in (*stores, *stops)):
        return 0.0
    return min(max(0.0, gap(a.where, b.where) - _reach(a) - _reach(b)) for a in stores for b in stops)


def _gives(body: Body) -> bool:
    """Whether a vehicle may be loaded there: it has a stock, or an interaction that `gives`."""
    return STOCK in body.entity.properties or any(one.gives for one in body.entity.interactions)


def _reach(body: Body) -> float:
    """From how far it can be loaded or unloaded; infinity if it does not say."""
    return max((one.within_m for one in body.entity.interactions), default=math.inf)
