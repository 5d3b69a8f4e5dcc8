"""Placeholders of goals and prompts (`Fly at {altitude}.` becomes `Fly at 100 m`), and values in words.

`lingjing.dsl.checking.wording` checks the names in placeholders. Numbers are shown in the author's unit, positions as
`(east, north)` in metres, a group as the ids of its members, a region as its corners, a grid as its cells' names.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence

import msgspec

from lingjing.mission import model
from lingjing.mission.evaluate import Scope
from lingjing.mission.expression import Number
from lingjing.mission.instance import AgentSpec, Datum, Entity
from lingjing.mission.languages import ORIGINAL, Phrases, phrases
from lingjing.mission.units import field_named, si_value, unit_behind
from lingjing.patterns import pattern

HOLE = pattern(r"\{\{|\}\}|\{([^{}\n]*)\}")
"""A doubled brace, or a placeholder with its content as group 1."""
PATH = pattern(r"\s*(?P<name>[^\W\d]\w*)(?:\[\s*(?P<index>\w+)\s*\])?(?:\.(?P<field>[^\W\d]\w*))?\s*")
"""The content of a placeholder: name, index and field."""


def fill(text: str, look_up: Callable[[str, str | None, str | None], str | None]) -> str:
    """The text with its placeholders replaced. `look_up(name, index, field)` gives the replacement; None keeps the
    placeholder."""
    if "{" not in text and "}" not in text:
        return text

    def replacement(hole: re.Match[str]) -> str:
        if hole[1] is None:
            return hole[0][0]
        path = PATH.fullmatch(hole[1])
        words = look_up(path["name"], path["index"], path["field"]) if path else None
        return hole[0] if words is None else words

    return HOLE.sub(replacement, text)


def some(words: Sequence[str], most: int = 6) -> str:
    """The first words of a long list: `a, b, c and 12 more`."""
    rest = len(words) - most
    return ", ".join(words) if rest <= 0 else f"{', '.join(words[:most])} and {rest} more"


def shown_number(value: float, unit: str = "", factor: float = 1.0) -> str:
    """`100 m`: a number in SI, shown in a unit of `factor` SI units."""
    amount = value / factor
    text = f"{round(amount, 6):g}" if math.isfinite(amount) else str(amount)
    return f"{text} {unit}" if unit else text


def shown_point(place: tuple[float, ...]) -> str:
    """`(12.4, -1351.8)`: east and north in metres."""
    return f"({place[0]:g}, {place[1]:g})"


def shown_field(entity: Entity, field: str, words: Phrases) -> str | None:
    """A public field of an entity in the words of a language; None if it has no field of that name."""
    if field == "position":
        return shown_point(entity.position)
    if field == "heading":
        return shown_number(entity.heading_deg, "deg")
    known = entity.properties
    if (stored := field_named(field, known)) is not None:
        return shown_datum(known[stored], unit_behind(field, stored))
    low, high = field_named(f"{field}_low", known), field_named(f"{field}_high", known)
    if low is None or high is None:
        return None
    upper = shown_datum(known[high], unit_behind(f"{field}_high", high))
    return words("{low} to {high}", low=shown_datum(known[low]), high=upper)


def shown_datum(value: Datum, unit: str = "") -> str:
    """A property's value in words."""
    match value:
        case bool():
            return "true" if value else "false"
        case int() | float():
            return shown_number(float(value), unit)
        case tuple():
            return ", ".join(shown_datum(item, unit) for item in value)
    return str(value)


class PromptFiller:
    """Fills the placeholders in one instance's goal and prompts. A placeholder of a hidden value stays as it is."""

    def __init__(
        self, mission: model.Mission, scope: Scope, entities: tuple[Entity, ...], language: str = ORIGINAL
    ) -> None:
        self._mission = mission
        self._words = phrases(language, "lingjing.mission")
        self._scope = scope
        self._entities = {entity.id: entity for entity in entities}
        self._units = {param.name: _unit(param) for param in mission.parameters}
        self._hidden = {param.name for param in mission.parameters if param.hidden}
        self._hidden |= {group.name for group in mission.groups if group.hides_count}

    def __call__(self, text: str, index: tuple[str, int] | None = None) -> str:
        """The text with its placeholders replaced; `index` binds an index variable."""
        return fill(text, lambda name, at, field: self._word(name, at, field, index))

    def agent(self, spec: AgentSpec) -> AgentSpec:
        """The agent with the placeholders of its prompt replaced."""
        if "{" not in spec.prompt and "}" not in spec.prompt:
            return spec
        name = next((agent.index for agent in self._mission.agents if agent.name == spec.name), "i")
        return msgspec.structs.replace(spec, prompt=self(spec.prompt, (name, spec.index)))

    def _word(self, name: str, at: str | None, field: str | None, index: tuple[str, int] | None) -> str | None:
        if name == "mode":
            return self._scope.mode
        if index is not None and name == index[0]:
            return str(index[1])
        if name in self._hidden and at is None:
            return None
        if name in self._scope.parameters:
            return shown_number(self._scope.parameters[name], *self._units[name])
        if name in self._scope.areas:
            return ", ".join(map(shown_point, self._scope.areas[name].polygon))
        ids = self._scope.members.get(name)
        if ids is None:
            grids = [grid.name for grid in self._mission.grids if grid.name == name]
            return grids[0] if grids else None
        if at is not None:
            position = index[1] if index is not None and at == index[0] else int(at) if at.isdigit() else 0
            ids = ids[position - 1 : position] if position >= 1 else ()
        if field is None:
            return ", ".join(ids)
        words = [self._field(entity_id, field) for entity_id in ids]
        return None if None in words else ", ".join(word for word in words if word is not None)

    def _field(self, entity_id: str, field: str) -> str | None:
        entity = self._entities[entity_id]
        if any(name == field or name.startswith(f"{field}_") for name in entity.hidden):
            return None
        return shown_field(entity, field, self._words)


def _unit(param: model.Parameter) -> tuple[str, float]:
    """The author's unit of a parameter's default, and its factor to SI."""
    unit = param.default.unit if isinstance(param.default, Number) else ""
    return (unit, si_value(1.0, unit)) if unit else ("", 1.0)
