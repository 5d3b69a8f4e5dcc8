"""Agents of other frameworks: their calls are recorded, billed, limited and replayed as those of `react` are."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import httpx
import pytest

import lingjing
from agents.tests.chat_server import NOOP, ChatServer, Reply, serve
from lingjing.plugins.asking import AskOptions, ask, serve_models
from lingjing.plugins.calls import CallRequest, CallResult, UnrecordedCalls
from lingjing.plugins.policy import NoDecisionError
from lingjing.testing import recorded_calls
from tests.bench.suite_kit import TRIP

EXAMPLES = Path(__file__).parents[2] / "examples" / "own_agents"
NEEDS = {
    "plain_loop.py": "httpx",
    "openai_sdk.py": "openai",
    "langgraph_agent.py": "langgraph",
    "inspect_agent.py": "inspect_ai",
}
KEY = "sk-a-key-that-nobody-may-see-123456"


@pytest.fixture
def mission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("OWN_KEY", KEY)
    path = tmp_path / "short.ljs"
    path.write_text(TRIP.replace("policy <= 8 s", "policy <= 120 s"))  # frameworks import slowly
    return path


def play(mission: Path, example: str, server: ChatServer, out: Path, **how: Any) -> lingjing.EpisodeReport:
    arguments = {"model": "tiny", "base_url": server.url, "api_key_env": "OWN_KEY", "price_in": 10, "price_out": 20}
    policy = str(EXAMPLES / example)
    return lingjing.run(mission, policy=policy, policy_args=arguments, overview=False, out=out, **how)


def test_every_example_is_listed_and_short() -> None:
    files = {file.name: file for file in EXAMPLES.glob("*.py")}
    assert files.keys() == NEEDS.keys()
    assert all(len(file.read_text().splitlines()) < 40 for file in files.values())


@pytest.mark.slow
@pytest.mark.parametrize("example", NEEDS)
def test_an_agent_of_another_framework_is_recorded_billed_and_replayed(
    example: str, mission: Path, tmp_path: Path
) -> None:
    if find_spec(NEEDS[example]) is None or (example == "langgraph_agent.py" and find_spec("langchain_openai") is None):
        pytest.skip(f"{NEEDS[example]} is not installed")
    with serve([Reply(NOOP)]) as server:
        report = play(mission, example, server, tmp_path / "a")
        assert report.metrics is not None
        assert (report.metrics.calls, report.metrics.substitutions, len(server.requests)) == (3, 0, 3), report.detail
        assert report.metrics.cost_usd == pytest.approx(3 * (100 * 10 + 20 * 20) / 1e6)
        assert {*server.keys} == {f"Bearer {KEY}"}, "the service gets its key, and the framework's own goes no further"
    calls = recorded_calls(tmp_path / "a")
    assert [(call.tick, call.number) for call in calls] == [(0, 0), (1, 0), (2, 0)]
    assert all(call.result is not None and json.loads(call.result.text) == NOOP for call in calls)
    assert KEY.encode() not in b"".join(file.read_bytes() for file in (tmp_path / "a").iterdir() if file.is_file())
    again = play(mission, example, server, tmp_path / "b", calls="replay", calls_from=str(tmp_path / "a"))
    assert again.metrics is not None
    assert (again.digest, again.metrics.cost_usd) == (report.digest, report.metrics.cost_usd), "the service is gone"


def test_the_limit_of_money_holds_for_a_framework(mission: Path, tmp_path: Path) -> None:
    with serve([Reply(NOOP)]) as server:
        report = play(mission, "openai_sdk.py", server, tmp_path / "a", max_cost=0.0001)
        assert server.requests == []
    assert report.reason == "infrastructure-abort"
    assert "money: the limit of $0.0001 does not cover another call" in report.detail


class Kept(UnrecordedCalls):
    """A record in memory."""

    def __init__(self) -> None:
        self.ended: list[tuple[CallRequest, CallResult]] = []

    def end(self, request: CallRequest, result: CallResult) -> None:
        self.ended.append((request, result))


@pytest.fixture
def service() -> Iterator[ChatServer]:
    called = {"role": "assistant", "content": None, "tool_calls": [
        {"id": "1", "type": "function", "function": {"name": "look", "arguments": '{"where": "north"}'}}
    ]}  # fmt: skip
    choice = {"index": 0, "message": called, "finish_reason": "tool_calls"}
    body = {"id": "x", "model": "tiny-0815", "choices": [choice],
            "usage": {"prompt_tokens": 7, "completion_tokens": 3}}  # fmt: skip
    with serve([Reply(body=json.dumps(body))]) as server:
        yield server


def test_a_request_and_its_answer_pass_completely_with_tools_and_pictures(service: ChatServer) -> None:
    calls = Kept()
    server = serve_models(AskOptions(model="tiny", base_url=service.url, max_tokens=64), calls)
    picture = "data:image/jpeg;base64,/9j/2Q=="
    request = {
        "model": "any", "max_tokens": 5000, "tools": [{"type": "function", "function": {"name": "look"}}],
        "messages": [{"role": "user", "content": [
            {"type": "text", "text": "Where?"}, {"type": "image_url", "image_url": {"url": picture}}]}],
    }  # fmt: skip
    key = {"authorization": f"Bearer {server.key}"}
    answer = httpx.post(f"{server.url}/chat/completions", json=request, headers=key)
    assert answer.status_code == 200
    assert answer.json()["choices"][0]["message"]["tool_calls"][0]["function"]["name"] == "look"
    (sent,) = service.requests
    assert (sent["model"], sent["max_tokens"], sent["messages"]) == ("tiny", 64, request["messages"])
    assert sent["tools"] == request["tools"]
    ((kept, result),) = calls.ended
    assert kept.pictures == (b"\xff\xd8\xff\xd9",) and picture.encode() not in kept.messages[0]
    assert (result.served, result.prompt_tokens, result.completion_tokens) == ("tiny-0815", 7, 3)
    streamed = httpx.post(f"{server.url}/chat/completions", json={**request, "stream": True}, headers=key).text
    chunk = json.loads(streamed.split("\n\n")[0].removeprefix("data: "))
    assert chunk["choices"][0]["delta"]["tool_calls"][0]["index"] == 0 and streamed.endswith("data: [DONE]\n\n")
    assert "stream" not in service.requests[1]
    server.close()


def test_foreign_clients_and_wrong_requests_are_rejected(service: ChatServer) -> None:
    server = serve_models(AskOptions(model="tiny", base_url=service.url), UnrecordedCalls())
    url, key = f"{server.url}/chat/completions", {"authorization": f"Bearer {server.key}"}
    assert httpx.post(url, json={"messages": []}).status_code == 401
    assert httpx.get(f"{server.url}/models", headers=key).json()["data"] == []
    for body, words in (
        ("{", "is no chat request"),
        ('{"messages": []}', "it has no messages"),
        ("[]", "no chat request"),
    ):
        refused = httpx.post(url, content=body, headers=key)
        assert refused.status_code == 400 and words in refused.json()["error"]["message"]
    assert httpx.post(f"{server.url}/responses", json={}, headers=key).status_code == 404
    assert service.requests == []
    server.close()


def test_a_failure_of_the_service_is_reported_with_a_status_that_no_client_retries() -> None:
    with serve([Reply(status=500)]) as service:
        options = AskOptions(model="tiny", base_url=service.url, deadline=2.0)
        server = serve_models(options, UnrecordedCalls())
        answer = httpx.post(
            f"{server.url}/chat/completions", json={"messages": [{"role": "user", "content": "Hi"}]},
            headers={"authorization": f"Bearer {server.key}"}, timeout=30.0,
        )  # fmt: skip
        assert answer.status_code == 400 and "answered 500" in answer.json()["error"]["message"]
        with pytest.raises(NoDecisionError, match="answered 500"):
            asyncio.run(ask(options, UnrecordedCalls())("Hi"))
        server.close()


def test_wrong_options_are_reported_at_once() -> None:
    with pytest.raises(lingjing.UsageError, match="base_url"):
        ask(AskOptions(model="unheard-of"), UnrecordedCalls())
