"""Policies with planted faults: the changes of each fault, their time and agent; without faults nothing changes."""

import asyncio
from collections.abc import Sequence

import numpy as np
import pytest
from lingjing_agents.faulty.options import FaultyOptions
from lingjing_agents.faulty.policy import FaultyPolicy

from agents.tests.agent_kit import ASSIGNMENT, REPORT, Inbox, brief, dog, observe, picture, sent_by
from lingjing.plugins.policy import Action, Brief, Decision, Observation, Outgoing, UsageError
from lingjing.testing import PluginHost, build_policy

SIGHTING = Outgoing(kind=REPORT.kind, body={"frame": "f1-uav[1]-nadir", "position": (10.0, 20.0, 0.0)})
ORDER = Outgoing(kind=ASSIGNMENT.kind, body={"assignee": "skipper", "task": "rescue"}, to=("skipper",))
FLY = Action(verb="setDestination", arguments={"x": 1.0, "y": 2.0, "z": 60.0}, resource="uav[1]")
ANSWER = Decision(command=FLY, messages=(SIGHTING, ORDER))


class Constant:
    """A policy with a constant decision that stores its inputs."""

    def __init__(self, answer: Decision) -> None:
        self.answer, self.shown = answer, []

    async def reset(self, own_brief: Brief) -> None:
        self.own_brief = own_brief

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        self.shown.append(observation)
        return self.answer


def answers(fault: dict[str, object], answer: Decision, own_brief: Brief, ticks: Sequence[int]) -> list[Decision]:
    policy = FaultyPolicy(Constant(answer), FaultyOptions(faults=({"agent": own_brief.agent, **fault},)))

    async def run() -> list[Decision]:
        await policy.reset(own_brief)
        return [await policy.act(observe(own_brief.agent, tick), Inbox()) for tick in ticks]

    return asyncio.run(run())


@pytest.fixture
def scout() -> Brief:
    return brief("scout[1]", messages=(sent_by(REPORT, "searcher"), sent_by(ASSIGNMENT, "searcher")))


def test_a_policy_without_faults_decides_like_the_wrapped_policy(scout: Brief) -> None:
    policy = FaultyPolicy(Constant(ANSWER), FaultyOptions())
    asyncio.run(policy.reset(scout))
    assert asyncio.run(policy.act(observe("scout[1]", 3), Inbox())) == ANSWER
    for name in ("oracle", "heuristic"):
        plugins = PluginHost().policies
        assert plugins[f"faulty-{name}"].privileged == plugins[name].privileged
        assert build_policy(plugins[f"faulty-{name}"], {"faults": []}) is not None


def test_a_fault_acts_from_its_boundary_on_for_its_number_of_boundaries(scout: Brief) -> None:
    fault = {"faculty": "execution", "boundary": 2}
    commands = [made.command for made in answers(fault, ANSWER, scout, range(5))]
    assert commands == [FLY, FLY, None, None, None]
    commands = [made.command for made in answers({**fault, "boundaries": 1}, ANSWER, scout, range(5))]
    assert commands == [FLY, FLY, None, FLY, FLY]


def test_a_fault_of_another_agent_changes_nothing(scout: Brief) -> None:
    assert answers({"faculty": "execution", "boundary": 0, "agent": "skipper"}, ANSWER, scout, [0]) == [ANSWER]


def test_each_faculty_changes_its_own_part_of_a_decision(scout: Brief) -> None:
    def made(faculty: str, **more: object) -> Decision:
        return answers({"faculty": faculty, "boundary": 0, **more}, ANSWER, scout, [0])[0]

    place = made("localisation", east_m=5.0, north_m=-7.0)
    assert place.messages[0].body["position"] == (15.0, 13.0, 0.0)
    assert (place.command, place.messages[1]) == (FLY, ORDER)

    way = made("waypoint", east_m=5.0, north_m=-7.0)
    assert way.command == Action(verb="setDestination", arguments={"x": 6.0, "y": -5.0, "z": 60.0}, resource="uav[1]")
    assert way.messages == ANSWER.messages
    assert made("routing") == ANSWER  # it flies, so its destination is a waypoint

    assert made("handoff").messages == (SIGHTING,)
    wrong = made("handoff", way="misaddressed").messages[1]
    assert wrong.body["assignee"] == wrong.to[0] != "skipper"
    assert wrong.to[0] in {peer.id for peer in scout.peers}

    halted = made("execution", way="halted").command
    assert halted is not None and (halted.verb, halted.resource) == ("stop", "uav[1]")
    assert made("perception") == ANSWER  # the fault changes the input of the model and not its answer


def test_a_mirrored_routing_fault_turns_a_walker_to_the_other_side() -> None:
    walker = brief("scout[1]", resources=(dog(),))
    left = Decision(command=Action(verb="left", arguments={"angle": 30.0}, resource="dog"))
    (made,) = answers({"faculty": "routing", "way": "mirrored", "boundary": 0}, left, walker, [0])
    assert made.command == Action(verb="right", arguments={"angle": 30.0}, resource="dog")


def test_a_perception_fault_shows_a_single_colour_and_keeps_the_depth(scout: Brief) -> None:
    rgb = np.zeros((4, 6, 3), np.uint8)
    rgb[1, 2] = (240, 120, 24)
    seen = picture((0.0, 0.0, 60.0), rgb)
    wrapped = Constant(ANSWER)
    policy = FaultyPolicy(
        wrapped, FaultyOptions(faults=({"agent": "scout[1]", "faculty": "perception", "boundary": 1},))
    )
    asyncio.run(policy.reset(scout))
    for tick in (0, 1):
        asyncio.run(policy.act(observe("scout[1]", tick, pictures=(seen,)), Inbox()))
    before, after = (shown.pictures[0] for shown in wrapped.shown)
    assert before is seen
    assert len(np.unique(after.rgb.reshape(-1, 3), axis=0)) == 1
    assert tuple(after.rgb[0, 0]) == (10, 5, 1)
    assert after.depth is seen.depth and after.pose == seen.pose


@pytest.mark.parametrize(
    ("faults", "complaint"),
    [
        ([{"agent": "a", "faculty": "handoff", "boundary": 0, "way": "blind"}], "handoff cannot be `blind`"),
        ([{"agent": "a", "faculty": "sight", "boundary": 0}], "faculty"),
        ([{"agent": "a", "faculty": "waypoint", "boundary": -1}], "boundary"),
        ([{"agent": "a", "faculty": "waypoint", "boundary": n} for n in (0, 1)], "same agent and faculty"),
    ],
)
def test_invalid_faults_are_rejected(faults: list[dict[str, object]], complaint: str) -> None:
    with pytest.raises(UsageError, match=complaint):
        build_policy(PluginHost().policies["faulty-oracle"], {"faults": faults})
