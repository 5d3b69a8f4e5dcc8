"""What a condition needs to know: the nodes whose state it reads."""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.functions import operation
from lingjing.mission.graph.builder import GraphBuilder
from lingjing.mission.graph.entities import groups_in

DECIDED = ("rule:", "event:", "inspection:", "stage:")
"""Ids of nodes that become true: these unlock what waits for them, others are merely needed."""


def needs(condition: ex.Expr, mission: model.Mission, draft: GraphBuilder) -> tuple[str, ...]:
    """The nodes whose state a condition reads, once each, in the order it reads them."""
    return tuple(dict.fromkeys(_read(condition, mission, draft)))


def _read(condition: ex.Expr, mission: model.Mission, draft: GraphBuilder) -> Iterator[str]:
    handed = _handed_on(condition)
    for part in ex.parts(condition):
        found: str | None = None
        match part:
            case ex.Ref() if id(part) in handed:
                continue
            case ex.Call(function=function, rule=True):
                found = draft.find(function, "rule")
            case ex.Call(function="assigned"):
                kinds = (kind.name for kind in mission.messages if kind.category == "assignment")
                yield from (node for name in kinds if (node := draft.find(name, "channel")))
            case ex.Ref(kind="group" | "entity"):
                found = next(iter(groups_in(part, draft)), None)
            case ex.Ref(name=name, kind="region" | "grid"):
                found = draft.find(name, "region", "grid")
            case ex.Call(arguments=(ex.Ref(name=name) | ex.Symbol(name=name), *_)) if done := operation(part):
                found = draft.find(name, *done.about) if done.about else None
            case ex.Quantified(domain=domain, body=body) | ex.Aggregate(domain=domain, body=body) if not _calls_a_rule(
                body
            ):
                found = draft.find(domain, "channel", "target", "asset")
        if found:
            yield found


def _handed_on(condition: ex.Expr) -> set[int]:
    """Identities of the arguments of rules and interactions: what is judged there is not read here."""
    calls = (part for part in ex.parts(condition) if isinstance(part, ex.Call))
    return {id(argument) for call in calls if call.rule or call.function == "emitted" for argument in call.arguments}


def _calls_a_rule(body: ex.Expr) -> bool:
    """Whether a rule is called: then the rule, not the quantifier around it, says what is read."""
    return any(isinstance(part, ex.Call) and part.rule for part in ex.parts(body))
