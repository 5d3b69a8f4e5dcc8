"""`public_values`: every value of a compiled mission that agents or engines may learn and that is no condition.

Conditions (success, failure, rules, unlocks, permits, constraints, stages, events), the deadlines of stages, the values
that events set and the requirements of draws belong to `lingjing.mission.conditions.leaks`. Hidden properties, regions
and params are no public values. Every other expression of `lingjing.mission.model` is listed here: a test compares the
list with the fields of the model.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from types import NoneType
from typing import NamedTuple, Protocol

from lingjing.mission import expression as ex
from lingjing.mission import model


class References(NamedTuple):
    """Expressions that name entities. Such a name tells nothing about the entity, but its index is public."""

    to: tuple[ex.Expr, ...]


class PublicValue(NamedTuple):
    """A value of a declaration that agents may learn."""

    name: str
    """The declaration that has it."""
    sink: str
    """The value, as the object of "reaches"."""
    value: ex.Expr | References | None


CONSTANT = (NoneType, ex.Number, ex.Flag, ex.Text, ex.Symbol)
"""Values that read nothing; None stands for one that a declaration leaves out."""


def public_values(mission: model.Mission) -> Iterator[PublicValue]:
    """Every public value that may read others, declaration by declaration, and some that are `CONSTANT`."""
    for param in mission.parameters:
        if not param.hidden:
            yield PublicValue(param.name, f"the param `{param.name}`", param.default)
        yield PublicValue(param.name, f"the bounds of `{param.name}`", param.bounds)
    for region in mission.regions:
        if not region.hidden:
            yield PublicValue(region.name, f"the region `{region.name}`", region.shape)
    for group in mission.groups:
        yield from _of_group(group)
    for agent in mission.agents:
        yield from _of_agent(agent)
    yield from _settings(mission)
    yield from _orders(mission)
    for event in mission.events:
        yield from _of_event(event)
    yield from _guards(mission)


# -- private


class _Guarded(Protocol):
    """A declaration that may have a condition over settings."""

    @property
    def when(self) -> model.Guard | None: ...


def _all(name: str, sink: str, values: Iterable[ex.Expr | None]) -> Iterator[PublicValue]:
    return (PublicValue(name, sink, value) for value in values if not isinstance(value, CONSTANT))


def _of_group(group: model.Group) -> Iterator[PublicValue]:
    name = group.name
    for prop in group.properties:
        if not prop.hidden:
            yield PublicValue(name, f"`{name}.{prop.plain}`", prop.value)
    if not group.hides_count:
        yield PublicValue(name, f"the number of `{name}`", group.count)
    for camera in group.cameras:
        yield from _all(name, f"the camera `{camera.name}` of `{name}`", (camera.width, camera.height, camera.hfov))
    for verb in group.verbs:
        for each in verb.arguments:
            for bound in (each.minimum, each.maximum, each.default):
                if not isinstance(bound, CONSTANT):  # skips constants, which nearly all bounds are
                    yield PublicValue(name, f"the bound of the action `{verb.name}`", bound)
    for spec in group.interactions:
        yield from _all(name, f"the interaction `{spec.name}` of `{name}`", (spec.within, spec.lasting, spec.aboard))
    if group.behaviour is not None:
        moves = group.behaviour
        yield from _all(name, f"the motion of `{name}`", (moves.speed, moves.distance))
        if moves.of is not None:
            yield PublicValue(name, f"the motion of `{name}`", References((moves.of,)))


def _of_agent(agent: model.Agent) -> Iterator[PublicValue]:
    name = agent.name
    yield PublicValue(name, f"the number of `{name}`", agent.count)
    yield PublicValue(name, f"the bodies of `{name}`", References(agent.controls))
    yield PublicValue(name, f"the observations of `{name}`", References(tuple(each.source for each in agent.observes)))
    if agent.budget is not None:
        spent = agent.budget
        yield from _all(name, f"the `budget` of `{name}`", (spent.tokens, spent.money, spent.messages))


def _settings(mission: model.Mission) -> Iterator[PublicValue]:
    limits, radio = mission.budget, mission.comms
    yield from _all("scene", "the scene", (prop.value for prop in mission.scene.options))
    yield from _all("clock", "the clock", (mission.clock.tick, mission.clock.sync))
    spent = (limits.tokens, limits.money, limits.messages)
    yield from _all("budget", "the budget", (limits.ticks, limits.policy, limits.engine, limits.capture, *spent))
    yield from _all("weather", "the weather", (prop.value for prop in mission.weather))
    yield from _all("comms", "the radio", (radio.delay, radio.payload, radio.range, radio.loss))
    for grid in mission.grids:
        yield from _all(grid.name, f"the grid `{grid.name}`", (grid.rows, grid.columns, grid.overlap, grid.seen))
    for sweep in mission.sweeps:
        yield from _all(sweep.name, f"the sweep `{sweep.name}`", (each for row in sweep.values for each in row))
    for tier in mission.tiers:
        yield from _all(mission.name, f"the tier {tier.level}", (setting.value for setting in tier.settings))


def _orders(mission: model.Mission) -> Iterator[PublicValue]:
    """Values of authorities, reveals, limits, permits, stages, constraints and inspections."""
    for authority in mission.authorities:
        sink = f"the authority of `{authority.role}`"
        yield PublicValue(authority.role, sink, References((authority.resource,)))
    for reveal in mission.reveals:
        yield PublicValue(reveal.role, f"the picture for `{reveal.role}`", References((reveal.entity,)))
    for limit in (*mission.limits, *(each for stage in mission.stages for each in stage.limits)):
        yield PublicValue(limit.name, f"the limit `{limit.name}`", limit.most)
        counted = tuple(each.resource for each in limit.counts if each.resource is not None)
        yield PublicValue(limit.name, f"the commands that `{limit.name}` counts", References(counted))
    for permit in mission.permits:
        yield PublicValue(permit.verb, "the command of a permit", References((permit.resource,)))
    for stage in mission.stages:
        yield from _all(stage.name, f"the stage `{stage.name}`", (stage.ticks, stage.weight))
    for constraint in mission.constraints:
        yield PublicValue(constraint.name, f"the penalty of `{constraint.name}`", constraint.penalty)
    for item in mission.inspections:
        sink = f"the inspection `{item.name}`"
        yield from _all(item.name, sink, (item.within, item.pictured))
        ends = () if item.destination is None else (item.destination,)
        yield PublicValue(item.name, sink, References((item.asset, *item.by, *ends)))


def _of_event(event: model.EventDeclaration) -> Iterator[PublicValue]:
    yield PublicValue(event.name, f"the time of the event `{event.name}`", event.at)
    yield PublicValue(event.name, f"the pause of the event `{event.name}`", event.pause)
    sink = f"the event `{event.name}`"
    for change in event.changes:
        yield from _all(event.name, sink, (*(prop.value for prop in change.weather), change.loss, change.range))
        if change.entity is not None:
            yield PublicValue(event.name, sink, References((change.entity,)))


def _guards(mission: model.Mission) -> Iterator[PublicValue]:
    """Conditions over settings, with which a declaration exists or a line replaces another one."""
    declared: tuple[Iterable[_Guarded], ...] = (
        mission.groups, mission.agents, *(agent.observes for agent in mission.agents), mission.authorities,
        mission.messages, mission.rules, mission.stages, *(stage.limits for stage in mission.stages),
        mission.relations, mission.limits, mission.constraints, mission.inspections, mission.events, mission.sweeps,
        *(group.alternatives for group in mission.groups),
        *(camera.alternatives for group in mission.groups for camera in group.cameras),
        mission.scene.alternatives, mission.weather_alternatives,
    )  # fmt: skip
    guards = (each.when for several in declared for each in several)
    conditions = (guard.condition for guard in guards if guard is not None)
    yield from _all(mission.name, "a declaration's condition", conditions)
    plain = (*mission.scene.alternatives, *mission.weather_alternatives)
    yield from _all(
        mission.name, "the scene or the weather", (prop.value for each in plain for prop in each.properties)
    )
    for group in mission.groups:
        for other in group.alternatives:
            shown = (prop.value for prop in other.properties if not prop.hidden)
            yield from _all(group.name, f"a line with `when` of `{group.name}`", shown)
