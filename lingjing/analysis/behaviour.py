"""What agents' actions were like: adherence, repetition, out of bounds, forgotten subgoals; over all or by tercile.

An *action* is a physical command that a policy decided on (the paper's "evaluated action"); doing nothing is none,
and what was substituted for a missing answer is none. The paper defines four rates of them in its table of
diagnostic metrics, and partitions each agent's sequence of actions "into three equal intervals by normalized
trajectory position" for its table of behaviour by trajectory tercile. How its terms are read from a trace:

- *Constraint adherence*, "actions that satisfy all active task and motion constraints": the action was admitted as
  it was asked for (its first receipt neither refuses nor clips it), and no constraint of the mission was broken by its
  body before the body was given another action that was admitted. What else happens to it later (`preempted`,
  `collided`) is no matter of constraints.
- *Out of bounds*, "actions that leave the configured operating region or violate an active altitude or motion bound":
  the first receipt says that arguments were clipped to their bounds, or refuses them for one (`OUT_OF_BOUNDS`), or a
  constraint was broken as above.
- *Repetition*, "actions whose normalized action signature matches the immediately preceding action from the same
  agent": the signature is verb, resource and arguments, numbers rounded to whole units, the resource named.
- *Forgotten subgoal*, "actions that omit an active requirement or act on an already completed subgoal": the targets
  that the action means are all completed already; or its body has an open assignment, and the action means others.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import msgspec

from lingjing.analysis.completion import completed_at
from lingjing.analysis.detection import ratio
from lingjing.analysis.memo import once_per_trace
from lingjing.analysis.repetition import assignments_of
from lingjing.trace.reader import Trace
from lingjing.trace.records import Action, BoundaryRecord, Receipt
from lingjing.trace.request_ids import is_request_of

OUT_OF_BOUNDS = frozenset({"clipped", "altitude", "outside_world", "unreachable", "water"})
"""Reasons of first receipts that name a bound of place, height or motion."""

TERCILES = ("early", "mid", "late")


@dataclass(frozen=True, slots=True)
class JudgedAction:
    """One action, decided at boundary `tick - 1`; `third` (0, 1 or 2) is the interval of its agent's sequence that
    it lies in.

    `elsewhere` says that its body has an open assignment and is sent to a place in the region of no target. `repeated`
    is None for the first action of an agent, which has no predecessor.
    """

    agent: str
    tick: int
    verb: str
    resource: str
    third: int
    admitted: bool
    adherent: bool
    out_of_bounds: bool
    forgotten: bool
    elsewhere: bool
    repeated: bool | None


class BehaviourRates(msgspec.Struct, frozen=True, kw_only=True):
    """The four rates over some actions, None over none."""

    actions: int
    adherence: float | None
    repetition: float | None
    out_of_bounds: float | None
    forgotten: float | None


class ActionCounts(msgspec.Struct, frozen=True, kw_only=True):
    """What the four rates are made of: how many of some `actions` were each; `following` are those that have a
    predecessor. Counts of several episodes add up."""

    actions: int = 0
    adherent: int = 0
    following: int = 0
    repeated: int = 0
    out_of_bounds: int = 0
    forgotten: int = 0

    def __add__(self, other: ActionCounts) -> ActionCounts:
        return ActionCounts(**{name: getattr(self, name) + getattr(other, name) for name in self.__struct_fields__})

    def rates(self) -> BehaviourRates:
        """The rates."""
        return BehaviourRates(
            actions=self.actions,
            adherence=ratio(self.adherent, self.actions),
            repetition=ratio(self.repeated, self.following),
            out_of_bounds=ratio(self.out_of_bounds, self.actions),
            forgotten=ratio(self.forgotten, self.actions),
        )


def counted(actions: Iterable[JudgedAction]) -> ActionCounts:
    """The counts of actions, of one episode or pooled from many."""
    judged = list(actions)
    return ActionCounts(
        actions=len(judged),
        adherent=sum(one.adherent for one in judged),
        following=sum(one.repeated is not None for one in judged),
        repeated=sum(bool(one.repeated) for one in judged),
        out_of_bounds=sum(one.out_of_bounds for one in judged),
        forgotten=sum(one.forgotten for one in judged),
    )


def counted_by_tercile(actions: Iterable[JudgedAction]) -> tuple[ActionCounts, ...]:
    """The counts of the first, second and last third of each agent's actions, in the order of `TERCILES`."""
    judged = list(actions)
    return tuple(counted(one for one in judged if one.third == third) for third in range(len(TERCILES)))


def behaviour(actions: Iterable[JudgedAction]) -> BehaviourRates:
    """The rates of actions, of one episode or pooled from many."""
    return counted(actions).rates()


@once_per_trace
def actions(trace: Trace) -> tuple[JudgedAction, ...]:
    """Every action of a trace, in order."""
    found = _blamed(trace, list(_judged(trace)))
    whole = Counter(one.agent for one in found)
    seen = dict.fromkeys(whole, 0)
    placed = []
    for one in found:
        third = min(2, 3 * seen[one.agent] // whole[one.agent])
        seen[one.agent] += 1
        placed.append(replace(one, third=third))
    return tuple(placed)


def _blamed(trace: Trace, judged: list[JudgedAction]) -> list[JudgedAction]:
    """The actions, those marked in whose course their body broke a constraint: the last admitted one of the body. What
    an event that names nobody breaks was broken by the actions of its tick."""
    constraints = {constraint.name for constraint in trace.header.instance.constraints}
    found, number, latest = list(judged), 0, dict[str, int]()
    for record in trace.boundaries if constraints else ():
        first = number
        while number < len(found) and found[number].tick == record.tick:
            if found[number].admitted:
                latest[found[number].resource] = number
            number += 1
        for event in record.events:
            if event.kind in constraints:
                named = [latest[name] for name in event.bindings if name in latest]
                for each in named if event.bindings else range(first, number):
                    found[each] = replace(found[each], adherent=False, out_of_bounds=True)
    return found


def _judged(trace: Trace) -> Iterator[JudgedAction]:
    instance = trace.header.instance
    assigned = assignments_of(trace)
    first = {agent.id: agent.controls[0] for agent in instance.agents if agent.controls}
    before: dict[str, tuple[object, ...]] = {}
    open_for: dict[str, set[str]] = {}
    completed: set[str] = set()
    for record in trace.boundaries:
        _drop(open_for, completed)
        answers = _first_receipts(record)
        for made in record.decisions:
            command = made.decision.command
            if command is None or made.substituted:
                continue
            resource = command.resource or first.get(made.agent, "")
            signature = (command.verb, resource, _rounded(command))
            answer = answers.get(made.agent)
            beyond = answer is not None and answer.reason in OUT_OF_BOUNDS
            admitted = answer is not None and answer.status != "rejected"
            meant = assigned.meant(record, command.arguments, resource)
            yield JudgedAction(
                agent=made.agent,
                tick=record.tick,
                verb=command.verb,
                resource=resource,
                third=0,
                admitted=admitted,
                adherent=admitted and not beyond,
                out_of_bounds=beyond,
                forgotten=_forgets(meant, open_for.get(resource, set()), completed),
                elsewhere=bool(open_for.get(resource)) and not meant and _places(command),
                repeated=before[made.agent] == signature if made.agent in before else None,
            )
            before[made.agent] = signature
        for body, targets, _ in assigned.at(record):
            open_for.setdefault(body, set()).update(targets)
        completed |= completed_at(instance, record)


def _drop(open_for: Mapping[str, set[str]], completed: set[str]) -> None:
    for targets in open_for.values():
        targets -= completed


def _forgets(meant: tuple[str, ...], due: set[str], completed: set[str]) -> bool:
    if not meant:
        return False
    return set(meant) <= completed or bool(due and not due & set(meant))


def _places(command: Action) -> bool:
    return "position" in command.arguments or {"x", "y"} <= set(command.arguments)


def _first_receipts(record: BoundaryRecord) -> dict[str, Receipt]:
    """The first receipt of each agent's command of this boundary."""
    own = [one for one in record.receipts if is_request_of("command", one.request, record.tick)]
    return {receipt.sender: receipt for receipt in reversed(own)}


def _rounded(command: Action) -> tuple[tuple[str, object], ...]:
    return tuple((name, _whole(value)) for name, value in sorted(command.arguments.items()) if value is not None)


def _whole(value: object) -> object:
    if isinstance(value, bool) or not isinstance(value, int | float | tuple | list):
        return value
    return tuple(map(_whole, value)) if isinstance(value, tuple | list) else round(value)


__all__ = [
    "TERCILES", "ActionCounts", "BehaviourRates", "JudgedAction", "actions", "behaviour", "counted",
    "counted_by_tercile",
]  # fmt: skip
