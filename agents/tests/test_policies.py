"""The contract of all policies: valid decisions for any observation, equal ones each time, no hidden information."""

import asyncio
import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lingjing_agents.plugin import lingjing_policies

from agents.tests.agent_kit import ASSIGNMENT, REPORT, STATUS, EventView, Inbox, brief, envelope, observe, picture, view
from lingjing.plugins.conformance import check_policy
from lingjing.plugins.policy import Absent, Decision, EntityView, Observation, PolicyPlugin, UsageError
from lingjing.testing import PluginHost, build_policy

PLUGINS = {plugin.name: plugin for plugin in lingjing_policies()}
AGENTS = [("scout[1]", "broadcast"), ("scout[2]", "star"), ("skipper", "broadcast"), ("commander", "star")]

coordinate = st.floats(-2000, 2000)
place = st.tuples(coordinate, coordinate, st.floats(-10, 200))
entity = st.builds(
    EntityView,
    id=st.sampled_from(["uav[1]", "uav[2]", "boat", "stranger"]),
    type=st.just("x"),
    position=st.none() | place,
    heading_deg=st.none() | st.floats(0, 359),
    status=st.sampled_from([None, "grounded", "hovering", "moving", "dead"]),
    busy=st.sampled_from([None, True, False]),
)
event = st.builds(
    EventView,
    id=st.text(min_size=1, max_size=3),
    kind=st.sampled_from(["rescue", "rescued", "matched", "reported", "arrived"]),
    tick=st.integers(0, 5),
    entities=st.just(()),
)
body = st.dictionaries(
    st.sampled_from(["position", "cell", "assignee", "confidence", "state", "task"]),
    st.sampled_from(
        [None, 0.5, "cells-1-1", "scout[1]", "missed", "searched", (1.0, -900.0), (1.0, -900.0, -3.5), True]
    ),
)
message = st.builds(
    envelope, st.sampled_from(["scout[1]", "scout[3]", "skipper", "commander"]),
    st.sampled_from([REPORT, ASSIGNMENT, STATUS]), body,
)  # fmt: skip
absent = st.builds(Absent, entity=st.just("uav[1]"), camera=st.just("nadir"), tick=st.just(1), reason=st.just("late"))


def play(plugin: PolicyPlugin, agent: str, mode: str, shown: list[tuple[Observation, Inbox]]) -> list[Decision]:
    async def run() -> list[Decision]:
        policy = plugin.factory()
        await policy.reset(brief(agent, mode))
        return [await policy.act(observation, inbox) for observation, inbox in shown]

    return asyncio.run(run())


class Shown:
    """A plug-in's policy that also receives inboxes, so that the conformance kit checks its messages."""

    def __init__(self, plugin: PolicyPlugin, inboxes: list[Inbox]) -> None:
        self._policy, self._inboxes = plugin.factory(), iter(inboxes)

    async def reset(self, own_brief):
        await self._policy.reset(own_brief)

    async def act(self, observation, inbox):
        return await self._policy.act(observation, next(self._inboxes))


@pytest.mark.parametrize("name", ["random", "heuristic"])
@pytest.mark.parametrize(("agent", "mode"), AGENTS)
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_observation_gets_a_valid_and_repeatable_answer(name: str, agent: str, mode: str, data: st.DataObject):
    ticks = data.draw(st.integers(1, 8))
    shown, inboxes = [], []
    for tick in range(ticks):
        entities = data.draw(st.lists(entity, max_size=4))
        pictures = (picture((100.0, -900.0, 96.5), tick=tick),) if data.draw(st.booleans()) else ()
        events = tuple(data.draw(st.lists(event, max_size=2)))
        missing = tuple(data.draw(st.lists(absent, max_size=1)))
        shown.append(observe(agent, tick, *entities, events=events, pictures=pictures, absent=missing))
        inboxes.append(Inbox(messages=tuple(data.draw(st.lists(message, max_size=3)))))
    plugin = PolicyPlugin(name=name, factory=lambda: Shown(PLUGINS[name], inboxes))
    check_policy(plugin, brief(agent, mode), shown)


def test_random_answers_are_valid_for_many_ticks():
    shown = [observe("scout[1]", tick, view("uav[1]", (300.0, -620.0, 1.1))) for tick in range(400)]
    check_policy(PLUGINS["random"], brief(), shown)
    decisions = play(PLUGINS["random"], "scout[1]", "broadcast", [(each, Inbox()) for each in shown])
    assert len({each.command.verb for each in decisions if each.command}) >= 5
    assert {note.kind for each in decisions for note in each.messages} == {"detection", "assignment", "progress"}


def test_the_random_policy_draws_only_from_the_seed_of_its_brief():
    shown = [(observe("scout[1]", tick), Inbox()) for tick in range(20)]
    np.random.seed(1)  # noqa: NPY002 - the global stream must not matter
    first = play(PLUGINS["random"], "scout[1]", "broadcast", shown)
    np.random.seed(2)  # noqa: NPY002
    assert first == play(PLUGINS["random"], "scout[1]", "broadcast", shown)
    assert first != play(PLUGINS["random"], "scout[2]", "broadcast", shown)


class Trap:
    """A ground truth that raises on every access."""

    def __getattribute__(self, name: str):
        raise AssertionError(f"an unprivileged policy read privileged.{name}")


@pytest.mark.parametrize("name", ["random", "heuristic"])
@pytest.mark.parametrize(("agent", "mode"), AGENTS)
def test_unprivileged_policies_never_read_the_ground_truth(name: str, agent: str, mode: str):
    own = "boat" if agent == "skipper" else f"uav[{agent[6:-1]}]"
    shown = [
        (
            observe(
                agent, tick, view(own, (100.0, -900.0, 96.5)), privileged=Trap(),
                pictures=(picture((100.0, -900.0, 96.5), tick=tick),),
            ),
            Inbox(messages=(envelope("scout[3]", REPORT, {"position": (50.0, -900.0), "confidence": 0.9}),)),
        )
        for tick in range(12)
    ]  # fmt: skip
    assert len(play(PLUGINS[name], agent, mode, shown)) == 12
    assert not PLUGINS[name].privileged


def test_the_oracle_is_declared_privileged_and_fails_without_the_ground_truth():
    assert [plugin.name for plugin in PLUGINS.values() if plugin.privileged] == [
        "oracle",
        "sighted-reader",
        "faulty-oracle",
    ]
    with pytest.raises(UsageError, match="privileged"):
        play(PLUGINS["oracle"], "skipper", "broadcast", [(observe("skipper", 0), Inbox())])


def test_entry_points_provide_the_five_reference_policies():
    assert {"random", "heuristic", "oracle", "react", "scripted"} <= set(PluginHost().policies)


def test_an_unknown_argument_is_named():
    with pytest.raises(UsageError, match="policy `heuristic`: option `speed` is not known; known: none"):
        build_policy(PLUGINS["heuristic"], {"speed": "9"})


def test_the_scripted_policy_plays_its_script(tmp_path):
    lines = {"scout[1]": {"0": {"command": {"verb": "takeoff"}}, "2": {"thought": "done"}}}
    path = tmp_path / "script.json"
    path.write_text(json.dumps(lines))

    async def run():
        policy = build_policy(PLUGINS["scripted"], {"script": str(path)})
        await policy.reset(brief())
        return [await policy.act(observe("scout[1]", tick), Inbox()) for tick in range(3)]

    first, second, third = asyncio.run(run())
    assert first.command is not None
    assert first.command.verb == "takeoff"
    assert second == Decision()
    assert third.thought == "done"


@pytest.mark.parametrize(
    ("text", "says"),
    [(None, "cannot read the script"), ("[]", "not a script"), ('{"a": {"0": {"x": 1}}}', "not a script")],
)
def test_invalid_scripts_are_reported(tmp_path, text, says):
    path = tmp_path / "script.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(UsageError, match=says):
        build_policy(PLUGINS["scripted"], {"script": str(path)})
    with pytest.raises(UsageError, match="option `script` is missing"):
        build_policy(PLUGINS["scripted"], {})
