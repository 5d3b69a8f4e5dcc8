"""Evaluate: the score r and the flag d of a boundary, and why an episode ended.

The built-in evaluator reads the mission's own success and failure conditions. Its score is the share of the success
condition's parts that hold, where `forall v in victim: rescued(v)` has one part for each victim and a conjunction adds
up the parts of its sides; or, where stages have weights, the weighted share of the stages that are done; 1 when the
mission is won. Broken soft constraints take their penalties off the score. The paper's subtask completion rate knows
neither weights nor penalties: see `subtasks`.

What holds first of these at a boundary ends the episode there: a broken hard constraint, success, failure, a stage that
is late. The mission's own ticks are the loop's to count and come last, so a stage that is late at the very last tick is
`late`: it would have ended a longer mission as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from msgspec.structs import replace

from lingjing.kernel.constraints import ConstraintMonitor
from lingjing.kernel.context import Locals, RuntimeContext
from lingjing.kernel.registry import Registry
from lingjing.kernel.rules import holds
from lingjing.kernel.stages import LateStage, Stages
from lingjing.mission.expression import Expr, components
from lingjing.mission.instance import Instance
from lingjing.mission.wording import some
from lingjing.plugins.evaluator import Evaluation
from lingjing.trace.records import AdjudicatedEvent

NOTHING_BOUND: Locals = {}
"""The scope of a mission's own conditions."""


class MissionEvaluator:
    """Scores by the mission's own success and failure conditions: the evaluator `mission`."""

    def __init__(self, instance: Instance) -> None:
        self._success = CountedParts(instance.success)
        self._failure = instance.failure
        self._monitor = ConstraintMonitor(instance)
        self._declared_stages = Stages(instance)

    def evaluate(self, at: RuntimeContext, events: Sequence[AdjudicatedEvent]) -> Evaluation:
        """Success before failure and lateness: a mission won at the boundary where it would be lost is won."""
        standing = at.registry
        parts = list(self._success.hold(at))
        won = all(parts)
        whole = 1.0 if won else self._share(standing, parts)
        score = min(1.0, max(0.0, whole - self._monitor.penalty(standing)))
        broken = self._monitor.broken(standing)
        if broken:
            return Evaluation(score, True, "constraint", broken)
        if won:
            return Evaluation(score, True, "success")
        if self._failure is not None and holds(self._failure, NOTHING_BOUND, at):
            return Evaluation(score, True, "failure")
        late = tuple(self._declared_stages.late(standing))
        return Evaluation(score, True, "late", _lateness(late, standing.tick)) if late else Evaluation(score, False)

    def _share(self, registry: Registry, parts: Sequence[bool]) -> float:
        score = self._declared_stages.score(registry)
        return sum(parts) / len(parts) if score is None else score


def _lateness(late: Sequence[LateStage], tick: int) -> str:
    first, *others = late
    had = f"{first.ticks} tick{'s' * (first.ticks != 1)}"
    told = f"the stage {first.name} was not done in the {had} it had (from tick {first.began} to tick {tick})"
    return told + (f"; so were {some([one.name for one in others])}" if others else "")


class CountedParts:
    """The parts of a condition that are counted: its components, once for each member that a `forall` asks them of."""

    def __init__(self, condition: Expr) -> None:
        self._parts = tuple(
            (each, part, None if each is None else CountedParts(part)) for each, part in components(condition)
        )

    def hold(self, at: RuntimeContext, scope: Locals = NOTHING_BOUND) -> Iterator[bool]:
        """Whether each of them holds; the condition holds when all do."""
        for each, part, inner in self._parts:
            if each is None or inner is None:
                yield holds(part, scope, at)
            else:
                for member in at.domain(each.domain):
                    yield from inner.hold(at, {**scope, each.variable: member})


def combine(results: Sequence[Evaluation]) -> Evaluation:
    """Several evaluators: the mean score; done when any says so, with the first one's reason and detail."""
    if not results:
        return Evaluation(0.0, False)
    reward = sum(result.reward for result in results) / len(results)
    ended = next((result for result in results if result.done), None)
    return Evaluation(reward, False) if ended is None else replace(ended, reward=reward)
