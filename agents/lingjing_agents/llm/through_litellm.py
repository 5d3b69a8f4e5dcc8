"""A client of any service that litellm supports. litellm is imported here alone, and only when it is used.

litellm's own retries are off: some need undeclared packages, and ours keep to a deadline. Its price map is the local
one, because an import without a network has been observed to dead-lock while fetching it. Its httpx traffic goes
through `wire`, so that answers are bounded; providers with a library of their own (boto3, Google's) are not.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from typing import Any

import httpx
import msgspec

from lingjing.decoding import from_json
from lingjing.installation import AGENTS, install_line
from lingjing.plugins.backbone import ChatRequest, FailureCause, ModelCompletion, ModelError
from lingjing.plugins.policy import UsageError
from lingjing_agents.llm.chat import parameters, wire_messages
from lingjing_agents.llm.direct import MOST_TOKENS, TRANSIENT_STATUS, basic, filtered
from lingjing_agents.llm.wire import BoundedTransport, pause_s


@dataclass(frozen=True, slots=True)
class LitellmClient:
    """A client over litellm."""

    base_url: str = ""
    """The address; "" for the provider's own, which litellm derives from the model's prefix."""
    api_key: str = field(default="", repr=False)
    """The key; "" for the provider's own environment variable."""
    login: str = field(default="", repr=False)
    """`user:password` for basic authorisation."""

    async def complete(self, request: ChatRequest, timeout_s: float) -> ModelCompletion:
        """Make one `acompletion` with `num_retries=0`. Raises `ModelError`."""
        litellm = load_litellm()
        try:
            answer = await litellm.acompletion(
                messages=wire_messages(request.messages),
                **from_json(msgspec.json.encode(parameters(replace(request, extra=b"{}")))),
                extra_body=from_json(request.extra) or None,
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
    """Return the litellm module, which takes seconds and 180 MB. Raises `UsageError` if it is not installed."""
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
    """Make both of litellm's HTTP paths use `BoundedTransport`: the OpenAI library's client and its own handler."""
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
    message = choice.message
    calls = getattr(message, "tool_calls", None) or ()
    called = next((call.function.arguments for call in calls if call.function.arguments), "")
    usage = getattr(answer, "usage", None)
    cost = getattr(answer, "_hidden_params", {}).get("response_cost")
    return ModelCompletion(
        text=called or message.content or "",
        finish_reason=choice.finish_reason or "stop",
        reasoning=getattr(message, "reasoning_content", None) or "",
        cached_tokens=_count(getattr(getattr(usage, "prompt_tokens_details", None), "cached_tokens", 0)),
        prompt_tokens=_count(getattr(usage, "prompt_tokens", 0)),
        completion_tokens=_count(getattr(usage, "completion_tokens", 0)),
        cost_usd=float(cost) if cost is not None else None,
    )


def _count(tokens: object) -> int:
    """Return a number of tokens; 0 for an implausible value."""
    return tokens if isinstance(tokens, int) and 0 <= tokens <= MOST_TOKENS else 0
