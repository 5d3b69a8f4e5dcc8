"""Conditions over time: `held(c, 30 s)`, `within(a, b, 60 s)`, `before(a, b)`, and what they remember.

A function over time is true because of the past of its conditions. The kernel remembers for each call and each binding
of its free names when its conditions last became true, and whether they are true now (`Registry.memory`). It examines
them at every macro-step, so that no break between two boundaries is missed, and after the rules that they read. A
condition that is true at time 0 became true then.

- `held(c, d)`: `c` is true and has been since at least `d` ago.
- `within(a, b, d)`: `b` has become true at most `d` after `a` became true, or at the same time. It stays true.
- `before(a, b)`: `a` became true for the first time before `b` did, or `b` never did.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from msgspec.structs import replace

from lingjing.kernel.context import RuntimeContext
from lingjing.kernel.memory import ConditionPast
from lingjing.kernel.registry import Registry
from lingjing.kernel.rules import bindings, holds, identity
from lingjing.mission.expression import Aggregate, Call, Expr, Quantified, children
from lingjing.mission.expression_text import spell
from lingjing.mission.functions import TEMPORAL, conditions_of, free_names


@dataclass(frozen=True, slots=True)
class TemporalCall:
    """One call of a function over time in the conditions of an instance."""

    call: Call
    """The call of `held`, `within`, `before` or `count`."""
    key: str
    """Its text, under which `Registry.memory` keeps its past."""
    domains: tuple[tuple[str, str], ...]
    """Its free names with the group or message kind of each, sorted by name."""


ContextOf = Callable[[Registry], RuntimeContext]
"""Returns the evaluation context of a registry at the instant that is examined."""


def temporal_calls(condition: Expr | None, domains: Mapping[str, str]) -> tuple[TemporalCall, ...]:
    """Return the calls of functions over time in a condition, inner ones first. `domains` are its bound names."""
    return () if condition is None else tuple(_calls(condition, domains))


def _calls(expr: Expr, domains: Mapping[str, str]) -> Iterator[TemporalCall]:
    if isinstance(expr, Quantified | Aggregate):
        domains = {**domains, expr.variable: expr.domain}
    for child in children(expr):
        yield from _calls(child, domains)
    if isinstance(expr, Call) and not expr.rule and expr.function in TEMPORAL:
        named = tuple((name, domains[name]) for name in free_names(expr) if name in domains)
        yield TemporalCall(expr, spell(expr), named)


def remember(registry: Registry, calls: Iterable[TemporalCall], context_of: ContextOf) -> Registry:
    """Return the registry with the past of these calls at the instant of `context_of`."""
    for each in calls:
        at = context_of(registry)
        changed = {}
        for scope in bindings(each.domains, at):
            key = each.key, tuple(identity(value) for value in scope.values())
            truths = tuple(holds(condition, scope, at) for condition in conditions_of(each.call))
            past = registry.memory.get(key)
            now = _after(past, truths, at.time_s)
            if now != past:
                changed[key] = now
        if changed:
            registry = replace(registry, memory={**registry.memory, **changed})
    return registry


def _after(past: ConditionPast | None, truths: Sequence[bool], time_s: float) -> ConditionPast:
    """Return the past of the conditions with their truths at one more instant."""
    known = past or ConditionPast((False,) * len(truths), (None,) * len(truths), (None,) * len(truths))
    rose = [truth and not was for truth, was in zip(truths, known.true, strict=True)]
    since = tuple(time_s if new else old for new, old in zip(rose, known.since_s, strict=True))
    first = tuple(time_s if new and old is None else old for new, old in zip(rose, known.first_s, strict=True))
    gap_s = known.gap_s
    if len(truths) > 1 and rose[1] and since[0] is not None:
        gap_s = time_s - since[0] if gap_s is None else min(gap_s, time_s - since[0])
    return ConditionPast(tuple(truths), since, first, gap_s)


__all__ = ["TemporalCall", "remember", "temporal_calls"]
