"""What a mission may say and the kernel does not play yet: refused by name, never passed over in silence.

The language is ahead of the kernel. An episode that left out a declared limit, event or allowance would be another
mission with the same name, so it does not start.
"""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.errors import UsageError
from lingjing.mission.expression import Call, Expr, parts
from lingjing.mission.functions import OPERATIONS
from lingjing.mission.instance import Instance


def check_playable(instance: Instance) -> None:
    """`UsageError` that lists every declared part of the instance that would not be played."""
    unknown = tuple(dict.fromkeys(unsupported_features(instance)))
    if unknown:
        raise UsageError(
            f"`{instance.mission}` cannot be played yet: the kernel does not know {', '.join(unknown)}",
            hint="`lingjing validate`, `graph` and `docs` work for it; playing takes a mission without them",
        )


def unsupported_features(instance: Instance) -> Iterator[str]:
    """Names of what the kernel would pass over, in the order of the specification."""
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
