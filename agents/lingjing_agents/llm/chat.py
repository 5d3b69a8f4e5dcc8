"""The requests of a chat model as the OpenAI chat protocol and the record of calls spell them."""

from __future__ import annotations

from base64 import b64encode
from hashlib import sha256

import msgspec

from lingjing.decoding import from_json
from lingjing.plugins.backbone import ChatMessage, ChatRequest

TOOL = "step"
"""The name of the schema, and of the tool with the schema."""


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
    return body | from_json(request.extra, dict[str, object])


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
