"""What expressions are evaluated on: the registry, states and events of one instant of an episode."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from lingjing.kernel.assignments import point
from lingjing.kernel.registry import Binding, Registry, Report
from lingjing.mission.fold import Meanings
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.model import Rule
from lingjing.mission.values import Area, Place, Value
from lingjing.trace.records import BodyState

Locals = Mapping[str, Entity | Report]


@dataclass(slots=True)
class RuntimeContext:
    """The evaluation context of a running mission at `time_s`; an `EvaluationContext` of `lingjing.mission.values`.

    `facts` are the functions that only a running mission answers. `meanings` holds what the mission's expressions mean;
    the contexts of one mission share it. `evidence` collects the numbers of the
    latest evaluation.
    """

    instance: Instance
    registry: Registry
    states: Mapping[str, BodyState]
    time_s: float
    groups: Mapping[str, tuple[Entity, ...]]
    rules: Mapping[str, Rule]
    kinds: frozenset[str]
    areas: Mapping[str, Area]
    facts: Mapping[str, Callable[..., Value]]
    meanings: Meanings
    evidence: dict[str, float] = field(default_factory=dict)

    @property
    def tick(self) -> int:
        """The boundary's tick. With `achieved`, `stages`, `states`, `time_s` it is an evaluator's `EpisodeState`."""
        return self.registry.tick

    @property
    def achieved(self) -> Mapping[tuple[str, Binding], float]:
        """When each (rule, binding) that has come true did, in seconds."""
        return self.registry.achieved

    @property
    def stages(self) -> Mapping[tuple[str, str], int]:
        """The tick at which each (stage, subject) that is done was done."""
        return self.registry.stages

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

    def place(self, value: Value) -> Place | None:
        """East and north of a position, or of where an entity is now."""
        if isinstance(value, Entity):
            state = self.states.get(value.id)
            return None if state is None else Place(state.position[0], state.position[1])
        if isinstance(value, Place):
            return value
        found = point(value)
        return None if found is None else Place(*found)

    def note(self, name: str, number: float) -> None:
        """Keep a number that decided."""
        self.evidence[name] = number

    def fact(self, name: str, arguments: Sequence[Value]) -> Value:
        """What a function of a running mission answers; None where it has no answer."""
        return self.facts[name](self, *arguments)
