"""The OpenAI chat protocol over HTTP, nothing else: works with every compatible server, hosted or local."""

from __future__ import annotations

import os
import socket
import ssl
from base64 import b64encode
from dataclasses import dataclass, field, replace
from typing import Annotated

import httpx
import msgspec

from lingjing_agents.llm.chat import ChatRequest, ModelCompletion, ModelError, parameters, wire_messages
from lingjing_agents.llm.dialect import Dialect
from lingjing_agents.llm.wire import HttpAnswer, UnreadableAnswerError, exchange

TRANSIENT_STATUS = frozenset({408, 409, 425, 429, 500, 502, 503, 504, 529})

MOST_TOKENS = 2**40
Count = Annotated[int, msgspec.Meta(ge=0, le=MOST_TOKENS)]


class _Called(msgspec.Struct):
    """Arguments are JSON as text, by the protocol; some servers give the object itself."""

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
    usage: msgspec.Raw = msgspec.Raw(b"null")


class _Failure(msgspec.Struct):
    """An answer in which an intermediary that had begun with 200 says what came of it."""

    error: msgspec.Raw
    choices: msgspec.Raw | None = None


class _Numbered(msgspec.Struct):
    code: Annotated[int, msgspec.Meta(ge=400, le=599)]


@dataclass(frozen=True, slots=True)
class DirectClient:
    """`base_url` ends where `/chat/completions` is appended. The key is sent as a bearer token if there is one, else
    `login` (`user:password`) as basic authorisation. What the service refuses to be told is remembered."""

    base_url: str
    api_key: str = field(default="", repr=False)
    login: str = field(default="", repr=False)
    dialect: Dialect = field(default_factory=Dialect, repr=False)

    async def complete(self, request: ChatRequest, timeout_s: float) -> ModelCompletion:
        """One POST. Raises `ModelError`; status, broken connections and time-outs say whether to try again."""
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
        return _completion(answer.body)

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
    """The status of the error that stands in the place of an answer, 502 if it names none; 0 if there is no error."""
    try:
        failure = msgspec.json.decode(content, type=_Failure)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return 0
    if bytes(failure.error) == b"null" or failure.choices is not None:
        return 0
    try:
        return msgspec.json.decode(failure.error, type=_Numbered).code
    except (msgspec.DecodeError, RecursionError):
        return int(httpx.codes.BAD_GATEWAY)


def basic(login: str) -> str:
    """The `Authorization` of a `user:password`."""
    return "Basic " + b64encode(login.encode()).decode()


def filtered(refusal: str) -> bool:
    """Whether a service refuses because of what the prompt is about, which is no fault of the service's."""
    return "content_filter" in refusal or "content_policy" in refusal


def _payload(request: ChatRequest) -> bytes:
    return msgspec.json.encode({**parameters(request), "messages": wire_messages(request.messages)})


def _completion(content: bytes) -> ModelCompletion:
    try:
        answer = msgspec.json.decode(content, type=_Answer)
        choice = answer.choices[0]
        text = _called(choice.message) or _written(choice.message)
    except (msgspec.DecodeError, UnicodeDecodeError, IndexError, RecursionError) as error:
        message = f"the service's answer is not a chat completion: {error}"
        raise ModelError(message, transient=True, billed=True) from error
    said = choice.message
    if said.refusal:
        raise ModelError(f"the model refused: {said.refusal}", fault="model", billed=True)
    tokens = _counted(answer.usage)
    kept = tokens.prompt_tokens_details or _PromptTokens()
    return ModelCompletion(
        text=text,
        finish_reason=choice.finish_reason or "stop",
        prompt_tokens=tokens.prompt_tokens or 0,
        completion_tokens=tokens.completion_tokens or 0,
        reasoning=said.reasoning_content or said.reasoning or "",
        cached_tokens=min(kept.cached_tokens or 0, tokens.prompt_tokens or 0),
    )


def _counted(usage: msgspec.Raw) -> _Tokens:
    """The tokens that the service says it has counted; none where what it says cannot be: an answer is not lost for
    that, and money that nobody has counted is reckoned in full."""
    try:
        return msgspec.json.decode(usage, type=_Tokens | None, strict=False) or _Tokens()
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return _Tokens()


def _called(message: _Message) -> str:
    """The arguments of the first tool that the model calls, as JSON text."""
    for call in message.tool_calls or ():
        given = bytes(call.function.arguments)
        text = msgspec.json.decode(given, type=str) if given.startswith(b'"') else given.decode()
        if text not in ("", "null"):
            return text
    return ""


def _written(message: _Message) -> str:
    """The text of a message, of whose parts those that are reasoning or no text are left out."""
    if isinstance(message.content, list):
        return "".join(part.text or "" for part in message.content if part.type == "text")
    return message.content or ""


def _sent(error: httpx.HTTPError) -> bool:
    """Whether the service may have got the request."""
    return not isinstance(error, httpx.ConnectError | httpx.ConnectTimeout | httpx.PoolTimeout)


def _reason(error: Exception) -> str:
    """The words of the error, with those of the system's or of TLS behind it, which httpx leaves out of some errors."""
    words, cause = str(error) or type(error).__name__, error.__cause__ or error.__context__
    while cause is not None:
        text = _system_words(cause) if isinstance(cause, OSError) else ""
        if text not in words:
            words = f"{words} ({text})"
        cause = cause.__cause__ or cause.__context__
    return words


def _system_words(error: OSError) -> str:
    """The system's words for an error number; a failure of TLS or of a look-up of a name has words of its own."""
    if error.errno and not isinstance(error, ssl.SSLError | socket.gaierror):
        return os.strerror(error.errno)
    return error.strerror or str(error)
