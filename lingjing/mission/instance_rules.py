"""The rules of an instance: its events, counted budgets, permits, constraints, inspections, stages and revealed
pictures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.draws import draw
from lingjing.mission.evaluate import Scope, describe, evaluate, flag_of, members, number, whole
from lingjing.mission.instance import (
    Allowance,
    CountedSpec,
    EventSpec,
    InspectionSpec,
    LimitSpec,
    PermitSpec,
    RadioChange,
    RevealSpec,
    StateChange,
    Weather,
)
from lingjing.mission.instance_entities import at_path, holds

_TICK_UNITS = ("", "tick", "ticks")


def events(
    mission: model.Mission, scope: Scope, seed: int, weather: Callable[[tuple[model.Property, ...]], Weather]
) -> tuple[EventSpec, ...]:
    """The mission's events: first those at a time in order of time, then the others in order of declaration.

    `weather` evaluates properties.
    """
    active = [event for event in mission.events if holds(event.when, scope)]
    ticks = {event.name: _tick(mission, event, scope, seed) for event in active}
    timed = sorted((event for event in active if event.at is not None), key=lambda event: ticks[event.name] or 0)
    triggered = [event for event in active if event.at is None]
    specs = []
    for event in (*timed, *triggered):
        with at_path(f"{mission.name}/{event.name}"):
            changed: tuple[model.Property, ...] = ()
            for change in event.changes:
                changed = _changed(changed, change.weather)
            specs.append(
                EventSpec(
                    name=event.name,
                    tick=ticks[event.name],
                    condition=event.condition,
                    until=event.until,
                    pause_s=None if event.pause is None else _pause_s(event.pause, scope),
                    weather=weather(_changed(mission.weather, changed)) if changed else None,
                    weather_fields=tuple(prop.name for prop in changed),
                    appear=_entities(event, "appear", scope),
                    vanish=_entities(event, "vanish", scope),
                    changes=tuple(_changes(event, scope)),
                    closes=tuple(change.region for change in event.changes if change.kind == "close"),
                    reopens=tuple(change.region for change in event.changes if change.kind == "reopen"),
                    radio=tuple(_radio(change, scope) for change in event.changes if change.kind in ("comms", "jam")),
                )
            )
    return tuple(specs)


def dormant(mission: model.Mission, scope: Scope) -> frozenset[str]:
    """Ids of the entities that an event makes appear: they do not exist before."""
    active = (event for event in mission.events if holds(event.when, scope))
    return frozenset(entity for event in active for entity in _entities(event, "appear", scope))


def check_members(mission: model.Mission, scope: Scope) -> None:
    """Raise `MissionError` for a condition with a member that its group does not have here: it could never hold.

    Sides of an `or` are not checked, because the other side can test the group's size.
    """
    for name, condition in _conditions(mission, scope):
        for part in _needed(condition):
            if isinstance(part, ex.Index) and isinstance(part.base, ex.Ref) and part.base.name in scope.members:
                with at_path(f"{mission.name}/{name}"):
                    _check_member(name, part.base.name, part.index, scope)


def limits(mission: model.Mission, scope: Scope) -> tuple[LimitSpec, ...]:
    """The counted budgets of the mission, then those of its stages."""
    specs = [_limit(mission, limit, scope, "") for limit in mission.limits if holds(limit.when, scope)]
    for stage in mission.stages:
        specs += [_limit(mission, limit, scope, stage.name) for limit in stage.limits if holds(limit.when, scope)]
    return tuple(specs)


def permits(mission: model.Mission, scope: Scope) -> tuple[PermitSpec, ...]:
    """The conditions of commands, one for each resource."""
    return tuple(
        PermitSpec(resource=resource, verb=permit.verb, condition=permit.condition)
        for permit in mission.permits
        for resource in _named(mission, permit.resource, scope)
    )


def constraints(mission: model.Mission, scope: Scope) -> tuple[model.Constraint, ...]:
    """The constraints of this mode, with penalties as numbers."""
    active = []
    for item in mission.constraints:
        if holds(item.when, scope):
            with at_path(f"{mission.name}/{item.name}"):
                penalty = None if item.penalty is None else ex.Number(number(item.penalty, scope))
            active.append(msgspec.structs.replace(item, penalty=penalty, when=None))
    return tuple(active)


def inspections(mission: model.Mission, scope: Scope) -> tuple[InspectionSpec, ...]:
    """The inspections of this mode."""
    specs = []
    for item in mission.inspections:
        if holds(item.when, scope):
            with at_path(f"{mission.name}/{item.name}"):
                (asset,) = members(item.asset, scope)
                by = tuple(dict.fromkeys(inspector for expr in item.by for inspector in members(expr, scope)))
                within = number(item.within, scope)
                destination = "" if item.destination is None else members(item.destination, scope)[0]
            specs.append(
                InspectionSpec(
                    name=item.name,
                    asset=asset,
                    by=by,
                    within_m=within,
                    order=item.order,
                    replan=item.replan,
                    destination=destination,
                    pictured=item.pictured is not None and flag_of(item.pictured, scope),
                )
            )
    return tuple(specs)


def reveals(mission: model.Mission, scope: Scope) -> tuple[RevealSpec, ...]:
    """The pictures that roles receive."""
    return tuple(
        RevealSpec(what=item.what, entities=_named(mission, item.entity, scope), role=item.role)
        for item in mission.reveals
    )


def stages(mission: model.Mission, scope: Scope) -> tuple[model.Stage, ...]:
    """The stages with tick limits and weights as numbers. Their counted budgets are among `limits`."""
    evaluated = []
    for stage in mission.stages:
        if stage.ticks is not None or stage.weight is not None or stage.limits:
            with at_path(f"{mission.name}/{stage.name}"):
                ticks = None if stage.ticks is None else ex.Number(float(whole(stage.ticks, scope)))
                weight = None if stage.weight is None else ex.Number(number(stage.weight, scope))
            evaluated.append(msgspec.structs.replace(stage, ticks=ticks, weight=weight, limits=()))
        else:
            evaluated.append(stage)
    return tuple(evaluated)


def allowance(declaration: model.AllowanceDeclaration | None, scope: Scope) -> Allowance | None:
    """The limits of one agent; None if it has none."""
    if declaration is None:
        return None
    return Allowance(
        tokens=None if declaration.tokens is None else whole(declaration.tokens, scope),
        money_usd=None if declaration.money is None else number(declaration.money, scope),
        messages=None if declaration.messages is None else whole(declaration.messages, scope),
    )


def _conditions(mission: model.Mission, scope: Scope) -> Iterator[tuple[str, ex.Expr]]:
    """Every condition that is evaluated in a run, with the name of its declaration."""
    yield from ((rule.name, rule.condition) for rule in mission.rules)
    yield from ((unlock.interaction, unlock.condition) for unlock in mission.unlocks)
    yield from ((stage.name, stage.condition) for stage in mission.stages)
    yield from (("permit", permit.condition) for permit in mission.permits)
    yield from ((item.name, item.condition) for item in mission.constraints if holds(item.when, scope))
    for event in mission.events:
        if holds(event.when, scope):
            yield from (
                (event.name, condition) for condition in (event.condition, event.until) if condition is not None
            )
    yield ("success", mission.success)
    if mission.failure is not None:
        yield ("failure", mission.failure)


def _needed(condition: ex.Expr) -> list[ex.Expr]:
    """The parts of a condition outside the sides of an `or`, in reading order."""
    visited, stack = [], [condition]
    while stack:
        part = stack.pop()
        visited.append(part)
        if not (isinstance(part, ex.Binary) and part.operator == "or"):
            stack.extend(reversed(ex.children(part)))
    return visited


def _check_member(name: str, group: str, index: ex.Expr, scope: Scope) -> None:
    if any(not isinstance(leaf, ex.Number) and getattr(leaf, "kind", "") != "param" for leaf in ex.leaves(index)):
        return  # known only in a run
    position, most = number(index, scope), len(scope.members[group])
    if position not in range(1, most + 1):
        size = f"`{group}` has {most} {'member' if most == 1 else 'members'}"
        raise MissionError(
            f"`{name}` refers to `{group}[{position:g}]`, and {size}", hint="members are counted 1, 2, 3, …"
        )


def _pause_s(pause: ex.Expr, scope: Scope) -> float:
    seconds = number(pause, scope)
    if seconds <= 0:
        raise MissionError(f"a pause of {seconds:g} s", hint="an event that repeats needs a pause above 0 s")
    return seconds


def _radio(change: model.Change, scope: Scope) -> RadioChange:
    loss = None if change.loss is None else number(change.loss, scope)
    range_m = None if change.range is None else number(change.range, scope)
    return RadioChange(region=change.region, loss=loss, range_m=range_m)


def _changes(event: model.EventDeclaration, scope: Scope) -> Iterator[StateChange]:
    for change in event.changes:
        if change.kind == "change" and change.entity is not None and change.value is not None:
            for entity in _there(change.entity, scope):
                yield StateChange(entity=entity, field=change.field, value=change.value)


def _tick(mission: model.Mission, event: model.EventDeclaration, scope: Scope, seed: int) -> int | None:
    """The tick of an event at a time; None for one that a condition triggers."""
    if event.at is None:
        return None
    path = f"{mission.name}/{event.name}/at"
    with at_path(path):
        if isinstance(event.at, ex.Draw):
            value = draw(event.at, scope, seed=seed, path=path, count=1).values[0]
        else:
            value = evaluate(event.at, scope)
        if isinstance(value, bool) or not isinstance(value, float) or value < 0:
            raise MissionError(f"an event occurs at a time, not at {describe(value)}")
        return math.ceil(value / scope.tick_s - 1e-9) if in_seconds(event.at) else math.ceil(value - 1e-9)


def in_seconds(expr: ex.Expr) -> bool:
    """True if the time was written with a unit of time, according to the first number with a unit."""
    queue: list[ex.Expr] = [expr]
    while queue:
        part = queue.pop(0)
        if isinstance(part, ex.Number) and part.unit:
            return part.unit not in _TICK_UNITS
        if isinstance(part, ex.Draw | ex.Call):
            queue.extend(part.arguments)
        elif isinstance(part, ex.Binary):
            queue.extend((part.left, part.right))
        elif isinstance(part, ex.Sequence):
            queue.extend(part.items)
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
    """The members that an expression names; none if the group is too small in this instance."""
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
        if most < 1 and any(item.kind == "claims" for item in limit.counts):
            raise MissionError("a limit of 0 claims", hint="permit at least one claim, or leave the limit out")
        counts: list[CountedSpec] = []
        for item in limit.counts:
            if item.kind == "claims":
                counts.append(CountedSpec(kind="claims"))
            elif item.resource is None:
                counts.append(CountedSpec(kind="message", name=item.name))
            else:
                named = members(item.resource, scope)
                counts += [CountedSpec(kind="command", resource=resource, name=item.name) for resource in named]
    return LimitSpec(name=limit.name, most=most, counts=tuple(counts), stage=stage)


def _named(mission: model.Mission, expr: ex.Expr, scope: Scope) -> tuple[str, ...]:
    with at_path(mission.name):
        return members(expr, scope)
