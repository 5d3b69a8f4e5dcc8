"""Idle fraction: the share of agent steps with nothing assigned and nothing done.

The paper (its table of diagnostic metrics): "Number of agent steps with no assigned or executed task action, divided by
all agent steps." An agent has a step at each boundary at which it was asked; only agents with a body have any, since a
hub is assigned nothing and executes nothing. A step is not idle if a command for one of the agent's bodies was admitted
in it or was still under way, or if an assignment to it was open: from the tick it was sent until what it names is
completed, the agent itself tells that it is done, or, where it means no target, until a command begun after it has
ended.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from lingjing.analysis.completion import completed_at
from lingjing.analysis.detection import ratio
from lingjing.analysis.memo import once_per_trace
from lingjing.analysis.repetition import assignments_of
from lingjing.trace.reader import Trace
from lingjing.trace.records import BoundaryRecord, Receipt

_ENDS = frozenset({"completed", "rejected", "timed_out"})
_DONE = "done"
"""The state by which a target-status message tells that its sender is through with something."""


@dataclass(slots=True)
class _Duty:
    """What one body is at: the request under way, targets it was assigned, and if an errand without one is open."""

    request: str = ""
    targets: set[str] = field(default_factory=set)
    errand: bool = False
    since: str = ""
    """The first request that began after the errand was given."""

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

    def assign(self, targets: Iterable[str]) -> None:
        given = set(targets)
        self.targets |= given
        if not given:
            self.errand, self.since = True, ""


def idle_fraction(trace: Trace) -> float | None:
    """Idle steps over all steps of agents with a body; None if there was none."""
    steps = idle_steps(trace)
    return ratio(sum(map(sum, steps.values())), sum(map(len, steps.values())))


def idle_steps(trace: Trace) -> dict[str, tuple[bool, ...]]:
    """Whether each step of each agent with a body was idle, in order."""
    return {agent: tuple(idle for idle, _ in steps) for agent, steps in _steps(trace).items()}


def still_steps(trace: Trace) -> dict[str, tuple[bool, ...]]:
    """Whether in each step of each agent with a body nothing was done or asked for, whatever it was assigned."""
    return {agent: tuple(still for _, still in steps) for agent, steps in _steps(trace).items()}


@once_per_trace
def _steps(trace: Trace) -> dict[str, tuple[tuple[bool, bool], ...]]:
    """Of each step of each agent with a body whether it was idle, and whether nothing was done."""
    instance = trace.header.instance
    bodies = {agent.id: agent.controls for agent in instance.agents if agent.controls}
    duties = {body: _Duty() for controls in bodies.values() for body in controls}
    assigned, completed = assignments_of(trace), set[str]()
    steps: dict[str, list[tuple[bool, bool]]] = {agent: [] for agent in bodies}
    for record in trace.boundaries:
        asked = [made.agent for made in record.decisions if made.agent in bodies]
        spoke = {made.agent for made in record.decisions if made.decision.command is not None and not made.substituted}
        began = _begin(record, duties)
        _assign(assigned.at(record), duties, completed)
        for agent in asked:
            active = any(duties[body].request or body in began for body in bodies[agent])
            steps[agent].append(
                (not active and not any(duties[body].busy for body in bodies[agent]), not active and agent not in spoke)
            )
        completed |= completed_at(instance, record)
        _end(record, bodies, duties, completed)
    return {agent: tuple(made) for agent, made in steps.items()}


def _begin(record: BoundaryRecord, duties: Mapping[str, _Duty]) -> set[str]:
    """The bodies for which a command was carried out or begun in this step."""
    first = {receipt.request: receipt for receipt in reversed(record.receipts)}
    began = set()
    for command in record.commands:
        duty = duties.get(command.resource)
        if duty is not None and _admitted(first.get(command.id)):
            began.add(command.resource)
            duty.begin(command.id)
    return began


def _admitted(receipt: Receipt | None) -> bool:
    """The first receipt of a command that an engine was sent says whether it took it."""
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
