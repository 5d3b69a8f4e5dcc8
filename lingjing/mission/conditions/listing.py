"""`list_conditions`: the conditions of a mission with bounds and declassifications, for people and other programs.

`lingjing compile` writes the list into `mission.json`, and `lingjing graph --conditions` prints it. The list is derived
from the mission; no program reads it back.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.conditions.episode import NOW, EpisodeKnowledge
from lingjing.mission.conditions.leaks import every_leak
from lingjing.mission.conditions.outline import of_mission, too_large
from lingjing.mission.conditions.quantities import Quantity, Record
from lingjing.mission.conditions.reads import Leaf
from lingjing.mission.conditions.survey import Condition, survey_mission
from lingjing.mission.instantiate import choose_mode
from lingjing.mission.intervals import ANYTHING, Bounds


class ListedCondition(Condition, frozen=True, kw_only=True):
    """A condition with the bounds of its quantities."""

    declassified: dict[str, str] = {}
    """Name of a leak of this condition that the mission declassifies → the author's reason."""


class ConditionList(Record, frozen=True, kw_only=True, omit_defaults=False):
    """The conditions of one mission, as `lingjing graph --conditions --format json` writes them."""

    format: Literal["lingjing-conditions/1"] = "lingjing-conditions/1"
    mission: str
    modes: tuple[str, ...]
    """The modes for which the bounds hold."""
    conditions: tuple[ListedCondition, ...]


def list_conditions(mission: model.Mission, mode: str | None = None) -> ConditionList:
    """The conditions of a mission in all its modes, or in one. A bound holds in each of these modes at the default
    settings, for every seed. Raises `UsageError` for a mode that the mission does not have."""
    modes = mission.modes.allowed if mode is None else (choose_mode(mission, mode),)
    survey = survey_mission(mission)
    reasons = {item.what: item.reason for item in mission.declassified}
    declassified: dict[str, dict[str, str]] = {}
    for leak in every_leak(mission, survey):
        if leak.what in reasons:
            declassified.setdefault(leak.at, {})[leak.what] = reasons[leak.what]
    known = knowledge_of(mission, modes)
    bounded: dict[Quantity, Quantity] = {}
    return ConditionList(
        mission=mission.name,
        modes=modes,
        conditions=tuple(
            _listed(condition, declassified.get(condition.at, {}), known, bounded)
            for condition in survey.conditions
            if _is_there(condition, known)
        ),
    )


def knowledge_of(mission: model.Mission, modes: Sequence[str]) -> tuple[EpisodeKnowledge, ...]:
    """Bounds of the episode in each of the modes; empty if one of them has none: the mission is too large, or its
    defaults have no value."""
    try:
        if any(too_large(mission, mode) for mode in modes):
            return ()
        return tuple(EpisodeKnowledge(of_mission(mission, mode)) for mode in modes)
    except MissionError:
        return ()


def episode_bounds(quantity: Quantity, known: Sequence[EpisodeKnowledge]) -> Bounds:
    """The bounds of a number during the whole episode in every mode of `known`; `ANYTHING` for what is no number."""
    bounds = [value for knowledge in known for value in _values(quantity, knowledge)]
    if not bounds:
        return ANYTHING
    return Bounds(min(low for low, _ in bounds), max(high for _, high in bounds))


# -- private


def _values(quantity: Quantity, known: EpisodeKnowledge) -> list[Bounds]:
    """The bounds of each member that has the quantity."""
    values: list[object] = []
    match quantity.kind:
        case "time":
            values = [known.name(ex.Ref(NOW, "clock"))]
        case "setting":
            values = [known.name(ex.Ref(quantity.name, "param"))]
        case "counter":
            limited = any(limit.name == quantity.owner for limit in known.outline.instance.limits)
            function = "used" if limited else "replans"
            values = [known.answer(ex.Call(function), (quantity.owner,))]
        case "state" | "property" | "heading":
            members = known.outline.groups.get(quantity.owner, ())
            values = [known.amount(body, quantity.name) for body in members]
    return [value if isinstance(value, Bounds) else ANYTHING for value in values]


def _listed(
    condition: Condition,
    declassified: dict[str, str],
    known: Sequence[EpisodeKnowledge],
    bounded: dict[Quantity, Quantity],
) -> ListedCondition:
    fields = {name: getattr(condition, name) for name in Condition.__struct_fields__}
    fields["leaves"] = tuple(_bounded_leaf(leaf, known, bounded) for leaf in condition.leaves)
    return ListedCondition(**fields, declassified=declassified)


def _bounded_leaf(leaf: Leaf, known: Sequence[EpisodeKnowledge], bounded: dict[Quantity, Quantity]) -> Leaf:
    for quantity in leaf.quantities:
        if quantity not in bounded:
            bounded[quantity] = _bounded(quantity, episode_bounds(quantity, known))
    return msgspec.structs.replace(leaf, quantities=tuple(bounded[quantity] for quantity in leaf.quantities))


def _bounded(quantity: Quantity, bounds: Bounds) -> Quantity:
    """The quantity with the narrower of its own bounds and these."""
    least = max((-math.inf if quantity.least is None else quantity.least), bounds.low)
    most = min((math.inf if quantity.most is None else quantity.most), bounds.high)
    return msgspec.structs.replace(
        quantity,
        least=least if math.isfinite(least) else None,
        most=most if math.isfinite(most) else None,
    )


def _is_there(condition: Condition, known: Sequence[EpisodeKnowledge]) -> bool:
    """False for a constraint that exists in none of the modes."""
    if condition.kind != "constraint" or not known:
        return True
    return any(constraint.name == condition.name for each in known for constraint in each.outline.instance.constraints)
