"""Rates of agents' actions: adherence, repetition, out of bounds and forgotten subgoals, over all or by tercile.

An *action* is a physical command that a policy decided on (the paper's "evaluated action"). Neither an idle tick nor a
substituted decision is an action. The paper defines four rates in its table of diagnostic metrics. For its table of
behaviour by trajectory tercile it partitions each agent's sequence of actions "into three equal intervals by normalized
trajectory position". Its terms are read from a trace as follows:

- *Constraint adherence*, "actions that satisfy all active task and motion constraints": the first receipt neither
  rejects nor clips the action, and its body breaks no constraint of the mission before its next admitted action. An
  action that was rejected because another agent's command came first (`LOST_RACES`) broke no constraint. Later receipts
  and events (`preempted`, `collided`) do not count.
- *Out of bounds*, "actions that leave the configured operating region or violate an active altitude or motion bound":
  the first receipt clips the arguments or rejects them for a bound (`OUT_OF_BOUNDS`), or a constraint is broken as
  above.
- *Repetition*, "actions whose normalized action signature matches the immediately preceding action from the same
  agent": the signature consists of verb, resource and arguments, with numbers rounded to whole units.
- *Forgotten subgoal*, "actions that omit an active requirement or act on an already completed subgoal": all targets of
  the action are completed already, or its body has an open assignment and the action has other targets.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import msgspec

from lingjing.analysis.completion import completed_at
from lingjing.analysis.detection import ratio
from lingjing.analysis.memo import cache_by_trace
from lingjing.analysis.repetition import assignments_of
from lingjing.trace.reader import Trace
from lingjing.trace.records import Action, BoundaryRecord, Receipt
from lingjing.trace.request_ids import is_request_of

OUT_OF_BOUNDS = frozenset({"clipped", "altitude", "outside_world", "unreachable", "water"})
"""Reasons of first receipts for a bound of place, height or motion."""

LOST_RACES = frozenset({"conflict"})
"""Reasons of first receipts for a resource that another agent's command won at the same tick (ADR 0053)."""

TERCILES = ("early", "mid", "late")
"""Names of the three thirds of an agent's actions."""


@dataclass(frozen=True, slots=True)
class EvaluatedAction:
    """One action and its evaluation."""

    agent: str
    tick: int
    """The tick after the boundary at which the action was decided."""
    verb: str
    resource: str
    third: int
    """The third of the agent's actions that it belongs to: 0, 1 or 2."""
    admitted: bool
    adherent: bool
    out_of_bounds: bool
    forgotten: bool
    on_completed: bool
    """True if it has targets and all of them are completed."""
    elsewhere: bool
    """True if its body has an open assignment and is sent to a place in the region of no target."""
    repeated: bool | None
    """True if it equals the agent's action before; None for an agent's first action."""


class BehaviourRates(msgspec.Struct, frozen=True, kw_only=True):
    """The four rates over a set of actions, 0 to 1. A rate over no actions is None."""

    actions: int
    adherence: float | None
    repetition: float | None
    out_of_bounds: float | None
    forgotten: float | None


class ActionCounts(msgspec.Struct, frozen=True, kw_only=True):
    """The counts behind the four rates. Counts of several episodes can be added."""

    actions: int = 0
    adherent: int = 0
    following: int = 0
    """Actions with a predecessor: the denominator of `repetition`."""
    repeated: int = 0
    out_of_bounds: int = 0
    forgotten: int = 0

    def __add__(self, other: ActionCounts) -> ActionCounts:
        return ActionCounts(**{name: getattr(self, name) + getattr(other, name) for name in self.__struct_fields__})

    def rates(self) -> BehaviourRates:
        """Return the rates."""
        return BehaviourRates(
            actions=self.actions,
            adherence=ratio(self.adherent, self.actions),
            repetition=ratio(self.repeated, self.following),
            out_of_bounds=ratio(self.out_of_bounds, self.actions),
            forgotten=ratio(self.forgotten, self.actions),
        )


def count_actions(actions: Iterable[EvaluatedAction]) -> ActionCounts:
    """The counts of actions, of one episode or pooled from many."""
    judged = list(actions)
    return ActionCounts(
        actions=len(judged),
        adherent=sum(action.adherent for action in judged),
        following=sum(action.repeated is not None for action in judged),
        repeated=sum(bool(action.repeated) for action in judged),
        out_of_bounds=sum(action.out_of_bounds for action in judged),
        forgotten=sum(action.forgotten for action in judged),
    )


def count_by_tercile(actions: Iterable[EvaluatedAction]) -> tuple[ActionCounts, ...]:
    """Return the counts of the first, second and last third of each agent's actions, in the order of `TERCILES`."""
    judged = list(actions)
    return tuple(count_actions(action for action in judged if action.third == third) for third in range(len(TERCILES)))


def behaviour(actions: Iterable[EvaluatedAction]) -> BehaviourRates:
    """Return the rates of actions of one or more episodes."""
    return count_actions(actions).rates()


@cache_by_trace
def actions(trace: Trace) -> tuple[EvaluatedAction, ...]:
    """Return all actions of a trace, in order."""
    judged = _with_constraints(trace, list(_judged(trace)))
    totals = Counter(action.agent for action in judged)
    seen = dict.fromkeys(totals, 0)
    placed = []
    for action in judged:
        third = min(2, 3 * seen[action.agent] // totals[action.agent])
        seen[action.agent] += 1
        placed.append(replace(action, third=third))
    return tuple(placed)


def _with_constraints(trace: Trace, judged: list[EvaluatedAction]) -> list[EvaluatedAction]:
    """Return the actions with broken constraints taken into account.

    A body that breaks a constraint does so by its last admitted action. A constraint event without bindings counts for
    all actions of its tick.
    """
    constraints = {constraint.name for constraint in trace.header.instance.constraints}
    marked, number, latest = list(judged), 0, dict[str, int]()
    for record in trace.boundaries if constraints else ():
        first = number
        while number < len(marked) and marked[number].tick == record.tick:
            if marked[number].admitted:
                latest[marked[number].resource] = number
            number += 1
        for event in record.events:
            if event.kind in constraints:
                causes = [latest[name] for name in event.bindings if name in latest]
                for index in causes if event.bindings else range(first, number):
                    marked[index] = replace(marked[index], adherent=False, out_of_bounds=True)
    return marked


def _judged(trace: Trace) -> Iterator[EvaluatedAction]:
    instance = trace.header.instance
    assigned = assignments_of(trace)
    first = {agent.id: agent.controls[0] for agent in instance.agents if agent.controls}
    before: dict[str, tuple[object, ...]] = {}
    open_for: dict[str, set[str]] = {}
    completed: set[str] = set()
    for record in trace.boundaries:
        _drop(open_for, completed)
        receipts = _first_receipts(record)
        for entry in record.decisions:
            command = entry.decision.command
            if command is None or entry.substituted:
                continue
            resource = command.resource or first.get(entry.agent, "")
            signature = (command.verb, resource, _rounded(command))
            receipt = receipts.get(entry.agent)
            beyond = receipt is not None and receipt.reason in OUT_OF_BOUNDS
            admitted = receipt is not None and receipt.status != "rejected"
            outrun = receipt is not None and receipt.reason in LOST_RACES
            targets = assigned.targets_of(record, command.arguments, resource)
            yield EvaluatedAction(
                agent=entry.agent,
                tick=record.tick,
                verb=command.verb,
                resource=resource,
                third=0,
                admitted=admitted,
                adherent=outrun or (admitted and not beyond),
                out_of_bounds=beyond,
                forgotten=_forgets(targets, open_for.get(resource, set()), completed),
                on_completed=bool(targets) and set(targets) <= completed,
                elsewhere=bool(open_for.get(resource)) and not targets and _has_position(command),
                repeated=before[entry.agent] == signature if entry.agent in before else None,
            )
            before[entry.agent] = signature
        for body, targets, _ in assigned.at(record):
            open_for.setdefault(body, set()).update(targets)
        completed |= completed_at(instance, record)


def _drop(open_for: Mapping[str, set[str]], completed: set[str]) -> None:
    for targets in open_for.values():
        targets -= completed


def _forgets(targets: tuple[str, ...], assigned: set[str], completed: set[str]) -> bool:
    """Return whether all `targets` of an action are completed, or none of them is `assigned` while others are."""
    if not targets:
        return False
    return set(targets) <= completed or bool(assigned and not assigned & set(targets))


def _has_position(command: Action) -> bool:
    return "position" in command.arguments or {"x", "y"} <= set(command.arguments)


def _first_receipts(record: BoundaryRecord) -> dict[str, Receipt]:
    """Return the first receipt of each agent's command of this boundary, by agent."""
    own = [receipt for receipt in record.receipts if is_request_of("command", receipt.request, record.tick)]
    return {receipt.sender: receipt for receipt in reversed(own)}


def _rounded(command: Action) -> tuple[tuple[str, object], ...]:
    return tuple((name, _whole(value)) for name, value in sorted(command.arguments.items()) if value is not None)


def _whole(value: object) -> object:
    if isinstance(value, bool) or not isinstance(value, int | float | tuple | list):
        return value
    return tuple(map(_whole, value)) if isinstance(value, tuple | list) else round(value)


__all__ = [
    "TERCILES", "ActionCounts", "BehaviourRates", "EvaluatedAction", "actions", "behaviour", "count_actions",
    "count_by_tercile",
]  # fmt: skip
