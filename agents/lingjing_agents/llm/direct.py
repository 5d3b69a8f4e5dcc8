"""The OpenAI chat protocol over HTTP, nothing else: works with every compatible server, hosted or local."""

from __future__ import annotations

from dataclasses import dataclass, field

import msgspec

from lingjing_agents.llm.chat import ChatRequest, Completion, ModelError, response_format, wire_messages

TRANSIENT_STATUS = frozenset({408, 409, 425, 429, 500, 502, 503, 504, 529})


class _Message(msgspec.Struct):
    content: str | None = None
    refusal: str | None = None


class _Choice(msgspec.Struct):
    message: _Message
    finish_reason: str | None = None


class _Tokens(msgspec.Struct):
    prompt_tokens: int = 0
    completion_tokens: int = 0


class _Answer(msgspec.Struct):
    choices: list[_Choice]
    usage: _Tokens | None = None


@dataclass(frozen=True, slots=True)
class DirectClient:
    """`base_url` ends where `/chat/completions` is appended. The key is sent as a bearer token if there is one."""

    base_url: str
    api_key: str = field(default="", repr=False)

    async def complete(self, request: ChatRequest, timeout_s: float) -> Completion:
        """One POST. Raises `ModelError`; status, broken connections and time-outs say whether to try again."""
        import httpx

        url = self.base_url.rstrip("/") + "/chat/completions"
        headers = {"content-type": "application/json"}
        if self.api_key:
            headers["authorization"] = f"Bearer {self.api_key}"
        try:
            # One client a call: each policy call has an event loop of its own, and a pool belongs to one loop.
            async with httpx.AsyncClient(timeout=timeout_s) as client:
                response = await client.post(url, content=_payload(request), headers=headers)
        except httpx.TimeoutException as error:
            raise ModelError(f"no answer from {self.base_url} within {timeout_s:.1f} s", transient=True) from error
        except httpx.InvalidURL as error:
            raise ModelError(f"base_url {self.base_url} is not a URL: {error}") from error
        except httpx.HTTPError as error:
            raise ModelError(f"connection to {self.base_url} failed: {_reason(error)}", transient=True) from error
        if response.status_code != httpx.codes.OK:
            raise _refused(response.status_code, response.text, response.headers.get("retry-after"))
        return _completion(response.content)


def _payload(request: ChatRequest) -> bytes:
    body: dict[str, object] = {
        "model": request.model,
        "messages": wire_messages(request.messages),
        "temperature": request.temperature,
        "max_tokens": request.max_tokens,
    }
    form = response_format(request.schema)
    if form is not None:
        body["response_format"] = form
    return msgspec.json.encode(body)


def _refused(status: int, text: str, retry_after: str | None) -> ModelError:
    seconds = float(retry_after) if retry_after and retry_after.replace(".", "", 1).isdigit() else None
    return ModelError(
        f"the model service answered {status}: {' '.join(text.split())[:300]}",
        transient=status in TRANSIENT_STATUS,
        retry_after_s=seconds,
        status=status,
    )


def _completion(content: bytes) -> Completion:
    try:
        answer = msgspec.json.decode(content, type=_Answer)
        choice = answer.choices[0]
    except (msgspec.DecodeError, UnicodeDecodeError, IndexError) as error:
        raise ModelError(f"the service's answer is not a chat completion: {error}", transient=True) from error
    if choice.message.refusal:
        raise ModelError(f"the model refused: {choice.message.refusal[:300]}")
    tokens = answer.usage or _Tokens()
    return Completion(
        text=choice.message.content or "",
        finish_reason=choice.finish_reason or "stop",
        prompt_tokens=tokens.prompt_tokens,
        completion_tokens=tokens.completion_tokens,
    )


def _reason(error: Exception) -> str:
    return str(error) or type(error).__name__
