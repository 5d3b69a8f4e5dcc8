"""Reports: every unreported target in a picture is reported with its exact box and position."""

from __future__ import annotations

from lingjing.plugins.policy import Brief, FrameInfo, Outgoing
from lingjing_agents.oracle.ability import Ability
from lingjing_agents.oracle.composing import MessageComposer
from lingjing_agents.oracle.privileged_state import InstanceIndex, PrivilegedState

PATIENCE_TICKS = 3
"""Ticks until a report is repeated. A report is adjudicated one boundary after it was sent, and the result is observed
one boundary later.
"""


class ReportAbility(Ability):
    """Reports the targets in the agent's own pictures and hands each over to an agent that can serve it."""

    def __init__(self, plan: InstanceIndex, composer: MessageComposer) -> None:
        self._plan, self._composer = plan, composer
        self.told: dict[str, int] = {}

    def open(self, truth: PrivilegedState) -> tuple[str, ...]:
        """Return the targets that are neither reported nor waiting for adjudication."""
        waiting = {name for name, tick in self.told.items() if truth.tick - tick < PATIENCE_TICKS}
        return tuple(name for name in truth.unreported if name not in waiting)

    def say(self, truth: PrivilegedState) -> list[Outgoing]:
        """Return reports of this boundary's pictures."""
        messages: list[Outgoing] = []
        for frame in truth.known.frames:
            messages += self._of(frame, truth)
        return messages

    def _of(self, frame: FrameInfo, truth: PrivilegedState) -> list[Outgoing]:
        messages: list[Outgoing] = []
        wanted = self.open(truth)
        for box in frame.boxes:
            state = truth.state(box.entity)
            if box.entity not in wanted or state is None:
                continue
            kind = self._plan.kinds[self._plan.entities[box.entity].group]
            report = self._composer.report(kind, frame, box.cls, box.box, state.position, state.resources)
            if report:
                self.told[box.entity] = truth.tick
                messages += report + self._hand_over(box.entity, truth)
        return messages

    def _hand_over(self, target: str, truth: PrivilegedState) -> list[Outgoing]:
        state = truth.states[target]
        for task in truth.left:
            if task.target == target:
                bodies = [body.id for body in self._plan.able(task)]
                own = {resource.id for resource in truth.brief.resources if resource.embodied}
                if bodies and not own.intersection(bodies):
                    nearest = min(bodies, key=lambda name: truth.distance(name, target))
                    return self._composer.order(nearest, task.name, {"position": state.position})
        return []


def report_abilities(brief: Brief, plan: InstanceIndex, composer: MessageComposer) -> list[Ability]:
    """Return the ability if the agent may send a kind that a rule matches."""
    able = any(composer.kind(kind) is not None for kind in plan.kinds.values())
    return [ReportAbility(plan, composer)] if able else []
