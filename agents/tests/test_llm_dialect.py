"""A parameter that a service rejects is not sent again."""

import json
from typing import Any

import pytest
from lingjing_agents.llm.models import read_models
from lingjing_agents.react.policy import ReactError, ReactPolicy

from agents.tests.agent_kit import Inbox, brief, observe, react
from agents.tests.chat_server import Reply, serve
from lingjing.plugins.policy import Usage


def openai_refusal(param: str, message: str, code: str = "unsupported_parameter") -> Reply:
    error = {"message": message, "type": "invalid_request_error", "param": param, "code": code}
    return Reply(status=400, body=json.dumps({"error": error}))


NO_MAX_TOKENS = openai_refusal(
    "max_tokens",
    "Unsupported parameter: 'max_tokens' is not supported with this model. Use 'max_completion_tokens' instead.",
)
NO_TEMPERATURE = openai_refusal(
    "temperature",
    "Unsupported value: 'temperature' does not support 0 with this model. Only the default (1) value is supported.",
    "unsupported_value",
)
UNKNOWN = Reply(
    status=422,
    body=json.dumps({"detail": [{"loc": ["body", "max_completion_tokens"], "msg": "Extra inputs are not permitted"}]}),
)


def strict(request: dict[str, Any]) -> Reply:
    """A service of a reasoning model, which rejects some parameters."""
    if "max_tokens" in request:
        return NO_MAX_TOKENS
    return NO_TEMPERATURE if "temperature" in request else Reply()


async def mind(url: str, model: str, **arguments: str) -> ReactPolicy:
    policy = react(model=model, base_url=url, deadline="600", **arguments)
    await policy.reset(brief("scout[1]"))
    return policy


async def calls(policy: ReactPolicy, tick: int) -> int:
    usage = (await policy.act(observe("scout[1]", tick), Inbox())).usage
    assert isinstance(usage, Usage)
    return usage.calls


async def test_a_known_reasoning_model_receives_its_own_parameters_at_once():
    with serve(strict) as server:
        assert await calls(await mind(server.url, "openai/o3-2025-04-16", max_tokens="4000"), 1) == 1
    (request,) = server.requests
    assert request["max_completion_tokens"] == 4000
    assert "temperature" not in request


async def test_the_parameters_of_an_unknown_model_are_learnt_once():
    with serve(strict) as server:
        policy = await mind(server.url, "mystery", tries="1")
        assert await calls(policy, 1) == 3
        assert await calls(policy, 2) == 1
    parameters = [
        sorted({"max_tokens", "max_completion_tokens", "temperature"} & request.keys()) for request in server.requests
    ]
    assert parameters == [
        ["max_tokens", "temperature"], ["max_completion_tokens", "temperature"],
        ["max_completion_tokens"], ["max_completion_tokens"],
    ]  # fmt: skip


async def test_an_old_server_receives_the_old_parameter():
    with serve(lambda request: UNKNOWN if "max_completion_tokens" in request else Reply()) as server:
        assert await calls(await mind(server.url, "gpt-5-mini"), 1) == 2
    assert server.requests[-1]["max_tokens"] == 2048


async def test_a_temperature_from_the_options_is_not_dropped():
    with serve(strict) as server:
        policy = await mind(server.url, "gpt-5-mini", temperature="0.7")
        with pytest.raises(ReactError, match=r"temperature.*another temperature, or none"):
            await policy.act(observe("scout[1]", 1), Inbox())
    assert [request["temperature"] for request in server.requests] == [0.7]


@pytest.mark.parametrize("stubborn", [NO_MAX_TOKENS, NO_TEMPERATURE, UNKNOWN])
async def test_a_service_that_rejects_every_request_is_called_at_most_three_times(stubborn: Reply):
    with serve([stubborn]) as server:
        policy = await mind(server.url, "mystery")
        with pytest.raises(ReactError):
            await policy.act(observe("scout[1]", 1), Inbox())
    assert len(server.requests) <= 3


async def test_a_parameter_with_too_large_a_value_is_reported_and_not_renamed():
    too_large = openai_refusal("max_tokens", "max_tokens is too large: 9000. This model supports at most 4096.", "")
    with serve([too_large]) as server:
        policy = await mind(server.url, "mystery", max_tokens="9000")
        with pytest.raises(ReactError, match="too large"):
            await policy.act(observe("scout[1]", 1), Inbox())
    assert len(server.requests) == 1


def test_reasoning_models_are_recognised_by_name():
    table = read_models()
    for name in ("o1", "o1-mini", "o3", "o3-pro", "o4-mini-2025", "openai/gpt-5", "gpt-5.1-codex"):
        assert not table.traits(name).takes_temperature, name
        assert table.traits(name).limit == "max_completion_tokens", name
    for name in ("gpt-4o", "olmo-2", "gpt-oss-20b", "gpt-5-chat-latest", "qwen3-vl", "o2net"):
        assert table.traits(name).takes_temperature, name
