"""`PromptFiller`: fills the holes of an instance's goal and prompts with the instance's own values."""

from __future__ import annotations

import msgspec

from lingjing.mission import model
from lingjing.mission.evaluate import Scope
from lingjing.mission.expression import Number
from lingjing.mission.instance import AgentSpec, Entity
from lingjing.mission.units import si_value
from lingjing.mission.wording import fill, shown_field, shown_number, shown_point


class PromptFiller:
    """Fills the texts of one instance. Hidden values have no words here: a hole that names one stays as it is."""

    def __init__(self, mission: model.Mission, scope: Scope, entities: tuple[Entity, ...]) -> None:
        self._mission = mission
        self._scope = scope
        self._entities = {entity.id: entity for entity in entities}
        self._units = {param.name: _unit(param) for param in mission.parameters}

    def __call__(self, text: str, index: tuple[str, int] | None = None) -> str:
        """The text with its holes filled; `index` binds an index variable."""
        return fill(text, lambda name, at, field: self._word(name, at, field, index))

    def agent(self, spec: AgentSpec) -> AgentSpec:
        """The agent with its prompt filled."""
        if "{" not in spec.prompt and "}" not in spec.prompt:
            return spec
        name = next((agent.index for agent in self._mission.agents if agent.name == spec.name), "i")
        return msgspec.structs.replace(spec, prompt=self(spec.prompt, (name, spec.index)))

    def _word(self, name: str, at: str | None, field: str | None, index: tuple[str, int] | None) -> str | None:
        if name == "mode":
            return self._scope.mode
        if index is not None and name == index[0]:
            return str(index[1])
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
        words = [self._field(one, field) for one in ids]
        return None if None in words else ", ".join(word for word in words if word is not None)

    def _field(self, entity_id: str, field: str) -> str | None:
        entity = self._entities[entity_id]
        if any(name == field or name.startswith(f"{field}_") for name in entity.hidden):
            return None
        return shown_field(entity, field)


def _unit(param: model.Parameter) -> tuple[str, float]:
    """The author's unit of a param's default and what one of it is in SI."""
    unit = param.default.unit if isinstance(param.default, Number) else ""
    return (unit, si_value(1.0, unit)) if unit else ("", 1.0)
