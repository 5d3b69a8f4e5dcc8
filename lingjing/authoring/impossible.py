"""`refusals`: settings for which a condition holds, each with the reason why the mission cannot be won with it.

A condition such as `boats == 0` stands for several settings. Tried are the combinations of: the numbers in the
condition, those numbers one less and one more, the bounds, all values of a list, all whole numbers of a range of at
most 20, and the default. Each is tried in every mode for which the condition holds. It is refused by the parameter's
bounds, by an error of the instance, or by a proof that holds for every seed (`lingjing.mission.feasibility`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import msgspec

from lingjing.errors import LingjingError, UsageError
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.evaluate import Interval, Scope, evaluate, number
from lingjing.mission.feasibility import prove
from lingjing.mission.instantiate import parameters
from lingjing.mission.trial import trial

WHOLE_RANGE = 20
"""Most whole numbers of a range that are all tried (chosen)."""
MOST = 200
"""Most combinations of settings that are tried (chosen). Of more, evenly spaced ones are tried."""


class Refusal(msgspec.Struct, frozen=True, kw_only=True):
    """One combination of settings for which the condition holds."""

    settings: dict[str, float]
    """SI values by parameter."""
    mode: str
    reason: str
    """The reason why the mission cannot be won; "" if none was found."""
    bounds: bool = False
    """True if the parameters' bounds refuse it, so that no run can have it."""


def refusals(mission: model.Mission, condition: ex.Expr) -> tuple[Refusal, ...]:
    """All combinations that were tried and for which the condition holds; empty if it holds for none of them."""
    names = sorted({node.name for node in ex.parts(condition) if isinstance(node, ex.Ref) and node.kind == "param"})
    return tuple(
        _refusal(mission, mode, values)
        for mode in mission.modes.allowed
        for values in _combinations(mission, mode, condition, names)
        if _holds(mission, mode, condition, values)
    )


# -- private


def _combinations(
    mission: model.Mission, mode: str, condition: ex.Expr, names: list[str]
) -> Iterator[dict[str, float]]:
    defaults = parameters(mission, mode, {})
    scope = Scope(parameters=defaults, mode=mode)
    written = [node.value for node in ex.parts(condition) if isinstance(node, ex.Number)]
    columns = [sorted({*_near(written), *_bounds(mission, name, scope), defaults[name]}) for name in names]
    whole = math.prod(map(len, columns))
    step = max(1, math.ceil(whole / MOST))
    for row in itertools.islice(itertools.product(*columns), 0, None, step):
        yield dict(zip(names, row, strict=True))


def _near(numbers: list[float]) -> Iterator[float]:
    for value in numbers:
        yield from (value - 1, value, value + 1)


def _bounds(mission: model.Mission, name: str, scope: Scope) -> Iterator[float]:
    declared = next(parameter for parameter in mission.parameters if parameter.name == name)
    if isinstance(declared.bounds, ex.Sequence):
        yield from (number(item, scope) for item in declared.bounds.items)
    elif declared.bounds is not None:
        interval = evaluate(declared.bounds, scope)
        assert isinstance(interval, Interval)
        yield from (interval.low, interval.high)
        first, last = math.ceil(interval.low), math.floor(interval.high)
        if last - first < WHOLE_RANGE:
            yield from map(float, range(first, last + 1))


def _holds(mission: model.Mission, mode: str, condition: ex.Expr, values: dict[str, float]) -> bool:
    known = {**parameters(mission, mode, {}), **values}
    return evaluate(condition, Scope(parameters=known, mode=mode)) is True


def _refusal(mission: model.Mission, mode: str, values: dict[str, float]) -> Refusal:
    try:
        known = parameters(mission, mode, values)
    except UsageError as error:
        return Refusal(settings=values, mode=mode, reason=str(error), bounds=True)
    except LingjingError as error:
        return Refusal(settings=values, mode=mode, reason=str(error))
    fixed = _fixed(mission, mode, known)
    reasons = (*(fault.message for fault in trial(fixed)), *(proof.message for proof in prove(fixed)))
    return Refusal(settings=values, mode=mode, reason=next(iter(reasons), ""))


def _fixed(mission: model.Mission, mode: str, values: dict[str, float]) -> model.Mission:
    """The mission in one mode, with these values as its defaults."""
    declared = tuple(
        msgspec.structs.replace(parameter, default=ex.Number(values[parameter.name], _unit(parameter.default)))
        for parameter in mission.parameters
    )
    modes = model.Modes(default=mode, allowed=(mode,))
    return msgspec.structs.replace(mission, parameters=declared, modes=modes, sweeps=())


def _unit(default: ex.Expr) -> str:
    """The author's unit of a default. Values of `ex.Number` are in SI units, whatever their unit."""
    return default.unit if isinstance(default, ex.Number) else ""
