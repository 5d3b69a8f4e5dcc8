"""The tasks of a mission, from its rules: the interactions that success requires, and the reports that rules match.

A policy that may read the rules (a privileged one) or an analysis finds here the open tasks without knowledge of the
mission. `required_tasks` are the interactions in the success condition and in the rules that it calls.
"""

from __future__ import annotations

from collections.abc import Sequence

from msgspec.structs import asdict

from lingjing.mission.certain import truth
from lingjing.mission.conditions.condition_needs import mentions
from lingjing.mission.conditions.declared_values import DeclaredValues, declared
from lingjing.mission.conditions.needs import Performed
from lingjing.mission.conditions.outline import Outline, of_instance
from lingjing.mission.conditions.survey import survey_instance, survey_unlocks
from lingjing.mission.expression import Expr
from lingjing.mission.instance import Entity, Instance, InteractionSpec, Region


class Task(InteractionSpec, frozen=True, kw_only=True):
    """An interaction with one target."""

    target: str
    """The target's id."""
    actors: tuple[str, ...]
    """Ids of the assets that may perform it."""


def possible(entity: Entity, instance: Instance) -> tuple[Task, ...]:
    """Every interaction with an entity."""
    return tuple(
        Task(**asdict(spec), target=entity.id, actors=tuple(actor.id for actor in instance.actors(spec)))
        for spec in entity.interactions
    )


def required_tasks(instance: Instance) -> tuple[Task, ...]:
    """The interactions that success requires, in the order of declaration of their targets.

    If a rule selects members of a group by declared values, the others are left out.
    """
    outline = of_instance(instance)
    wanted = {(leaf.interaction, leaf.target.id) for leaf in _interactions(instance.success, outline) if leaf.target}
    excluded = _excluded(outline)
    return tuple(
        task
        for entity in instance.entities
        if entity.role == "target"
        for task in possible(entity, instance)
        if (task.name, entity.group) in wanted or (task.name, entity.id) in wanted
        if (task.name, entity.id) not in excluded
    )


def matching_members(
    condition: Expr, variable: str, members: Sequence[Entity], instance: Instance
) -> tuple[Entity, ...]:
    """The members for which the condition can be true, with `variable` bound to them.

    If it can be true for none of them with the declared values, the result is all members: an event must change them
    first.
    """
    declarations = DeclaredValues(instance)
    candidates = tuple(member for member in members if truth(condition, {variable: member}, declarations) is not False)
    return candidates or tuple(members)


def _interactions(condition: Expr, outline: Outline) -> tuple[Performed, ...]:
    """The interactions in a condition and in the rules that it calls."""
    return tuple(leaf for leaf in mentions(condition, outline) if isinstance(leaf, Performed))


def _excluded(outline: Outline) -> frozenset[tuple[str, str]]:
    """(interaction, target) pairs for which the rule about their event can never be true."""
    instance = outline.instance
    read = {rule.name: tuple(rule.reads("event")) for rule in survey_instance(instance).of_kind("rule")}
    pairs: set[tuple[str, str]] = set()
    for rule in instance.rules:
        for parameter in rule.parameters:
            members = [body.entity for body in outline.groups.get(parameter.domain, ())]
            names = {event.name for event in read[rule.name] if event.owner == parameter.domain}
            kept = matching_members(rule.condition, parameter.name, members, instance) if names else members
            pairs.update((kind, entity.id) for kind in names for entity in members if entity not in kept)
    return frozenset(pairs)


def entry_regions(task: Task, instance: Instance) -> tuple[Region, ...]:
    """The regions in which an actor must be before a task can be performed, according to its unlock conditions."""
    names = {
        quantity.name
        for unlock in survey_unlocks(instance, task.name).conditions
        for leaf in unlock.own
        if leaf.necessary and not leaf.negated
        for quantity in leaf.quantities
        if quantity.kind == "region"
    }
    return tuple(region for region in instance.regions if region.name in names)


def reported(instance: Instance) -> dict[str, str]:
    """The message kind that reports members of a group, by group, from rules that match reports with true boxes."""
    kind_of_group: dict[str, str] = {}
    for rule in survey_instance(instance).of_kind("rule"):
        kind = next((quantity.owner for quantity in rule.reads("message")), "")
        if kind:
            kind_of_group.update({box.owner: kind for box in rule.reads("true box")})
    return kind_of_group


__all__ = ["Task", "declared", "matching_members", "possible", "reported", "required_tasks"]
