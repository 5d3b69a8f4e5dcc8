"""The two example scaffolds over real HTTP: their requests, what becomes of bad answers, and a real episode of each."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import msgspec
import pytest
from lingjing_agents import plugin

import lingjing
from agents.tests.agent_kit import Inbox, brief, observe, react, view
from agents.tests.chat_server import NOOP, Reply, serve
from lingjing import read as read_trace
from lingjing.plugins.conformance import SCAFFOLD_CHECKS, ScaffoldCase, check_name, sample_brief, sample_observations
from lingjing.plugins.conformance.scaffolds import NO_OP
from lingjing.plugins.contract import CONTRACT_MODULES
from lingjing.plugins.loading import options_fingerprint
from lingjing.plugins.policy import Receipt, UsageError
from lingjing.testing import PluginHost, shortened

ROOT = Path(__file__).parents[1]
SCENARIO = ROOT.parent / "scenarios" / "ssr.ljs"
SCAFFOLDS = {offer.name: offer for offer in plugin.lingjing_scaffolds()}
HERE = view("uav[1]", (306.0, -620.0, 96.5))
REJECTED = Receipt(
    request="c1-1", sender="scout[1]", resource="uav[1]", by="kernel", status="rejected", tick=1, time_s=10.0,
    reason="bad_argument", detail="`x` is outside of the city",
)  # fmt: skip
LESSON = "I will keep inside of the region."
PLAN = {"steps": ["Fly to the middle.", "Take a picture."]}
ORDER = {"step": 2, "order": "Take a picture now.", "replan": False}


def asked(request: dict[str, Any]) -> str:
    """The part of a scaffold that makes a request."""
    system = request["messages"][0]["content"]
    if "You plan for the agent" in system:
        return "planner"
    if "You manage the agent" in system:
        return "manager"
    return "reflection" if "Something that you did has failed" in system else "actor"


def answer(request: dict[str, Any]) -> Reply:
    answers = {"planner": PLAN, "manager": ORDER, "reflection": LESSON, "actor": NOOP}
    return Reply(answers[asked(request)])


def state(request: dict[str, Any]) -> dict[str, Any]:
    content = request["messages"][-1]["content"]
    return json.loads(content if isinstance(content, str) else content[0]["text"])


async def played(url: str, scaffold: str, inboxes: list[Inbox], **arguments: object) -> None:
    policy = react(model="test-model", base_url=url, deadline="600", scaffold=scaffold, **arguments)
    await policy.reset(brief())
    for tick, inbox in enumerate(inboxes):
        await policy.act(observe("scout[1]", tick, HERE), inbox)


@pytest.mark.parametrize("check", SCAFFOLD_CHECKS, ids=check_name)
@pytest.mark.parametrize("name", SCAFFOLDS)
def test_the_scaffolds_conform(name: str, check: Any) -> None:
    observations = sample_observations(sample_brief(), 12)
    check(ScaffoldCase(SCAFFOLDS[name], sample_brief(), observations, (NO_OP, json.dumps(PLAN), json.dumps(ORDER))[:1]))


async def test_a_plan_is_written_managed_and_shown_to_the_actor() -> None:
    with serve(answer) as server:
        await played(server.url, "plan-manage-act", [Inbox()] * 4, scaffold_args={"every": 3})
    assert [asked(request) for request in server.requests] == [
        "planner", "actor", "manager", "actor", "manager", "actor", "planner", "actor",
    ]  # fmt: skip
    actors = [request for request in server.requests if asked(request) == "actor"]
    assert "YOUR PLAN" in actors[0]["messages"][0]["content"]
    assert [(state(actor)["plan"], state(actor)["step"]) for actor in actors] == [
        (PLAN["steps"], 1), (PLAN["steps"], 2), (PLAN["steps"], 2), (PLAN["steps"], 1),
    ]  # fmt: skip
    assert [state(actor).get("order") for actor in actors] == [None, ORDER["order"], ORDER["order"], None]
    managed = next(request for request in server.requests if asked(request) == "manager")
    assert "1. Fly to the middle.\n2. Take a picture." in managed["messages"][1]["content"]


@pytest.mark.parametrize("bad", ["", "I would fly.", '{"steps": "east"}', '{"steps": [1, ""]}', "[" * 5000])
async def test_a_plan_that_cannot_be_read_leaves_the_agent_without_one(bad: str) -> None:
    with serve(lambda request: Reply(NOOP if asked(request) == "actor" else bad)) as server:
        await played(server.url, "plan-manage-act", [Inbox()] * 2)
    assert [asked(request) for request in server.requests] == ["planner", "actor"] * 2
    assert not {"plan", "step", "order"} & state(server.requests[-1]).keys()


async def test_a_manager_can_request_a_new_plan() -> None:
    def replan(request: dict[str, Any]) -> Reply:
        return Reply({**ORDER, "step": 99, "replan": True}) if asked(request) == "manager" else answer(request)

    with serve(replan) as server:
        await played(server.url, "plan-manage-act", [Inbox()] * 2)
    assert [asked(request) for request in server.requests] == ["planner", "actor", "manager", "planner", "actor"]
    assert state(server.requests[-1])["step"] == 1


async def test_a_failed_command_becomes_a_lesson_that_is_kept() -> None:
    foreign = msgspec.structs.replace(REJECTED, sender="skipper")
    inboxes = [Inbox(), Inbox(receipts=(REJECTED,)), Inbox(receipts=(foreign,)), Inbox()]
    with serve(answer) as server:
        await played(server.url, "reflective-memory", inboxes)
    assert [asked(request) for request in server.requests] == ["actor", "reflection", "actor", "actor", "actor"]
    assert "is outside of the city" in server.requests[1]["messages"][1]["content"]
    actors = [request for request in server.requests if asked(request) == "actor"]
    assert [state(actor).get("lessons") for actor in actors] == [None, [LESSON], [LESSON], [LESSON]]
    system = actors[0]["messages"][0]["content"]
    assert "YOUR MEMORY" in system
    assert "YOUR LESSONS" in system


async def test_the_latest_lessons_are_kept() -> None:
    numbers = iter(range(100))

    def lesson(request: dict[str, Any]) -> Reply:
        return Reply(f"Lesson {next(numbers)}.") if asked(request) == "reflection" else Reply()

    with serve(lesson) as server:
        await played(server.url, "reflective-memory", [Inbox(receipts=(REJECTED,))] * 4, scaffold_args={"lessons": 2})
    assert state(server.requests[-1])["lessons"] == ["Lesson 2.", "Lesson 3."]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"scaffold": "plan-manage"}, "option `scaffold` cannot be used: no scaffold is called `plan-manage`"),
        (
            {"scaffold": "plan-manage-act", "scaffold_args": {"every": 0}},
            "option `scaffold_args` cannot be used: .*every",
        ),
        ({"scaffold": "plan-manage-act", "scaffold_args": "every=3"}, "`scaffold_args`"),
        ({"scaffold_args": {"every": 3}}, "the scaffold `react` has no options"),
    ],
)
def test_a_wrong_scaffold_is_named(arguments: dict[str, Any], says: str) -> None:
    with pytest.raises(UsageError, match=says):
        react(model="m", base_url="http://localhost:1", **arguments)


def test_the_trace_names_the_scaffold_and_its_distribution() -> None:
    arguments = {"model": "m", "base_url": "http://localhost:1", "scaffold": "reflective-memory"}
    fingerprint = options_fingerprint(PluginHost().policy("react"), arguments)
    assert fingerprint["react.scaffold"].startswith("reflective-memory of lingjing-sim-agents ")


@pytest.mark.parametrize(
    "path", sorted((ROOT / "lingjing_agents" / "scaffolds").glob("*.py")), ids=lambda path: path.stem
)
def test_the_scaffolds_import_the_contract_alone(path: Path) -> None:
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    modules = {node.module or "" for node in nodes if isinstance(node, ast.ImportFrom)}
    own = {name for name in modules if name.startswith("lingjing_agents.scaffolds")}
    assert {name for name in modules - own if name.startswith("lingjing")} <= set(CONTRACT_MODULES)


@pytest.mark.parametrize("scaffold", SCAFFOLDS)
def test_a_scaffold_plays_an_episode(scaffold: str, tmp_path: Path) -> None:
    mission = shortened(SCENARIO, 3)
    far = {"verb": "setDestination", "arguments": {"x": 1e6, "y": 0, "z": 60}, "resource": "uav[1]"}

    def reply(request: dict[str, Any]) -> Reply:
        first = "You are `scout[1]`" in request["messages"][0]["content"]
        return Reply({**NOOP, "command": far}) if asked(request) == "actor" and first else answer(request)

    with serve(reply) as server:
        result = lingjing.run(
            mission,
            policy="react",
            policy_args={
                "model": "test-model", "base_url": server.url, "deadline": "60", "price_in": "1", "scaffold": scaffold,
            },
            world="inline",
            out=tmp_path / "run",
        )  # fmt: skip
    assert (result.reason, result.ticks) == ("budget", 3)
    trace = read_trace(result.trace)
    decisions = [made for record in trace.boundaries for made in record.decisions]
    assert [made.detail for made in decisions if made.substituted] == []
    assert trace.header.fingerprint["react.scaffold"].startswith(scaffold)
    own = {"plan-manage-act": {"planner", "manager", "actor"}, "reflective-memory": {"reflection", "actor"}}
    assert {asked(request) for request in server.requests} == own[scaffold]
    calls = sum(made.decision.usage.calls for made in decisions if made.decision.usage is not None)
    assert calls == len(server.requests)
