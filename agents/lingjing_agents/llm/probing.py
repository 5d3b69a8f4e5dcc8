"""`probe_model`: a test of whether a chat model answers, independent of the policy that reports an outage."""

from __future__ import annotations

from lingjing.plugins.backbone import ChatMessage, ChatRequest, ModelError
from lingjing.plugins.options import PluginOptions
from lingjing.plugins.policy import UsageError
from lingjing_agents.llm.asking import open_client
from lingjing_agents.llm.options import ModelOptions
from lingjing_agents.llm.retry import Attempts, CallDeadline, complete_with_retries

WITHIN_S = 20.0
"""Seconds of wall clock for the answer. Chosen."""

FEW_TOKENS = 16
"""Bound on the tokens of the answer."""


async def probe_model(options: PluginOptions) -> str:
    """Return the reason for which the service does not answer a short question without pictures; "" if it answers.

    A refusal by the model counts as an answer. A missing key or address is a reason.
    """
    assert isinstance(options, ModelOptions)
    profile = options.profile
    request = ChatRequest(
        model=profile.served,
        messages=(ChatMessage("user", "Answer with the word yes."),),
        temperature=profile.temperature,
        max_tokens=FEW_TOKENS,
        limit_name=profile.traits.limit,
        structured="none",
    )
    try:
        client = open_client(options, profile)
        await complete_with_retries(client, request, CallDeadline(WITHIN_S), Attempts(), tries=2)
    except ModelError as error:
        return "" if error.fault == "model" else f"{error}"
    except UsageError as error:
        return f"{error}"
    return ""
