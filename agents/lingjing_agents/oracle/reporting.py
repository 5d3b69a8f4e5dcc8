"""Reports: whatever unreported target a picture shows is reported with its exact box and position."""

from __future__ import annotations

from lingjing.plugins.policy import Brief, FrameInfo, Outgoing
from lingjing_agents.oracle.ability import Ability
from lingjing_agents.oracle.composing import MessageComposer
from lingjing_agents.oracle.privileged_state import InstanceIndex, PrivilegedState

PATIENCE_TICKS = 3
"""A report is adjudicated one boundary after it was sent and seen to be one later; after that it is sent again."""


class ReportAbility(Ability):
    """Says what the agent's own pictures show, and hands each target over to whoever deals with it."""

    def __init__(self, plan: InstanceIndex, composer: MessageComposer) -> None:
        self._plan, self._composer = plan, composer
        self.told: dict[str, int] = {}

    def open(self, truth: PrivilegedState) -> tuple[str, ...]:
        """The targets that are neither reported nor waiting to be judged."""
        waiting = {name for name, tick in self.told.items() if truth.tick - tick < PATIENCE_TICKS}
        return tuple(name for name in truth.unreported if name not in waiting)

    def say(self, truth: PrivilegedState) -> list[Outgoing]:
        """Reports of this boundary's pictures."""
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
            said = self._composer.report(kind, frame, box.cls, box.box, state.position, state.resources)
            if said:
                self.told[box.entity] = truth.tick
                messages += said + self._hand_over(box.entity, truth)
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
    """Whoever may send a kind that a rule matches."""
    able = any(composer.kind(kind) is not None for kind in plan.kinds.values())
    return [ReportAbility(plan, composer)] if able else []
