"""The heuristic reports at its first tick that it has no detector for the classes that it should report."""

from __future__ import annotations

import asyncio

import pytest
from lingjing_agents.heuristic.policy import HeuristicPolicy

from lingjing.plugins.policy import NOTE, Inbox, Observation
from lingjing.testing import brief_of, instantiate


def first_thought(mission: str, agent: str, classes: tuple[str, ...]) -> str:
    policy = HeuristicPolicy()
    asyncio.run(policy.reset(brief_of(instantiate(mission), agent, classes)))
    return asyncio.run(policy.act(Observation(agent=agent, tick=0, time_s=0.0), Inbox())).thought


def test_classes_without_a_detector_are_named() -> None:
    thought = first_thought("ssr", "scout[1]", ("life_raft", "quadrotor"))
    assert thought.startswith(NOTE) and "life_raft, quadrotor" in thought


@pytest.mark.parametrize(
    ("mission", "agent", "classes"),
    [
        ("ssr", "scout[1]", ("lifeboat", "person_in_water")),
        ("queue", "counter", ("queue_of_people",)),
        ("ssr", "skipper", ("lifeboat",)),
    ],
)
def test_no_note_if_a_detector_knows_a_class_or_nothing_is_reported(
    mission: str, agent: str, classes: tuple[str, ...]
) -> None:
    assert NOTE not in first_thought(mission, agent, classes)
