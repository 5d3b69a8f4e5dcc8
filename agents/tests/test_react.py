"""`react` over real HTTP: its requests, the answers that it accepts, its repairs, bills and deadlines."""

import base64
import hashlib
import json
from dataclasses import replace
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import cv2
import jsonschema
import msgspec
import numpy as np
import pytest
from lingjing_agents.react.answer import StepError, read_step, step_text
from lingjing_agents.react.facts import interface
from lingjing_agents.react.policy import ReactError, ReactPolicy
from lingjing_agents.react.state import observation_text
from lingjing_agents.react.step import StepFormat

from agents.tests.agent_kit import (
    EYE,
    NADIR,
    REPORT,
    WEATHER,
    CellView,
    Inbox,
    brief,
    envelope,
    observe,
    picture,
    quadrotor,
    react,
    view,
)
from agents.tests.chat_server import NOOP, Reply, serve
from lingjing.plugins.decisions import decision_schema
from lingjing.plugins.loading import options_fingerprint
from lingjing.plugins.policy import UsageError
from lingjing.testing import PluginHost

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
    policy = react(model="test-model", base_url=url, **{"deadline": "600", **arguments})
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


async def test_a_request_contains_goal_actions_state_messages_and_pictures():
    report = envelope("scout[2]", REPORT, {"confidence": 0.5, "class": "person_in_water"})
    rgb = np.full((1080, 1920, 3), 90, np.uint8)
    with serve([Reply()]) as server:
        policy = await mind(server.url, image_side="640")
        seen = observe("scout[1]", 1, HERE, pictures=(picture((306.0, -620.0, 96.5), rgb),))
        await policy.act(seen, Inbox(messages=(report,)))
    system, user = server.requests[0]["messages"]
    assert "Find every person in the water." in system["content"]
    assert "setDestination(x: m, y: m, z: 20 to 160 m)" in system["content"]
    text, image = user["content"]
    state = json.loads(text["text"])
    assert state["tick"] == 1
    assert state["entities"][0]["id"] == "uav[1]"
    assert state["received"][0]["from"] == "scout[2]"
    assert state["pictures"][0]["frame"] == "f1-uav[1]-nadir"
    assert len(state["pictures"][0]["ground"]["east_north_elevation_m"]) == 3
    data = base64.b64decode(image["image_url"]["url"].split(",", 1)[1])
    assert cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR).shape == (360, 640, 3)


async def test_text_models_receive_no_pictures_and_the_schema_as_text():
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
        policy = await mind(server.url, repairs="2")
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


async def test_the_error_of_a_rejected_request_names_the_arguments_to_try():
    with serve([Reply(status=400)]) as server:
        policy = await mind(server.url)
        with pytest.raises(ReactError, match=r"vision=no .* schema=no"):
            await policy.act(observe("scout[1]", 1, HERE, pictures=(picture((0, 0, 96)),)), Inbox())


async def test_history_is_bounded_in_tokens_and_its_beginning_stays_for_many_ticks():
    with serve([Reply()]) as server:
        policy = await mind(server.url, history_tokens="3000")
        for tick in range(40):
            await policy.act(observe("scout[1]", tick, HERE, pictures=(picture((0, 0, 96), tick=tick),)), Inbox())
    requests = [request["messages"] for request in server.requests]
    sizes = [sum(len(json.dumps(turn)) for turn in turns[1:-1]) for turns in requests]
    assert max(sizes) < 3000 * 3 * 1.2
    kept = [len(turns) for turns in requests]
    assert max(kept) > 6
    again = sum(before[:-1] == after[: len(before) - 1] for before, after in pairwise(requests))
    assert again >= 30  # nearly all requests repeat the beginning of the previous request, which services cache
    assert all(isinstance(turn["content"], str) for turn in requests[-1][:-1])
    assert json.loads(requests[-1][-3]["content"])["tick"] == 38


async def test_a_picture_that_was_reported_stays_in_the_history():
    with serve([Reply(STEP), Reply()]) as server:
        policy = await mind(server.url)
        await policy.act(observe("scout[1]", 1, HERE, pictures=(picture((0, 0, 96)),)), Inbox())
        await policy.act(observe("scout[1]", 2, HERE), Inbox())
    first = server.requests[-1]["messages"][1]["content"]
    assert [part["type"] for part in first] == ["text", "image_url"]


async def test_a_service_receives_no_more_images_than_its_limit(tmp_path: Path):
    models = tmp_path / "models.toml"
    models.write_text('[models.narrow]\nservice = "vllm"\nserved = "narrow"\nmost_images = 3\n')
    seen = observe("scout[1]", 1, HERE, pictures=tuple(picture((0, 0, 96), tick=tick) for tick in (1, 1, 1, 1, 1)))
    with serve([Reply(STEP)]) as server:
        policy = react(model="narrow", models=str(models), base_url=server.url, history_images="9", crops="1")
        await policy.reset(brief())
        for _ in range(3):
            await policy.act(seen, Inbox())
    sent = [json.dumps(request["messages"]).count("data:image/jpeg") for request in server.requests]
    assert max(sent) <= 3, sent


async def test_reported_pictures_are_kept_as_far_as_there_is_room():
    with serve([Reply(STEP)]) as server:
        policy = await mind(server.url, history_images="2", request_tokens="80000")
        for tick in range(5):
            await policy.act(observe("scout[1]", tick, HERE, pictures=(picture((0, 0, 96)),)), Inbox())
    turns = server.requests[-1]["messages"][1:-1:2]
    assert [not isinstance(turn["content"], str) for turn in turns] == [True, True, False, False]


async def test_a_request_has_no_history_and_no_memory_if_both_are_off():
    with serve([Reply({**NOOP, "plan": ["go east"]})]) as server:
        policy = await mind(server.url, history_tokens="0", memory="no")
        for tick in range(3):
            await policy.act(observe("scout[1]", tick, HERE), Inbox())
    assert [len(request["messages"]) for request in server.requests] == [2, 2, 2]
    assert "go east" not in json.dumps(server.requests)
    assert "plan" not in server.requests[0]["response_format"]["json_schema"]["schema"]["properties"]
    assert "YOUR MEMORY" not in server.requests[0]["messages"][0]["content"]


async def test_commitments_and_plan_are_repeated_until_the_model_rewrites_them():
    answers = [{**NOOP, "plan": ["go east", "look"], "commitments": ["cells-1-1 is mine"]}, {**NOOP, "plan": ["look"]}]
    with serve([*map(Reply, answers), Reply()]) as server:
        policy = await mind(server.url, history_tokens="0")
        for tick in range(4):
            await policy.act(observe("scout[1]", tick, HERE), Inbox())
    states = [json.loads(request["messages"][-1]["content"]) for request in server.requests]
    assert "plan" not in states[0]
    assert (states[1]["plan"], states[1]["commitments"]) == (["go east", "look"], ["cells-1-1 is mine"])
    assert (states[2]["plan"], states[2]["commitments"]) == (["look"], ["cells-1-1 is mine"])
    assert states[3]["plan"] == ["look"]


async def test_a_crop_is_shown_enlarged_and_costs_no_repair():
    crop = {**NOOP, "crop": {"frame": "f1-uav[1]-nadir", "box": [0.5, 0.5, 0.6, 0.6]}}
    rgb = np.zeros((1080, 1920, 3), np.uint8)
    rgb[540:648, 960:1152] = (250, 20, 20)
    with serve([Reply(crop), Reply(STEP)]) as server:
        policy = await mind(server.url, crops="1", repairs="0")
        decision = await policy.act(observe("scout[1]", 1, HERE, pictures=(picture((0, 0, 96), rgb),)), Inbox())
    assert decision.messages
    assert "ask 1 times a tick" in server.requests[0]["messages"][0]["content"]
    assert '"crop": {"frame": id of a picture' in server.requests[0]["messages"][0]["content"]
    text, image = server.requests[1]["messages"][-1]["content"]
    assert '"shows":[0.5,0.5,0.6,0.6]' in text["text"]
    shown = cv2.imdecode(
        np.frombuffer(base64.b64decode(image["image_url"]["url"].split(",", 1)[1]), np.uint8), cv2.IMREAD_COLOR
    )
    assert shown.shape == (432, 768, 3)
    assert shown[..., 2].mean() > 240  # all of it is the red part


async def test_a_crop_beyond_the_limit_or_of_an_unknown_picture_is_a_fault():
    crop = {**NOOP, "crop": {"frame": "f1-uav[1]-nadir", "box": [0.5, 0.5, 0.6, 0.6]}}
    stranger = {**NOOP, "crop": {"frame": "f9", "box": [0.5, 0.5, 0.6, 0.6]}}
    seen = observe("scout[1]", 1, HERE, pictures=(picture((0, 0, 96)),))
    with serve([Reply(crop), Reply(crop), Reply()]) as server:
        await (await mind(server.url, crops="1")).act(seen, Inbox())
    assert "no crop is left" in server.requests[2]["messages"][-1]["content"]
    with serve([Reply(stranger), Reply()]) as server:
        await (await mind(server.url, crops="1")).act(seen, Inbox())
    assert "`f9` is none of the pictures" in server.requests[1]["messages"][-1]["content"]


async def test_answers_and_valid_answers_are_counted():
    with serve([Reply("no"), Reply(STEP)]) as server:
        decision = await (await mind(server.url)).act(observe("scout[1]", 1, HERE), Inbox())
    assert decision.usage is not None
    assert (decision.usage.answers, decision.usage.valid_answers) == (2, 1)


async def test_a_single_pass_takes_no_picture_of_a_searched_cell_and_ends_without_a_call():
    look = {**NOOP, "command": {"verb": "takePhoto", "arguments": {"camera": "nadir"}, "resource": "uav[1]"}}
    cells = brief().cells
    east, north = cells[0].centre
    here = view("uav[1]", (east, north, 96.5))
    some = tuple(CellView(name=cell.name, visited_tick=1 if cell is cells[0] else None) for cell in cells)
    done = tuple(CellView(name=cell.name, visited_tick=1) for cell in cells)
    with serve([Reply(look)]) as server:
        once = await mind(server.url, research="0")
        decision = await once.act(observe("scout[1]", 2, here, cells=some), Inbox())
        assert decision.command is None
        await once.act(observe("scout[1]", 3, here, cells=some), Inbox())
        assert "no cell may be searched again" in server.requests[-1]["messages"][-1]["content"]
        calls = len(server.requests)
        quiet = await once.act(observe("scout[1]", 4, here, cells=done), Inbox())
        assert (quiet.command, quiet.usage, len(server.requests)) == (None, None, calls)
        twice = await mind(server.url, research="1")
        allowed = [
            (await twice.act(observe("scout[1]", tick, here, cells=some), Inbox())).command for tick in range(10)
        ]
    assert [command is not None for command in allowed] == [True] * len(cells) + [False]


async def test_no_request_contains_the_second_view_or_the_grid_if_they_are_off():
    two = msgspec.structs.replace(quadrotor(1), cameras=(NADIR, EYE))
    own_brief = brief(resources=(two,))
    front = replace(picture((0, 0, 96)), frame="f1-uav[1]-front", camera="front")
    seen = observe("scout[1]", 1, HERE, pictures=(picture((0, 0, 96)), front), cells=(CellView(name="cells-1-1"),))
    with serve([Reply()]) as server:
        for options in ({"second_view": "no", "grid": "no"}, {}):
            policy = react(model="m", base_url=server.url, **options)
            await policy.reset(own_brief)
            await policy.act(seen, Inbox())
    without, whole = (json.dumps(request["messages"]) for request in server.requests)
    assert "front" in whole and "cells-1-1" in whole
    assert "`front`" not in without and "f1-uav[1]-front" not in without and "cells-1-1" not in without


async def test_the_sweep_decides_without_a_model_call():
    policy = react(model="m", base_url="http://127.0.0.1:9/v1", decider="sweep")
    await policy.reset(brief())
    decision = await policy.act(observe("scout[1]", 0, HERE), Inbox())
    assert decision.command is not None
    assert decision.usage is None


def test_the_schema_accepts_good_steps_and_refuses_others():
    schema = decision_schema(brief())
    validator = jsonschema.Draft202012Validator(schema)
    validator.check_schema(schema)
    assert validator.is_valid(STEP)
    assert validator.is_valid(NOOP)
    assert not validator.is_valid({**STEP, "command": {"verb": "dance", "arguments": {}, "resource": "uav[1]"}})
    assert not validator.is_valid({**NOOP, "messages": [{"kind": "detection", "body": {}, "to": []}]})


def test_the_schema_of_an_agent_without_bodies_admits_no_command():
    schema = decision_schema(brief("commander", "star"))
    assert schema["properties"]["command"]["anyOf"] == [{"type": "null"}]
    jsonschema.validate(NOOP, schema)


def test_a_step_is_read_from_between_fences_and_prose():
    text = 'Sure:\n```json\n{"thought": "a } in a \\"string\\"", "command": null, "messages": []}\n```'
    assert read_step(text, StepFormat(brief(), memory=True, crops=False)).decision.thought == 'a } in a "string"'
    with pytest.raises(StepError):
        step_text("nothing here")


def test_all_faults_of_a_step_are_reported_at_once():
    step = {
        **NOOP,
        "command": {"verb": "setDestination", "arguments": {"x": "far", "y": 1, "z": 2, "w": 3}, "resource": "uav[1]"},
        "messages": [{"kind": "progress", "body": {"task": 1}, "to": ["nobody"]}],
    }
    with pytest.raises(StepError) as fault:
        read_step(json.dumps(step), StepFormat(brief(), memory=True, crops=False))
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
            "`client` is neither direct nor litellm, and no backbone is called `carrier-pigeon`",
        ),
        ({"model": "m", "base_url": "http://x", "temperature": "hot"}, "`temperature` is 'hot', a number is due"),
        ({"model": "m", "base_url": "http://x", "repairs": "1.5"}, "`repairs` is '1.5', a whole number is due"),
        ({"model": "m", "base_url": "http://x", "api_key_env": "NO_SUCH_KEY_HERE"}, "NO_SUCH_KEY_HERE"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict[str, str], says: str):
    with pytest.raises(UsageError, match=says):
        react(**arguments)


def test_every_wrong_option_is_reported_at_once():
    with pytest.raises(UsageError) as caught:
        react(modle="m", client="direct", temperature="3", images="-1", api_key_env="NO_SUCH_KEY_HERE", tries="many")
    wrong = {fault.where for fault in caught.value.faults}
    assert wrong == {"model", "base_url", "temperature", "tries", "images", "modle"}
    assert "`modle` is not known; did you mean `model`?" in str(caught.value)
    with pytest.raises(UsageError) as caught:
        react(model="m", api_key_env="NO_SUCH_KEY_HERE", base_url_env="NO_SUCH_URL_HERE")
    assert [fault.where for fault in caught.value.faults] == ["api_key_env", "base_url_env"]


@pytest.mark.slow
async def test_the_litellm_client_works_with_the_same_server(monkeypatch: pytest.MonkeyPatch):
    if find_spec("litellm") is None:  # never import it here: the client sets what its import must find
        pytest.skip("litellm is an optional extra")
    with serve([Reply(status=500), Reply(STEP)]) as server:
        monkeypatch.setenv("REACT_TEST_KEY", "a-key")
        policy = react(
            model="openai/test-model",
            base_url=server.url,
            client="litellm",
            deadline="600",
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


def test_the_prompt_has_the_weather_and_an_observation_only_changed_weather() -> None:
    storm = msgspec.structs.replace(WEATHER, wind_mps=14.0, visibility_m=800.0)
    own_brief = brief("skipper")
    assert '"weather":{"wind_mps":4.0,"wind_from_deg":220.0' in interface(own_brief)
    same = json.loads(observation_text(observe("skipper", 3), Inbox(), own_brief))
    other = json.loads(observation_text(observe("skipper", 3, weather=storm), Inbox(), own_brief))
    assert "weather" not in same
    assert (other["weather"]["wind_mps"], other["weather"]["visibility_m"]) == (14.0, 800.0)


@pytest.mark.parametrize(
    ("text", "says"),
    [(" \n", "is empty"), ("You are $agnt", "nothing fills: agnt"), ("It costs $5", "begins no name")],
)
def test_an_invalid_or_unknown_prompt_is_rejected(text: str, says: str, tmp_path: Path):
    (tmp_path / "p.txt").write_text(text)
    with pytest.raises(UsageError, match=says):
        react(model="m", base_url="http://x", prompt=str(tmp_path / "p.txt"))
    with pytest.raises(UsageError, match="is no prompt"):
        react(model="m", base_url="http://x", prompt="P9")


async def test_a_prompt_from_a_file_is_sent_and_its_hash_is_in_the_fingerprint(tmp_path: Path):
    (tmp_path / "p.txt").write_text("Be brief, $agent.")
    options = {"model": "m", "base_url": "http://127.0.0.1:9/v1", "prompt": str(tmp_path / "p.txt")}
    fingerprint = options_fingerprint(PluginHost().policy("react"), options)
    assert fingerprint == {"react.prompt": f"p.txt sha256:{hashlib.sha256(b'Be brief, $agent.').hexdigest()}"}
    with serve([Reply()]) as server:
        policy = react(**{**options, "base_url": server.url})
        await policy.reset(brief())
        await policy.act(observe("scout[1]", 1, HERE), Inbox())
    assert server.requests[0]["messages"][0]["content"].startswith("Be brief, scout[1].\n\nYOU MAY COMMAND")
