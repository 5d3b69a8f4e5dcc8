"""One moment of an episode, as rules see it."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field

from lingjing.kernel.registry import Registry, Report
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.model import Rule
from lingjing.trace.records import BodyState, Box


@dataclass(frozen=True, slots=True)
class RegionValue:
    """A named region as a value: membership is the only thing it can be asked."""

    name: str
    polygon: tuple[tuple[float, float], ...]


Value = bool | float | str | tuple[object, ...] | Entity | Report | Box | RegionValue | None
Locals = Mapping[str, Entity | Report]


@dataclass(slots=True)
class Instant:
    """One moment at which expressions are evaluated: the registry, the entities' states and what was emitted.

    `domains` restricts the reports a quantifier sees (reports of a boundary count from its commit on). `evidence`
    collects the numbers of the latest evaluation.
    """

    instance: Instance
    registry: Registry
    states: Mapping[str, BodyState]
    time_s: float
    groups: Mapping[str, tuple[Entity, ...]]
    rules: Mapping[str, Rule]
    kinds: frozenset[str]
    evidence: dict[str, float] = field(default_factory=dict)

    def domain(self, name: str) -> tuple[Entity, ...] | tuple[Report, ...]:
        """The members of a group or the reports of a message kind, in declaration or arrival order."""
        if name in self.kinds:
            return tuple(report for report in self.registry.reports.values() if report.kind == name)
        return self.groups.get(name, ())

    def fresh(self, name: str) -> tuple[Entity, ...] | tuple[Report, ...]:
        """As `domain`, but of the reports only those that arrived at this boundary."""
        if name not in self.kinds:
            return self.groups.get(name, ())
        tick = self.registry.tick
        new = itertools.takewhile(lambda report: report.tick == tick, self.registry.reports.newest())
        return tuple(reversed([report for report in new if report.kind == name]))
