"""The direct client and the retries against a real HTTP server."""

import socket

import pytest
from lingjing_agents.llm.direct import DirectClient
from lingjing_agents.llm.retry import Attempts, CallDeadline, complete_with_retries

from agents.tests.chat_server import Reply, serve, stopwatch
from lingjing.plugins.backbone import ChatMessage, ChatRequest, ModelError

HELLO = ChatRequest("test-model", (ChatMessage("user", "hello", (b"\xff\xd8jpeg",)),), schema=b'{"type":"object"}')


async def ask(url: str, seconds: float = 5.0, tries: int = 5, key: str = ""):
    attempts = Attempts()
    answer = await complete_with_retries(DirectClient(url, key), HELLO, CallDeadline(seconds), attempts, tries=tries)
    return answer, attempts.calls


async def test_a_good_answer_has_text_and_tokens_and_the_request_is_complete():
    with serve([Reply("hi")]) as server:
        answer, calls = await ask(server.url, key="secret")
    assert (answer.text, answer.finish_reason, answer.prompt_tokens, answer.completion_tokens) == (
        "hi",
        "stop",
        100,
        20,
    )
    assert calls == 1
    assert server.keys == ["Bearer secret"]
    (request,) = server.requests
    assert request["model"] == "test-model"
    assert request["response_format"]["json_schema"]["schema"] == {"type": "object"}
    text, image = request["messages"][0]["content"]
    assert text == {"type": "text", "text": "hello"}
    assert image["image_url"]["url"].startswith("data:image/jpeg;base64,/9h")


async def test_a_rate_limited_call_waits_as_long_as_the_service_requests():
    elapsed = stopwatch()
    with serve([Reply(status=429, headers={"retry-after": "1"}), Reply("hi")]) as server:
        answer, calls = await ask(server.url)
    assert answer.text == "hi"
    assert calls == 2
    assert elapsed() >= 1.0


async def test_rate_limit_longer_than_the_deadline_fails_at_once():
    elapsed = stopwatch()
    with serve([Reply(status=429, headers={"retry-after": "6000"})]) as server:
        with pytest.raises(ModelError, match="429"):
            await ask(server.url, seconds=1200.0)
        assert len(server.requests) == 1
    assert elapsed() < 600.0


@pytest.mark.parametrize(
    "bad", [Reply(status=500), Reply(status=503), Reply(drop=True), Reply(body="<html>busy</html>")]
)
async def test_transient_failures_are_tried_again(bad: Reply):
    with serve([bad, Reply("hi")]) as server:
        answer, calls = await ask(server.url)
    assert answer.text == "hi"
    assert calls == 2


async def test_the_last_failure_is_reported():
    with serve([Reply(status=500)]) as server:
        with pytest.raises(ModelError, match="scripted 500"):
            await ask(server.url, tries=2)
        assert len(server.requests) == 2


@pytest.mark.parametrize("status", [400, 401, 403, 404, 422])
async def test_client_errors_are_not_retried(status: int):
    with serve([Reply(status=status)]) as server:
        with pytest.raises(ModelError, match=f"answered {status}") as failure:
            await ask(server.url)
        assert len(server.requests) == 1
    assert failure.value.status == status


async def test_a_slow_service_ends_at_the_deadline():
    elapsed = stopwatch()
    with serve([Reply(delay_s=3600.0)]) as server:
        with pytest.raises(ModelError, match=r"within|deadline"):
            await ask(server.url, seconds=0.5)
        assert elapsed() < 600.0


async def test_a_refused_connection_is_reported_with_its_address():
    with socket.socket() as bound:  # bound, so that no other process takes the port, and not listening
        bound.bind(("127.0.0.1", 0))
        port = bound.getsockname()[1]
        with pytest.raises(ModelError, match=f"127.0.0.1:{port}"):
            await ask(f"http://127.0.0.1:{port}/v1", tries=2)


REFUSALS = [
    ('{"error": {"code": 401, "message": "no such user"}}', 401, 1),
    ('{"error": {"code": 429, "message": "no such user"}}', 429, 2),
    ('{"error": {"code": "busy", "message": "no such user"}, "choices": null}', 502, 2),
    ('{"error": "no such user"}', 502, 2),
]


@pytest.mark.parametrize(("body", "status", "requests"), REFUSALS)
async def test_an_error_with_status_200_is_a_refusal_with_the_services_message(body: str, status: int, requests: int):
    """An intermediary that has already sent its status can report a failure only in the body."""
    with serve([Reply(body=body)]) as server:
        with pytest.raises(ModelError, match=f"answered {status}.*no such user") as failure:
            await ask(server.url, tries=2)
        assert len(server.requests) == requests
    assert (failure.value.status, failure.value.fault, failure.value.billed) == (status, "service", False)


async def test_the_text_parts_of_an_answer_are_joined():
    thinking = '{"type": "thinking", "thinking": [{"type": "text", "text": "hm"}]}'
    parts = f'[{thinking}, {{"type": "text", "text": "h"}}, {{"type": "text", "text": "i"}}]'
    with serve([Reply(body='{"error": null, "choices": [{"message": {"content": ' + parts + "}}]}")]) as server:
        answer, calls = await ask(server.url)
    assert (answer.text, calls) == ("hi", 1)
