"""The OpenAI chat protocol over HTTP and nothing else: works with every compatible server, hosted or local."""

from __future__ import annotations

import os
import re
import socket
import ssl
from base64 import b64encode
from dataclasses import dataclass, field, replace
from typing import Annotated

import httpx
import msgspec

from lingjing.decoding import from_json
from lingjing.plugins.backbone import ChatRequest, ModelCompletion, ModelError, TokenLimit
from lingjing_agents.llm.chat import parameters, wire_messages
from lingjing_agents.llm.wire import HttpAnswer, UnreadableAnswerError, exchange

TRANSIENT_STATUS = frozenset({408, 409, 425, 429, 500, 502, 503, 504, 529})
"""HTTP statuses after which another attempt may succeed."""

MOST_TOKENS = 2**40
"""Largest plausible token count of a service; larger ones are ignored. Chosen."""
Count = Annotated[int, msgspec.Meta(ge=0, le=MOST_TOKENS)]
"""A token count."""


class _Called(msgspec.Struct):
    """The arguments of a tool call: JSON as text by the protocol; some servers send the object itself."""

    arguments: msgspec.Raw = msgspec.Raw(b"null")


class _ToolCall(msgspec.Struct):
    function: _Called = msgspec.field(default_factory=_Called)


class _Part(msgspec.Struct):
    type: str = ""
    text: str | None = None


class _Message(msgspec.Struct):
    content: str | list[_Part] | None = None
    refusal: str | None = None
    tool_calls: list[_ToolCall] | None = None
    reasoning_content: str | None = None
    reasoning: str | None = None


class _Choice(msgspec.Struct):
    message: _Message
    finish_reason: str | None = None


class _PromptTokens(msgspec.Struct):
    cached_tokens: Count | None = None


class _Tokens(msgspec.Struct):
    prompt_tokens: Count | None = None
    completion_tokens: Count | None = None
    prompt_tokens_details: _PromptTokens | None = None


class _Answer(msgspec.Struct):
    choices: list[_Choice]
    model: str | None = None
    usage: msgspec.Raw = msgspec.Raw(b"null")


class _Failure(msgspec.Struct):
    """An error body under status 200, as intermediaries send it when they have begun the response before the
    failure.
    """

    error: msgspec.Raw
    choices: msgspec.Raw | None = None


class _Numbered(msgspec.Struct):
    code: Annotated[int, msgspec.Meta(ge=400, le=599)]


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
    """The parameters to leave out or to rename. A parameter is adapted once; a second rejection is final."""

    refused: set[str] = field(default_factory=set)
    """Names of rejected parameters."""

    def spoken(self, request: ChatRequest) -> ChatRequest:
        """Return the request in the form that the service accepts."""
        limit = _OTHER[request.limit_name] if request.limit_name in self.refused else request.limit_name
        temperature = None if "temperature" in self.refused else request.temperature
        effort = "" if "reasoning_effort" in self.refused else request.reasoning_effort
        return replace(request, temperature=temperature, limit_name=limit, reasoning_effort=effort)

    def adapt(self, refusal: str, request: ChatRequest) -> bool:
        """Adapt to a rejection (the body of a 400 or 422). Return whether it names a parameter that can be left out or
        renamed.
        """
        if not _REFUSED.search(refusal):
            return False
        sent = [request.limit_name, *["reasoning_effort"] * bool(request.reasoning_effort)]
        sent += ["temperature"] * (request.temperature is not None and not request.insist)
        named = _param(refusal)
        for name in sent:
            is_named = named == name if named in _ADAPTED else re.search(rf"\b{name}\b", refusal) is not None
            if is_named and name not in self.refused:
                self.refused.add(name)
                return True
        return False


def _param(refusal: str) -> str | None:
    """Return the parameter that an error of the protocol names, or None."""
    try:
        return from_json(refusal, _Refusal).error.param
    except (msgspec.DecodeError, UnicodeEncodeError, RecursionError):
        return None


@dataclass(frozen=True, slots=True)
class DirectClient:
    """A client of the OpenAI chat protocol. It stores what the service rejects."""

    base_url: str
    """The address to which `/chat/completions` is appended."""
    api_key: str = field(default="", repr=False)
    """Sent as a bearer token unless it is ""."""
    login: str = field(default="", repr=False)
    """`user:password` for basic authorisation, used without a key."""
    dialect: Dialect = field(default_factory=Dialect, repr=False)
    """The parameters that the service rejects."""

    async def complete(self, request: ChatRequest, timeout_s: float) -> ModelCompletion:
        """Send one POST. Raises `ModelError`, transient for suitable statuses, broken connections and time-outs."""
        try:
            post = httpx.Request(
                "POST", self._url(), headers=self._headers(), content=_payload(self.dialect.spoken(request))
            )
            answer = await exchange(post, timeout_s)
        except httpx.TimeoutException as error:
            message = f"no answer from {self.base_url} within {timeout_s:.1f} s"
            raise ModelError(message, transient=True, fault="time", billed=_sent(error)) from error
        except (httpx.InvalidURL, httpx.UnsupportedProtocol) as error:
            raise ModelError(f"base_url {self.base_url} is not a URL: {error}") from error
        except httpx.HTTPError as error:
            message = f"connection to {self.base_url} failed: {_reason(error)}"
            raise ModelError(message, transient=True, billed=_sent(error)) from error
        except UnreadableAnswerError as error:
            raise ModelError(str(error), transient=True, billed=True) from error
        failed = _failed(answer.body) if answer.status == httpx.codes.OK else answer.status
        if failed:
            raise self._refused(replace(answer, status=failed), request)
        completion = _completion(answer.body)
        return replace(completion, body=answer.body.decode("utf-8", "replace")) if request.whole else completion

    def _url(self) -> str:
        return self.base_url.rstrip("/") + "/chat/completions"

    def _headers(self) -> dict[str, str]:
        headers = {"content-type": "application/json"}
        if self.api_key:
            headers["authorization"] = f"Bearer {self.api_key}"
        elif self.login:
            headers["authorization"] = basic(self.login)
        return headers

    def _refused(self, answer: HttpAnswer, request: ChatRequest) -> ModelError:
        text = answer.body.decode("utf-8", "replace")
        return ModelError(
            f"the model service answered {answer.status}: {' '.join(text.split())}",
            transient=answer.status in TRANSIENT_STATUS,
            retry_after_s=answer.retry_after_s,
            status=answer.status,
            fault="model" if answer.status == httpx.codes.BAD_REQUEST and filtered(text) else "service",
            adapted=answer.status in (400, 422) and self.dialect.adapt(text, request),
        )


def _failed(content: bytes) -> int:
    """Return the status of an error body, 502 if it has none; 0 if the body is no error."""
    try:
        failure = from_json(content, _Failure)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return 0
    if bytes(failure.error) == b"null" or failure.choices is not None:
        return 0
    try:
        return from_json(failure.error, _Numbered).code
    except (msgspec.DecodeError, RecursionError):
        return int(httpx.codes.BAD_GATEWAY)


def basic(login: str) -> str:
    """Return the `Authorization` header of a `user:password`."""
    return "Basic " + b64encode(login.encode()).decode()


def filtered(refusal: str) -> bool:
    """Return whether a service rejects the content of the prompt, which is no fault of the service."""
    return "content_filter" in refusal or "content_policy" in refusal


def _payload(request: ChatRequest) -> bytes:
    if request.whole:
        return request.whole
    return msgspec.json.encode({**parameters(request), "messages": wire_messages(request.messages)})


def _completion(content: bytes) -> ModelCompletion:
    try:
        answer = from_json(content, _Answer)
        choice = answer.choices[0]
        text = _called(choice.message) or _written(choice.message)
    except (msgspec.DecodeError, UnicodeDecodeError, IndexError, RecursionError) as error:
        problem = f"the service's answer is not a chat completion: {error}"
        raise ModelError(problem, transient=True, billed=True) from error
    message = choice.message
    if message.refusal:
        raise ModelError(f"the model refused: {message.refusal}", fault="model", billed=True)
    tokens = _counted(answer.usage)
    kept = tokens.prompt_tokens_details or _PromptTokens()
    return ModelCompletion(
        text=text,
        finish_reason=choice.finish_reason or "stop",
        prompt_tokens=tokens.prompt_tokens or 0,
        completion_tokens=tokens.completion_tokens or 0,
        reasoning=message.reasoning_content or message.reasoning or "",
        cached_tokens=min(kept.cached_tokens or 0, tokens.prompt_tokens or 0),
        served=(answer.model or "")[:200],
    )


def _counted(usage: msgspec.Raw) -> _Tokens:
    """Return the service's token counts, or none if they are invalid.

    Invalid counts do not invalidate the answer; its cost then counts in full as unknown.
    """
    try:
        return from_json(usage, _Tokens | None, strict=False) or _Tokens()
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return _Tokens()


def _called(message: _Message) -> str:
    """Return the arguments of the model's first tool call as JSON text; "" without one."""
    for call in message.tool_calls or ():
        arguments = bytes(call.function.arguments)
        text = from_json(arguments, str) if arguments.startswith(b'"') else arguments.decode()
        if text not in ("", "null"):
            return text
    return ""


def _written(message: _Message) -> str:
    """Return the text of a message, without parts that are reasoning or no text."""
    if isinstance(message.content, list):
        return "".join(part.text or "" for part in message.content if part.type == "text")
    return message.content or ""


def _sent(error: httpx.HTTPError) -> bool:
    """Return whether the service may have received the request."""
    return not isinstance(error, httpx.ConnectError | httpx.ConnectTimeout | httpx.PoolTimeout)


def _reason(error: Exception) -> str:
    """Return the text of the error with those of its system or TLS causes, which httpx leaves out of some errors."""
    words, cause = str(error) or type(error).__name__, error.__cause__ or error.__context__
    while cause is not None:
        text = _system_words(cause) if isinstance(cause, OSError) else ""
        if text not in words:
            words = f"{words} ({text})"
        cause = cause.__cause__ or cause.__context__
    return words


def _system_words(error: OSError) -> str:
    """Return the system's text for an error number. Failures of TLS or of name resolution have texts of their own."""
    if error.errno and not isinstance(error, ssl.SSLError | socket.gaierror):
        return os.strerror(error.errno)
    return error.strerror or str(error)
