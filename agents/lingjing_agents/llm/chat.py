"""Requests, completions, failures and the one-method Protocol of a chat model."""

from __future__ import annotations

from base64 import b64encode
from dataclasses import dataclass
from hashlib import sha256
from typing import Literal, Protocol

import msgspec

TokenLimit = Literal["max_tokens", "max_completion_tokens"]
"""How a bound on the tokens of an answer is spelled; the second one counts the reasoning too."""

Structured = Literal["json_schema", "json_object", "tool", "none"]
"""How a service is asked for an answer of a given form: by `response_format` with the JSON Schema or without it, by a
tool whose parameters are the schema, or not at all."""

FailureCause = Literal["service", "model", "time"]

TOOL = "step"
"""The name of the schema, and of the tool that has it."""


@dataclass(frozen=True, slots=True)
class ChatMessage:
    """One turn. `images` are JPEG files; they go with user turns only."""

    role: Literal["system", "user", "assistant"]
    text: str
    images: tuple[bytes, ...] = ()


@dataclass(frozen=True, slots=True)
class ChatRequest:
    """One completion to ask for. `schema` is a JSON Schema the answer must satisfy, as JSON text, or None; `structured`
    says how the service is told of it.

    `temperature` is None where the model takes none; `insist` says that somebody asked for this one, so that it must
    not be left out where a service refuses it. `limit_name` is what the model calls the bound of `max_tokens`.
    `reasoning_effort` is sent if it is not empty, and so are the members of `extra`, a JSON object as text.
    """

    model: str
    messages: tuple[ChatMessage, ...]
    temperature: float | None = 0.0
    max_tokens: int = 2048
    schema: bytes | None = None
    insist: bool = False
    limit_name: TokenLimit = "max_tokens"
    structured: Structured = "json_schema"
    reasoning_effort: str = ""
    extra: bytes = b"{}"


@dataclass(frozen=True, slots=True)
class ModelCompletion:
    """What came back. `text` is the answer (the arguments, if it came as a tool's call), `reasoning` what the service
    gave beside it. `finish_reason` is the protocol's (`stop`, `length`, `content_filter`, …). `cached_tokens` are those
    of the prompt that the service had kept; no tokens at all means that it did not count. `cost_usd` is what the client
    knows of the price, None if nothing."""

    text: str
    finish_reason: str
    prompt_tokens: int = 0
    completion_tokens: int = 0
    cost_usd: float | None = None
    reasoning: str = ""
    cached_tokens: int = 0


class ModelError(Exception):
    """A call to a model failed. `transient` says whether trying again may help, `retry_after_s` when the service
    said so, `status` is the HTTP status or None, `fault` whose failure it is: the service's (it refuses, or is not
    there), the model's (it will not answer this), or that of time, which ran out. `adapted` says that the client has
    changed its way of asking and the same request may now be taken. `billed` says that the service may have answered
    and taken money for it."""

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
    """A chat model. A call may be made from any event loop; nothing is kept open between calls."""

    async def complete(self, request: ChatRequest, timeout_s: float) -> ModelCompletion:
        """Ask once, without retries, within `timeout_s` seconds. Raises `ModelError`."""
        ...


def wire_messages(messages: tuple[ChatMessage, ...]) -> list[dict[str, object]]:
    """The messages as the OpenAI chat protocol spells them; images become base64 data URLs."""
    return [{"role": message.role, "content": _content(message)} for message in messages]


def recorded_message(message: ChatMessage) -> bytes:
    """The message as JSON for a record: a picture is named by its SHA-256."""
    content: object = message.text
    if message.images:
        shown = [{"type": "picture", "sha256": sha256(image).hexdigest()} for image in message.images]
        content = [{"type": "text", "text": message.text}, *shown]
    return msgspec.json.encode({"role": message.role, "content": content})


def parameters(request: ChatRequest) -> dict[str, object]:
    """Everything of the request but its messages, as the protocol spells it."""
    body: dict[str, object] = {"model": request.model, request.limit_name: request.max_tokens}
    if request.temperature is not None:
        body["temperature"] = request.temperature
    if request.reasoning_effort:
        body["reasoning_effort"] = request.reasoning_effort
    body |= _form(request)
    return body | msgspec.json.decode(request.extra, type=dict[str, object])


def _form(request: ChatRequest) -> dict[str, object]:
    """What tells the service of the schema. Not `strict`: optional fields are part of it."""
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
