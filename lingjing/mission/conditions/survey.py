"""`survey_mission`, `survey_instance`: every condition, leaf by leaf, with what it reads and what it gates.

A *leaf* is a part of a condition without `and`, `or`, `not` and quantifiers. A condition that calls rules has the
leaves of these rules too, so that its reads are complete. A *gate* is what the condition decides: the end of the
episode, an event, the admission of a command.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Literal

import msgspec

from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.conditions.declarations import Declarations, of_instance, of_mission
from lingjing.mission.conditions.quantities import Quantity, QuantityKind, Record
from lingjing.mission.conditions.reads import Leaf, Reader, domains_of
from lingjing.mission.conditions.taint import propagate
from lingjing.mission.expression_text import spell
from lingjing.mission.instance import Instance

ConditionKind = Literal["success", "failure", "rule", "unlock", "permit", "constraint", "stage", "event"]
"""The declarations that have a condition."""

GateKind = Literal["end", "event", "interaction", "command", "penalty", "stage", "count", "world"]
"""The kinds of gates.

`end`: the episode ends. `event`: an adjudicated event. `interaction`: an actor may perform it. `command`: the kernel
admits a verb, or else sends a receipt `not_permitted`. `penalty`: the score falls. `stage`: a stage is complete.
`count`: the kernel rejects further commands or messages while the condition does not hold. `world`: an event of the
mission occurs, is undone, or sets a value.
"""


class Gate(Record, frozen=True, kw_only=True):
    """One thing that a condition decides."""

    kind: GateKind
    name: str = ""
    """The rule, interaction, constraint, `resource.verb`, stage or limit; "" for the end and a penalty."""


class Condition(Record, frozen=True, kw_only=True):
    """One condition of a mission."""

    at: str
    """The path of its declaration: `success`, `rule/rescued`, `unlock/rescue`, `permit/uav.takePhoto`,
    `event/surge/when`."""
    kind: ConditionKind
    name: str = ""
    """The name of its declaration; "" for success and failure."""
    text: str
    """The condition as it is written."""
    over: dict[str, str] = {}
    """Bound names → the group or message kind that each ranges over."""
    leaves: tuple[Leaf, ...] = ()
    gates: tuple[Gate, ...] = ()
    hidden: bool = False
    """True if it depends on a hidden quantity, itself or through rules."""
    private: bool = False
    """True if it depends on messages, which not every agent receives."""

    @property
    def own(self) -> Iterator[Leaf]:
        """The parts of its own text, without those of the rules that it calls."""
        return (leaf for leaf in self.leaves if not leaf.via)

    def reads(self, *kinds: QuantityKind) -> Iterator[Quantity]:
        """The quantities of some kinds in its own text."""
        return (quantity for leaf in self.own for quantity in leaf.quantities if quantity.kind in kinds)


class Survey(msgspec.Struct, frozen=True, dict=True):
    """All conditions of a mission or an instance."""

    declarations: Declarations
    conditions: tuple[Condition, ...]

    def of_kind(self, *kinds: ConditionKind) -> Iterator[Condition]:
        """The conditions of some kinds, in their order of declaration."""
        return (condition for condition in self.conditions if condition.kind in kinds)

    @cached_property
    def open_events(self) -> frozenset[str]:
        """The rules and constraints that depend on nothing hidden and on no message: every agent may see their
        events."""
        return frozenset(
            condition.name
            for condition in self.of_kind("rule", "constraint")
            if not condition.hidden and not condition.private
        )


def survey_mission(mission: model.Mission) -> Survey:
    """Survey a compiled mission. Names range over groups: one condition stands for all members."""
    draft = _Draft(propagate(of_mission(mission)))
    draft.ends(mission.success, mission.failure)
    draft.judgements(mission.rules, mission.unlocks)
    for permit in mission.permits:
        draft.permit(spell(permit.resource), permit.verb, permit.condition)
    draft.terms(mission.constraints, mission.stages)
    for event in mission.events:
        values = tuple(change.value for change in event.changes if change.value is not None)
        draft.event(event.name, event.condition, event.until, values)
    return Survey(draft.of, tuple(draft.conditions))


def survey_instance(instance: Instance, *, shown: bool = False) -> Survey:
    """Survey one instance. Conditions of permits are listed once for each resource.

    `shown`: interactions that are told to all agents are public, as for the kernel that shows them.
    """
    draft = _Draft(propagate(of_instance(instance), shown=shown))
    draft.ends(instance.success, instance.failure)
    draft.judgements(instance.rules, instance.unlocks)
    for permit in instance.permits:
        draft.permit(permit.resource, permit.verb, permit.condition)
    draft.terms(instance.constraints, instance.stages)
    for event in instance.events:
        draft.event(event.name, event.condition, event.until, tuple(change.value for change in event.changes))
    return Survey(draft.of, tuple(draft.conditions))


def survey_unlocks(instance: Instance, interaction: str) -> Survey:
    """Survey the unlocks of one interaction of an instance alone."""
    draft = _Draft(of_instance(instance))
    draft.judgements((), tuple(unlock for unlock in instance.unlocks if unlock.interaction == interaction))
    return Survey(draft.of, tuple(draft.conditions))


# -- private


class _Draft:
    """The conditions found so far."""

    def __init__(self, of: Declarations) -> None:
        self.of = of
        self.conditions: list[Condition] = []

    def ends(self, success: ex.Expr, failure: ex.Expr | None) -> None:
        self._add("success", "", success, {}, Gate(kind="end"))
        if failure is not None:
            self._add("failure", "", failure, {}, Gate(kind="end"))

    def judgements(self, rules: tuple[model.Rule, ...], unlocks: tuple[model.Unlock, ...]) -> None:
        for rule in rules:
            self._add("rule", rule.name, rule.condition, domains_of(rule), Gate(kind="event", name=rule.name))
        for unlock in unlocks:
            gate = Gate(kind="interaction", name=unlock.interaction)
            self._add("unlock", unlock.interaction, unlock.condition, domains_of(unlock), gate)

    def permit(self, resource: str, verb: str, condition: ex.Expr) -> None:
        name = f"{resource}.{verb or '*'}"
        self._add("permit", name, condition, {}, Gate(kind="command", name=name))

    def terms(self, constraints: tuple[model.Constraint, ...], stages: tuple[model.Stage, ...]) -> None:
        for constraint in constraints:
            decided = Gate(kind="end" if constraint.kind == "hard" else "penalty")
            names = _per(constraint.variable, constraint.domain)
            event = Gate(kind="event", name=constraint.name)
            self._add("constraint", constraint.name, constraint.condition, names, decided, event)
        for stage in stages:
            gates = [Gate(kind="stage", name=stage.name)]
            gates += [Gate(kind="end")] if stage.ticks is not None or stage.deadline is not None else []
            gates += [Gate(kind="count", name=limit.name) for limit in stage.limits]
            names = _per(stage.variable, stage.domain)
            self._add("stage", stage.name, stage.condition, names, *gates, also=stage.deadline)

    def event(self, name: str, when: ex.Expr | None, until: ex.Expr | None, values: tuple[ex.Expr, ...]) -> None:
        """The conditions of an event, and the values that it sets: agents notice what they depend on."""
        gate = Gate(kind="world", name=name)
        for part, condition in (("when", when), ("until", until)):
            if condition is not None:
                self._add("event", name, condition, {}, gate, part=part)
        for number, value in enumerate(dict.fromkeys(values), 1):
            if any(isinstance(part, ex.Ref | ex.Call | ex.Aggregate | ex.Quantified) for part in ex.parts(value)):
                self._add("event", name, value, {}, gate, part=f"set {number}")

    def _add(
        self,
        kind: ConditionKind,
        name: str,
        expr: ex.Expr,
        names: Mapping[str, str],
        *gates: Gate,
        part: str = "",
        also: ex.Expr | None = None,
    ) -> None:
        """Add a condition. `also` is a value that decides together with it."""
        reader = Reader(self.of)
        leaves = (*reader.bound(names), *reader.leaves(expr, names))
        leaves += () if also is None else (reader.value(also, names),)
        quantities: tuple[Quantity, ...] = tuple(quantity for leaf in leaves for quantity in leaf.quantities)
        self.conditions.append(
            Condition(
                at="/".join(word for word in (kind, name, part) if word),
                kind=kind,
                name=name,
                text=spell(expr),
                over=dict(names),
                leaves=leaves,
                gates=gates,
                hidden=any(quantity.hidden for quantity in quantities),
                private=any(quantity.kind == "message" for quantity in quantities),
            )
        )


def _per(variable: str | None, domain: str | None) -> dict[str, str]:
    return {variable: domain} if variable and domain else {}
