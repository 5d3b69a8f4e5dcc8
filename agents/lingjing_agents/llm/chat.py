"""Requests, completions, failures and the one-method Protocol of a chat model."""

from __future__ import annotations

from base64 import b64encode
from dataclasses import dataclass
from hashlib import sha256
from typing import Literal, Protocol

import msgspec

TokenLimit = Literal["max_tokens", "max_completion_tokens"]
"""The parameter that bounds the tokens of an answer. The second one counts reasoning too."""

Structured = Literal["json_schema", "json_object", "tool", "none"]
"""The way in which a service is asked for an answer of a given form: `response_format` with or without the JSON Schema,
a tool with the schema as parameters, or none.
"""

FailureCause = Literal["service", "model", "time"]
"""The cause of a failed call: the service rejected it or is unreachable, the model refused the request, or the
deadline passed.
"""

TOOL = "step"
"""The name of the schema, and of the tool with the schema."""


@dataclass(frozen=True, slots=True)
class ChatMessage:
    """One turn of a conversation."""

    role: Literal["system", "user", "assistant"]
    """The sender of the turn."""
    text: str
    """The text."""
    images: tuple[bytes, ...] = ()
    """JPEG files; only in user turns."""


@dataclass(frozen=True, slots=True)
class ChatRequest:
    """A request for one completion."""

    model: str
    """The model's name at the service."""
    messages: tuple[ChatMessage, ...]
    """The conversation."""
    temperature: float | None = 0.0
    """None if the model accepts none."""
    max_tokens: int = 2048
    """Bound on the tokens of the answer."""
    schema: bytes | None = None
    """JSON Schema of the answer as text, or None."""
    insist: bool = False
    """True if the user set the temperature: it is then never left out, even if a service rejects it."""
    limit_name: TokenLimit = "max_tokens"
    """The model's name for the bound of `max_tokens`."""
    structured: Structured = "json_schema"
    """The way in which the service is asked for the schema."""
    reasoning_effort: str = ""
    """Sent unless it is ""."""
    extra: bytes = b"{}"
    """Further members of the request, a JSON object as text."""


@dataclass(frozen=True, slots=True)
class ModelCompletion:
    """The answer of a model."""

    text: str
    """The answer: the content, or the arguments of a tool call."""
    finish_reason: str
    """The protocol's reason (`stop`, `length`, `content_filter`, …)."""
    prompt_tokens: int = 0
    """Tokens of the prompt; 0 if the service does not count."""
    completion_tokens: int = 0
    """Tokens of the answer; 0 if the service does not count."""
    cost_usd: float | None = None
    """The price that the client knows, in US dollars; None if unknown."""
    reasoning: str = ""
    """Reasoning that the service returned beside the answer."""
    cached_tokens: int = 0
    """Tokens of the prompt that the service had cached."""


class ModelError(Exception):
    """A failed call to a model.

    - `transient`: whether another attempt may succeed.
    - `retry_after_s`: pause that the service requested, in seconds; None without one.
    - `status`: HTTP status, or None.
    - `fault`: the cause.
    - `adapted`: the client has changed its dialect, and the same request may now be accepted.
    - `billed`: the service may have answered and charged for it.
    """

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
        self.retry_after_s = retry_after_s
        self.status = status
        self.fault = fault
        self.adapted = adapted
        self.billed = billed


class ModelClient(Protocol):
    """A chat model. Calls may come from any event loop; no connection stays open between calls."""

    async def complete(self, request: ChatRequest, timeout_s: float) -> ModelCompletion:
        """Make one call, without retries, within `timeout_s` seconds. Raises `ModelError`."""
        ...


def wire_messages(messages: tuple[ChatMessage, ...]) -> list[dict[str, object]]:
    """Return the messages in the OpenAI chat protocol, images as base64 data URLs."""
    return [{"role": message.role, "content": _content(message)} for message in messages]


def recorded_message(message: ChatMessage) -> bytes:
    """Return the message as JSON for a record, pictures as SHA-256."""
    content: object = message.text
    if message.images:
        shown = [{"type": "picture", "sha256": sha256(image).hexdigest()} for image in message.images]
        content = [{"type": "text", "text": message.text}, *shown]
    return msgspec.json.encode({"role": message.role, "content": content})


def parameters(request: ChatRequest) -> dict[str, object]:
    """Return all of the request but its messages, in the OpenAI chat protocol."""
    body: dict[str, object] = {"model": request.model, request.limit_name: request.max_tokens}
    if request.temperature is not None:
        body["temperature"] = request.temperature
    if request.reasoning_effort:
        body["reasoning_effort"] = request.reasoning_effort
    body |= _form(request)
    return body | msgspec.json.decode(request.extra, type=dict[str, object])


def _form(request: ChatRequest) -> dict[str, object]:
    """Return the parameters for the schema. It is not `strict`, because it has optional fields."""
    if request.schema is None or request.structured == "none":
        return {}
    if request.structured == "json_object":
        return {"response_format": {"type": "json_object"}}
    schema = msgspec.Raw(request.schema)
    if request.structured == "json_schema":
        named = {"name": TOOL, "strict": False, "schema": schema}
        return {"response_format": {"type": "json_schema", "json_schema": named}}
    function = {"name": TOOL, "description": "Give the step.", "parameters": schema}
    chosen = {"type": "function", "function": {"name": TOOL}}
    return {"tools": [{"type": "function", "function": function}], "tool_choice": chosen}


def _content(message: ChatMessage) -> object:
    if not message.images:
        return message.text
    parts: list[dict[str, object]] = [{"type": "text", "text": message.text}]
    parts.extend({"type": "image_url", "image_url": {"url": _data_url(image)}} for image in message.images)
    return parts


def _data_url(image: bytes) -> str:
    return "data:image/jpeg;base64," + b64encode(image).decode("ascii")
