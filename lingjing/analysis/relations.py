"""Occurrences of the declared coordination relations: who did it to whom, by what, at which boundary.

The paper's five labels describe task structure. A declaration becomes a record when it happens: a message that
carries the evidence (information handoff) or the assignment (guidance), a first visit of a shared cell or first work in
it (cooperation), a command for a shared resource that was refused because somebody else has it (competition), a stage
that follows its prerequisite (dependency). A mutual relation occurs in both directions.

What a hub passes on counts for those who said it: its message of the same kind, or to the same place, as one that it
was sent. Those who take no pictures share cells by what an engine says that they did there, each agent once in a cell;
what is competed for is no such work. Those who share a region work together when one comes in while the other is there.
A target is competed for by those who are at it when somebody else gets it.

The kernel decides nothing by these records and knows none of them. Whoever writes a trace adds them to each boundary.
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
from lingjing.trace.admitted import admitted_at, categories_of
from lingjing.trace.records import BoundaryRecord, Envelope, Receipt, RelationRecord, StageChange

Emitted = tuple[str, tuple[str, ...]]
"""What an engine said: its kind, and its entities, the target first."""

NamedPolygon = tuple[str, Sequence[tuple[float, float]]]
"""A region or a cell: its name and polygon."""


def _photographs_ground(entity: Entity) -> bool:
    """Whether cells may become visited by what it photographs: a picture from a front camera visits none."""
    asks = any(verb.name == PHOTO for verb in entity.verbs)
    return asks and any(camera.view != "front" for camera in entity.cameras)


class RelationTracker:
    """Recognises occurrences of one instance's relations, one boundary after another."""

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
        """The occurrences at the next boundary, the first of which is boundary 0."""
        before, self._registry = self._registry, self._next(record)
        return self.occurrences(before, self._registry, record.messages, record.receipts, record.stages)

    def _next(self, record: BoundaryRecord) -> Registry:
        """The part of the kernel's registry that relations are read from, as the record shows it."""
        said = admitted_at(record, self._categories)
        updated = (
            self._registry.with_boundary(record.tick, record.time_s, record.snapshots[-1].states)
            .with_receipts(record.commands, record.receipts)
            .with_events(event for event in record.task_events if not event.name)
            .with_frames([frame for frame in record.frames if frame.camera != REFERENCE], self._instance)
            .with_reports([Report(one.id, one.kind, one.sender, one.tick, one.body) for one in said])
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
        """All occurrences at the boundary of `after`, in declaration order of the relations."""
        found: list[RelationRecord] = []
        for relation in self._relations:
            if relation.kind in ("information_handoff", "guidance"):
                found.extend(self._messages(relation, envelopes, before, after.tick))
            elif relation.kind == "cooperation":
                found.extend(self._visits(relation, before, after))
                found.extend(self._worked(relation, before, after))
                found.extend(self._shared(relation, before, after))
            elif relation.kind == "competition":
                found.extend(self._conflicts(relation, before, receipts, after.tick))
                found.extend(self._rivals(relation, before, after))
            else:
                found.extend(_dependencies(relation, after, stages))
        return tuple(found)

    def _messages(
        self, relation: Relation, envelopes: Sequence[Envelope], before: Registry, tick: int
    ) -> Iterator[RelationRecord]:
        kind = relation.carries or relation.by
        for edge in envelopes:
            source = ""
            if edge.kind == kind and self._between(relation, edge.sender, edge.recipient):
                source = edge.sender
            elif edge.sender == self._hub:
                source = self._passed_on(relation, str(kind), edge, before)
            if source:
                yield RelationRecord(kind=relation.kind, source=source, target=edge.recipient, by=edge.id, tick=tick)

    def _passed_on(self, relation: Relation, kind: str, edge: Envelope, before: Registry) -> str:
        """Who told the hub what it now tells the recipient, or ""."""
        for report in before.reports.newest():
            told = report.kind == kind and report.sender != self._hub and _same(report, edge)
            if told and self._between(relation, report.sender, edge.recipient):
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
        """Who for the first time has done something in a cell, for the partners in the grid; of those without pictures
        of the ground, the others share a grid by what they have photographed."""
        if relation.over not in self._grids.values() or relation.source not in self._blind:
            return
        parts = self._areas[relation.over or ""]
        known = {done for key in before.emitted for done in self._done(key, parts, before)}
        fresh = [done for key in after.emitted if key not in before.emitted for done in self._done(key, parts, after)]
        for agent, name in dict.fromkeys(done for done in fresh if done not in known):
            for partner in self._partners(relation, self._agents[agent]):
                if any(self._inside(partner, polygon, after) for _, polygon in parts):
                    yield RelationRecord(kind=relation.kind, source=agent, target=partner.id, by=name, tick=after.tick)

    def _done(self, key: Emitted, parts: Sequence[NamedPolygon], at: Registry) -> Iterator[tuple[str, str]]:
        """(agent, cell) of an engine's event that somebody did something at a target."""
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
        """Who comes into a region while a partner is in it."""
        parts = self._areas.get(relation.over or "", ())
        if relation.over in self._grids.values():
            return
        for agent in self._agents.values():
            partners = self._partners(relation, agent)
            for name, polygon in parts if partners else ():
                # Who is there together at boundary 0 has shared the area from the beginning.
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
        return tuple(one for one in self._agents.values() if one.role in roles and one.id != agent.id)

    def _inside(self, agent: AgentSpec, polygon: Sequence[tuple[float, float]], at: Registry) -> bool:
        bodies = (at.states[name] for name in agent.controls if name in at.states)
        return len(polygon) > 2 and any(contains(polygon, *body.position[:2]) for body in bodies)

    def _rivals(self, relation: Relation, before: Registry, after: Registry) -> Iterator[RelationRecord]:
        """Who is at a target of the group when an engine says that another one has got it."""
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
    """Whether a body of the agent's is where a destination would mean the target."""
    here = at.states.get(target)
    bodies = [at.states[name] for name in agent.controls if name in at.states]
    return here is not None and any(math.dist(one.position[:2], here.position[:2]) <= HANDOFF_M for one in bodies)


def _same(report: Report, edge: Envelope) -> bool:
    """Whether two messages say the same: the same record, or the same place."""
    if report.kind == edge.kind:
        return dict(report.body) == edge.body
    one, other = point(report.body.get("position")), point(edge.body.get("position"))
    return one is not None and other is not None and math.dist(one, other) <= SAME_POINT_M


def _dependencies(relation: Relation, after: Registry, stages: Sequence[StageChange]) -> Iterator[RelationRecord]:
    for change in stages:
        if change.stage == relation.target and (relation.source, change.subject) in after.stages:
            yield RelationRecord(
                kind=relation.kind, source=relation.source, target=relation.target, by=change.subject, tick=after.tick
            )
