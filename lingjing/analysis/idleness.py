"""Idle fraction: the share of agent steps without an assignment and without an action.

The paper (its table of diagnostic metrics): "Number of agent steps with no assigned or executed task action, divided by
all agent steps."

An agent has a step at each boundary at which its policy was called. Only agents with a body count, because a hub is
assigned nothing and executes nothing. A step is active if a command for one of the agent's bodies was admitted in it or
was still running, or if an assignment was open. An assignment is open from the tick at which it was sent until its
targets are completed. An assignment without targets, an *errand*, is open until the agent reports that it is done, or
until the first command that began after the assignment has ended.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from lingjing.analysis.completion import completed_at
from lingjing.analysis.detection import ratio
from lingjing.analysis.memo import cache_by_trace
from lingjing.analysis.repetition import assignments_of
from lingjing.trace.reader import Trace
from lingjing.trace.records import BoundaryRecord, Receipt

_ENDS = frozenset({"completed", "rejected", "timed_out"})
"""Statuses of receipts that end a request."""
_DONE = "done"
"""The `state` of a target-status message that ends the sender's errand."""


@dataclass(slots=True)
class _Duty:
    """The occupation of one body."""

    request: str = ""
    """The id of the running request, or ""."""
    targets: set[str] = field(default_factory=set)
    """Assigned targets that are not completed."""
    errand: bool = False
    """True if an assignment without targets is open."""
    since: str = ""
    """The id of the first request that began after the errand was assigned, or ""."""

    @property
    def busy(self) -> bool:
        return bool(self.request or self.targets or self.errand)

    def begin(self, request: str) -> None:
        self.request = request
        self.since = self.since or request

    def end(self, request: str) -> None:
        if self.request == request:
            self.request = ""
        if self.errand and request == self.since:
            self.errand = False

    def assign(self, targets: set[str]) -> None:
        self.targets |= targets
        if not targets:
            self.errand, self.since = True, ""


def idle_fraction(trace: Trace) -> float | None:
    """Return the share of idle steps of agents with a body, or None if there were no steps."""
    steps = idle_steps(trace)
    return ratio(sum(map(sum, steps.values())), sum(map(len, steps.values())))


def idle_steps(trace: Trace) -> dict[str, tuple[bool, ...]]:
    """Return, for each agent with a body, True for each idle step, in order."""
    return {agent: tuple(idle for idle, _ in steps) for agent, steps in _steps(trace).items()}


def still_steps(trace: Trace) -> dict[str, tuple[bool, ...]]:
    """Return, for each agent with a body, True for each step without an action, in order. Assignments do not count."""
    return {agent: tuple(still for _, still in steps) for agent, steps in _steps(trace).items()}


@cache_by_trace
def _steps(trace: Trace) -> dict[str, tuple[tuple[bool, bool], ...]]:
    """Return, for each step of each agent with a body: True if it was idle, and True if it had no action."""
    instance = trace.header.instance
    bodies = {agent.id: agent.controls for agent in instance.agents if agent.controls}
    duties = {body: _Duty() for controls in bodies.values() for body in controls}
    assigned, completed = assignments_of(trace), set[str]()
    steps: dict[str, list[tuple[bool, bool]]] = {agent: [] for agent in bodies}
    for record in trace.boundaries:
        own = [entry for entry in record.decisions if entry.agent in bodies]
        commanded = {entry.agent for entry in own if entry.decision.command is not None and not entry.substituted}
        began = _begin(record, duties)
        _assign(assigned.at(record), duties, completed)
        for agent in (entry.agent for entry in own):
            active = any(duties[body].request or body in began for body in bodies[agent])
            busy = any(duties[body].busy for body in bodies[agent])
            steps[agent].append((not active and not busy, not active and agent not in commanded))
        completed |= completed_at(instance, record)
        _end(record, bodies, duties, completed)
    return {agent: tuple(own_steps) for agent, own_steps in steps.items()}


def _begin(record: BoundaryRecord, duties: Mapping[str, _Duty]) -> set[str]:
    """Register the admitted commands of a step, and return their bodies."""
    first = {receipt.request: receipt for receipt in reversed(record.receipts)}
    began = set()
    for command in record.commands:
        duty = duties.get(command.resource)
        if duty is not None and _admitted(first.get(command.id)):
            began.add(command.resource)
            duty.begin(command.id)
    return began


def _admitted(receipt: Receipt | None) -> bool:
    """Return whether the first receipt of a command admits it."""
    return receipt is not None and receipt.status not in ("rejected", "timed_out")


def _assign(
    assignments: Iterable[tuple[str, tuple[str, ...], str]], duties: Mapping[str, _Duty], completed: set[str]
) -> None:
    for body, targets, _ in assignments:
        duty = duties.get(body)
        if duty is not None and (not targets or set(targets) - completed):
            duty.assign(set(targets) - completed)


def _end(
    record: BoundaryRecord,
    bodies: Mapping[str, tuple[str, ...]],
    duties: Mapping[str, _Duty],
    completed: set[str],
) -> None:
    for receipt in record.receipts:
        if receipt.status in _ENDS and receipt.resource in duties:
            duties[receipt.resource].end(receipt.request)
    for duty in duties.values():
        duty.targets -= completed
    for message in record.messages:
        if message.category == "target_status" and message.body.get("state") == _DONE:
            for body in bodies.get(message.sender, ()):
                duties[body].errand = False
