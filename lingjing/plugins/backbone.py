"""The contract of a chat-model backbone: a chat model behind one method, and the values that it exchanges.

A *backbone* turns one `ChatRequest` into one `ModelCompletion`, or raises `ModelError`. The policy `react` sends its
requests to the backbone that its option `client` names. The policy records, limits, retries and bills the calls, so a
backbone does none of that. `direct` (the OpenAI chat protocol) and `litellm` are the shipped backbones.

`lingjing.plugins.conformance.check_backbone` tests the promises of this module. See `docs/models.md` and ADR 0034.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, Protocol

TokenLimit = Literal["max_tokens", "max_completion_tokens"]
"""The name of the bound on an answer's tokens. `max_completion_tokens` includes the tokens of the reasoning."""

Structured = Literal["json_schema", "json_object", "tool", "none"]
"""The way to request an answer in JSON: `response_format` with the JSON Schema, `response_format` without it, a tool
with the schema as its parameters, or none of them."""

FailureCause = Literal["service", "model", "time", "backbone"]
"""The cause of a failed call: the service is absent or rejects every request, the model rejects this one request, the
time is used up, or the code of the backbone failed. A backbone does not raise the last one: its caller sets it for an
exception that is no `ModelError`."""


@dataclass(frozen=True, slots=True)
class ChatMessage:
    """One turn of a conversation."""

    role: Literal["system", "user", "assistant"]
    text: str
    images: tuple[bytes, ...] = ()
    """JPEG files. User turns alone have images."""


@dataclass(frozen=True, slots=True)
class ChatRequest:
    """One request for a completion."""

    model: str
    """The model's name at its service."""
    messages: tuple[ChatMessage, ...]
    temperature: float | None = 0.0
    """The sampling temperature, 0 to 2; None where the model takes none."""
    max_tokens: int = 2048
    """The bound on the answer, tokens."""
    schema: bytes | None = None
    """The JSON Schema that the answer must satisfy, as JSON text; None for free text."""
    insist: bool = False
    """True if the user chose the temperature: a backbone must not leave it out where a service rejects it."""
    limit_name: TokenLimit = "max_tokens"
    structured: Structured = "json_schema"
    """The way to send `schema`."""
    reasoning_effort: str = ""
    """The effort of a reasoning model in the service's words; not sent if empty."""
    extra: bytes = b"{}"
    """Further members of the request, a JSON object as text."""
    whole: bytes = b""
    """A whole request in the OpenAI chat protocol, sent as it is in the place of all other fields; empty without one.
    Backbones of other protocols reject it."""


@dataclass(frozen=True, slots=True)
class ModelCompletion:
    """The answer of a model."""

    text: str
    """The answer. The arguments of the tool's call, if the answer is one."""
    finish_reason: str
    """The reason of the protocol: `stop`, `length`, `content_filter`, …"""
    prompt_tokens: int = 0
    """Tokens of the request; 0 with `completion_tokens` 0 means that the service does not count."""
    completion_tokens: int = 0
    """Tokens of the answer and its reasoning."""
    cost_usd: float | None = None
    """The price that the backbone knows, US dollars; None if it knows none."""
    reasoning: str = ""
    """The reasoning that the service returns beside the answer."""
    cached_tokens: int = 0
    """The part of `prompt_tokens` that the service had cached."""
    served: str = ""
    """The model that the service names in its answer; "" if it names none."""
    body: str = ""
    """The service's whole answer to a `ChatRequest.whole`, as JSON text."""


class ModelError(Exception):
    """A failed call to a model."""

    def __init__(
        self,
        message: str,
        *,
        transient: bool = False,
        retry_after_s: float | None = None,
        status: int | None = None,
        fault: FailureCause = "service",
        adapted: bool = False,
        billed: bool = False,
    ) -> None:
        super().__init__(message)
        self.transient = transient
        """True if a second try may succeed."""
        self.retry_after_s = retry_after_s
        """The wait that the service requests, seconds; None without one."""
        self.status = status
        """The HTTP status; None without one."""
        self.fault = fault
        """The cause."""
        self.adapted = adapted
        """True if the backbone has changed its form of the request, which may now be accepted."""
        self.billed = billed
        """True if the service may have answered and charged for it."""


class Backbone(Protocol):
    """A chat model. A call may come from any event loop, so no connection stays open between calls."""

    async def complete(self, request: ChatRequest, timeout_s: float) -> ModelCompletion:
        """Make one request without retries, within `timeout_s` seconds. Raises `ModelError` for every failure."""
        ...


@dataclass(frozen=True, slots=True)
class ServiceAccess:
    """The address and the credentials of a service. No text that a backbone raises or prints may contain `key` or
    `login`."""

    url: str
    """The address without user and password; "" if the user gives none."""
    key: str = field(default="", repr=False)
    """The key of the service; "" without one."""
    login: str = field(default="", repr=False)
    """`user:password` of HTTP Basic; "" without one."""


@dataclass(frozen=True, slots=True)
class BackbonePlugin:
    """The declaration of a backbone through the hook `lingjing_backbones`."""

    name: str
    """The value of `react`'s option `client` that chooses it."""
    factory: Callable[[ServiceAccess], Backbone]
    """Returns the backbone for a service, once for each agent. Heavy imports belong here."""
    summary: str = ""
    models: tuple[str, ...] | None = None
    """The names of all models that it serves: another name is an error before the episode starts. None if it may serve
    any."""


__all__ = [
    "Backbone", "BackbonePlugin", "ChatMessage", "ChatRequest", "FailureCause", "ModelCompletion", "ModelError",
    "ServiceAccess", "Structured", "TokenLimit",
]  # fmt: skip
