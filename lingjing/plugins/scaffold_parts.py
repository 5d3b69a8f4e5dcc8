"""The parts of a scaffold with named errors: a part that raises or returns a wrong value is named with its scaffold.

`lingjing.plugins.lookup` puts them around the parts that a scaffold replaces; those of `react` stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

from lingjing.articles import with_article
from lingjing.errors import LingjingError, PluginError
from lingjing.plugins.backbone import ChatMessage, ModelError
from lingjing.plugins.calls import AbandonedCallError
from lingjing.plugins.decisions import JsonSchema
from lingjing.plugins.foreign_errors import kind_of_value, one_line
from lingjing.plugins.policy import Decision, NoDecisionError, Observation
from lingjing.plugins.scaffold import AgentParts, MemoryLimits, ModelQuestion, ModelStep, Situation, StepError, Turn

ResultT = TypeVar("ResultT")

_OWN_ERRORS = (StepError, ModelError, NoDecisionError, AbandonedCallError, LingjingError)
"""The exceptions that the contract allows, and those of this project."""


def named_parts(parts: AgentParts, react: AgentParts, owner: str) -> AgentParts:
    """Return the parts of a scaffold with named errors. `owner` is the scaffold in words."""
    own: dict[str, Any] = {}
    for field, wrap in _WRAPPERS.items():
        part = getattr(parts, field)
        if part is not getattr(react, field):
            own[field] = wrap(part, f"{owner}: {field}")
    return replace(parts, **own)


class _NamedPart:
    """A part behind named errors. Attributes beyond the contract are those of the part."""

    def __init__(self, part: Any, name: str) -> None:
        self._part = part
        self._name = name

    def __getattr__(self, attribute: str) -> Any:
        return getattr(self._part, attribute)

    def _call(self, method: str, call: Callable[[], object], due: type[ResultT]) -> ResultT:
        try:
            value = call()
        except _OWN_ERRORS:
            raise
        except (Exception, SystemExit) as error:
            raise self._error(method, f"raised {one_line(error)}") from error
        return self._checked(method, value, due)

    def _checked(self, method: str, value: object, due: type[ResultT]) -> ResultT:
        if not isinstance(value, due):
            raise self._error(method, f"returned {kind_of_value(value)}, and {with_article(due.__name__)} is due")
        return value

    def _error(self, method: str, problem: str) -> PluginError:
        return PluginError(f"{self._name}.{method} {problem}", hint=f"correct `{method}` of the scaffold's part")


class _NamedPrompt(_NamedPart):
    def system(self, first: Observation, memory: str, answer: str) -> str:
        return self._call("system", lambda: self._part.system(first, memory, answer), str)

    def state(self, situation: Situation) -> str:
        return self._call("state", lambda: self._part.state(situation), str)


class _NamedMemory(_NamedPart):
    @property
    def instructions(self) -> str:
        return self._call("instructions", lambda: self._part.instructions, str)

    def begin(self, limits: MemoryLimits) -> None:
        self._call("begin", lambda: self._part.begin(limits), object)

    def turns(self) -> tuple[ChatMessage, ...]:
        turns = self._call("turns", lambda: self._part.turns(), Sequence)  # type: ignore[type-abstract]
        return tuple(self._checked("turns", turn, ChatMessage) for turn in turns)

    def members(self) -> Mapping[str, object]:
        return self._call("members", lambda: self._part.members(), Mapping)  # type: ignore[type-abstract]

    def record(self, turn: Turn) -> None:
        self._call("record", lambda: self._part.record(turn), object)


class _NamedParser(_NamedPart):
    @property
    def instructions(self) -> str:
        return self._call("instructions", lambda: self._part.instructions, str)

    @property
    def schema(self) -> JsonSchema | None:
        schema: JsonSchema | None = self._call("schema", lambda: self._part.schema, object)  # type: ignore[assignment]
        return schema

    def parse(self, text: str) -> ModelStep:
        step = self._call("parse", lambda: self._part.parse(text), ModelStep)
        self._checked("parse", step.decision, Decision)
        return step

    def repair(self, fault: str) -> str:
        return self._call("repair", lambda: self._part.repair(fault), str)


class _NamedDeliberation(_NamedPart):
    async def think(self, situation: Situation, ask: ModelQuestion) -> Mapping[str, object]:
        try:
            members: object = await self._part.think(situation, ask)
        except _OWN_ERRORS:
            raise
        except Exception as error:
            raise self._error("think", f"raised {one_line(error)}") from error
        return self._checked("think", members, Mapping)  # type: ignore[type-abstract]


_WRAPPERS: dict[str, type[_NamedPart]] = {
    "prompt": _NamedPrompt,
    "memory": _NamedMemory,
    "parser": _NamedParser,
    "deliberation": _NamedDeliberation,
}
"""The wrapper of each part, by its field of `AgentParts`."""

__all__ = ["named_parts"]
