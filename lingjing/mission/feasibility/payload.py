"""Payload: the required goods exceed the stock, or exceed the capacity of all trips within the available time.

A target has a state that measures its demand (`demand`). Its interactions take goods out of a state of the actor
(`load`). An actor holds at most the limit up to which interactions load it (`payload`). The stock is the state that
these interactions load from. An order of 250 kg that does not fit into a vehicle of 200 kg is split into several loads:
it is infeasible only if all vehicles together cannot make the trips.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from lingjing.mission.conditions.needs import NeedLeaf, Supply
from lingjing.mission.conditions.outline import Body, Outline
from lingjing.mission.conditions.spread import gap
from lingjing.mission.feasibility.limits import TimeLimit
from lingjing.mission.feasibility.proof import Proof, both, exceeds, spelled
from lingjing.mission.instance import InteractionSpec
from lingjing.mission.units import field_named

_TRIPS_MOST = 1e6
"""Trips of a vehicle without a known minimum distance (chosen): more than any mission needs."""


class _Goods(NamedTuple):
    """One kind of goods with its demand, carriers and stores."""

    name: str
    unit: str
    supplies: list[Supply]
    carriers: dict[str, float]
    """Id of a carrier → the largest amount that it holds at once."""
    stores: list[tuple[Body, InteractionSpec]]
    """The bodies with an interaction that loads these goods."""


def refute_supplies(leaves: Sequence[NeedLeaf], limit: TimeLimit, outline: Outline) -> list[Proof]:
    """Proofs that mandatory supplies cannot be brought within the limit."""
    supplies = list({leaf.target.id: leaf for leaf in leaves if isinstance(leaf, Supply)}.values())
    proofs = []
    for goods in _kinds(supplies, outline):
        proofs += [proof for proof in (_stock(goods, outline), _trips(goods, limit, outline)) if proof]
    return proofs


def _kinds(supplies: list[Supply], outline: Outline) -> Iterator[_Goods]:
    """The kinds of goods of the supplies, with their carriers and stores."""
    named: dict[tuple[str, str], list[Supply]] = {}
    for supply in supplies:
        state = supply.target.entity.state_of(supply.name)
        lowering = [spec for spec in supply.target.entity.interactions if state is not None and spec.own == state.name]
        sources = {spec.source if spec.takes else "" for spec in lowering}
        if state is not None and len(sources) == 1 and all(sources):  # else the demand also falls without a delivery
            named.setdefault((sources.pop(), state.unit), []).append(supply)
    for (name, unit), wanted in named.items():
        stores = [(body, spec) for body in outline.bodies.values() for spec in body.entity.interactions]
        giving = [(body, spec) for body, spec in stores if spec.gives == name]
        carriers = {body.id: _most_held(body, name, giving, outline) for body in _carriers(wanted, name, outline)}
        if carriers:
            yield _Goods(name, unit, wanted, carriers, giving)


def _carriers(wanted: list[Supply], name: str, outline: Outline) -> Iterator[Body]:
    """The bodies that have the goods as a state and may hand them over to one of the targets."""
    interactions = [spec for supply in wanted for spec in supply.target.entity.interactions]
    able = {actor.id for spec in interactions for actor in outline.actors(spec)}
    for body in outline.bodies.values():
        if body.id in able and any(state.name == name for state in body.entity.state):
            yield body


def _most_held(body: Body, name: str, giving: list[tuple[Body, InteractionSpec]], outline: Outline) -> float:
    """The largest amount of the goods that the body can hold; infinity if it has no limit."""
    limits = [spec.up_to for _, spec in giving if body in outline.actors(spec)]
    fields = [field_named(limit, body.entity.properties) if limit else None for limit in limits]
    return max((math.inf if field is None else body.bounds(field)[1] for field in fields), default=0.0)


def _initially(body: Body, name: str) -> float:
    """Upper bound of the amount of the goods that the body has at the start."""
    return sum(max(body.bounds(state.field)[1], 0.0) for state in body.entity.state if state.name == name)


def _stock(goods: _Goods, outline: Outline) -> Proof | None:
    """A proof that the demand exceeds all stock."""
    held = {
        (body.id, spec.source): _initially(body, spec.source) if spec.source and goods.unit else math.inf
        for body, spec in goods.stores
    }
    stock = sum(held.values()) + sum(_initially(outline.bodies[name], goods.name) for name in goods.carriers)
    wanted = sum(supply.amount for supply in goods.supplies)
    if math.isinf(stock) or not exceeds(wanted, stock):
        return None
    holders = "the warehouses hold" if goods.stores else "there is no warehouse, and the vehicles hold"
    return Proof(
        "LJ0604",
        goods.supplies[0].at,
        f"{len(goods.supplies)} orders require {spelled(wanted)} {goods.unit}, and {holders} "
        f"{spelled(stock)} {goods.unit}",
        "raise the stock or lower the demand",
        tuple((path, "a warehouse") for path in dict.fromkeys(body.path for body, _ in goods.stores)),
    )


def _trips(goods: _Goods, limit: TimeLimit, outline: Outline) -> Proof | None:
    """A proof that the demand exceeds the deliveries of all vehicles without pauses: a first load, and another one for
    each return trip."""
    if not goods.stores:
        return None  # `_stock` compares the demand with the loads at the start
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
        f"{len(goods.supplies)} orders require {needed} {goods.unit}, but {len(bodies)} vehicles bring {most_brought} "
        f"{goods.unit} at most: "
        f"{spelled(loads)} loads, with a return trip of at least {spelled(round(2 * way, 3))} m between two loads of "
        f"a vehicle, {limit.words}",
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
    """Lower bound of the distance between loading and unloading, metres; 0 if a position is not known."""
    stores = [body for body, _ in goods.stores]
    stops = [supply.target for supply in goods.supplies]
    if any(body.speed_mps > 0 for body in (*stores, *stops)):
        return 0.0
    return min(max(0.0, gap(a.where, b.where) - _reach(a) - _reach(b)) for a in stores for b in stops)


def _reach(body: Body) -> float:
    """The largest distance for loading or unloading, metres."""
    return max(spec.within_m for spec in body.entity.interactions)
