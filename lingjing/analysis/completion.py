"""Which targets were completed, and when: what the mission's success asks of each, wherever the mission says it.

A target is completed by an event of a rule that the success condition calls (`forall v in victim: rescued(v)`), or,
where success calls none, by the mission's last stage.
"""

from __future__ import annotations

from lingjing.analysis.memo import once_per_trace
from lingjing.mission.expression import Call, parts
from lingjing.mission.feasibility.condition_needs import mentions
from lingjing.mission.feasibility.needs import Supply
from lingjing.mission.feasibility.outline import of_instance
from lingjing.mission.instance import Instance
from lingjing.trace.reader import Trace
from lingjing.trace.records import BoundaryRecord

_MASS = "kg"


@once_per_trace
def completion_ticks(trace: Trace) -> dict[str, int]:
    """The tick at which each completed target was completed."""
    found: dict[str, int] = {}
    for record in trace.boundaries:
        for target in completed_at(trace.header.instance, record):
            found.setdefault(target, record.tick)
    return found


def asked_groups(instance: Instance) -> frozenset[str]:
    """The groups of which success asks something: what its rules, or else the last stage, range over."""
    rules = _success_rules(instance)
    if rules:
        return frozenset(
            parameter.domain for rule in instance.rules if rule.name in rules for parameter in rule.parameters
        )
    last = instance.stages[-1].domain if instance.stages else None
    return frozenset({last} if last is not None else ())


def owed_kg(trace: Trace) -> tuple[float, float] | None:
    """Mass that success asks to be brought, as (at the beginning, still due at the end); None if it asks for none.

    Such a condition holds when a mass that is a target's state is small enough: `p.demand <= 0 kg`.
    """
    instance = trace.header.instance
    asked = _masses(instance)
    if not asked or not trace.boundaries or not trace.boundaries[-1].snapshots:
        return None
    last = {state.id: state.resources for state in trace.boundaries[-1].snapshots[-1].states}
    initial = due = 0.0
    for entity in instance.entities:
        for (wanted, field), most in asked.items():
            spec, amount = entity.state_of(field), entity.number(field)
            if wanted in (entity.group, entity.id) and spec is not None and spec.unit == _MASS and amount is not None:
                initial += max(0.0, amount - most)
                due += max(0.0, last.get(entity.id, {}).get(spec.name, amount) - most)
    return (initial, due) if initial > 0.0 else None


def _masses(instance: Instance) -> dict[tuple[str, str], float]:
    """Of which group or target success wants which state at most how large."""
    found = mentions(instance.success, of_instance(instance))
    return {(leaf.target.id, leaf.name): leaf.most for leaf in found if isinstance(leaf, Supply)}


def completed_at(instance: Instance, record: BoundaryRecord) -> set[str]:
    """Targets that this boundary's events or stages complete."""
    if not record.events and not record.stages:
        return set()
    targets = {entity.id for entity in instance.entities if entity.role == "target"}
    rules = _success_rules(instance)
    if rules:
        return targets & {name for event in record.events if event.kind in rules for name in event.bindings}
    last = instance.stages[-1].name if instance.stages else None
    return targets & {change.subject for change in record.stages if change.stage == last}


def _success_rules(instance: Instance) -> set[str]:
    return {node.function for node in parts(instance.success) if isinstance(node, Call) and node.rule}
