"""The nodes that a condition reads."""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.functions import operation
from lingjing.mission.graph.builder import GraphBuilder
from lingjing.mission.graph.entities import groups_in

DECIDED = ("rule:", "event:", "inspection:", "stage:")
"""Prefixes of ids of nodes that become true. Such a node unlocks a waiting command; any other one is required by it."""


def needs(condition: ex.Expr, mission: model.Mission, draft: GraphBuilder) -> tuple[str, ...]:
    """The nodes that a condition reads, once each, in order."""
    return tuple(dict.fromkeys(_read(condition, mission, draft)))


def _read(condition: ex.Expr, mission: model.Mission, draft: GraphBuilder) -> Iterator[str]:
    handed = _handed_on(condition)
    for part in ex.parts(condition):
        node: str | None = None
        match part:
            case ex.Ref() if id(part) in handed:
                continue
            case ex.Call(function=function, rule=True):
                node = draft.find(function, "rule")
            case ex.Call(function="assigned"):
                kinds = (kind.name for kind in mission.messages if kind.category == "assignment")
                yield from (each for name in kinds if (each := draft.find(name, "channel")))
            case ex.Ref(kind="group" | "entity"):
                node = next(iter(groups_in(part, draft)), None)
            case ex.Ref(name=name, kind="region" | "grid"):
                node = draft.find(name, "region", "grid")
            case ex.Call(arguments=(ex.Ref(name=name) | ex.Symbol(name=name), *_)) if operation_entry := operation(
                part
            ):
                node = draft.find(name, *operation_entry.about) if operation_entry.about else None
            case ex.Quantified(domain=domain, body=body) | ex.Aggregate(domain=domain, body=body) if not _calls_a_rule(
                body
            ):
                node = draft.find(domain, "channel", "target", "asset")
        if node:
            yield node


def _handed_on(condition: ex.Expr) -> set[int]:
    """Identities of the arguments of rules and interactions: these judge the arguments, so that the condition does not
    read them itself."""
    calls = (part for part in ex.parts(condition) if isinstance(part, ex.Call))
    return {id(argument) for call in calls if call.rule or call.function == "emitted" for argument in call.arguments}


def _calls_a_rule(body: ex.Expr) -> bool:
    """True if a rule is called: then the rule reads the nodes, not the quantifier around it."""
    return any(isinstance(part, ex.Call) and part.rule for part in ex.parts(body))
