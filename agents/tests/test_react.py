"""`react` over real HTTP: what it asks, what it accepts, how it repairs, what it bills, how it gives up."""

import json
from importlib.util import find_spec

import jsonschema
import msgspec
import numpy as np
import pytest
from lingjing_agents.react.answer import StepError, read_step, step_text
from lingjing_agents.react.policy import ReactError, ReactPolicy
from lingjing_agents.react.prompt import observation_text, system_prompt

from agents.tests.agent_kit import REPORT, WEATHER, Inbox, brief, envelope, observe, picture, react, view
from agents.tests.chat_server import NOOP, Reply, serve
from lingjing.plugins.decisions import DecisionFormat, decision_schema
from lingjing.plugins.policy import UsageError

STEP = {
    "thought": "go east",
    "command": {"verb": "setDestination", "arguments": {"x": 10, "y": -900.5, "z": 96.5}, "resource": "uav[1]"},
    "messages": [
        {
            "kind": "detection",
            "body": {
                "frame": "f1-uav[1]-nadir",
                "class": "person_in_water",
                "box": [0.1, 0.2, 0.15, 0.25],
                "position": [1.0, -900.0, -3.5],
                "confidence": 0.9,
            },
            "to": [],
        }
    ],
}
HERE = view("uav[1]", (306.0, -620.0, 96.5))


async def mind(url: str, agent: str = "scout[1]", mode: str = "broadcast", **arguments: str) -> ReactPolicy:
    policy = react(model="test-model", base_url=url, **{"deadline": "10", **arguments})
    await policy.reset(brief(agent, mode))
    return policy


async def test_a_good_step_becomes_a_decision_with_its_bill():
    with serve([Reply(STEP)]) as server:
        policy = await mind(server.url, price_in="2", price_out="10")
        decision = await policy.act(observe("scout[1]", 1, HERE), Inbox())
    assert decision.command is not None
    assert (decision.command.verb, decision.command.resource) == ("setDestination", "uav[1]")
    assert decision.command.arguments == {"x": 10.0, "y": -900.5, "z": 96.5}
    assert decision.messages[0].kind == "detection"
    assert decision.messages[0].body["box"] == (0.1, 0.2, 0.15, 0.25)
    assert decision.thought == "go east"
    assert decision.usage is not None
    assert (decision.usage.calls, decision.usage.prompt_tokens, decision.usage.completion_tokens) == (1, 100, 20)
    assert decision.usage.cost_usd == pytest.approx((100 * 2 + 20 * 10) / 1e6)


async def test_the_model_is_told_goal_actions_state_messages_and_pictures():
    heard = envelope("scout[2]", REPORT, {"confidence": 0.5, "class": "person_in_water"})
    rgb = np.full((1080, 1920, 3), 90, np.uint8)
    with serve([Reply()]) as server:
        policy = await mind(server.url, image_side="640")
        seen = observe("scout[1]", 1, HERE, pictures=(picture((306.0, -620.0, 96.5), rgb),))
        await policy.act(seen, Inbox(messages=(heard,)))
    system, user = server.requests[0]["messages"]
    assert "Find every person in the water." in system["content"]
    assert "setDestination(x [m], y [m], z [m])" in system["content"]
    text, image = user["content"]
    state = json.loads(text["text"])
    assert state["tick"] == 1
    assert state["entities"][0]["id"] == "uav[1]"
    assert state["received"][0]["from"] == "scout[2]"
    assert state["pictures"][0]["frame"] == "f1-uav[1]-nadir"
    assert len(state["pictures"][0]["ground"]) == 4
    import base64

    import cv2

    data = base64.b64decode(image["image_url"]["url"].split(",", 1)[1])
    assert cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR).shape == (360, 640, 3)


async def test_text_models_get_no_pictures_and_the_schema_in_words():
    with serve([Reply()]) as server:
        policy = await mind(server.url, vision="no", schema="no")
        await policy.act(observe("scout[1]", 1, HERE, pictures=(picture((0, 0, 96)),)), Inbox())
    (request,) = server.requests
    assert isinstance(request["messages"][1]["content"], str)
    assert "response_format" not in request
    assert '"additionalProperties":false' in request["messages"][0]["content"]


@pytest.mark.parametrize(
    ("bad", "complaint"),
    [
        (Reply("I would fly east."), "no JSON object"),
        (Reply('{"thought": "x", "command": '), "does not end"),
        (Reply('{"thought": 5, "command": null, "messages": []}'), "not a step"),
        (
            Reply({**NOOP, "command": {"verb": "dance", "arguments": {}, "resource": "uav[1]"}}),
            "is due, this is the text 'dance'",
        ),
        (
            Reply({**NOOP, "command": {"verb": "stop", "arguments": {}, "resource": "uav[9]"}}),
            "command.resource: uav[1] is due, this is the text 'uav[9]'",
        ),
        (
            Reply({**NOOP, "command": {"verb": "setDestination", "arguments": {"x": 1}}}),
            "command.arguments: 'y' is missing",
        ),
        (
            Reply({**NOOP, "messages": [{"kind": "detection", "body": {}}]}),
            "messages[0].body: 'frame' is missing",
        ),
        (
            Reply({**NOOP, "messages": [{"kind": "gossip", "body": {}}]}),
            "is due, this is the text 'gossip'",
        ),
        (Reply(STEP, finish_reason="length"), "cut off"),
    ],
)
async def test_an_answer_that_cannot_be_used_is_sent_back_with_the_reason(bad: Reply, complaint: str):
    with serve([bad, Reply(STEP)]) as server:
        policy = await mind(server.url)
        decision = await policy.act(observe("scout[1]", 1, HERE), Inbox())
    assert decision.command is not None
    assert decision.usage is not None
    assert (decision.usage.calls, decision.usage.prompt_tokens) == (2, 200)
    assert complaint in server.requests[1]["messages"][-1]["content"]


async def test_repairs_are_bounded_and_their_tokens_are_billed_at_once():
    with serve([Reply("no"), Reply("no"), Reply("no"), Reply()]) as server:
        policy = await mind(server.url)
        with pytest.raises(ReactError, match="no valid step after 2 repairs") as failure:
            await policy.act(observe("scout[1]", 1, HERE), Inbox())
        decision = await policy.act(observe("scout[1]", 2, HERE), Inbox())
    assert failure.value.usage is not None
    assert (failure.value.usage.calls, failure.value.usage.prompt_tokens) == (3, 300)
    assert decision.usage is not None
    assert (decision.usage.calls, decision.usage.prompt_tokens) == (1, 100)


async def test_a_slow_model_is_given_up_at_the_policys_own_deadline():
    with serve([Reply(delay_s=3600.0)]) as server:
        policy = await mind(server.url, deadline="0.5")
        with pytest.raises(ReactError, match=r"within|deadline"):
            await policy.act(observe("scout[1]", 1, HERE), Inbox())


async def test_a_refused_request_names_the_arguments_to_try():
    with serve([Reply(status=400)]) as server:
        policy = await mind(server.url)
        with pytest.raises(ReactError, match=r"vision=no .* schema=no"):
            await policy.act(observe("scout[1]", 1, HERE, pictures=(picture((0, 0, 96)),)), Inbox())


async def test_history_is_bounded_and_holds_no_old_pictures():
    with serve([Reply()]) as server:
        policy = await mind(server.url, history="2")
        for tick in range(5):
            await policy.act(observe("scout[1]", tick, HERE, pictures=(picture((0, 0, 96), tick=tick),)), Inbox())
    last = server.requests[-1]["messages"]
    assert [turn["role"] for turn in last] == ["system", "user", "assistant", "user", "assistant", "user"]
    assert [isinstance(turn["content"], str) for turn in last] == [True] * 5 + [False]
    assert json.loads(last[1]["content"])["tick"] == 2


def test_the_schema_accepts_good_steps_and_refuses_others():
    schema = decision_schema(brief())
    validator = jsonschema.Draft202012Validator(schema)
    validator.check_schema(schema)
    assert validator.is_valid(STEP)
    assert validator.is_valid(NOOP)
    assert not validator.is_valid({**STEP, "command": {"verb": "dance", "arguments": {}, "resource": "uav[1]"}})
    assert not validator.is_valid({**NOOP, "messages": [{"kind": "detection", "body": {}, "to": []}]})


def test_schema_of_an_agent_that_controls_nothing():
    schema = decision_schema(brief("commander", "star"))
    assert schema["properties"]["command"]["anyOf"] == [{"type": "null"}]
    jsonschema.validate(NOOP, schema)


def test_fences_and_prose_around_the_object_do_no_harm():
    text = 'Sure:\n```json\n{"thought": "a } in a \\"string\\"", "command": null, "messages": []}\n```'
    assert read_step(text, DecisionFormat(brief())).thought == 'a } in a "string"'
    with pytest.raises(StepError):
        step_text("nothing here")


def test_all_faults_of_a_step_are_told_at_once():
    step = {
        **NOOP,
        "command": {"verb": "setDestination", "arguments": {"x": "far", "y": 1, "z": 2, "w": 3}, "resource": "uav[1]"},
        "messages": [{"kind": "progress", "body": {"task": 1}, "to": ["nobody"]}],
    }
    with pytest.raises(StepError) as fault:
        read_step(json.dumps(step), DecisionFormat(brief()))
    for part in (
        "command.arguments.x: a number is due, this is the text 'far'",
        "command.arguments: there is no field 'w'",
        "messages[0].body: 'state' is missing",
        "messages[0].body.task: a text is due, this is the number 1",
    ):
        assert part in str(fault.value)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({}, "option `model` is missing"),
        ({"model": "m"}, "service's address"),
        ({"model": "m", "base_url": "localhost"}, "service's address"),
        (
            {"model": "m", "base_url": "http://x", "client": "carrier-pigeon"},
            "`client` is 'carrier-pigeon', 'direct' or 'litellm' is due",
        ),
        ({"model": "m", "base_url": "http://x", "temperature": "hot"}, "`temperature` is 'hot', a number is due"),
        ({"model": "m", "base_url": "http://x", "repairs": "1.5"}, "`repairs` is '1.5', a whole number is due"),
        ({"model": "m", "base_url": "http://x", "api_key_env": "NO_SUCH_KEY_HERE"}, "NO_SUCH_KEY_HERE"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict[str, str], says: str):
    with pytest.raises(UsageError, match=says):
        react(**arguments)


def test_every_wrong_option_is_told_at_once():
    with pytest.raises(UsageError) as caught:
        react(modle="m", client="direct", temperature="3", history="-1", api_key_env="NO_SUCH_KEY_HERE", tries="many")
    assert [fault.where for fault in caught.value.faults] == [
        "model", "base_url", "temperature", "tries", "history", "modle",
    ]  # fmt: skip
    assert "`modle` is not known; did you mean `model`?" in str(caught.value)
    with pytest.raises(UsageError) as caught:
        react(model="m", api_key_env="NO_SUCH_KEY_HERE", base_url_env="NO_SUCH_URL_HERE")
    assert [fault.where for fault in caught.value.faults] == ["api_key_env", "base_url_env"]


@pytest.mark.slow
async def test_litellm_speaks_to_the_same_server(monkeypatch: pytest.MonkeyPatch):
    if find_spec("litellm") is None:  # never import it here: the client sets what its import must find
        pytest.skip("litellm is an optional extra")
    with serve([Reply(status=500), Reply(STEP)]) as server:
        monkeypatch.setenv("REACT_TEST_KEY", "a-key")
        policy = react(
            model="openai/test-model",
            base_url=server.url,
            client="litellm",
            deadline="60",
            api_key_env="REACT_TEST_KEY",
        )
        await policy.reset(brief())
        seen = observe("scout[1]", 1, HERE, pictures=(picture((306.0, -620.0, 96.5)),))
        decision = await policy.act(seen, Inbox())
    assert decision.command is not None
    assert decision.usage is not None
    assert (decision.usage.calls, decision.usage.prompt_tokens) == (2, 100)
    assert server.requests[1]["messages"][1]["content"][1]["type"] == "image_url"
    assert server.requests[1]["response_format"]["type"] == "json_schema"
    assert server.keys[-1] == "Bearer a-key"


def test_the_prompt_has_the_weather_and_an_observation_what_it_has_become() -> None:
    storm = msgspec.structs.replace(WEATHER, wind_mps=14.0, visibility_m=800.0)
    told = brief("skipper")
    assert '"weather":{"wind_mps":4.0,"wind_from_deg":220.0' in system_prompt(told, None)
    same = json.loads(observation_text(observe("skipper", 3), Inbox(), told, ()))
    other = json.loads(observation_text(observe("skipper", 3, weather=storm), Inbox(), told, ()))
    assert "weather" not in same
    assert (other["weather"]["wind_mps"], other["weather"]["visibility_m"]) == (14.0, 800.0)
