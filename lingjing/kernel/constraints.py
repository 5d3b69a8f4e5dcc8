"""Constraints: conditions that must hold at every macro-step. Each is broken at most once for each subject."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from msgspec.structs import replace

from lingjing.kernel.context import RuntimeContext
from lingjing.kernel.registry import Registry
from lingjing.kernel.rules import bindings, holds, identity
from lingjing.kernel.temporal import remember, temporal_calls
from lingjing.mission.expression import Number
from lingjing.mission.instance import Instance
from lingjing.mission.model import Constraint
from lingjing.mission.wording import some
from lingjing.sums import total
from lingjing.trace.records import AdjudicatedEvent, BodyState, Snapshot

ContextAt = Callable[[Registry, Mapping[str, BodyState], float], RuntimeContext]
"""A function that returns the evaluation context of a registry, the entities' states and a time in seconds."""


class ConstraintMonitor:
    """The constraints of one instance. Holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._constraints = instance.constraints
        self._temporal = tuple(
            call
            for constraint in instance.constraints
            for call in temporal_calls(constraint.condition, dict(_domain(constraint)))
        )

    def check(
        self, registry: Registry, snapshots: Sequence[Snapshot], context_at: ContextAt, first: int
    ) -> tuple[Registry, tuple[AdjudicatedEvent, ...]]:
        """Check the constraints at each snapshot.

        Returns the registry with the constraints that were broken, and one event for each; event ids count from
        `first`.
        """
        if not self._constraints:
            return registry, ()
        events: list[AdjudicatedEvent] = []
        broken = dict(registry.progress.broken)
        for snapshot in snapshots:
            states = {state.id: state for state in snapshot.states}
            if self._temporal:
                registry = remember(registry, self._temporal, partial(_context_of, context_at, states, snapshot.time_s))
            at = context_at(registry, states, snapshot.time_s)
            for constraint in self._constraints:
                for subject in _offenders(constraint, at):
                    if (constraint.name, subject) not in broken:
                        broken[constraint.name, subject] = snapshot.time_s
                        events.append(_event(constraint, subject, at, first + len(events)))
        if not events:
            return registry, ()
        return replace(registry, progress=replace(registry.progress, broken=broken)), tuple(events)

    def broken(self, registry: Registry) -> str:
        """Describe the first broken hard constraint with times and subjects; "" if none is broken. It excludes
        success.
        """
        if not registry.progress.broken:
            return ""
        hard = [constraint.name for constraint in self._constraints if constraint.kind == "hard"]
        name = next((broken for broken, _ in registry.progress.broken if broken in hard), None)
        if name is None:
            return ""
        acts = [
            f"at {time_s:g} s" + (f" by {subject}" if subject else "")
            for (broken, subject), time_s in registry.progress.broken.items()
            if broken == name
        ]
        return f"the constraint `{name}` was broken {some(acts)}"

    def penalty(self, registry: Registry) -> float:
        """Return the sum of the penalties of broken soft constraints, once for each subject."""
        if not registry.progress.broken:
            return 0.0
        cost = {each.name: each.penalty.value for each in self._constraints if isinstance(each.penalty, Number)}
        return total(cost.get(name, 0.0) for name, _ in registry.progress.broken)


def _context_of(
    context_at: ContextAt, states: Mapping[str, BodyState], time_s: float, registry: Registry
) -> RuntimeContext:
    return context_at(registry, states, time_s)


def _domain(constraint: Constraint) -> tuple[tuple[str, str], ...]:
    return ((constraint.variable, constraint.domain),) if constraint.variable and constraint.domain else ()


def _offenders(constraint: Constraint, at: RuntimeContext) -> list[str]:
    domain = _domain(constraint)
    return [
        "".join(identity(value) for value in scope.values())
        for scope in bindings(domain, at)
        if not holds(constraint.condition, scope, at)
    ]


def _event(constraint: Constraint, subject: str, at: RuntimeContext, number: int) -> AdjudicatedEvent:
    return AdjudicatedEvent(
        id=f"e{at.registry.tick}-{number}",
        kind=constraint.name,
        tick=at.registry.tick,
        time_s=at.time_s,
        bindings=(subject,) if subject else (),
    )
