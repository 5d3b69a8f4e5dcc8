"""`Dialect`: which of a request's parameters a service has refused, so that it is not asked that way again."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace

import msgspec

from lingjing_agents.llm.chat import ChatRequest, TokenLimit

_OTHER: dict[TokenLimit, TokenLimit] = {
    "max_tokens": "max_completion_tokens",
    "max_completion_tokens": "max_tokens",
}
_ADAPTED = frozenset({"temperature", "reasoning_effort", *_OTHER})
_REFUSED = re.compile(
    r"unsupported|not support|unrecogni[sz]ed|unknown|unexpected|not permitted|not allowed|extra", re.I
)


class _Fault(msgspec.Struct):
    param: str | None = None


class _Refusal(msgspec.Struct):
    error: _Fault


@dataclass(slots=True)
class Dialect:
    """What is left out or spelled otherwise. A parameter is adapted once; a second refusal of it stands."""

    refused: set[str] = field(default_factory=set)

    def spoken(self, request: ChatRequest) -> ChatRequest:
        """The request as the service takes it."""
        limit = _OTHER[request.limit_name] if request.limit_name in self.refused else request.limit_name
        temperature = None if "temperature" in self.refused else request.temperature
        effort = "" if "reasoning_effort" in self.refused else request.reasoning_effort
        return replace(request, temperature=temperature, limit_name=limit, reasoning_effort=effort)

    def adapt(self, refusal: str, request: ChatRequest) -> bool:
        """Whether a refusal (the body of a 400 or 422) names a parameter that can be left out or spelled otherwise."""
        if not _REFUSED.search(refusal):
            return False
        sent = [request.limit_name, *["reasoning_effort"] * bool(request.reasoning_effort)]
        sent += ["temperature"] * (request.temperature is not None and not request.insist)
        named = _param(refusal)
        for name in sent:
            said = named == name if named in _ADAPTED else re.search(rf"\b{name}\b", refusal) is not None
            if said and name not in self.refused:
                self.refused.add(name)
                return True
        return False


def _param(refusal: str) -> str | None:
    """The parameter that an error of the protocol says it is about."""
    try:
        return msgspec.json.decode(refusal, type=_Refusal).error.param
    except (msgspec.DecodeError, UnicodeEncodeError, RecursionError):
        return None
