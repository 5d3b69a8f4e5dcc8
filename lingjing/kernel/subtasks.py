"""Subtasks: what the subtask completion rate counts.

The paper (its table of metrics): "Number of required targets, deliveries, rescues, repairs, or other task components
completed, divided by the number required in that episode." Required are the members of every group of targets that
success asks for (`forall v in victim: rescued(v)` requires each victim); a mission that asks for no group is one of
stages, and requires each stage, once for each of its subjects; one without stages the parts of its success condition.
A mission that is won has completed all that it requires, even where a stage on the way was skipped: goods may be left
at a place that nobody was sent to. Weights and penalties make the score (`evaluation`) and change nothing here.
"""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.kernel.adjudication import Adjudicator
from lingjing.kernel.context import RuntimeContext
from lingjing.kernel.evaluation import NOTHING_BOUND, CountedParts
from lingjing.kernel.registry import Registry
from lingjing.kernel.rules import holds
from lingjing.kernel.stages import Stages
from lingjing.mission.expression import Quantified, components
from lingjing.mission.instance import Instance


class Subtasks:
    """The subtasks of one instance; holds no run-time state."""

    def __init__(self, instance: Instance, adjudicator: Adjudicator) -> None:
        self._success = instance.success
        self._adjudicator = adjudicator
        self._parts = CountedParts(instance.success)
        self._groups = required_groups(instance)
        self._declared_stages = Stages(instance)

    def share(self, registry: Registry) -> float:
        """Completed over required, 0..1."""
        at = self._adjudicator.instant(registry, registry.states, registry.time_s)
        if holds(self._success, NOTHING_BOUND, at):
            return 1.0
        done = list(self._done(registry, at))
        return sum(done) / len(done) if done else 0.0

    def _done(self, registry: Registry, at: RuntimeContext) -> Iterator[bool]:
        if self._groups:
            for asked in self._groups:
                for member in at.domain(asked.domain):
                    yield holds(asked.body, {asked.variable: member}, at)
        elif self._declared_stages.parts:
            yield from (part in registry.stages for part in self._declared_stages.parts)
        else:
            yield from self._parts.hold(at)


def required_groups(instance: Instance) -> tuple[Quantified, ...]:
    """What success asks of whole groups of targets."""
    targets = {entity.group for entity in instance.entities if entity.role == "target"}
    return tuple(each for each, _ in components(instance.success) if each is not None and each.domain in targets)
