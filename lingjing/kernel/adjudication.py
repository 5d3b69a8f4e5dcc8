"""Adjudicate: rules become events, once per binding, from engine state alone.

At a boundary the macro-steps since the boundary before are visited in order. Rules that depend on motion are evaluated
at each of them, so that no body passes through a radius between two evaluations. The other rules are evaluated once, at
the boundary, with the messages that were committed there. A rule that holds is *latched*: its event is emitted once,
with the time of the macro-step. Rules that compare a report with `truth(…)` are matched one to one in each frame: a
report matches at most one entity, and an entity at most one report of a frame. Earlier reports match first; of several
entities the one with the highest overlap (intersection over union) is chosen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence

import msgspec
from msgspec.structs import replace

from lingjing.kernel.assignments import point
from lingjing.kernel.constraints import ConstraintMonitor
from lingjing.kernel.context import RuntimeContext
from lingjing.kernel.facts import FACTS
from lingjing.kernel.registry import Binding, Registry, Report
from lingjing.kernel.rules import RUNNING, bindings, holds, identity, is_decided_on_arrival, rule_depends_on_motion
from lingjing.kernel.stages import Stages
from lingjing.kernel.temporal import TemporalCall, remember, temporal_calls
from lingjing.mission.expression import Call, Expr, parts
from lingjing.mission.fold import Meanings
from lingjing.mission.instance import Datum, Entity, Instance
from lingjing.mission.model import Rule
from lingjing.mission.values import Area
from lingjing.scene.city import City
from lingjing.scene.sight import SightLines
from lingjing.trace.records import AdjudicatedEvent, BodyState, Snapshot, StageChange


class Verdict(msgspec.Struct, frozen=True):
    """The adjudication of one boundary: V in the paper."""

    registry: Registry
    """The registry with the latched rules, broken constraints, begun stages and unlocks."""
    events: tuple[AdjudicatedEvent, ...]
    """Rules that became true and constraints that were broken, in the order of evaluation."""
    stages: tuple[StageChange, ...]
    """Stages that were completed at this boundary."""
    unlocks: tuple[tuple[str, str], ...]
    """Newly allowed (interaction, entity) pairs."""


class Adjudicator:
    """The adjudicator of one instance. It orders rules after the rules that they call and holds no run-time state.

    `city` supplies the city for lines of sight; it is called at the first one. Without a city they have no value.
    """

    def __init__(self, instance: Instance, city: Callable[[], City | None] = lambda: None) -> None:
        self._instance = instance
        self._sight = SightLines(city)
        self.kinds = frozenset(message.kind for message in instance.messages)
        self._groups = _groups(instance.entities)
        self._monitor = ConstraintMonitor(instance)
        self._declared_stages = Stages(instance)
        self._rules = {rule.name: rule for rule in instance.rules}
        ordered = _sorted_rules(instance.rules)
        self._moving = tuple(rule for rule in ordered if rule_depends_on_motion(rule, self._rules, self.kinds))
        self._static = tuple(rule for rule in ordered if rule not in self._moving)
        self._temporal = {rule.name: temporal_calls(rule.condition, dict(_domains(rule))) for rule in ordered}
        self._others = tuple(_other_calls(instance))
        self._areas = {region.name: Area(region.polygon) for region in instance.regions}
        self._meanings = Meanings(RUNNING)
        # A boundary needs the same context several times: for permits, observations, adjudication and evaluation.
        self._latest: RuntimeContext | None = None
        self._decided_on_arrival = frozenset(
            rule.name for rule in ordered if is_decided_on_arrival(rule, self._rules, self.kinds)
        )

    def context_at(self, registry: Registry, states: Mapping[str, BodyState], time_s: float) -> RuntimeContext:
        """Return the evaluation context of this instance at `time_s`; repeated calls with the same state return the
        same one.
        """
        latest = self._latest
        if latest is not None and latest.registry is registry and latest.states is states and latest.time_s == time_s:
            return latest
        self._latest = RuntimeContext(
            self._instance,
            registry,
            states,
            time_s,
            self._groups,
            self._rules,
            self.kinds,
            self._areas,
            FACTS,
            self._meanings,
            self._sight,
        )
        return self._latest

    def context_of(self, registry: Registry) -> RuntimeContext:
        """Return the evaluation context of a registry at its own boundary."""
        return self.context_at(registry, registry.states, registry.time_s)

    def adjudicate(self, before: Registry, registry: Registry, snapshots: Sequence[Snapshot]) -> Verdict:
        """Adjudicate the macro-steps of the boundary at which `registry` stands.

        `before` is the registry of the boundary before. Its reports count for all macro-steps but the last, because
        messages are committed only with the boundary.
        """
        events: list[AdjudicatedEvent] = []
        if (self._moving or self._others) and len(snapshots) > 1:
            early = replace(registry, reports=before.reports)
            for snapshot in snapshots[:-1]:
                states = {state.id: state for state in snapshot.states}
                early = self._apply(self._moving, early, states, snapshot.time_s, events)
                early = self._remember(early, self._others, states, snapshot.time_s)
            registry = replace(early, reports=registry.reports)
        registry = self._apply(self._static + self._moving, registry, registry.states, registry.time_s, events)
        registry = self._remember(registry, self._others, registry.states, registry.time_s)
        registry, broken = self._monitor.check(registry, snapshots, self.context_at, len(events) + 1)
        events.extend(broken)
        registry, stages = self._stages(registry)
        registry = self._declared_stages.begin(registry)
        registry, unlocks = self._unlocks(registry)
        return Verdict(registry, tuple(events), stages, unlocks)

    def _apply(
        self,
        rules: Iterable[Rule],
        registry: Registry,
        states: Mapping[str, BodyState],
        time_s: float,
        events: list[AdjudicatedEvent],
    ) -> Registry:
        for rule in rules:
            registry = self._remember(registry, self._temporal[rule.name], states, time_s)
            at = self.context_at(registry, states, time_s)
            registry = self._match(rule, at, events) if rule.matching else self._latch(rule, at, events)
        return registry

    def _remember(
        self, registry: Registry, calls: Sequence[TemporalCall], states: Mapping[str, BodyState], time_s: float
    ) -> Registry:
        if not calls:
            return registry
        return remember(registry, calls, lambda current: self.context_at(current, states, time_s))

    def _latch(self, rule: Rule, at: RuntimeContext, events: list[AdjudicatedEvent]) -> Registry:
        achieved: dict[Binding, float] = {}
        for scope in bindings(_domains(rule), at, fresh=rule.name in self._decided_on_arrival):
            binding = tuple(identity(value) for value in scope.values())
            if (rule.name, binding) in at.registry.achieved:
                continue
            at.evidence.clear()
            if holds(rule.condition, scope, at):
                achieved[binding] = at.time_s
                events.append(self._event(rule, scope, at, len(events)))
        return at.registry.with_achieved(rule.name, achieved)

    def _match(self, rule: Rule, at: RuntimeContext, events: list[AdjudicatedEvent]) -> Registry:
        registry = at.registry
        achieved: dict[Binding, float] = {}
        for report, scopes in self._by_report(rule, at).items():
            best = self._best(rule, scopes, registry.claimed, at)
            if best is None:
                continue
            scope, claim, evidence = best
            at.evidence.clear()
            at.evidence.update(evidence)
            registry = _with_sightings(replace(registry, claimed=registry.claimed.extended({claim: report})), scope, at)
            achieved[tuple(identity(value) for value in scope.values())] = at.time_s
            events.append(self._event(rule, scope, at, len(events)))
        return registry.with_achieved(rule.name, achieved)

    def _by_report(self, rule: Rule, at: RuntimeContext) -> dict[str, list[dict[str, Entity | Report]]]:
        """Return the candidate bindings of each report that arrived at this boundary, in arrival order."""
        arrived = dict.fromkeys(
            value.id for _, domain in _domains(rule) for value in at.fresh(domain) if isinstance(value, Report)
        )
        table: dict[str, list[dict[str, Entity | Report]]] = {name: [] for name in arrived}
        for scope in bindings(_domains(rule), at, fresh=True):
            for value in scope.values():
                if isinstance(value, Report):
                    table[value.id].append(scope)
        return table

    def _best(
        self,
        rule: Rule,
        scopes: list[dict[str, Entity | Report]],
        claimed: Container[tuple[str, str]],
        at: RuntimeContext,
    ) -> tuple[dict[str, Entity | Report], tuple[str, str], dict[str, float]] | None:
        best: tuple[dict[str, Entity | Report], tuple[str, str], dict[str, float]] | None = None
        for scope in scopes:
            claim = _claim(scope)
            at.evidence.clear()
            # One report takes one target of a frame, in the order of admission (ADR 0004).
            if claim in claimed or not holds(rule.condition, scope, at):
                continue
            if best is None or at.evidence.get("iou", 0.0) > best[2].get("iou", 0.0):
                best = (scope, claim, dict(at.evidence))
        return best

    def _event(
        self, rule: Rule, scope: Mapping[str, Entity | Report], at: RuntimeContext, number: int
    ) -> AdjudicatedEvent:
        evidence: dict[str, Datum] = dict(at.evidence)
        error = _localisation_error(scope, at)
        if error is not None:
            evidence["loc_error_m"] = error
        return AdjudicatedEvent(
            id=f"e{at.registry.tick}-{number + 1}",
            kind=rule.name,
            tick=at.registry.tick,
            time_s=at.time_s,
            bindings=tuple(identity(value) for value in scope.values()),
            evidence=evidence,
        )

    def _stages(self, registry: Registry) -> tuple[Registry, tuple[StageChange, ...]]:
        if not self._instance.stages:
            return registry, ()
        at = self.context_at(registry, registry.states, registry.time_s)
        done = dict(registry.stages)
        changes = []
        waiting = self._declared_stages.waiting(registry)
        for stage in self._instance.stages:
            domain = ((stage.variable, stage.domain),) if stage.variable and stage.domain else ()
            for scope in bindings(domain, at):
                subject = "".join(identity(value) for value in scope.values())
                if (stage.name, subject) in done or (stage.name, subject) in waiting:
                    continue
                if holds(stage.condition, scope, at):
                    done[stage.name, subject] = registry.tick
                    changes.append(
                        StageChange(stage=stage.name, subject=subject, tick=registry.tick, time_s=registry.time_s)
                    )
        return (replace(registry, stages=done) if changes else registry), tuple(changes)

    def _unlocks(self, registry: Registry) -> tuple[Registry, tuple[tuple[str, str], ...]]:
        if not self._instance.unlocks:
            return registry, ()
        at = self.context_at(registry, registry.states, registry.time_s)
        fresh: dict[tuple[str, str], int] = {}
        for unlock in self._instance.unlocks:
            domains = tuple((parameter.name, parameter.domain) for parameter in unlock.parameters)
            for scope in bindings(domains, at):
                key = (unlock.interaction, identity(next(iter(scope.values()))))
                if key not in registry.unlocked and key not in fresh and holds(unlock.condition, scope, at):
                    fresh[key] = registry.tick
        if not fresh:
            return registry, ()
        return replace(registry, unlocked={**registry.unlocked, **fresh}), tuple(fresh)


def _other_calls(instance: Instance) -> Iterator[TemporalCall]:
    """Yield the functions over time outside of rules and constraints."""
    yield from temporal_calls(instance.success, {})
    yield from temporal_calls(instance.failure, {})
    for stage in instance.stages:
        yield from temporal_calls(
            stage.condition, {stage.variable: stage.domain} if stage.variable and stage.domain else {}
        )
    for unlock in instance.unlocks:
        domains = {parameter.name: parameter.domain for parameter in unlock.parameters}
        yield from temporal_calls(unlock.condition, domains)
    for permit in instance.permits:
        yield from temporal_calls(permit.condition, {})
    for event in instance.events:
        for condition in (event.condition, event.until, *(change.value for change in event.changes)):
            yield from temporal_calls(condition, {})


def _domains(rule: Rule) -> tuple[tuple[str, str], ...]:
    return tuple((parameter.name, parameter.domain) for parameter in rule.parameters)


def _claim(scope: Mapping[str, Entity | Report]) -> tuple[str, str]:
    """Return the (frame, entity) pair that a matched binding occupies."""
    frame = next((str(value.body.get("frame")) for value in scope.values() if isinstance(value, Report)), "")
    entity = next((value.id for value in scope.values() if isinstance(value, Entity)), "")
    return frame, entity


def _with_sightings(registry: Registry, scope: Mapping[str, Entity | Report], at: RuntimeContext) -> Registry:
    """Return the registry with the reported position as a sighting of each entity of a matched binding."""
    for report in (value for value in scope.values() if isinstance(value, Report)):
        place = point(report.body.get("position"))
        for entity in (value for value in scope.values() if isinstance(value, Entity)):
            registry = registry if place is None else registry.with_sighting(entity.id, place)
    return registry


def _localisation_error(scope: Mapping[str, Entity | Report], at: RuntimeContext) -> float | None:
    """Return the planar distance in metres between the reported position and the entity's true position.

    The true position is that at the time of the report's frame. None if the report has no position or no known frame.
    """
    report = next((value for value in scope.values() if isinstance(value, Report)), None)
    entity = next((value for value in scope.values() if isinstance(value, Entity)), None)
    if report is None or entity is None:
        return None
    states = at.registry.frame_states.get(str(report.body.get("frame")))
    place = point(report.body.get("position"))
    if states is None or place is None or entity.id not in states:
        return None
    return math.dist(place, states[entity.id].position[:2])


def _groups(entities: Iterable[Entity]) -> dict[str, tuple[Entity, ...]]:
    groups: dict[str, tuple[Entity, ...]] = {}
    for entity in entities:
        groups[entity.group] = (*groups.get(entity.group, ()), entity)
    return groups


def _sorted_rules(rules: Sequence[Rule]) -> tuple[Rule, ...]:
    """Return the rules in declaration order, each after the rules that it calls. The checker has rejected cycles."""
    table = {rule.name: rule for rule in rules}
    ordered: dict[str, Rule] = {}

    def visit(rule: Rule) -> None:
        if rule.name in ordered:
            return
        for name in _calls(rule.condition):
            if name in table and name != rule.name:
                visit(table[name])
        ordered[rule.name] = rule

    for rule in rules:
        visit(rule)
    return tuple(ordered.values())


def _calls(expr: Expr) -> Iterable[str]:
    return (part.function for part in parts(expr) if isinstance(part, Call) and part.rule)


__all__ = ["Adjudicator", "Verdict"]
