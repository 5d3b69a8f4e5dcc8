"""Any service that litellm speaks to. litellm is imported here and nowhere else, and only when it is used.

Its own retries stay off: some need undeclared packages, and ours keep to a deadline. The price map it would fetch at
import is replaced by the local one: an import without a network has been seen to dead-lock.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any

from lingjing.plugins.policy import UsageError
from lingjing_agents.llm.chat import ChatRequest, Completion, ModelError, response_format, wire_messages
from lingjing_agents.llm.direct import TRANSIENT_STATUS


@dataclass(frozen=True, slots=True)
class LitellmClient:
    """`base_url` and `api_key` are optional: litellm finds a provider's own by the model's prefix."""

    base_url: str = ""
    api_key: str = field(default="", repr=False)

    async def complete(self, request: ChatRequest, timeout_s: float) -> Completion:
        """One `acompletion` with `num_retries=0`. Raises `ModelError`."""
        litellm = load_litellm()
        try:
            answer = await litellm.acompletion(
                model=request.model,
                messages=wire_messages(request.messages),
                temperature=request.temperature,
                max_tokens=request.max_tokens,
                response_format=response_format(request.schema),
                api_base=self.base_url or None,
                api_key=self.api_key or None,
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
            hint="pip install 'lingjing-agents[litellm]', or use client=direct",
        ) from error
    litellm.suppress_debug_info = True
    litellm.telemetry = False
    return litellm


def _failed(error: Exception) -> ModelError:
    status = getattr(error, "status_code", None)
    status = status if isinstance(status, int) else None
    response = getattr(error, "response", None)
    retry_after = response.headers.get("retry-after") if response is not None else None
    seconds = float(retry_after) if retry_after and str(retry_after).isdigit() else None
    # Connection faults carry 500 (InternalServerError) or none at all.
    transient = status in TRANSIENT_STATUS or "connection" in type(error).__name__.lower()
    text = " ".join(str(error).split())[:300]
    return ModelError(f"{type(error).__name__}: {text}", transient=transient, retry_after_s=seconds, status=status)


def _completion(answer: Any) -> Completion:
    if not answer.choices:
        raise ModelError("the service's answer holds no choices", transient=True)
    choice = answer.choices[0]
    usage = getattr(answer, "usage", None)
    cost = getattr(answer, "_hidden_params", {}).get("response_cost")
    return Completion(
        text=choice.message.content or "",
        finish_reason=choice.finish_reason or "stop",
        prompt_tokens=int(getattr(usage, "prompt_tokens", 0) or 0),
        completion_tokens=int(getattr(usage, "completion_tokens", 0) or 0),
        cost_usd=float(cost) if cost is not None else None,
    )
