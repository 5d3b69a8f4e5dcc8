"""Occurrences of the declared coordination relations: who did it to whom, by what, at which boundary.

The paper's five labels describe task structure. A declaration becomes a record when it happens: a message that
carries the evidence (information handoff) or the assignment (guidance), a first visit of a shared cell
(cooperation), a command for a shared resource that was refused because somebody else has it (competition), a stage
that follows its prerequisite (dependency). A mutual relation occurs in both directions.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lingjing.kernel.registry import Registry
from lingjing.mission.instance import AgentSpec, Instance
from lingjing.mission.model import Relation
from lingjing.trace.records import Envelope, Receipt, RelationRecord, StageChange


class RelationTracker:
    """Recognises occurrences of one instance's relations; holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._relations = instance.relations
        self._agents: dict[str, AgentSpec] = {agent.id: agent for agent in instance.agents}
        self._owner = {name: agent for agent in instance.agents for name in agent.controls}
        self._resources = {entity.id: entity.group for entity in instance.entities}
        self._grids = {cell.name: cell.grid for cell in instance.cells}

    def occurrences(
        self,
        before: Registry,
        after: Registry,
        envelopes: Sequence[Envelope],
        receipts: Sequence[Receipt],
        stages: Sequence[StageChange],
    ) -> tuple[RelationRecord, ...]:
        """All occurrences at the boundary of `after`, in declaration order of the relations."""
        found: list[RelationRecord] = []
        for relation in self._relations:
            if relation.kind in ("information_handoff", "guidance"):
                found.extend(self._messages(relation, envelopes, after.tick))
            elif relation.kind == "cooperation":
                found.extend(self._visits(relation, before, after))
            elif relation.kind == "competition":
                found.extend(self._conflicts(relation, before, receipts, after.tick))
            else:
                found.extend(_dependencies(relation, after, stages))
        return tuple(found)

    def _messages(self, relation: Relation, envelopes: Sequence[Envelope], tick: int) -> Iterator[RelationRecord]:
        kind = relation.carries or relation.by
        for edge in envelopes:
            if edge.kind == kind and self._between(relation, edge.sender, edge.recipient):
                yield RelationRecord(
                    kind=relation.kind, source=edge.sender, target=edge.recipient, by=edge.id, tick=tick
                )

    def _visits(self, relation: Relation, before: Registry, after: Registry) -> Iterator[RelationRecord]:
        partners = tuple(agent.id for agent in self._agents.values() if agent.role == relation.target)
        for name, visit in after.visits.items():
            agent = self._owner.get(visit.entity)
            if name in before.visits or agent is None or agent.role != relation.source:
                continue
            if relation.over is not None and self._grids.get(name) != relation.over:
                continue
            for partner in partners:
                if partner != agent.id:
                    yield RelationRecord(kind=relation.kind, source=agent.id, target=partner, by=name, tick=after.tick)

    def _conflicts(
        self, relation: Relation, before: Registry, receipts: Sequence[Receipt], tick: int
    ) -> Iterator[RelationRecord]:
        roles = (relation.source, relation.target) if relation.mutual else (relation.source,)
        for receipt in receipts:
            if self._resources.get(receipt.resource) != relation.over or self._role(receipt.sender) not in roles:
                continue
            held = before.pending.get(receipt.resource)
            by_other = held is not None and held.sender != receipt.sender
            if receipt.reason == "conflict" or (receipt.reason == "busy" and by_other):
                yield RelationRecord(
                    kind=relation.kind, source=receipt.sender, target=receipt.resource, by=receipt.request, tick=tick
                )

    def _between(self, relation: Relation, sender: str, recipient: str) -> bool:
        roles, declared = (self._role(sender), self._role(recipient)), (relation.source, relation.target)
        return roles == declared or (relation.mutual and roles == declared[::-1])

    def _role(self, agent: str) -> str:
        return self._agents[agent].role if agent in self._agents else ""


def _dependencies(relation: Relation, after: Registry, stages: Sequence[StageChange]) -> Iterator[RelationRecord]:
    for change in stages:
        if change.stage == relation.target and (relation.source, change.subject) in after.stages:
            yield RelationRecord(
                kind=relation.kind, source=relation.source, target=relation.target, by=change.subject, tick=after.tick
            )
