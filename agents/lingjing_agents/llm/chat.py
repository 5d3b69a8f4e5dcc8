"""Requests, completions, failures and the one-method Protocol of a chat model."""

from __future__ import annotations

from base64 import b64encode
from dataclasses import dataclass
from typing import Literal, Protocol

import msgspec

TokenLimit = Literal["max_tokens", "max_completion_tokens"]
"""How a bound on the tokens of an answer is spelled; the second one counts the reasoning too."""

FailureCause = Literal["service", "model", "time"]


@dataclass(frozen=True, slots=True)
class ChatMessage:
    """One turn. `images` are JPEG files; they go with user turns only."""

    role: Literal["system", "user", "assistant"]
    text: str
    images: tuple[bytes, ...] = ()


@dataclass(frozen=True, slots=True)
class ChatRequest:
    """One completion to ask for. `schema` is a JSON Schema the answer must satisfy, as JSON text, or None.

    `temperature` is None where the model takes none; `insist` says that somebody asked for this one, so that it must
    not be left out where a service refuses it. `limit_name` is what the model calls the bound of `max_tokens`.
    """

    model: str
    messages: tuple[ChatMessage, ...]
    temperature: float | None = 0.0
    max_tokens: int = 2048
    schema: bytes | None = None
    insist: bool = False
    limit_name: TokenLimit = "max_tokens"


@dataclass(frozen=True, slots=True)
class ModelCompletion:
    """What came back. `finish_reason` is the protocol's (`stop`, `length`, `content_filter`, …); `cost_usd` is what
    the client knows of the price, None if nothing."""

    text: str
    finish_reason: str
    prompt_tokens: int = 0
    completion_tokens: int = 0
    cost_usd: float | None = None


class ModelError(Exception):
    """A call to a model failed. `transient` says whether trying again may help, `retry_after_s` when the service
    said so, `status` is the HTTP status or None, `fault` whose failure it is: the service's (it refuses, or is not
    there), the model's (it will not answer this), or that of time, which ran out. `adapted` says that the client has
    changed its way of asking and the same request may now be taken."""

    def __init__(
        self,
        message: str,
        *,
        transient: bool = False,
        retry_after_s: float | None = None,
        status: int | None = None,
        fault: FailureCause = "service",
        adapted: bool = False,
    ) -> None:
        super().__init__(message)
        self.transient = transient
        self.retry_after_s = retry_after_s
        self.status = status
        self.fault = fault
        self.adapted = adapted


class ModelClient(Protocol):
    """A chat model. A call may be made from any event loop; nothing is kept open between calls."""

    async def complete(self, request: ChatRequest, timeout_s: float) -> ModelCompletion:
        """Ask once, without retries, within `timeout_s` seconds. Raises `ModelError`."""
        ...


def wire_messages(messages: tuple[ChatMessage, ...]) -> list[dict[str, object]]:
    """The messages as the OpenAI chat protocol spells them; images become base64 data URLs."""
    return [{"role": message.role, "content": _content(message)} for message in messages]


def response_format(schema: bytes | None) -> dict[str, object] | None:
    """The protocol's `response_format` for a JSON Schema. Not `strict`: optional fields are part of the schema."""
    if schema is None:
        return None
    return {
        "type": "json_schema",
        "json_schema": {"name": "step", "strict": False, "schema": msgspec.json.decode(schema)},
    }


def _content(message: ChatMessage) -> object:
    if not message.images:
        return message.text
    parts: list[dict[str, object]] = [{"type": "text", "text": message.text}]
    parts.extend({"type": "image_url", "image_url": {"url": _data_url(image)}} for image in message.images)
    return parts


def _data_url(image: bytes) -> str:
    return "data:image/jpeg;base64," + b64encode(image).decode("ascii")
