"""What a mission asks for, read from its rules: the interactions that success needs and the reports that are matched.

A policy that may see the rules (a privileged one, an analysis) finds here what is left to do without knowing any
mission: `required_tasks` are the interactions that success mentions, directly or through the rules it calls.
"""

from __future__ import annotations

from collections.abc import Sequence

from msgspec.structs import asdict

from lingjing.mission.certain import Knowledge, known, truth
from lingjing.mission.expression import Binary, Expr, Quantified, Ref, conjuncts
from lingjing.mission.feasibility.condition_needs import mentions
from lingjing.mission.feasibility.needs import Performed
from lingjing.mission.feasibility.outline import Outline, of_instance
from lingjing.mission.instance import Entity, Instance, InteractionSpec, Region
from lingjing.mission.intervals import exactly
from lingjing.mission.values import Value


class Task(InteractionSpec, frozen=True, kw_only=True):
    """An interaction with one target: its id, and which assets may do it."""

    target: str
    actors: tuple[str, ...]


def possible(entity: Entity, instance: Instance) -> tuple[Task, ...]:
    """Every interaction that an entity's type declares."""
    return tuple(
        Task(**asdict(one), target=entity.id, actors=tuple(actor.id for actor in instance.actors(one)))
        for one in entity.interactions
    )


def required_tasks(instance: Instance) -> tuple[Task, ...]:
    """The interactions whose task events success needs, in the order of declaration of their targets.

    Where a rule chooses among the members of a group by what is declared of them, only those it means are there.
    """
    outline = of_instance(instance)
    wanted = {(leaf.interaction, leaf.target.id) for leaf in _interactions(instance.success, outline) if leaf.target}
    passed = _passed_over(outline)
    return tuple(
        task
        for entity in instance.entities
        if entity.role == "target"
        for task in possible(entity, instance)
        if (task.name, entity.group) in wanted or (task.name, entity.id) in wanted
        if (task.name, entity.id) not in passed
    )


def matching_members(
    condition: Expr, variable: str, members: Sequence[Entity], instance: Instance
) -> tuple[Entity, ...]:
    """Those of `members` that the condition can be true of with `variable` bound to them.

    All of them, if it can be true of none as things are declared: then something must make it true first.
    """
    declarations = _Declarations(instance)
    left = tuple(one for one in members if truth(condition, {variable: one}, declarations) is not False)
    return left or tuple(members)


def declared(entity: Entity, field: str) -> float | None:
    """A declared number of an entity; None for a state that interactions change."""
    spec = entity.state_of(field)
    if spec is not None and any(spec.name in (one.takes, one.gives, one.source) for one in entity.interactions):
        return None
    return entity.number(field)


class _Declarations(Knowledge):
    """What can be said beforehand: declared numbers. Whatever depends on the run (places, task events, reports, what
    interactions take and give) is not known."""

    def __init__(self, instance: Instance) -> None:
        self._settings = instance.settings
        self._groups: dict[str, list[Entity]] = {}
        for entity in instance.entities:
            self._groups.setdefault(entity.group, []).append(entity)

    def name(self, ref: Ref) -> Value:
        """A setting, or the one entity of a group."""
        if ref.kind == "param":
            return known(self._settings.get(ref.name))
        members = self._groups.get(ref.name, [])
        return members[0] if len(members) == 1 else tuple(members) or None

    def field(self, value: Value, name: str) -> Value:
        """A declared number of an entity."""
        amount = declared(value, name) if isinstance(value, Entity) else None
        return None if amount is None else exactly(amount)

    def members(self, domain: str) -> Sequence[Value] | None:
        """The entities of a group."""
        return self._groups.get(domain)


def _interactions(condition: Expr, outline: Outline, domains: dict[str, str] | None = None) -> tuple[Performed, ...]:
    """The interactions that a condition mentions, itself and through the rules it calls."""
    return tuple(leaf for leaf in mentions(condition, outline, domains) if isinstance(leaf, Performed))


def _passed_over(outline: Outline) -> frozenset[tuple[str, str]]:
    """(Interaction, target) pairs that the rule about their task event can never be true of."""
    instance = outline.instance
    found: set[tuple[str, str]] = set()
    for rule in instance.rules:
        domains = {parameter.name: parameter.domain for parameter in rule.parameters}
        own = [leaf for leaf in _interactions(rule.condition, outline, domains) if leaf.target and not leaf.at]
        for parameter in rule.parameters:
            members = [body.entity for body in outline.groups.get(parameter.domain, ())]
            done = {leaf.interaction for leaf in own if leaf.target and leaf.target.id == parameter.domain}
            kept = matching_members(rule.condition, parameter.name, members, instance) if done else members
            found.update((kind, entity.id) for kind in done for entity in members if entity not in kept)
    return frozenset(found)


def entry_regions(task: Task, instance: Instance) -> tuple[Region, ...]:
    """The regions that a body must be in before a task can be done: what unlocks it says so."""
    conditions = [unlock.condition for unlock in instance.unlocks if unlock.interaction == task.name]
    bodies = [one.body if isinstance(one, Quantified) else one for one in conditions]
    names = {
        part.right.name
        for body in bodies
        for part in conjuncts(body)
        if isinstance(part, Binary) and part.operator == "in"
        if isinstance(part.right, Ref) and part.right.kind == "region"
    }
    return tuple(region for region in instance.regions if region.name in names)


def reported(instance: Instance) -> dict[str, str]:
    """The message kind with which members of a group are reported, by group: what rules match with true boxes."""
    kinds = {message.kind for message in instance.messages}
    found: dict[str, str] = {}
    for rule in instance.rules:
        if rule.matching:
            domains = [parameter.domain for parameter in rule.parameters]
            kind = next((domain for domain in domains if domain in kinds), "")
            found.update({domain: kind for domain in domains if kind and domain != kind})
    return found


__all__ = ["Task", "declared", "matching_members", "possible", "reported", "required_tasks"]
