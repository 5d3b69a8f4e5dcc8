"""Payload: what must be brought does not fit into all the trips that there is time for.

A target lacks a state (`demand`) that its interactions take out of a state of the actor (`load`), the goods. What an
actor holds of them is the limit up to which interactions give them (`payload`), what there is of them the states that
these give from. An order of 250 kg that does not fit into a vehicle of 200 kg is split among loads: it is infeasible
only if all vehicles together cannot make the trips.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from lingjing.mission.feasibility.limits import TimeLimit
from lingjing.mission.feasibility.needs import NeedLeaf, Supply
from lingjing.mission.feasibility.outline import Body, Outline
from lingjing.mission.feasibility.proof import Proof, both, exceeds, spelled
from lingjing.mission.feasibility.spread import gap
from lingjing.mission.instance import InteractionSpec
from lingjing.mission.units import field_named

_TRIPS_MOST = 1e6


class _Goods(NamedTuple):
    """One kind of goods: who needs it, who carries it and how much of it at most at once, who gives it."""

    name: str
    unit: str
    supplies: list[Supply]
    carriers: dict[str, float]
    stores: list[tuple[Body, InteractionSpec]]


def refute_supplies(leaves: Sequence[NeedLeaf], limit: TimeLimit, outline: Outline) -> list[Proof]:
    """Why the supplies that are all needed cannot be brought within the limit, if that is so."""
    supplies = list({leaf.target.id: leaf for leaf in leaves if isinstance(leaf, Supply)}.values())
    proofs = []
    for goods in _kinds(supplies, outline):
        proofs += [proof for proof in (_stock(goods, outline), _trips(goods, limit, outline)) if proof]
    return proofs


def _kinds(supplies: list[Supply], outline: Outline) -> Iterator[_Goods]:
    """The goods that the supplies are, with those of their carriers whose limit is known."""
    named: dict[tuple[str, str], list[Supply]] = {}
    for supply in supplies:
        state = supply.target.entity.state_of(supply.name)
        lowering = [one for one in supply.target.entity.interactions if state is not None and one.own == state.name]
        sources = {one.source if one.takes else "" for one in lowering}
        if state is not None and len(sources) == 1 and all(sources):  # else something lowers it that nobody brings
            named.setdefault((sources.pop(), state.unit), []).append(supply)
    for (name, unit), wanted in named.items():
        stores = [(body, one) for body in outline.bodies.values() for one in body.entity.interactions]
        giving = [(body, one) for body, one in stores if one.gives == name]
        carriers = {body.id: _most_held(body, name, giving, outline) for body in _carriers(wanted, name, outline)}
        if carriers and giving:
            yield _Goods(name, unit, wanted, carriers, giving)


def _carriers(wanted: list[Supply], name: str, outline: Outline) -> Iterator[Body]:
    """The bodies that have the goods as a state and may hand them over to one of the targets."""
    able = {actor.id for supply in wanted for one in supply.target.entity.interactions for actor in outline.actors(one)}
    for body in outline.bodies.values():
        if body.id in able and any(one.name == name for one in body.entity.state):
            yield body


def _most_held(body: Body, name: str, giving: list[tuple[Body, InteractionSpec]], outline: Outline) -> float:
    """How much of the goods the body can be given until it is full; infinity if nothing bounds that."""
    limits = [one.up_to for _, one in giving if body in outline.actors(one)]
    fields = [field_named(limit, body.entity.properties) if limit else None for limit in limits]
    return max((math.inf if field is None else body.bounds(field)[1] for field in fields), default=0.0)


def _initially(body: Body, name: str) -> float:
    """How much of the goods the body begins with at most."""
    return sum(max(body.bounds(one.field)[1], 0.0) for one in body.entity.state if one.name == name)


def _stock(goods: _Goods, outline: Outline) -> Proof | None:
    """More demanded than all that gives the goods holds."""
    held = {
        (body.id, one.source): _initially(body, one.source) if one.source and goods.unit else math.inf
        for body, one in goods.stores
    }
    there = sum(held.values()) + sum(_initially(outline.bodies[name], goods.name) for name in goods.carriers)
    wanted = sum(supply.amount for supply in goods.supplies)
    if math.isinf(there) or not exceeds(wanted, there):
        return None
    return Proof(
        "LJ0604",
        goods.supplies[0].at,
        f"{len(goods.supplies)} orders ask for {spelled(wanted)} {goods.unit}, the warehouses hold "
        f"{spelled(there)} {goods.unit}",
        "raise the stock or lower the demand",
        tuple((path, "a warehouse") for path in dict.fromkeys(body.path for body, _ in goods.stores)),
    )


def _trips(goods: _Goods, limit: TimeLimit, outline: Outline) -> Proof | None:
    """More than all vehicles can bring if none ever rests: a first load, and another for each way there and back."""
    wanted = sum(supply.amount for supply in goods.supplies)
    way = _shortest_way(goods)
    bodies = {name: outline.bodies[name] for name in goods.carriers}
    trips = {name: _loads(body, way, limit) for name, body in bodies.items()}
    brought = sum(
        max(most, _initially(bodies[name], goods.name)) + (most * (trips[name] - 1.0) if most > 0.0 else 0.0)
        for name, most in goods.carriers.items()
    )
    if not exceeds(wanted, brought):
        return None
    needed, most_brought = both(wanted, brought)
    loads = sum(trips.values())
    return Proof(
        "LJ0604",
        goods.supplies[0].at,
        f"{len(goods.supplies)} orders ask for {needed} {goods.unit}, but {len(bodies)} vehicles bring {most_brought} "
        f"{goods.unit} at most: "
        f"{spelled(loads)} loads, with at least {spelled(round(2 * way, 3))} m there and back between two "
        f"of a vehicle's, {limit.words}",
        "raise the budget, add vehicles or capacity, or lower the demand",
        (
            (limit.at, "the budget"),
            (next(iter(bodies.values())).path, "a vehicle"),
            (goods.supplies[0].target.path, "an order"),
        ),
    )


def _loads(body: Body, way: float, limit: TimeLimit) -> float:
    metres = body.speed_mps * min(limit.seconds, body.flight_s)
    if way <= 0 or math.isinf(metres):
        return _TRIPS_MOST
    return 1.0 + math.floor(metres / (2.0 * way) + 1e-9)


def _shortest_way(goods: _Goods) -> float:
    """Metres between being able to load and being able to unload, at least; 0 if it is not known where that is."""
    stores = [body for body, _ in goods.stores]
    stops = [supply.target for supply in goods.supplies]
    if any(body.speed_mps > 0 for body in (*stores, *stops)):
        return 0.0
    return min(max(0.0, gap(a.where, b.where) - _reach(a) - _reach(b)) for a in stores for b in stops)


def _reach(body: Body) -> float:
    """From how far it can be loaded or unloaded."""
    return max(one.within_m for one in body.entity.interactions)
