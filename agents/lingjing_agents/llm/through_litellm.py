"""Any service that litellm speaks to. litellm is imported here and nowhere else, and only when it is used.

Its own retries stay off: some need undeclared packages, and ours keep to a deadline. The price map it would fetch at
import is replaced by the local one: an import without a network has been seen to dead-lock. What it sends over httpx
goes through `wire`, so that answers are bounded; providers with a library of their own (boto3, Google's) are not.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from typing import Any

import httpx
import msgspec

from lingjing.installation import AGENTS, install_line
from lingjing.plugins.policy import UsageError
from lingjing_agents.llm.chat import (
    ChatRequest,
    FailureCause,
    ModelCompletion,
    ModelError,
    parameters,
    wire_messages,
)
from lingjing_agents.llm.direct import MOST_TOKENS, TRANSIENT_STATUS, basic, filtered
from lingjing_agents.llm.wire import BoundedTransport, pause_s


@dataclass(frozen=True, slots=True)
class LitellmClient:
    """`base_url` and `api_key` are optional: litellm finds a provider's own by the model's prefix. `login` is
    `user:password` for basic authorisation."""

    base_url: str = ""
    api_key: str = field(default="", repr=False)
    login: str = field(default="", repr=False)

    async def complete(self, request: ChatRequest, timeout_s: float) -> ModelCompletion:
        """One `acompletion` with `num_retries=0`. Raises `ModelError`."""
        litellm = load_litellm()
        try:
            answer = await litellm.acompletion(
                messages=wire_messages(request.messages),
                **msgspec.json.decode(msgspec.json.encode(parameters(replace(request, extra=b"{}")))),
                extra_body=msgspec.json.decode(request.extra) or None,
                api_base=self.base_url or None,
                api_key=self.api_key or None,
                extra_headers={"Authorization": basic(self.login)} if self.login and not self.api_key else None,
                timeout=timeout_s,
                num_retries=0,
                max_retries=0,
                drop_params=True,
            )
        except Exception as error:
            raise _failed(error) from error
        return _completion(answer)


def load_litellm() -> Any:
    """The litellm module (seconds of import and 180 MB); `UsageError` if it is not installed."""
    os.environ.setdefault("LITELLM_LOCAL_MODEL_COST_MAP", "True")
    try:
        import litellm
    except ImportError as error:
        raise UsageError(
            f"client=litellm cannot import litellm: {error}",
            hint=_install_hint(),
        ) from error
    litellm.suppress_debug_info = True
    litellm.telemetry = False
    _bound(litellm)
    return litellm


def _install_hint() -> str:
    return f"{install_line('litellm', of=AGENTS)}, or use client=direct"


def _bound(litellm: Any) -> None:
    """Have both of its ways to HTTP use `BoundedTransport`: the OpenAI library's client and its own handler."""
    from litellm.llms.custom_httpx.http_handler import AsyncHTTPHandler

    if isinstance(litellm.aclient_session, httpx.AsyncClient):
        return
    handler: Any = AsyncHTTPHandler
    if not callable(getattr(handler, "_create_async_transport", None)):
        message = "this version of litellm makes its connections in a way that cannot be bounded"
        raise UsageError(message, hint=_install_hint())
    handler._create_async_transport = staticmethod(lambda *_, **__: BoundedTransport())
    handler._create_httpx_proxy_mounts = staticmethod(lambda *_, **__: {})  # `wire` reads the proxies' variables itself
    litellm.aclient_session = httpx.AsyncClient(transport=BoundedTransport())


def _failed(error: Exception) -> ModelError:
    status = getattr(error, "status_code", None)
    status = status if isinstance(status, int) else None
    response = getattr(error, "response", None)
    retry_after = response.headers.get("retry-after") if response is not None else None
    answered = response.headers.get("date") if response is not None else None
    # Connection faults carry 500 (InternalServerError) or none at all.
    transient = status in TRANSIENT_STATUS or "connection" in type(error).__name__.lower()
    text = " ".join(str(error).split())
    return ModelError(
        f"{type(error).__name__}: {text}",
        transient=transient,
        retry_after_s=pause_s(retry_after, answered),
        status=status,
        fault=_fault(error, text),
        billed=status is None or type(error).__name__ == "Timeout",
    )


def _fault(error: Exception, text: str) -> FailureCause:
    name = type(error).__name__
    if name == "Timeout":
        return "time"
    return "model" if name == "ContentPolicyViolationError" or filtered(text) else "service"


def _completion(answer: Any) -> ModelCompletion:
    if not answer.choices:
        raise ModelError("the service's answer holds no choices", transient=True, billed=True)
    choice = answer.choices[0]
    said = choice.message
    calls = getattr(said, "tool_calls", None) or ()
    called = next((one.function.arguments for one in calls if one.function.arguments), "")
    usage = getattr(answer, "usage", None)
    cost = getattr(answer, "_hidden_params", {}).get("response_cost")
    return ModelCompletion(
        text=called or said.content or "",
        finish_reason=choice.finish_reason or "stop",
        reasoning=getattr(said, "reasoning_content", None) or "",
        cached_tokens=_count(getattr(getattr(usage, "prompt_tokens_details", None), "cached_tokens", 0)),
        prompt_tokens=_count(getattr(usage, "prompt_tokens", 0)),
        completion_tokens=_count(getattr(usage, "completion_tokens", 0)),
        cost_usd=float(cost) if cost is not None else None,
    )


def _count(tokens: object) -> int:
    """A number of tokens; 0 for what cannot be one."""
    return tokens if isinstance(tokens, int) and 0 <= tokens <= MOST_TOKENS else 0
