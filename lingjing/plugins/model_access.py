"""The access to chat models that a plug-in offers to the policies of others (`lingjing.plugins.asking`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import msgspec

from lingjing.plugins.backbone import ChatMessage
from lingjing.plugins.calls import CallResult, ModelCalls


class ForwardedAnswer(msgspec.Struct, frozen=True, kw_only=True):
    """The answer to a request in the protocol of a service."""

    status: int
    """The HTTP status."""
    body: bytes
    """A JSON object."""


class ModelAsker(Protocol):
    """One agent's access to a model. Any thread and any event loop may call it."""

    async def ask(
        self, tick: int, messages: tuple[ChatMessage, ...], within_s: float, schema: bytes | None = None
    ) -> CallResult:
        """Return the answer of the model. `schema` is a JSON Schema that the answer must satisfy, as text.

        Raises `NoDecisionError` without an answer, and the errors of `ModelCalls.begin`.
        """
        ...

    async def forward(self, tick: int, body: bytes, within_s: float) -> ForwardedAnswer:
        """Return the service's answer to a whole request in the OpenAI chat protocol. The model's name and limits are
        those of the options. A failure is an answer with an error.
        """
        ...


class ModelServer(Protocol):
    """A server on loopback that speaks the OpenAI chat protocol for one agent."""

    @property
    def url(self) -> str:
        """The address, to which clients append `/chat/completions`."""
        ...

    @property
    def key(self) -> str:
        """The key that clients must send."""
        ...

    def close(self) -> None:
        """Stop serving. A server also ends with its process."""
        ...


@dataclass(frozen=True, slots=True)
class AskerPlugin:
    """The declaration of an access to models through the hook `lingjing_askers`."""

    name: str
    factory: Callable[[Mapping[str, object], ModelCalls], ModelAsker]
    """Returns the access of one agent from the given options of `AskOptions`. Raises `UsageError`."""
    serve: Callable[[ModelAsker, Callable[[], int], float], ModelServer]
    """Returns a server over an access. It takes the function that returns the present tick, and the seconds of one
    answer."""
    summary: str = ""


__all__ = ["AskerPlugin", "ForwardedAnswer", "ModelAsker", "ModelServer"]
