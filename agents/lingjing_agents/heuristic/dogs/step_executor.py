"""The rules of a walker without a camera: carry out the step of the last guidance and report its result."""

from __future__ import annotations

from collections import deque
from typing import ClassVar

from lingjing.plugins.policy import Action, Brief, Datum, Decision, Envelope, Inbox, Observation, Outgoing, Resource
from lingjing_agents.capability import compose, has_verb, may_send
from lingjing_agents.heuristic.events import view_of
from lingjing_agents.heuristic.sightings import name_in

ENDED = {"completed": "done", "rejected": "blocked"}
"""The reported state for each receipt status that ends a step."""

PATIENCE_TICKS = 4
"""Ticks without a receipt after which the next step begins. Chosen."""


class StepExecutor:
    """One body that is guided step by step."""

    roles: ClassVar[tuple[str, ...]] = ("executor",)
    reads: ClassVar[tuple[str, ...]] = ("guidance",)
    sends: ClassVar[tuple[str, ...]] = ("status",)

    def __init__(self, brief: Brief, body: Resource) -> None:
        self._brief, self._body = brief, body
        self._status = may_send(brief, "target_status")
        self._steps: deque[Action] = deque()
        self._under_way = -1

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Report the result of the last step and begin the next."""
        for envelope in inbox.messages:
            step = _step_in(envelope, self._brief.agent, self._body)
            if step is not None:
                self._steps.append(step)
        messages: tuple[Outgoing, ...] = ()
        ends = [ENDED[receipt.status] for receipt in inbox.receipts if self._ended(receipt.resource, receipt.status)]
        own = view_of(observation, self._body.id)
        if self._under_way >= 0 and ends:
            self._under_way = -1
            if self._status is not None:
                place = own.position if own is not None else None
                body: dict[str, Datum] = {"task": "step", "state": ends[-1]}
                if place is not None:
                    body["position"] = place
                messages = (compose(self._status, body),)
        late = observation.tick - self._under_way > PATIENCE_TICKS
        if not self._steps or (self._under_way >= 0 and not late):
            return Decision(messages=messages)
        self._under_way = observation.tick
        return Decision(command=self._steps.popleft(), messages=messages)

    def _ended(self, resource: str, status: str) -> bool:
        return resource == self._body.id and status in ENDED


def _step_in(envelope: Envelope, agent: str, body: Resource) -> Action | None:
    """Return the step that a message of guidance requests of `agent`, as a command of `body`, or None."""
    step, assignee = name_in(envelope.body, "step"), name_in(envelope.body, "assignee")
    amount = envelope.body.get("amount")
    if envelope.category != "assignment" or step is None or not has_verb(body, step):
        return None
    if assignee is not None and assignee not in (agent, body.id):
        return None
    names = [argument.name for spec in body.verbs if spec.name == step for argument in spec.arguments]
    if names and not isinstance(amount, (int, float)):
        return None
    arguments: dict[str, Datum] = {names[0]: float(amount)} if names and isinstance(amount, (int, float)) else {}
    return Action(verb=step, arguments=arguments, resource=body.id)
