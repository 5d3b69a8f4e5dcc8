"""`ServiceAsker`: one agent's calls to a model for policies of others, as messages or as whole requests.

Both ways share what `AskedModel` does: the record, the limits, the retries and the bill. A whole request keeps all of
its members but the model's name, the limit of the answer and `stream`. A record holds its pictures once, by hash.
"""

from __future__ import annotations

import threading
from base64 import b64decode
from binascii import Error as Base64Error
from collections.abc import Mapping
from hashlib import sha256
from typing import Any

import msgspec

from lingjing.decoding import from_json
from lingjing.plugins.backbone import ChatMessage, ModelError
from lingjing.plugins.calls import AbandonedCallError, CallResult, ModelCalls
from lingjing.plugins.model_access import ForwardedAnswer
from lingjing.plugins.options import read_options
from lingjing.plugins.policy import InfrastructureError, NoDecisionError, UsageError
from lingjing_agents.llm.asking import AskedModel, RawRequest, open_model
from lingjing_agents.llm.options import DIRECT, ModelOptions
from lingjing_agents.llm.retry import CallDeadline

REFUSED = 400
"""The HTTP status of every failure: the harness has tried again already, and clients try other statuses again."""

_JPEG = "data:image/jpeg;base64,"


class ServiceAsker:
    """`lingjing.plugins.asking.ModelAsker` over the model of the options."""

    def __init__(self, options: ModelOptions, calls: ModelCalls) -> None:
        self._model: AskedModel = open_model(options, calls)
        self._client = self._model.profile.client
        self._lock = threading.Lock()

    async def ask(
        self, tick: int, messages: tuple[ChatMessage, ...], within_s: float, schema: bytes | None = None
    ) -> CallResult:
        """See `ModelAsker.ask`."""
        try:
            return await self._model.ask(tick, messages, CallDeadline(within_s), schema=schema)
        except ModelError as error:
            raise NoDecisionError(str(error)) from error

    async def forward(self, tick: int, body: bytes, within_s: float) -> ForwardedAnswer:
        """See `ModelAsker.forward`."""
        if self._client != DIRECT:
            return failed(f"whole requests need client=direct, and this is {self._client}")
        try:
            request = raw_request(body)
        except (msgspec.DecodeError, ValueError, RecursionError) as error:
            return failed(f"the request is no chat request: {error}")
        try:
            result = await self._model.forward(tick, request, CallDeadline(within_s))
        except AbandonedCallError:
            return failed("the call was abandoned when it was recorded")
        except (ModelError, InfrastructureError, UsageError) as error:
            return failed(str(error))
        return ForwardedAnswer(status=200, body=result.body.encode() or completion_of(result))


def open_asker(arguments: Mapping[str, object], calls: ModelCalls) -> ServiceAsker:
    """Return the access to the model of the options. Raises `UsageError` that lists every fault."""
    return ServiceAsker(read_options(ModelOptions, arguments, "the model"), calls)


def raw_request(body: bytes) -> RawRequest:
    """Return a request with its pictures apart. Raises `ValueError` or `msgspec.DecodeError` for no chat request."""
    members = from_json(body, dict[str, Any])
    messages = members.pop("messages", None)
    if not isinstance(messages, list) or not messages:
        raise ValueError("it has no messages")
    pictures: list[bytes] = []
    recorded = tuple(msgspec.json.encode(_without_pictures(message, pictures)) for message in messages)
    for name in ("stream", "stream_options", "n"):
        members.pop(name, None)
    return RawRequest(members, tuple(messages), recorded, tuple(pictures))


def failed(reason: str) -> ForwardedAnswer:
    """Return an answer with an error in the protocol's form."""
    error = {"error": {"message": reason, "type": "lingjing", "code": None}}
    return ForwardedAnswer(status=REFUSED, body=msgspec.json.encode(error))


def completion_of(result: CallResult) -> bytes:
    """Return the body of a completion for a record that holds the text alone."""
    message = {"role": "assistant", "content": result.text}
    usage = {
        "prompt_tokens": result.prompt_tokens,
        "completion_tokens": result.completion_tokens,
        "total_tokens": result.prompt_tokens + result.completion_tokens,
    }
    choice = {"index": 0, "message": message, "finish_reason": result.finish_reason or "stop"}
    body = {"id": "recorded", "object": "chat.completion", "created": 0, "model": "", "choices": [choice]}
    return msgspec.json.encode({**body, "usage": usage})


def _without_pictures(message: object, pictures: list[bytes]) -> object:
    """Return a message with its JPEG pictures replaced by their hashes; they are added to `pictures`."""
    content = message.get("content") if isinstance(message, dict) else None
    if not isinstance(message, dict) or not isinstance(content, list):
        return message
    return {**message, "content": [_part(part, pictures) for part in content]}


def _part(part: object, pictures: list[bytes]) -> object:
    shown = part.get("image_url") if isinstance(part, dict) else None
    url = shown.get("url") if isinstance(shown, dict) else shown
    if not isinstance(url, str) or not url.startswith(_JPEG):
        return part
    try:
        data = b64decode(url.removeprefix(_JPEG), validate=True)
    except (Base64Error, ValueError):
        return part
    pictures.append(data)
    return {"type": "picture", "sha256": sha256(data).hexdigest()}
