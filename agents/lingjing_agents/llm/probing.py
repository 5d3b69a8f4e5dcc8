"""`probe_model`: a chat model asked for a sign of life, in place of a policy that says that its service is gone."""

from __future__ import annotations

from lingjing.plugins.options import PluginOptions
from lingjing.plugins.policy import UsageError
from lingjing_agents.llm.asking import open_client
from lingjing_agents.llm.chat import ChatMessage, ChatRequest, ModelError
from lingjing_agents.llm.options import ModelOptions
from lingjing_agents.llm.retry import Attempts, CallDeadline, complete_with_retries

WITHIN_S = 20.0
"""How long the service has for its sign of life, seconds of wall clock."""

FEW_TOKENS = 16
"""The longest answer that is asked for."""


async def probe_model(options: PluginOptions) -> str:
    """Why the service gives no answer to one short question without pictures; "" if it gives one.

    A refusal of what the question is about is an answer; a key or an address that is not set is silence.
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
