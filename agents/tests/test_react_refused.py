"""A service that refuses is no model failure: the episode is aborted with the service's own words."""

import json

import pytest
from lingjing_agents.react.policy import PATIENCE, ReactError, ReactPolicy

from agents.tests.agent_kit import Inbox, brief, observe, react
from agents.tests.chat_server import NOOP, Reply, serve
from lingjing.plugins.policy import InfrastructureError


async def mind(url: str, **arguments: str) -> ReactPolicy:
    policy = react(model="m", base_url=url, **{"deadline": "600", "tries": "1", **arguments})
    await policy.reset(brief("scout[1]"))
    return policy


async def ended(policy: ReactPolicy, ticks: int) -> list[type[Exception] | None]:
    """Return the type of the error at each tick, or None."""
    errors: list[type[Exception] | None] = []
    for tick in range(ticks):
        try:
            await policy.act(observe("scout[1]", tick), Inbox())
            errors.append(None)
        except (ReactError, InfrastructureError) as error:
            errors.append(type(error))
    return errors


@pytest.mark.parametrize(
    "refusal",
    [
        Reply(status=401), Reply(status=402), Reply(status=403), Reply(status=404), Reply(status=400),
        Reply(status=429), Reply(status=500), Reply(status=307), Reply(drop=True), Reply(body="<html>hello</html>"),
        Reply(body="[" * 100_000), Reply(body='{"choices": []}'), Reply(body="null"),
    ],
)  # fmt: skip
async def test_a_service_that_refuses_everything_ends_the_episode(refusal: Reply):
    with serve([refusal]) as server:
        assert await ended(await mind(server.url), PATIENCE) == [ReactError] * (PATIENCE - 1) + [InfrastructureError]


async def test_the_message_of_the_service_and_a_hint_are_reported():
    with serve([Reply(status=401, body='{"error": "the key has expired"}')]) as server:
        policy = await mind(server.url)
        for tick in range(PATIENCE - 1):
            with pytest.raises(ReactError) as failure:
                await policy.act(observe("scout[1]", tick), Inbox())
            assert failure.value.usage is not None
            assert failure.value.usage.calls == 1
        with pytest.raises(InfrastructureError, match=r"401.*the key has expired") as abort:
            await policy.act(observe("scout[1]", 9), Inbox())
    assert "api_key_env" in abort.value.hint


@pytest.mark.parametrize(
    ("says", "hint", "not_hint"),
    [
        ("The model `m` does not exist", "", "vision=no"),
        ("this model's maximum context length is 4096 tokens", "", "schema=no"),
        ("image input is not supported", "", "schema=no"),
        ("response_format json_schema is not available", "schema=no", "vision=no"),
        ("bad request", "schema=no", "vision=no"),
    ],
)
async def test_a_suggested_option_does_not_contradict_the_message_of_the_service(says: str, hint: str, not_hint: str):
    with serve([Reply(status=400, body=json.dumps({"error": {"message": says}}))]) as server:
        policy = await mind(server.url)
        with pytest.raises(ReactError) as failure:
            await policy.act(observe("scout[1]", 1), Inbox())
    assert hint in str(failure.value)
    assert not_hint not in str(failure.value)


@pytest.mark.parametrize(
    "word",
    [
        Reply(NOOP), Reply("prose"), Reply(NOOP, finish_reason="content_filter"),
        Reply(status=400, body='{"error": {"code": "content_filter", "message": "no"}}'),
        Reply(body='{"choices": [{"message": {"refusal": "I will not"}}]}'),
    ],
)  # fmt: skip
async def test_any_answer_of_the_model_resets_the_count_of_failures(word: Reply):
    few = PATIENCE - 1
    with serve([*[Reply(status=500)] * few, word, *[Reply(status=500)] * few]) as server:
        errors = await ended(await mind(server.url, repairs="0"), 2 * few + 1)
    assert InfrastructureError not in errors


async def test_slow_answers_are_failures_of_the_model_and_not_of_the_service():
    with serve([Reply(delay_s=3600.0)]) as server:
        assert await ended(await mind(server.url, deadline="0.3"), PATIENCE + 1) == [ReactError] * (PATIENCE + 1)
