"""`react` in a real episode of the sea rescue: the service fails in every way, the episode goes on."""

import json
from importlib.util import find_spec
from pathlib import Path

import pytest

import lingjing
from agents.tests.chat_server import NOOP, Reply, serve
from lingjing import read as read_trace
from lingjing.testing import shortened

SCENARIO = Path(__file__).parents[2] / "scenarios" / "ssr.ljs"
TICKS = 8

FAILURES = {
    1: Reply(delay_s=3600.0),
    2: Reply(status=429, headers={"retry-after": "600"}),
    3: Reply("I would rather fly east."),
    4: Reply(status=500),
    5: Reply(drop=True),
    6: Reply({**NOOP, "command": {"verb": "dance", "arguments": {}, "resource": "uav[2]"}}),
}
"""The service itself never fails three ticks in a row: that would end the episode."""
FLY = {
    "thought": "over the middle of the region",
    "command": {"verb": "setDestination", "arguments": {"x": 270, "y": -700, "z": 60}, "resource": "uav[1]"},
    "messages": [{"kind": "progress", "body": {"task": "search", "state": "started"}, "to": []}],
}
LOOK = {**NOOP, "command": {"verb": "takePhoto", "arguments": {"camera": "nadir"}, "resource": "uav[1]"}}


def answer(request: dict) -> Reply:
    """scout[1] flies and takes pictures, scout[2] meets every failure at its tick, the others do nothing."""
    system = request["messages"][0]["content"]
    content = next(turn["content"] for turn in reversed(request["messages"]) if _is_state(turn))
    state = json.loads(content if isinstance(content, str) else content[0]["text"])
    if "You are `scout[1]`" in system:
        busy = state["entities"][0].get("busy")
        return Reply(NOOP if busy else FLY if state["tick"] == 0 else LOOK)
    if "You are `scout[2]`" in system:
        return FAILURES.get(state["tick"], Reply())
    return Reply()


def _is_state(turn: dict) -> bool:
    text = turn["content"] if isinstance(turn["content"], str) else turn["content"][0]["text"]
    return turn["role"] == "user" and text.startswith('{"tick"')


@pytest.mark.slow
@pytest.mark.parametrize("client", ["direct", pytest.param("litellm", marks=pytest.mark.thorough)])
def test_an_episode_survives_every_failure_and_reports_each(
    client: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    if client == "litellm" and find_spec("litellm") is None:
        pytest.skip("litellm is an optional extra")
    monkeypatch.setenv("REACT_TEST_KEY", "a-key")
    mission = shortened(SCENARIO, TICKS)
    with serve(answer) as server:
        result = lingjing.run(
            mission,
            policy="react",
            policy_args={
                "model": "test-model" if client == "direct" else "openai/test-model",
                "base_url": server.url,
                "client": client,
                "api_key_env": "REACT_TEST_KEY",
                "deadline": "15",
                "tries": "2",
                "price_in": "1",
                "vision": "yes",
            },
            out=tmp_path / "run",
            overview=False,
            world="inline",
        )
    assert (result.reason, result.ticks) == ("budget", TICKS)
    trace = read_trace(result.trace)
    assert trace.complete
    substituted = {
        record.tick - 1: made
        for record in trace.boundaries
        for made in record.decisions
        if made.agent == "scout[2]" and made.substituted
    }
    assert sorted(substituted) == sorted(FAILURES)
    assert {made.substituted for made in substituted.values()} == {"policy_error"}
    for tick, says in {2: "429", 3: "no valid step", 4: "500", 6: "this is the text 'dance'"}.items():
        assert says in substituted[tick].detail
    receipts = [
        receipt for record in trace.boundaries for receipt in record.receipts if receipt.status == "substituted"
    ]
    assert sorted(receipt.tick - 1 for receipt in receipts) == sorted(FAILURES)
    assert {receipt.sender for receipt in receipts} == {"scout[2]"}
    good = [made for record in trace.boundaries for made in record.decisions if made.agent == "scout[1]"]
    assert len(good) == TICKS
    assert all(made.decision.usage is not None and made.decision.usage.prompt_tokens >= 100 for made in good)
    assert good[0].decision.command is not None
    assert trace.frames
    assert any(message.kind == "progress" for record in trace.boundaries for message in record.messages)
    shown = [request for request in server.requests if "image_url" in json.dumps(request)]
    assert shown
