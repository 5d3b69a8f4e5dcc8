"""Rejection of instances with language features that the kernel does not implement yet.

The language is ahead of the kernel. An episode without a declared limit, event or allowance would be another mission
under the same name, so it does not start.
"""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.errors import UsageError
from lingjing.mission.expression import Call, Expr, parts
from lingjing.mission.functions import OPERATIONS
from lingjing.mission.instance import Instance


def check_playable(instance: Instance) -> None:
    """Raise `UsageError` with every declared part of the instance that the kernel does not implement."""
    unknown = tuple(dict.fromkeys(_unsupported_features(instance)))
    if unknown:
        raise UsageError(
            f"`{instance.mission}` cannot be played yet: the kernel does not implement {', '.join(unknown)}",
            hint="`lingjing validate`, `graph` and `docs` work for it; playing takes a mission without them",
        )


def _unsupported_features(instance: Instance) -> Iterator[str]:
    """Yield the names of features that the kernel does not implement, in the order of the language specification."""
    if any(region.on_map is not None for region in instance.regions):
        yield "regions along roads"
    for condition in _conditions(instance):
        calls = (part for part in parts(condition) if isinstance(part, Call) and not part.rule)
        yield from (f"`{call.function}(…)` in rules" for call in calls if call.function not in OPERATIONS)


def _conditions(instance: Instance) -> Iterator[Expr]:
    yield instance.success
    if instance.failure is not None:
        yield instance.failure
    yield from (rule.condition for rule in instance.rules)
    yield from (unlock.condition for unlock in instance.unlocks)
    yield from (permit.condition for permit in instance.permits)
    yield from (constraint.condition for constraint in instance.constraints)
    yield from (stage.condition for stage in instance.stages)
    for event in instance.events:
        yield from (condition for condition in (event.condition, event.until) if condition is not None)
