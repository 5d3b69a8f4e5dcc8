"""Adjudicate: rules become events, once per binding, from engine state alone.

At a boundary the macro-steps since the last one are walked in order. Rules that depend on motion are evaluated at
each of them, so nothing drives through a radius unseen; the others once, at the boundary, where the messages
committed with it count for the first time. A rule that holds is *latched*: its event is emitted once and time-stamped
with the macro-step. Rules that compare a report with `truth(…)` are solved one to one in each frame: a report
matches at most one entity, an entity at most one report a frame, earlier reports first, highest overlap first.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Mapping, Sequence

import msgspec
from msgspec.structs import replace

from lingjing.kernel.assignments import point
from lingjing.kernel.constraints import ConstraintMonitor
from lingjing.kernel.context import RuntimeContext
from lingjing.kernel.facts import FACTS
from lingjing.kernel.registry import Binding, Registry, Report
from lingjing.kernel.rules import RUNNING, bindings, holds, identity, rule_moves, settles_at_once
from lingjing.kernel.stages import Stages
from lingjing.mission.expression import Call, Expr, parts
from lingjing.mission.fold import Meanings
from lingjing.mission.instance import Datum, Entity, Instance
from lingjing.mission.model import Rule
from lingjing.mission.values import Area
from lingjing.trace.records import AdjudicatedEvent, BodyState, Snapshot, StageChange


class Verdict(msgspec.Struct, frozen=True):
    """What a boundary's adjudication found [V], with the registry that has latched it."""

    registry: Registry
    events: tuple[AdjudicatedEvent, ...]
    stages: tuple[StageChange, ...]
    unlocks: tuple[tuple[str, str], ...]


class Adjudicator:
    """The rules of one instance, sorted so that a rule follows those it calls; holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._instance = instance
        self.kinds = frozenset(message.kind for message in instance.messages)
        self._groups = _groups(instance.entities)
        self._monitor = ConstraintMonitor(instance)
        self._declared_stages = Stages(instance)
        self._rules = {rule.name: rule for rule in instance.rules}
        ordered = _sorted_rules(instance.rules)
        self._moving = tuple(rule for rule in ordered if rule_moves(rule, self._rules, self.kinds))
        self._settled = tuple(rule for rule in ordered if rule not in self._moving)
        self._areas = {region.name: Area(region.polygon) for region in instance.regions}
        self._meanings = Meanings(RUNNING)
        self._latest: RuntimeContext | None = None
        self._at_once = frozenset(rule.name for rule in ordered if settles_at_once(rule, self._rules, self.kinds))

    def instant(self, registry: Registry, states: Mapping[str, BodyState], time_s: float) -> RuntimeContext:
        """The evaluation context of this instance at `time_s`; the latest one again where it is asked for again."""
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
        )
        return self._latest

    def adjudicate(self, before: Registry, registry: Registry, snapshots: Sequence[Snapshot]) -> Verdict:
        """Walk the macro-steps of the boundary that `registry` stands at; `before` is the last boundary's, whose
        reports are the ones that count until the commit."""
        events: list[AdjudicatedEvent] = []
        if self._moving and len(snapshots) > 1:
            early = replace(registry, reports=before.reports)
            for snapshot in snapshots[:-1]:
                states = {state.id: state for state in snapshot.states}
                early = self._apply(self._moving, early, states, snapshot.time_s, events)
            registry = replace(early, reports=registry.reports)
        registry = self._apply(self._settled + self._moving, registry, registry.states, registry.time_s, events)
        registry, broken = self._monitor.look(registry, snapshots, self.instant, len(events) + 1)
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
            at = self.instant(registry, states, time_s)
            registry = self._match(rule, at, events) if rule.matching else self._latch(rule, at, events)
        return registry

    def _latch(self, rule: Rule, at: RuntimeContext, events: list[AdjudicatedEvent]) -> Registry:
        achieved: dict[Binding, float] = {}
        for scope in bindings(_domains(rule), at, fresh=rule.name in self._at_once):
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
            registry = _sighted(replace(registry, claimed=registry.claimed.extended({claim: report})), scope, at)
            achieved[tuple(identity(value) for value in scope.values())] = at.time_s
            events.append(self._event(rule, scope, at, len(events)))
        return registry.with_achieved(rule.name, achieved)

    def _by_report(self, rule: Rule, at: RuntimeContext) -> dict[str, list[dict[str, Entity | Report]]]:
        """Candidate bindings of each report that no boundary has judged yet, in arrival order."""
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
        at = self.instant(registry, registry.states, registry.time_s)
        done = dict(registry.stages)
        changes = []
        for stage in self._instance.stages:
            domain = ((stage.variable, stage.domain),) if stage.variable and stage.domain else ()
            for scope in bindings(domain, at):
                subject = "".join(identity(value) for value in scope.values())
                if (stage.name, subject) not in done and holds(stage.condition, scope, at):
                    done[stage.name, subject] = registry.tick
                    changes.append(
                        StageChange(stage=stage.name, subject=subject, tick=registry.tick, time_s=registry.time_s)
                    )
        return (replace(registry, stages=done) if changes else registry), tuple(changes)

    def _unlocks(self, registry: Registry) -> tuple[Registry, tuple[tuple[str, str], ...]]:
        if not self._instance.unlocks:
            return registry, ()
        at = self.instant(registry, registry.states, registry.time_s)
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


def _domains(rule: Rule) -> tuple[tuple[str, str], ...]:
    return tuple((parameter.name, parameter.domain) for parameter in rule.parameters)


def _claim(scope: Mapping[str, Entity | Report]) -> tuple[str, str]:
    """The (frame, entity) pair that a matching binding uses up."""
    frame = next((str(value.body.get("frame")) for value in scope.values() if isinstance(value, Report)), "")
    entity = next((value.id for value in scope.values() if isinstance(value, Entity)), "")
    return frame, entity


def _sighted(registry: Registry, scope: Mapping[str, Entity | Report], at: RuntimeContext) -> Registry:
    """The registry that knows where a matched report says its entities are."""
    for report in (value for value in scope.values() if isinstance(value, Report)):
        place = point(report.body.get("position"))
        for entity in (value for value in scope.values() if isinstance(value, Entity)):
            registry = registry if place is None else registry.with_sighting(entity.id, place)
    return registry


def _localisation_error(scope: Mapping[str, Entity | Report], at: RuntimeContext) -> float | None:
    """Planar distance between a report's position and where the bound entity was when its frame was taken."""
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
    """Declaration order, but never before a rule it calls (the checker has refused cycles)."""
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
