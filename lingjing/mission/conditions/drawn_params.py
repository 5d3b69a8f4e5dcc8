"""Drawn params before the seed is known: values to try one by one, and bounds where there are too many values.

`cases(mission, mode)` yields the settings of proofs. A param with few values has one case for each of them. Any other
one is *wide*: conditions read its bounds, and declarations are loosened. A larger budget, a longer stage, a wider
payload and an unknown place permit more episodes, so that a proof for the loosened mission holds for every value. A
declaration that cannot be loosened (a number of members, the clock) leaves the mission unproved.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping

import msgspec

from lingjing.errors import LingjingError
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.certain import Knowledge, certain
from lingjing.mission.conditions.spread import PossiblePlaces, numbers
from lingjing.mission.evaluate import Scope, evaluate
from lingjing.mission.intervals import ANYTHING, Bounds, greatest, least
from lingjing.mission.values import Value, is_number

COMBINATIONS = 128
"""The largest number of combinations of drawn values that are proved one by one (chosen)."""

Wide = Mapping[str, Bounds]
"""Wide params with their bounds."""


class Case(msgspec.Struct, frozen=True):
    """The params of one proof."""

    settings: dict[str, float]
    """A value of each drawn param; any value of a wide one."""
    wide: Wide
    """The params with bounds in place of a value, computed ones included."""


def cases(mission: model.Mission, mode: str) -> Iterator[Case]:
    """The cases that cover every seed; nothing if a declaration that cannot be loosened reads a wide param."""
    columns, wide = _split(mission, mode)
    if wide and fixed_reader(mission, wide):
        return
    placeholders = {name: _placeholder(bounds) for name, bounds in wide.items() if _is_drawn(mission, name)}
    for row in itertools.product(*columns.values()):
        yield Case({**placeholders, **dict(zip(columns, row, strict=True))}, wide)


def open_reason(mission: model.Mission, mode: str) -> str:
    """The reason why a mission with drawn params has no case, as the end of a sentence; "" if it has some."""
    _, wide = _split(mission, mode)
    reader = fixed_reader(mission, wide) if wide else ""
    if not reader:
        return ""
    names = " and ".join(f"`{name}`" for name in wide if _is_drawn(mission, name))
    return f"{reader} depends on {names}, which {'have' if ' and ' in names else 'has'} too many values to try"


def _is_drawn(mission: model.Mission, name: str) -> bool:
    return any(param.name == name and param.is_drawn for param in mission.parameters)


def _split(mission: model.Mission, mode: str) -> tuple[dict[str, tuple[float, ...]], dict[str, Bounds]]:
    """The params to try value by value, and the wide ones with their bounds."""
    listed: dict[str, tuple[float, ...]] = {}
    bounds: dict[str, Bounds] = {}
    knowledge = _Params(bounds, mode)
    for param in mission.parameters:
        if isinstance(param.default, ex.Draw):
            values = _values_of(param.default, knowledge)
            if values:
                listed[param.name] = values
            bounds[param.name] = _bounds_of(param.default, knowledge)
        else:
            value = certain(param.default, {}, knowledge)
            bounds[param.name] = value if isinstance(value, Bounds) else ANYTHING
    chosen: dict[str, tuple[float, ...]] = {}
    fixed = [name for name in listed if fixed_reader(mission, {name: bounds[name]})]
    for name in sorted(listed, key=lambda each: (each not in fixed, len(listed[each]))):
        if math.prod(map(len, chosen.values())) * len(listed[name]) <= COMBINATIONS:
            chosen[name] = listed[name]
    return chosen, _wide(mission, set(chosen), bounds)


def _wide(mission: model.Mission, chosen: set[str], bounds: Mapping[str, Bounds]) -> dict[str, Bounds]:
    """The drawn params without a chosen value, and those computed from them."""
    wide: dict[str, Bounds] = {}
    for param in mission.parameters:
        if (param.is_drawn and param.name not in chosen) or (not param.is_drawn and reads(param.default, wide)):
            wide[param.name] = bounds[param.name]
    return wide


class _Params(Knowledge):
    """The bounds of the params that were declared before."""

    def __init__(self, bounds: Mapping[str, Bounds], mode: str) -> None:
        self._bounds, self._mode = bounds, mode

    def name(self, ref: ex.Ref) -> Value:
        """The bounds of a param, or the name of the mode."""
        if ref.kind == "mode":
            return self._mode if ref.name == "mode" else ref.name
        return self._bounds.get(ref.name) if ref.kind == "param" else None


def _values_of(draw: ex.Draw, knowledge: Knowledge) -> tuple[float, ...]:
    """The values of a drawn whole number or of a choice among numbers; empty for others and for too many."""
    if draw.distribution == "integer":
        low, high = _bounds_of(draw, knowledge)
        exact = all(isinstance(each := certain(item, {}, knowledge), Bounds) and each.exact for item in draw.arguments)
        return tuple(float(n) for n in range(int(low), int(high) + 1)) if exact and high - low <= COMBINATIONS else ()
    if draw.distribution == "choice":
        try:
            items = [evaluate(argument, Scope()) for argument in draw.arguments]
        except LingjingError:
            return ()
        values = items[0] if len(items) == 1 and isinstance(items[0], tuple) else tuple(items)
        return tuple(dict.fromkeys(float(value) for value in values)) if all(map(is_number, values)) else ()
    return ()


def _bounds_of(draw: ex.Draw, knowledge: Knowledge) -> Bounds:
    """The bounds of a drawn number with arguments that may be params."""
    if draw.distribution in ("uniform", "integer") and draw.arguments:
        ends = [certain(argument, {}, knowledge) for argument in draw.arguments]
        known = [end if isinstance(end, Bounds) else ANYTHING for end in ends]
        if not all(isinstance(end, Bounds) for end in ends):
            return _plain_bounds(draw)
        return Bounds(least(*known).low, greatest(*known).high)
    if draw.distribution == "normal":
        named = {name: certain(limit, {}, knowledge) for name, limit in draw.named}
        low, high = named.get("low"), named.get("high")
        return Bounds(
            low.low if isinstance(low, Bounds) else -math.inf, high.high if isinstance(high, Bounds) else math.inf
        )
    return _plain_bounds(draw)


def _plain_bounds(draw: ex.Draw) -> Bounds:
    try:
        return numbers(draw, Scope())
    except LingjingError:
        return ANYTHING


def _placeholder(bounds: Bounds) -> float:
    """A number within the bounds."""
    return next((end for end in bounds if math.isfinite(end)), 0.0)


# -- reading and loosening ------------------------------------------------------------------------------------------


def reads(expr: ex.Expr, names: Wide) -> bool:
    """True if an expression reads one of the params."""
    return bool(names) and any(
        isinstance(leaf, ex.Ref) and leaf.kind == "param" and leaf.name in names for leaf in ex.leaves(expr)
    )


def fixed_reader(mission: model.Mission, wide: Wide) -> str:
    """The first declaration that reads one of the params and cannot be loosened, in words; "" if there is none."""
    for words, part in _fixed_parts(loosened(mission, wide)):
        if _contains(part, wide):
            return words
    return ""


def _fixed_parts(mission: model.Mission) -> Iterator[tuple[str, object]]:
    """The parts of a mission that proofs read at a fixed value, each with its name."""
    yield "the clock", mission.clock
    yield "the budget", (mission.budget.ticks, mission.budget.tokens, mission.budget.money, mission.budget.messages)
    for stage in mission.stages:
        yield f"`{stage.name}`", (stage.ticks, stage.limits)
    yield "the scene", mission.scene
    for group in mission.groups:
        yield f"`{group.name}`", msgspec.structs.replace(group, properties=())
    for agent in mission.agents:
        yield f"`{agent.name}`", agent
    for item in (*mission.authorities, *mission.messages, *mission.inspections, *mission.limits, *mission.permits):
        yield "a declaration", msgspec.structs.replace(item, condition=_TRUE) if hasattr(item, "condition") else item
    for event in mission.events:
        yield f"`{event.name}`", (event.when, event.pause, [_fixed_change(change) for change in event.changes])
    yield "the radio", mission.comms


_TRUE = ex.Flag(value=True)


def _fixed_change(change: model.Change) -> object:
    return change.entity, change.region, change.loss, change.range


def _contains(part: object, names: Wide) -> bool:
    """True if a declaration, with everything in it, reads one of the params."""
    if isinstance(part, ex.Ref):
        return part.kind == "param" and part.name in names
    if isinstance(part, msgspec.Struct):
        return any(_contains(getattr(part, field), names) for field in part.__struct_fields__)
    return isinstance(part, tuple | list) and any(_contains(each, names) for each in part)


def loosened(mission: model.Mission, wide: Wide) -> model.Mission:
    """The mission with the loosest value of each bound that reads a wide param."""
    if not wide:
        return mission
    knowledge = _Params(wide, "")

    def most(expr: ex.Expr | None, *, whole: bool = False) -> ex.Expr | None:
        return _end(expr, wide, knowledge, upper=True, whole=whole)

    budget, comms = mission.budget, mission.comms
    return msgspec.structs.replace(
        mission,
        budget=msgspec.structs.replace(
            budget,
            ticks=most(budget.ticks, whole=True),
            tokens=most(budget.tokens, whole=True),
            money=most(budget.money),
            messages=most(budget.messages, whole=True),
        ),
        comms=msgspec.structs.replace(
            comms,
            delay=_end(comms.delay, wide, knowledge, upper=False, whole=True),
            payload=most(comms.payload, whole=True),
            range=most(comms.range),
            loss=_end(comms.loss, wide, knowledge, upper=False),
        ),
        limits=tuple(_loosened_limit(limit, wide, knowledge) for limit in mission.limits),
        stages=tuple(_loosened_stage(stage, wide, knowledge) for stage in mission.stages),
    )


def _loosened_limit(limit: model.Limit, wide: Wide, knowledge: Knowledge) -> model.Limit:
    most = _end(limit.most, wide, knowledge, upper=True, whole=True)
    return msgspec.structs.replace(limit, most=most)


def _loosened_stage(stage: model.Stage, wide: Wide, knowledge: Knowledge) -> model.Stage:
    return msgspec.structs.replace(
        stage,
        ticks=_end(stage.ticks, wide, knowledge, upper=True, whole=True),
        limits=tuple(_loosened_limit(limit, wide, knowledge) for limit in stage.limits),
    )


def _end(expr: ex.Expr | None, wide: Wide, knowledge: Knowledge, *, upper: bool, whole: bool = False) -> ex.Expr | None:
    """The greatest or the least value of an expression that reads a wide param; other ones stay."""
    if expr is None or not reads(expr, wide):
        return expr
    bounds = certain(expr, {}, knowledge)
    end = (bounds.high if upper else bounds.low) if isinstance(bounds, Bounds) else math.inf
    if not math.isfinite(end):
        return expr
    return ex.Number(float(math.floor(end) if upper else math.ceil(end)) if whole else end)


def property_places(expr: ex.Expr, wide: Wide, index: str, count: int) -> PossiblePlaces:
    """Every place of a declared position that reads a wide param; no outline if it is not bounded."""
    if not isinstance(expr, ex.Point):
        return PossiblePlaces()
    names: dict[str, Value] = {index: Bounds(1.0, float(max(1, count)))}
    ends = [certain(item, names, _Params(wide, "")) for item in expr.items[:2]]
    if not all(isinstance(end, Bounds) and math.isfinite(end.low) and math.isfinite(end.high) for end in ends):
        return PossiblePlaces()
    (west, east), (south, north) = ends
    return PossiblePlaces((((west, south), (east, south), (east, north), (west, north)),))


def property_bounds(expr: ex.Expr, wide: Wide, index: str, count: int) -> Bounds:
    """The bounds of a declared or drawn number that reads a wide param."""
    knowledge = _Params(wide, "")
    if isinstance(expr, ex.Draw):
        return _bounds_of(expr, knowledge)
    value = certain(expr, {index: Bounds(1.0, float(max(1, count)))}, knowledge)
    return value if isinstance(value, Bounds) else ANYTHING
