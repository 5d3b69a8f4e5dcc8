"""The encoding of the suites: every model is sent the same texts, pictures and earlier turns, within one budget."""

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest
from lingjing_agents.llm.models import read_models
from lingjing_agents.llm.picture_tokens import PictureRule, most_tokens
from lingjing_agents.react.answer import StepParser
from lingjing_agents.react.options import ReactOptions
from lingjing_agents.react.policy import ReactPolicy
from lingjing_agents.react.state_difference import shortened
from lingjing_agents.react.step import StepFormat
from lingjing_agents.react.token_bound import token_bound

from agents.tests.test_react_request import COLUMNS, brief_of, observation, placed
from lingjing.plugins.calls import CallRequest, CallResult
from lingjing.plugins.decisions import prompt_schema
from lingjing.plugins.policy import Inbox, UsageError

ANSWER = json.dumps({"thought": "north of the pier I see nothing " * 8, "command": None, "messages": []})
TICKS = 4


class Answering:
    """A record of calls that holds the same answer for every request, and keeps the requests."""

    replaying = True
    capped = False
    broker = None

    def __init__(self, answer: str = ANSWER) -> None:
        self.requests: list[CallRequest] = []
        self._answer = answer

    def begin(self, request: CallRequest) -> CallResult:
        self.requests.append(request)
        return CallResult(text=self._answer, finish_reason="stop", prompt_tokens=10, completion_tokens=5)

    def end(self, request: CallRequest, result: CallResult) -> None:
        raise AssertionError("every call is recorded")


async def sent(column: str, agent: Any, **options: object) -> list[CallRequest]:
    """The requests of an agent's model over some boundaries, with pictures of all cameras that it receives."""
    calls = Answering()
    policy = ReactPolicy(ReactOptions.model_validate(options), calls)
    await policy.reset(brief_of(column, agent))
    for tick in range(TICKS):
        await policy.act(observation(column, agent, tick), Inbox())
    return calls.requests


def roles(column: str) -> list[Any]:
    """One agent of each role."""
    return list({agent.role: agent for agent in reversed(placed(column)[0].agents)}.values())


def suite_models() -> list[str]:
    suite = Path(__file__).parents[2] / "suites" / "main.toml"
    return [entrant["model"] for entrant in tomllib.loads(suite.read_text("utf-8"))["entrants"]]


UNLIKE = ("gpt-5.5", "qwen3-vl-flash", "gemma-3-4b")
"""Models that differ in service, context, cost of pictures and in how they are asked for a step."""


@pytest.mark.parametrize("column", COLUMNS)
async def test_all_models_of_the_suite_receive_the_same_requests_within_the_budget(column: str) -> None:
    rules = tuple(read_models().pictures.values())
    models = suite_models() if column == "bi-single" else UNLIKE
    assert {*UNLIKE} <= {*suite_models()}
    for agent in roles(column):
        requests = [await sent(column, agent, model=model, encoding="paper") for model in models]
        first, *others = ([(call.messages, call.pictures) for call in calls] for calls in requests)
        assert all(other == first for other in others)
        assert len(first) == TICKS
        heads = [json.loads(calls[0].head) for calls in requests]
        assert {"response_format", "tools"} & {name for head in heads for name in head} == set()
        for messages, pictures in first:
            tokens = sum(token_bound(message.decode()) for message in messages)
            assert tokens + most_tokens(rules, [(1920, 1080)] * len(pictures)) + 2048 <= 16_384


async def test_earlier_turns_fill_the_budget_that_pictures_leave() -> None:
    """A driver without pictures keeps every turn. Two pictures at each boundary cost 5,400 tokens of the budget."""
    kept = {}
    for column, cameras in (("upr-star", 0), ("ufr-star", 2)):
        agent = next(agent for agent in roles(column) if len(brief_of(column, agent).views) == cameras)
        requests = await sent(column, agent, model="qwen3-vl-8b", encoding="paper", request_tokens=14_000)
        kept[cameras] = len(requests[-1].messages)
    assert kept[2] < kept[0] == 2 * TICKS


def test_an_encoding_rejects_a_model_that_cannot_receive_its_requests(tmp_path) -> None:  # type: ignore[no-untyped-def]
    own = tmp_path / "models.toml"
    own.write_text(
        '[models.short]\nservice = "vllm"\nserved = "short"\ncontext = 8192\n'
        '[models.narrow]\nservice = "vllm"\nserved = "narrow"\nmost_images = 1\n'
    )
    for model, words in (("short", "context of 8,192 tokens"), ("narrow", "takes 1 images")):
        with pytest.raises(ValueError, match=words):
            ReactOptions.model_validate({"model": model, "models": str(own), "encoding": "paper"})
        ReactOptions.model_validate({"model": model, "models": str(own)})  # without an encoding, less is accepted


def test_an_unknown_rule_for_pictures_is_named(tmp_path) -> None:  # type: ignore[no-untyped-def]
    own = tmp_path / "models.toml"
    own.write_text('[models.one]\nservice = "vllm"\nserved = "one"\npictures = "qwen"\n')
    with pytest.raises(
        UsageError, match=r"models.one.pictures: no rule for pictures is called `qwen`; there are: openai"
    ):
        read_models(own)
    own.write_text('[pictures.own]\nrule = "patches"\ntokens = 3\n')
    with pytest.raises(UsageError, match="`side` is missing"):
        read_models(own)


@pytest.mark.parametrize(
    ("family", "full", "small"),
    [("openai", 2448, 308), ("gemini", 1120, 1120), ("kimi", 2691, 361), ("qwen-vl", 2042, 258),
     ("internvl", 2306, 258), ("pixtral", 2340, 1056), ("gemma", 260, 260)],
)  # fmt: skip
def test_the_tokens_of_a_picture_follow_the_rule_of_the_model_family(family: str, full: int, small: int) -> None:
    """1920 x 1080 and 512 x 512 pixels; `openai` by the dataset that the table names, the others by their rules."""
    rule = read_models().pictures[family]
    assert (rule.count((1920, 1080)), rule.count((512, 512))) == (full, small)


def test_the_bound_counts_digits_signs_and_words() -> None:
    assert token_bound("") == 0
    assert token_bound("12.5") == 4
    assert token_bound("a word of seven letters") == 6  # `letters` has seven
    assert token_bound("[[1,2],[3,4]]") == 4 + 1 + 1 + 2 + 1 + 1
    assert token_bound("救援任务") == 4


def test_an_earlier_state_is_sent_as_a_difference() -> None:
    entity = {"id": "van", "position": [1.0, 2.0, 0.0], "status": "idle"}
    place = {"id": "stop[1]", "position": [5.0, 5.0, 0.0]}
    picture = {"frame": "f1", "camera": "uav/nadir", "ground": {"x": [0, 1]}, "heading_deg": 3.0}
    first = {"tick": 0, "of": 60, "entities": [entity, place], "cells_unsearched": ["a", "b"], "settings": {"a": 1}}
    second = {
        "tick": 1, "of": 60, "entities": [{**entity, "position": [9.0, 2.0, 0.0]}, place],
        "cells_searched": {"a": {"tick": 1}}, "cells_unsearched": ["b"], "settings": {"a": 1}, "pictures": [picture],
    }  # fmt: skip
    assert json.loads(shortened(json.dumps(first), None)) == {
        "tick": 0, "entities": [entity, place], "settings": {"a": 1}
    }  # fmt: skip
    assert json.loads(shortened(json.dumps(second), json.dumps(first))) == {
        "tick": 1, "entities": [{"id": "van", "position": [9.0, 2.0, 0.0]}], "cells_searched": {"a": {"tick": 1}},
        "pictures": [{"frame": "f1", "camera": "uav/nadir", "heading_deg": 3.0}],
    }  # fmt: skip
    kept = json.loads(shortened(json.dumps(second), json.dumps(first), frozenset({"f1"})))
    assert kept["pictures"] == [picture]
    assert shortened("no JSON", json.dumps(first)) == "no JSON"


@pytest.mark.parametrize("column", COLUMNS)
def test_the_prompt_schema_accepts_what_the_whole_schema_accepts(column: str) -> None:
    from jsonschema import Draft202012Validator

    for agent in roles(column):
        form = StepFormat(brief_of(column, agent), memory=True, crops=False)
        whole, short = Draft202012Validator(form.schema), Draft202012Validator(prompt_schema(form.schema))
        answers = [*examples(form.schema)]
        assert [short.is_valid(answer) for answer in answers] == [whole.is_valid(answer) for answer in answers]
        assert {whole.is_valid(answer) for answer in answers} == {True, False}
        assert len(StepParser(form).instructions) < 0.8 * len(json.dumps(form.schema, separators=(",", ":")))


def examples(schema: dict) -> list[dict]:
    """A valid answer for each command and message of a schema, and damaged copies of each."""
    empty = {"thought": "", "command": None, "messages": []}
    answers: list[dict] = [empty]
    for branch in schema["properties"]["command"]["anyOf"]:
        if "properties" in branch:
            command = _example(branch)
            answers += [{**empty, "command": wrong} for wrong in (command, *_damaged(command))]
    for branch in schema["properties"]["messages"].get("items", {}).get("anyOf", ()):
        message = _example(branch)
        answers += [{**empty, "messages": [wrong]} for wrong in (message, *_damaged(message))]
    return answers


def _damaged(value: dict) -> list[dict]:
    inner = "arguments" if "arguments" in value else "body"
    wrong = [{**value, inner: {**value[inner], "more": 1}}, {**value, inner: {name: {} for name in value[inner]}}]
    return [*wrong, {**value, "more": 1}, dict.fromkeys(value, "fly"), {inner: value[inner]}]


def _example(schema: dict) -> object:  # type: ignore[type-arg]
    if "const" in schema or "enum" in schema:
        return schema.get("const", schema.get("enum", [None])[0])
    kind = schema.get("type")
    if kind == "object":
        return {name: _example(field) for name, field in schema["properties"].items()}
    if kind == "array":
        return [_example(schema["items"])] * schema.get("minItems", 0)
    return {"string": "a", "number": 0.5, "integer": 1, "boolean": True}[kind]


def test_an_unknown_kind_of_picture_rule_is_rejected() -> None:
    with pytest.raises(ValueError, match="patches"):
        PictureRule.model_validate({"rule": "squares"})
