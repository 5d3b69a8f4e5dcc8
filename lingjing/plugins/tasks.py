"""What a mission asks for, read from its rules: the interactions that success needs and the reports that are matched.

A policy that may see the rules (a privileged one, an analysis) finds here what is left to do without knowing any
mission: `asked` walks from the success condition through the rules it calls to the task events they need.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from lingjing.mission.expression import Call, Expr, Index, Quantified, Ref, Symbol, Text, children
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.model import Rule
from lingjing.plugins.choice import meant

_EMITTED = "emitted"


@dataclass(frozen=True, slots=True)
class Task:
    """An interaction with a target: which engine's bodies do it, and from how far (metres).

    `takes`/`source` and `gives`/`up_to` name the stocks that change hands, "" where nothing does.
    """

    name: str
    target: str
    engine: str
    within_m: float
    takes: str = ""
    source: str = ""
    gives: str = ""
    up_to: str = ""

    @property
    def moves_goods(self) -> bool:
        """Whether something changes hands, so that it may happen again and again."""
        return bool(self.gives or (self.takes and self.source))


def possible(entity: Entity) -> tuple[Task, ...]:
    """Every interaction that an entity's type declares."""
    return tuple(
        Task(one.name, entity.id, one.by, one.within_m, one.takes, one.source, one.gives, one.up_to)
        for one in entity.interactions
    )


def asked(instance: Instance) -> tuple[Task, ...]:
    """The interactions whose task events success needs, in the order of declaration of their targets.

    Where a rule chooses among the members of a group by what is declared of them, only those it means are there.
    """
    rules = {rule.name: rule for rule in instance.rules}
    wanted = set(_events(instance.success, {}, rules))
    passed = _passed_over(instance)
    return tuple(
        task
        for entity in instance.entities
        if entity.role == "target"
        for task in possible(entity)
        if (task.name, entity.group) in wanted or (task.name, entity.id) in wanted
        if (task.name, entity.id) not in passed
    )


def _passed_over(instance: Instance) -> frozenset[tuple[str, str]]:
    """(Interaction, target) pairs that the rule about their task event can never be true of."""
    found: set[tuple[str, str]] = set()
    for rule in instance.rules:
        for parameter in rule.parameters:
            members = [entity for entity in instance.entities if entity.group == parameter.domain]
            kinds = {kind for kind, group in _events(rule.condition, {parameter.name: parameter.domain}, {})
                     if group == parameter.domain}  # fmt: skip
            if kinds and members:
                kept = meant(rule.condition, parameter.name, members, instance)
                found.update((kind, entity.id) for kind in kinds for entity in members if entity not in kept)
    return frozenset(found)


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


def _events(expr: Expr, domains: Mapping[str, str], rules: Mapping[str, Rule]) -> Iterator[tuple[str, str]]:
    """(Kind, group or entity) of every task event that a condition looks at, through the rules it calls."""
    if isinstance(expr, Quantified):
        domains = {**domains, expr.variable: expr.domain}
    if isinstance(expr, Call) and expr.rule and expr.function in rules:
        rule = rules[expr.function]
        yield from _events(rule.condition, {one.name: one.domain for one in rule.parameters}, rules)
    if isinstance(expr, Call) and expr.function == _EMITTED and len(expr.arguments) > 1:
        kind, *about = expr.arguments
        yield from ((_word(kind), _group(one, domains)) for one in about)
    for child in children(expr):
        yield from _events(child, domains, rules)


def _word(expr: Expr) -> str:
    if isinstance(expr, Symbol | Ref):
        return expr.name
    return expr.value if isinstance(expr, Text) else ""


def _group(expr: Expr, domains: Mapping[str, str]) -> str:
    if isinstance(expr, Index):
        return _group(expr.base, domains)
    return domains.get(expr.name, expr.name) if isinstance(expr, Ref | Symbol) else ""


__all__ = ["Task", "asked", "possible", "reported"]
