"""The rules of an instance: its events, counted budgets, limits, permits, inspections and revealed pictures."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.draws import draw
from lingjing.mission.evaluate import Scope, describe, evaluate, members, number, whole
from lingjing.mission.instance import (
    Allowance,
    CountedSpec,
    EventSpec,
    InspectionSpec,
    LimitSpec,
    PermitSpec,
    RevealSpec,
    Weather,
)
from lingjing.mission.instance_entities import at_path, holds

_TICK_UNITS = ("", "tick", "ticks")


def events(
    mission: model.Mission, scope: Scope, seed: int, weather: Callable[[tuple[model.Property, ...]], Weather]
) -> tuple[EventSpec, ...]:
    """The mission's events in order of time. `weather` evaluates properties over those of the event before."""
    active = [event for event in mission.events if holds(event.when, scope)]
    timed = sorted(((_tick(mission, event, scope, seed), order) for order, event in enumerate(active)))
    now = mission.weather
    made = []
    for tick, order in timed:
        event = active[order]
        with at_path(f"{mission.name}/{event.name}"):
            changes = [change for change in event.changes if change.kind == "weather"]
            for change in changes:
                now = _changed(now, change.weather)
            made.append(
                EventSpec(
                    name=event.name,
                    tick=tick,
                    weather=weather(now) if changes else None,
                    appear=_entities(event, "appear", scope),
                    vanish=_entities(event, "vanish", scope),
                )
            )
    return tuple(made)


def dormant(mission: model.Mission, scope: Scope) -> frozenset[str]:
    """The entities that some event lets appear: they are not there before."""
    active = (event for event in mission.events if holds(event.when, scope))
    return frozenset(entity for event in active for entity in _entities(event, "appear", scope))


def check_members(mission: model.Mission, scope: Scope) -> None:
    """Raise `MissionError` for a condition that needs a member which its group lacks here: it could never hold.

    A side of an `or` may name one: the other side can say how many there are.
    """
    for name, condition in _conditions(mission, scope):
        for part in _needed(condition):
            if isinstance(part, ex.Index) and isinstance(part.base, ex.Ref) and part.base.name in scope.members:
                with at_path(f"{mission.name}/{name}"):
                    _check_member(name, part.base.name, part.index, scope)


def limits(mission: model.Mission, scope: Scope) -> tuple[LimitSpec, ...]:
    """The counted budgets of the mission, then those of its stages."""
    made = [_limit(mission, limit, scope, "") for limit in mission.limits if holds(limit.when, scope)]
    for stage in mission.stages:
        made += [_limit(mission, limit, scope, stage.name) for limit in stage.limits if holds(limit.when, scope)]
    return tuple(made)


def permits(mission: model.Mission, scope: Scope) -> tuple[PermitSpec, ...]:
    """What commands wait for, one for each resource."""
    return tuple(
        PermitSpec(resource=resource, verb=permit.verb, condition=permit.condition)
        for permit in mission.permits
        for resource in _named(mission, permit.resource, scope)
    )


def constraints(mission: model.Mission, scope: Scope) -> tuple[model.Constraint, ...]:
    """The constraints of this mode, their penalties as numbers."""
    made = []
    for item in mission.constraints:
        if holds(item.when, scope):
            with at_path(f"{mission.name}/{item.name}"):
                penalty = None if item.penalty is None else ex.Number(number(item.penalty, scope))
            made.append(msgspec.structs.replace(item, penalty=penalty, when=None))
    return tuple(made)


def inspections(mission: model.Mission, scope: Scope) -> tuple[InspectionSpec, ...]:
    """The inspections of this mode."""
    made = []
    for item in mission.inspections:
        if holds(item.when, scope):
            with at_path(f"{mission.name}/{item.name}"):
                (asset,) = members(item.asset, scope)
                by = tuple(dict.fromkeys(one for expr in item.by for one in members(expr, scope)))
                within = number(item.within, scope)
                destination = "" if item.destination is None else members(item.destination, scope)[0]
            made.append(
                InspectionSpec(
                    name=item.name,
                    asset=asset,
                    by=by,
                    within_m=within,
                    order=item.order,
                    replan=item.replan,
                    destination=destination,
                )
            )
    return tuple(made)


def reveals(mission: model.Mission, scope: Scope) -> tuple[RevealSpec, ...]:
    """Which role is shown pictures of what."""
    return tuple(
        RevealSpec(what=item.what, entities=_named(mission, item.entity, scope), role=item.role)
        for item in mission.reveals
    )


def stages(mission: model.Mission, scope: Scope) -> tuple[model.Stage, ...]:
    """The stages, their tick limits and weights as numbers; their counted budgets are among `limits`."""
    made = []
    for stage in mission.stages:
        if stage.ticks is not None or stage.weight is not None or stage.limits:
            with at_path(f"{mission.name}/{stage.name}"):
                ticks = None if stage.ticks is None else ex.Number(float(whole(stage.ticks, scope)))
                weight = None if stage.weight is None else ex.Number(number(stage.weight, scope))
            made.append(msgspec.structs.replace(stage, ticks=ticks, weight=weight, limits=()))
        else:
            made.append(stage)
    return tuple(made)


def allowance(given: model.AllowanceDeclaration | None, scope: Scope) -> Allowance | None:
    """What one agent may spend."""
    if given is None:
        return None
    return Allowance(
        tokens=None if given.tokens is None else whole(given.tokens, scope),
        money_usd=None if given.money is None else number(given.money, scope),
        messages=None if given.messages is None else whole(given.messages, scope),
    )


def _conditions(mission: model.Mission, scope: Scope) -> Iterator[tuple[str, ex.Expr]]:
    """Every condition that is judged while this instance runs, beside the name of what it belongs to."""
    yield from ((rule.name, rule.condition) for rule in mission.rules)
    yield from ((unlock.interaction, unlock.condition) for unlock in mission.unlocks)
    yield from ((stage.name, stage.condition) for stage in mission.stages)
    yield from (("permit", permit.condition) for permit in mission.permits)
    yield from ((item.name, item.condition) for item in mission.constraints if holds(item.when, scope))
    yield ("success", mission.success)
    if mission.failure is not None:
        yield ("failure", mission.failure)


def _needed(condition: ex.Expr) -> list[ex.Expr]:
    """The parts of a condition that are not on a side of an `or`, in the order they are read."""
    found, waiting = [], [condition]
    while waiting:
        part = waiting.pop()
        found.append(part)
        if not (isinstance(part, ex.Binary) and part.operator == "or"):
            waiting.extend(reversed(ex.children(part)))
    return found


def _check_member(name: str, group: str, index: ex.Expr, scope: Scope) -> None:
    if any(not isinstance(leaf, ex.Number) and getattr(leaf, "kind", "") != "param" for leaf in ex.leaves(index)):
        return  # known while the mission runs
    position, most = number(index, scope), len(scope.members[group])
    if position not in range(1, most + 1):
        there = f"`{group}` has {most} {'member' if most == 1 else 'members'}"
        raise MissionError(
            f"`{name}` asks for `{group}[{position:g}]`, and {there}", hint="members are counted 1, 2, 3, …"
        )


def _tick(mission: model.Mission, event: model.EventDeclaration, scope: Scope, seed: int) -> int:
    path = f"{mission.name}/{event.name}/at"
    with at_path(path):
        if isinstance(event.at, ex.Draw):
            value = draw(event.at, scope, seed=seed, path=path, count=1)[0]
        else:
            value = evaluate(event.at, scope)
        if isinstance(value, bool) or not isinstance(value, float) or value < 0:
            raise MissionError(f"an event happens at a time, this is {describe(value)}")
        return math.ceil(value / scope.tick_s - 1e-9) if _in_seconds(event.at) else math.ceil(value - 1e-9)


def _in_seconds(expr: ex.Expr) -> bool:
    """Whether the time was written with a unit of time: the first number that has a unit says so."""
    waiting: list[ex.Expr] = [expr]
    while waiting:
        part = waiting.pop(0)
        if isinstance(part, ex.Number) and part.unit:
            return part.unit not in _TICK_UNITS
        if isinstance(part, ex.Draw | ex.Call):
            waiting.extend(part.arguments)
        elif isinstance(part, ex.Binary):
            waiting.extend((part.left, part.right))
        elif isinstance(part, ex.Sequence):
            waiting.extend(part.items)
    return False


def _changed(old: tuple[model.Property, ...], new: tuple[model.Property, ...]) -> tuple[model.Property, ...]:
    names = {prop.name for prop in new}
    return (*(prop for prop in old if prop.name not in names), *new)


def _entities(event: model.EventDeclaration, kind: str, scope: Scope) -> tuple[str, ...]:
    return tuple(
        dict.fromkeys(
            entity
            for change in event.changes
            if change.kind == kind and change.entity is not None
            for entity in _there(change.entity, scope)
        )
    )


def _there(expr: ex.Expr, scope: Scope) -> tuple[str, ...]:
    """The members an expression names; none if the group is smaller in this instance."""
    if isinstance(expr, ex.Index):
        every = members(expr.base, scope)
        position = whole(expr.index, scope)
        return every[position - 1 : position]
    return members(expr, scope)


def _limit(mission: model.Mission, limit: model.Limit, scope: Scope, stage: str) -> LimitSpec:
    with at_path(f"{mission.name}/{limit.name}"):
        most = whole(limit.most, scope)
        if most < 0:
            raise MissionError(f"a limit of {most}", hint="a limit counts from 0")
        counts: list[CountedSpec] = []
        for item in limit.counts:
            if item.resource is None:
                counts.append(CountedSpec(kind="message", name=item.name))
            else:
                named = members(item.resource, scope)
                counts += [CountedSpec(kind="command", resource=one, name=item.name) for one in named]
    return LimitSpec(name=limit.name, most=most, counts=tuple(counts), stage=stage)


def _named(mission: model.Mission, expr: ex.Expr, scope: Scope) -> tuple[str, ...]:
    with at_path(mission.name):
        return members(expr, scope)
