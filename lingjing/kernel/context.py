"""The environment in which expressions are evaluated: registry, states and events of one instant of an episode."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from lingjing.kernel.assignments import point
from lingjing.kernel.registry import Binding, Registry, Report
from lingjing.mission.fold import Meanings
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.model import Rule
from lingjing.mission.values import Area, Place, Value, is_number
from lingjing.scene.sight import SightLines
from lingjing.trace.records import BodyState

Locals = Mapping[str, Entity | Report]
"""The bound variables of an expression."""


@dataclass(slots=True)
class RuntimeContext:
    """The evaluation context of a running mission; an `EvaluationContext` of `lingjing.mission.values`."""

    instance: Instance
    """The instance that is played."""
    registry: Registry
    """The registry at this instant."""
    states: Mapping[str, BodyState]
    """Entity states at this instant, which may lie between two boundaries."""
    time_s: float
    """Simulated time of this instant in seconds."""
    groups: Mapping[str, tuple[Entity, ...]]
    """The entities of each group, in declaration order."""
    rules: Mapping[str, Rule]
    """The mission's rules by name."""
    kinds: frozenset[str]
    """The names of message kinds."""
    areas: Mapping[str, Area]
    """The polygons of the regions by name."""
    facts: Mapping[str, Callable[..., Value]]
    """The functions that need a running mission."""
    meanings: Meanings
    """The compiled expressions of the mission; all its contexts share them."""
    sight: SightLines
    """The free lines of sight of the city."""
    evidence: dict[str, float] = field(default_factory=dict)
    """The numbers of the latest evaluation."""

    @property
    def tick(self) -> int:
        """The boundary's tick. With `achieved`, `stages`, `states`, `time_s` it forms an evaluator's `EpisodeState`."""
        return self.registry.tick

    @property
    def achieved(self) -> Mapping[tuple[str, Binding], float]:
        """The time in seconds at which each (rule, binding) became true."""
        return self.registry.achieved

    @property
    def stages(self) -> Mapping[tuple[str, str], int]:
        """The tick at which each (stage, subject) was completed."""
        return self.registry.stages

    def domain(self, name: str) -> tuple[Entity, ...] | tuple[Report, ...]:
        """Return the members of a group or the reports of a message kind, in declaration or arrival order."""
        if name in self.kinds:
            return tuple(report for report in self.registry.reports.values() if report.kind == name)
        return self.groups.get(name, ())

    def fresh(self, name: str) -> tuple[Entity, ...] | tuple[Report, ...]:
        """Return the members of a group, or the reports of a message kind that arrived at this boundary."""
        if name not in self.kinds:
            return self.groups.get(name, ())
        tick = self.registry.tick
        new = itertools.takewhile(lambda report: report.tick == tick, self.registry.reports.newest())
        return tuple(reversed([report for report in new if report.kind == name]))

    def place(self, value: Value) -> Place | None:
        """Return a position, or an entity's present position; the elevation is None if a position has none."""
        if isinstance(value, Entity):
            state = self.states.get(value.id)
            return None if state is None else Place(*state.position)
        if isinstance(value, Place):
            return value
        position = point(value)
        return None if position is None else Place(*position, _elevation(value))

    def note(self, name: str, number: float) -> None:
        """Store a number on which the result depends."""
        self.evidence[name] = number

    def fact(self, name: str, arguments: Sequence[Value]) -> Value:
        """Return the value of a function of a running mission; None if it has none."""
        return self.facts[name](self, *arguments)


def _elevation(value: Value) -> float | None:
    up = value[2] if isinstance(value, tuple | list) and len(value) > 2 else None
    return float(up) if is_number(up) else None
