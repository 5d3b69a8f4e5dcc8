"""Completion of targets.

A target is completed by an event of a rule that the success condition calls (`forall v in victim: rescued(v)`). If the
success condition calls no rule, the mission's last stage completes it.
"""

from __future__ import annotations

from collections.abc import Container

from lingjing.analysis.memo import cache_by_trace
from lingjing.mission.conditions.condition_needs import mentions
from lingjing.mission.conditions.needs import Supply
from lingjing.mission.conditions.outline import of_instance
from lingjing.mission.expression import Aggregate, Call, Quantified, Ref, parts
from lingjing.mission.instance import Instance
from lingjing.trace.reader import Trace
from lingjing.trace.records import BoundaryRecord

_MASS = "kg"


@cache_by_trace
def completion_ticks(trace: Trace) -> dict[str, int]:
    """Return the tick of completion of each completed target."""
    ticks: dict[str, int] = {}
    for record in trace.boundaries:
        for target in completed_at(trace.header.instance, record):
            ticks.setdefault(target, record.tick)
    return ticks


def required_target_groups(instance: Instance) -> frozenset[str]:
    """Return the groups that success requires something of: the domains of its rules, or else of the last stage."""
    rules = _success_rules(instance)
    if rules:
        return frozenset(
            parameter.domain for rule in instance.rules if rule.name in rules for parameter in rule.parameters
        )
    last = instance.stages[-1].domain if instance.stages else None
    return frozenset({last} if last is not None else ())


def sought_targets(instance: Instance) -> frozenset[str]:
    """Return the targets that the mission is about: those that success or a stage names, also in a rule that it calls,
    and those that a report can match. Rivals, which only resemble them, are none. If nothing is named, all are.
    """
    names = {stage.domain for stage in instance.stages}
    rules, called = {rule.name: rule for rule in instance.rules}, set()
    waiting = [instance.success, *(stage.condition for stage in instance.stages)]
    while waiting:
        for part in parts(waiting.pop()):
            if isinstance(part, Ref):
                names.add(part.name)
            elif isinstance(part, Quantified | Aggregate):
                names.add(part.domain)
            elif isinstance(part, Call) and part.rule and part.function not in called:
                called.add(part.function)
                names |= {parameter.domain for parameter in rules[part.function].parameters}
                waiting.append(rules[part.function].condition)
    every = _members(instance, {entity.group for entity in instance.entities})
    return judged_targets(instance) | _members(instance, names) or every


def judged_targets(instance: Instance) -> frozenset[str]:
    """Return the targets that a report can match: those that a rule compares with reports."""
    rules = (rule for rule in instance.rules if rule.matching)
    return _members(instance, {parameter.domain for rule in rules for parameter in rule.parameters})


def required_mass_kg(trace: Trace) -> tuple[float, float] | None:
    """Return the mass to deliver at the beginning and at the end of the episode, or None if success requires none.

    Such a condition bounds a state of a target that is a mass: `p.demand <= 0 kg`.
    """
    instance = trace.header.instance
    bounds = _mass_bounds(instance)
    if not bounds or not trace.boundaries or not trace.boundaries[-1].snapshots:
        return None
    last = {state.id: state.resources for state in trace.boundaries[-1].snapshots[-1].states}
    initial = remaining = 0.0
    for entity in instance.entities:
        for (target, field), most in bounds.items():
            spec, amount = entity.state_of(field), entity.number(field)
            if target in (entity.group, entity.id) and spec is not None and spec.unit == _MASS and amount is not None:
                initial += max(0.0, amount - most)
                remaining += max(0.0, last.get(entity.id, {}).get(spec.name, amount) - most)
    return (initial, remaining) if initial > 0.0 else None


def _mass_bounds(instance: Instance) -> dict[tuple[str, str], float]:
    """Return the upper bounds of success on states, by (group or target, name of the state)."""
    needs = mentions(instance.success, of_instance(instance))
    return {(leaf.target.id, leaf.name): leaf.most for leaf in needs if isinstance(leaf, Supply)}


def completed_at(instance: Instance, record: BoundaryRecord) -> set[str]:
    """Return the targets that are completed by the events or stages of this boundary."""
    if not record.events and not record.stages:
        return set()
    targets = {entity.id for entity in instance.entities if entity.role == "target"}
    rules = _success_rules(instance)
    if rules:
        return targets & {name for event in record.events if event.kind in rules for name in event.bindings}
    last = instance.stages[-1].name if instance.stages else None
    return targets & {change.subject for change in record.stages if change.stage == last}


def _members(instance: Instance, groups: Container[str | None]) -> frozenset[str]:
    """Return the targets of some groups, which may also be named by their ids."""
    return frozenset(
        entity.id
        for entity in instance.entities
        if entity.role == "target" and (entity.group in groups or entity.id in groups)
    )


def _success_rules(instance: Instance) -> set[str]:
    return {node.function for node in parts(instance.success) if isinstance(node, Call) and node.rule}
