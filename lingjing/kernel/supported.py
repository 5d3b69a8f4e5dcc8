"""What a mission may say and the kernel does not play yet: refused by name, never passed over in silence.

The language is ahead of the kernel. An episode that left out a declared limit, event or allowance would be another
mission with the same name, so it does not start.
"""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.errors import UsageError
from lingjing.mission.expression import Call, Expr, children
from lingjing.mission.functions import OPERATIONS
from lingjing.mission.instance import Instance


def check_playable(instance: Instance) -> None:
    """`UsageError` that lists every declared part of the instance that would not be played."""
    parts = tuple(dict.fromkeys(unplayed(instance)))
    if parts:
        raise UsageError(
            f"`{instance.mission}` cannot be played yet: the kernel does not know {', '.join(parts)}",
            hint="`lingjing validate`, `graph` and `docs` work for it; playing takes a mission without them",
        )


def unplayed(instance: Instance) -> Iterator[str]:
    """Names of what the kernel would pass over, in the order of the specification."""
    if any(region.on_map is not None for region in instance.regions):
        yield "regions along roads"
    for condition in _conditions(instance):
        yield from (f"`{name}(…)` in rules" for name in _unknown_calls(condition))


def _conditions(instance: Instance) -> Iterator[Expr]:
    yield instance.success
    if instance.failure is not None:
        yield instance.failure
    yield from (rule.condition for rule in instance.rules)
    yield from (unlock.condition for unlock in instance.unlocks)
    yield from (permit.condition for permit in instance.permits)
    yield from (constraint.condition for constraint in instance.constraints)
    yield from (stage.condition for stage in instance.stages)


def _unknown_calls(condition: Expr) -> Iterator[str]:
    if isinstance(condition, Call) and not condition.rule and condition.function not in OPERATIONS:
        yield condition.function
    for child in children(condition):
        yield from _unknown_calls(child)
