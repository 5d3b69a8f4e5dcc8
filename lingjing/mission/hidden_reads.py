"""Detection of conditions that read values hidden from agents: of entities with hidden properties, of messages, or of
functions that reveal them.
"""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.mission.expression import Aggregate, Call, Expr, Quantified, Ref, Symbol, parts
from lingjing.mission.functions import OPERATIONS
from lingjing.mission.model import Mission, Rule

Rules = Mapping[str, Rule]
"""The rules of a mission by name."""


def secret_names(mission: Mission) -> set[str]:
    """Names that agents must not learn about: groups with a hidden property, their interactions, hidden regions, and
    message kinds, because not every agent receives them."""
    hiding = [group for group in mission.groups if any(prop.hidden for prop in group.properties)]
    return {
        *(group.name for group in hiding),
        *(interaction.name for group in hiding for interaction in group.interactions),
        *(region.name for region in mission.regions if region.hidden),
        *(message.name for message in mission.messages),
    }


def rule_reads(rule: Rule, rules: Rules, secret: set[str]) -> bool:
    """True if a rule has a secret domain or a condition that reads a secret."""
    return any(parameter.domain in secret for parameter in rule.parameters) or reads(rule.condition, rules, secret)


def reads(expr: Expr, rules: Rules, secret: set[str]) -> bool:
    """True if an expression names a secret, itself or through the rules that it calls."""
    return any(_names(part, rules, secret) for part in parts(expr))


def _names(part: Expr, rules: Rules, secret: set[str]) -> bool:
    match part:
        case Symbol(name=name) | Quantified(domain=name) | Aggregate(domain=name):
            return name in secret
        case Ref(name=name, kind=kind):
            return kind != "local" and name in secret
        case Call(function=name, rule=True):
            return name in rules and rule_reads(rules[name], rules, secret)
        case Call(function=name):
            return name in OPERATIONS and OPERATIONS[name].secret
    return False
