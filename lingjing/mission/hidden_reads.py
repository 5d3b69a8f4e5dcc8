"""Whether a condition reads what agents may not know: anything of who hides something, a message, a secret function."""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.mission.expression import Aggregate, Call, Expr, Quantified, Ref, Symbol, parts
from lingjing.mission.functions import OPERATIONS
from lingjing.mission.model import Mission, Rule

Rules = Mapping[str, Rule]
"""Rules by name: what a condition calls."""


def secret_names(mission: Mission) -> set[str]:
    """What agents of a mission may not know of: groups that hide something, their interactions, hidden regions, and
    messages, which not everybody reads."""
    hiding = [group for group in mission.groups if any(prop.hidden for prop in group.properties)]
    return {
        *(group.name for group in hiding),
        *(one.name for group in hiding for one in group.interactions),
        *(region.name for region in mission.regions if region.hidden),
        *(message.name for message in mission.messages),
    }


def rule_reads(rule: Rule, rules: Rules, secret: set[str]) -> bool:
    """Whether a rule is over something of those names, or reads it."""
    return any(parameter.domain in secret for parameter in rule.parameters) or reads(rule.condition, rules, secret)


def reads(expr: Expr, rules: Rules, secret: set[str]) -> bool:
    """Whether an expression names something secret, itself or through the rules that it calls."""
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
