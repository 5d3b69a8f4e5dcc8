"""Evaluate: the score r and the termination flag d of a boundary, with the reason of the termination.

The built-in evaluator reads the mission's own success and failure conditions. Its score is 1 if the mission is won.
Otherwise it is the share of the success condition's parts that hold: `forall v in victim: rescued(v)` has one part for
each victim, and a conjunction has the parts of both sides. If stages have weights, the score is the weighted share of
completed stages instead. Broken soft constraints subtract their penalties. The paper's subtask completion rate ignores
weights and penalties; see `subtasks`.

An episode ends at the first boundary where one of these holds, in this order of precedence: a broken hard constraint,
success, failure, a late stage. The loop in `episode` checks the tick limit last. A stage that is late at the last tick
therefore ends the episode as `late`, as it would in a longer mission.
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

NO_BINDINGS: Locals = {}
"""The scope of the mission's own conditions, which have no bound variables."""


class MissionEvaluator:
    """The evaluator `mission`, which scores by the mission's own success and failure conditions."""

    def __init__(self, instance: Instance) -> None:
        self._success = CountedParts(instance.success)
        self._failure = instance.failure
        self._monitor = ConstraintMonitor(instance)
        self._declared_stages = Stages(instance)

    def evaluate(self, at: RuntimeContext, events: Sequence[AdjudicatedEvent]) -> Evaluation:
        """Return the evaluation at a boundary. Success precedes failure and lateness at the same boundary."""
        registry = at.registry
        parts = list(self._success.hold(at))
        won = all(parts)
        whole = 1.0 if won else self._share(registry, parts)
        score = min(1.0, max(0.0, whole - self._monitor.penalty(registry)))
        broken = self._monitor.broken(registry)
        if broken:
            return Evaluation(score, True, "constraint", broken)
        if won:
            return Evaluation(score, True, "success")
        if self._failure is not None and holds(self._failure, NO_BINDINGS, at):
            return Evaluation(score, True, "failure")
        late = tuple(self._declared_stages.late(registry))
        return Evaluation(score, True, "late", _lateness(late)) if late else Evaluation(score, False)

    def _share(self, registry: Registry, parts: Sequence[bool]) -> float:
        score = self._declared_stages.score(registry)
        return sum(parts) / len(parts) if score is None else score


def _lateness(late: Sequence[LateStage]) -> str:
    first, *others = late
    text = f"the stage {first.name} was not done {first.allowed}"
    return text + (f"; so were {some([stage.name for stage in others])}" if others else "")


class CountedParts:
    """The parts of a condition that are counted: its components, once for each member of a `forall` group."""

    def __init__(self, condition: Expr) -> None:
        self._parts = tuple(
            (each, part, None if each is None else CountedParts(part)) for each, part in components(condition)
        )

    def hold(self, at: RuntimeContext, scope: Locals = NO_BINDINGS) -> Iterator[bool]:
        """Yield the truth of each part. The condition holds if all parts hold."""
        for each, part, inner in self._parts:
            if each is None or inner is None:
                yield holds(part, scope, at)
            else:
                for member in at.domain(each.domain):
                    yield from inner.hold(at, {**scope, each.variable: member})


def combine(results: Sequence[Evaluation]) -> Evaluation:
    """Combine the results of several evaluators: the mean score, and the termination of the first result that is
    done.
    """
    if not results:
        return Evaluation(0.0, False)
    reward = sum(result.reward for result in results) / len(results)
    ended = next((result for result in results if result.done), None)
    return Evaluation(reward, False) if ended is None else replace(ended, reward=reward)
