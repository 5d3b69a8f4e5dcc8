"""The subtasks of a mission and the subtask completion rate.

The paper (its table of metrics): "Number of required targets, deliveries, rescues, repairs, or other task components
completed, divided by the number required in that episode." Required are the members of every group of targets that
success quantifies over (`forall v in victim: rescued(v)` requires each victim). A mission without such a group requires
its stages, once for each subject. A mission without stages requires the parts of its success condition. A mission that
is won has completed all subtasks, even if it skipped a stage. Weights and penalties belong to the score (`evaluation`)
and change nothing here.
"""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.kernel.adjudication import Adjudicator
from lingjing.kernel.context import RuntimeContext
from lingjing.kernel.evaluation import NO_BINDINGS, CountedParts
from lingjing.kernel.registry import Registry
from lingjing.kernel.rules import holds
from lingjing.kernel.stages import Stages
from lingjing.mission.expression import Quantified, components
from lingjing.mission.instance import Instance


class Subtasks:
    """The subtasks of one instance. Holds no run-time state."""

    def __init__(self, instance: Instance, adjudicator: Adjudicator) -> None:
        self._success = instance.success
        self._adjudicator = adjudicator
        self._parts = CountedParts(instance.success)
        self._groups = required_groups(instance)
        self._declared_stages = Stages(instance)

    def share(self, registry: Registry) -> float:
        """Return the completed share of the required subtasks, 0 to 1."""
        at = self._adjudicator.context_at(registry, registry.states, registry.time_s)
        if holds(self._success, NO_BINDINGS, at):
            return 1.0
        done = list(self._done(registry, at))
        return sum(done) / len(done) if done else 0.0

    def _done(self, registry: Registry, at: RuntimeContext) -> Iterator[bool]:
        if self._groups:
            for group in self._groups:
                for member in at.domain(group.domain):
                    yield holds(group.body, {group.variable: member}, at)
        elif self._declared_stages.parts:
            yield from (part in registry.stages for part in self._declared_stages.parts)
        else:
            yield from self._parts.hold(at)


def required_groups(instance: Instance) -> tuple[Quantified, ...]:
    """Return the quantifiers of the success condition that range over groups of targets."""
    targets = {entity.group for entity in instance.entities if entity.role == "target"}
    return tuple(each for each, _ in components(instance.success) if each is not None and each.domain in targets)
