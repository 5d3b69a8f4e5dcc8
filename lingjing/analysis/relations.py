"""Occurrences of the declared coordination relations.

The paper's five labels describe task structure. A mission declares those that its team can have (ADR 0011). Each
occurrence of a declared relation becomes a record:

- *information handoff*: a message carries the evidence. *Guidance*: a message carries the assignment. A message that a
  hub forwards has the original sender as its source. The hub forwards a message if it sends the same body of the same
  kind, or the same position, as it has received.
- *cooperation*: an agent visits a cell of a shared grid first, or works in it first. Agents without a camera that
  photographs the ground share a grid by the interactions that an engine reports, each agent once in a cell. Contested
  targets do not count. Agents share a region when one enters while the other is inside.
- *competition*: a command for a shared resource is rejected because another agent holds it. Agents also compete for a
  target if one is at it when an engine reports that another agent got it.
- *dependency*: a stage follows its prerequisite.

A mutual relation occurs in both directions. The kernel neither uses nor creates these records. The caller that writes a
trace adds them to each boundary.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from msgspec.structs import replace

from lingjing.kernel.assignments import point
from lingjing.kernel.facts import HANDOFF_M, SAME_POINT_M
from lingjing.kernel.registry import Registry, Report, initial
from lingjing.mission.geometry2d import contains
from lingjing.mission.instance import AgentSpec, Entity, Instance
from lingjing.mission.model import Relation
from lingjing.mission.vocabulary import PHOTO
from lingjing.plugins.policy import REFERENCE
from lingjing.trace.admitted_messages import admitted_at, categories_of
from lingjing.trace.records import BoundaryRecord, Envelope, Receipt, RelationRecord, StageChange

_Emitted = tuple[str, tuple[str, ...]]
"""A task event of an engine: its kind, and its entities with the target first."""

_NamedPolygon = tuple[str, Sequence[tuple[float, float]]]
"""A region or a cell: its name and polygon."""


def _photographs_ground(entity: Entity) -> bool:
    """Return whether pictures of the entity can mark cells as visited. Pictures of front cameras cannot."""
    takes_pictures = any(verb.name == PHOTO for verb in entity.verbs)
    return takes_pictures and any(camera.view != "front" for camera in entity.cameras)


class RelationTracker:
    """Detector of the occurrences of one instance's relations. Boundaries must be passed in order."""

    def __init__(self, instance: Instance) -> None:
        self._instance = instance
        self._categories = categories_of(instance)
        self._registry = initial(instance)
        self._relations = instance.relations
        self._agents: dict[str, AgentSpec] = {agent.id: agent for agent in instance.agents}
        self._owner = {name: agent for agent in instance.agents for name in agent.controls}
        self._resources = {entity.id: entity.group for entity in instance.entities}
        self._grids = {cell.name: cell.grid for cell in instance.cells}
        self._hub = instance.comms.hub
        self._targets = {entity.id: entity.group for entity in instance.entities if entity.role == "target"}
        eyes = {entity.id for entity in instance.entities if _photographs_ground(entity)}
        self._blind = {agent.role for agent in instance.agents if not eyes.intersection(agent.controls)}
        self._contested = {relation.over for relation in instance.relations if relation.kind == "competition"}
        self._areas = {
            **{region.name: ((region.name, region.polygon),) for region in instance.regions},
            **{
                grid: tuple((cell.name, cell.polygon) for cell in instance.cells if cell.grid == grid)
                for grid in self._grids.values()
            },
        }

    def take(self, record: BoundaryRecord) -> tuple[RelationRecord, ...]:
        """Return the occurrences at the next boundary. The first call is for boundary 0."""
        before, self._registry = self._registry, self._next(record)
        return self.occurrences(before, self._registry, record.messages, record.receipts, record.stages)

    def _next(self, record: BoundaryRecord) -> Registry:
        """Return the registry after a boundary, as far as relations depend on it."""
        messages = admitted_at(record, self._categories)
        updated = (
            self._registry.with_boundary(record.tick, record.time_s, record.snapshots[-1].states)
            .with_receipts(record.commands, record.receipts)
            .with_events(event for event in record.task_events if not event.name)
            .with_frames([frame for frame in record.frames if frame.camera != REFERENCE], self._instance)
            .with_reports([Report(sent.id, sent.kind, sent.sender, sent.tick, sent.body) for sent in messages])
        )
        done = {(change.stage, change.subject): change.tick for change in record.stages}
        return replace(updated, stages={**updated.stages, **done})

    def occurrences(
        self,
        before: Registry,
        after: Registry,
        envelopes: Sequence[Envelope],
        receipts: Sequence[Receipt],
        stages: Sequence[StageChange],
    ) -> tuple[RelationRecord, ...]:
        """Return all occurrences at the boundary of `after`, in declaration order of the relations."""
        occurrences: list[RelationRecord] = []
        for relation in self._relations:
            if relation.kind in ("information_handoff", "guidance"):
                occurrences.extend(self._messages(relation, envelopes, before, after.tick))
            elif relation.kind == "cooperation":
                occurrences.extend(self._visits(relation, before, after))
                occurrences.extend(self._worked(relation, before, after))
                occurrences.extend(self._shared(relation, before, after))
            elif relation.kind == "competition":
                occurrences.extend(self._conflicts(relation, before, receipts, after.tick))
                occurrences.extend(self._rivals(relation, before, after))
            else:
                occurrences.extend(_dependencies(relation, after, stages))
        return tuple(occurrences)

    def _messages(
        self, relation: Relation, envelopes: Sequence[Envelope], before: Registry, tick: int
    ) -> Iterator[RelationRecord]:
        kind = relation.carries or relation.by
        for edge in envelopes:
            source = ""
            if edge.kind == kind and self._between(relation, edge.sender, edge.recipient):
                source = edge.sender
            elif edge.sender == self._hub:
                source = self._original_sender(relation, str(kind), edge, before)
            if source:
                yield RelationRecord(kind=relation.kind, source=source, target=edge.recipient, by=edge.id, tick=tick)

    def _original_sender(self, relation: Relation, kind: str, edge: Envelope, before: Registry) -> str:
        """Return the sender of the message that the hub forwards by `edge`, or ""."""
        for report in before.reports.newest():
            forwarded = report.kind == kind and report.sender != self._hub and _same(report, edge)
            if forwarded and self._between(relation, report.sender, edge.recipient):
                return report.sender
        return ""

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

    def _worked(self, relation: Relation, before: Registry, after: Registry) -> Iterator[RelationRecord]:
        """Yield the first work of agents in cells of a shared grid, for each partner inside the grid.

        Only agents that photograph no ground count here. The others share a grid by their visits.
        """
        if relation.over not in self._grids.values() or relation.source not in self._blind:
            return
        parts = self._areas[relation.over or ""]
        known = {done for key in before.emitted for done in self._done(key, parts, before)}
        fresh = [done for key in after.emitted if key not in before.emitted for done in self._done(key, parts, after)]
        for agent, name in dict.fromkeys(done for done in fresh if done not in known):
            for partner in self._partners(relation, self._agents[agent]):
                if any(self._inside(partner, polygon, after) for _, polygon in parts):
                    yield RelationRecord(kind=relation.kind, source=agent, target=partner.id, by=name, tick=after.tick)

    def _done(self, key: _Emitted, parts: Sequence[_NamedPolygon], at: Registry) -> Iterator[tuple[str, str]]:
        """Yield (agent, cell) for an engine's event of an interaction with an uncontested target."""
        target, *actors = key[1]
        agent = self._owner.get(actors[0]) if actors else None
        group = self._targets.get(target)
        if agent is None or group is None or group in self._contested or target not in at.states:
            return
        place = at.states[target].position[:2]
        for name, polygon in parts:
            if contains(polygon, *place):
                yield agent.id, name

    def _shared(self, relation: Relation, before: Registry, after: Registry) -> Iterator[RelationRecord]:
        """Yield the entries of agents into a region while a partner is inside."""
        parts = self._areas.get(relation.over or "", ())
        if relation.over in self._grids.values():
            return
        for agent in self._agents.values():
            partners = self._partners(relation, agent)
            for name, polygon in parts if partners else ():
                # agents that are inside together at boundary 0 share the area from the beginning
                if not self._inside(agent, polygon, after) or (after.tick > 0 and self._inside(agent, polygon, before)):
                    continue
                for partner in partners:
                    if any(self._inside(partner, other, after) for _, other in parts):
                        yield RelationRecord(
                            kind=relation.kind, source=agent.id, target=partner.id, by=name, tick=after.tick
                        )

    def _partners(self, relation: Relation, agent: AgentSpec) -> tuple[AgentSpec, ...]:
        roles = {relation.target} if agent.role == relation.source else set()
        if relation.mutual and agent.role == relation.target:
            roles.add(relation.source)
        return tuple(partner for partner in self._agents.values() if partner.role in roles and partner.id != agent.id)

    def _inside(self, agent: AgentSpec, polygon: Sequence[tuple[float, float]], at: Registry) -> bool:
        bodies = (at.states[name] for name in agent.controls if name in at.states)
        return len(polygon) > 2 and any(contains(polygon, *body.position[:2]) for body in bodies)

    def _rivals(self, relation: Relation, before: Registry, after: Registry) -> Iterator[RelationRecord]:
        """Yield the agents that are at a target of the group when an engine reports that another agent got it."""
        for key in after.emitted:
            target, *actors = key[1]
            if key in before.emitted or not actors or self._targets.get(target) != relation.over:
                continue
            winner = self._owner.get(actors[0])
            for rival in self._partners(relation, winner) if winner is not None else ():
                if winner is not None and _is_at(rival, target, after):
                    yield RelationRecord(
                        kind=relation.kind, source=rival.id, target=target, by=winner.id, tick=after.tick
                    )

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


def _is_at(agent: AgentSpec, target: str, at: Registry) -> bool:
    """Return whether a body of the agent is within `HANDOFF_M` of the target."""
    here = at.states.get(target)
    bodies = [at.states[name] for name in agent.controls if name in at.states]
    return here is not None and any(math.dist(body.position[:2], here.position[:2]) <= HANDOFF_M for body in bodies)


def _same(report: Report, edge: Envelope) -> bool:
    """Return whether two messages have the same content: equal kind and body, or the same position."""
    if report.kind == edge.kind:
        return dict(report.body) == edge.body
    received, sent = point(report.body.get("position")), point(edge.body.get("position"))
    return received is not None and sent is not None and math.dist(received, sent) <= SAME_POINT_M


def _dependencies(relation: Relation, after: Registry, stages: Sequence[StageChange]) -> Iterator[RelationRecord]:
    for change in stages:
        if change.stage == relation.target and (relation.source, change.subject) in after.stages:
            yield RelationRecord(
                kind=relation.kind, source=relation.source, target=relation.target, by=change.subject, tick=after.tick
            )
