"""The tasks of a mission, from its rules."""

from __future__ import annotations

import pytest

import lingjing
from lingjing.mission.tasks import possible, reported, required_tasks
from lingjing.testing import instantiate, shipped_missions

MISSIONS = {path.stem: path for path in shipped_missions()}


def instance(name: str):
    return instantiate(lingjing.compile(MISSIONS[name]), seed=1)


def engines(instance, task):
    """The engines of the assets that may do a task."""
    return sorted({entity.engine for entity in instance.entities if entity.id in task.actors})


@pytest.mark.parametrize(
    "name, tasks, groups",
    [
        ("vdn", {("arrive", "home", "quadruped", 30.0)}, {}),
        ("bi", {("inspect", "fracture", "multirotor", 25.0)}, {"fracture": "finding"}),
        ("ld", {("arrive", "stop_node", "road", 30.0), ("receive", "house", "quadruped", 15.0)}, {}),
        ("cr", {("arrive", "goal_place", "road", 30.0)}, {}),  # the jams are recorded too, but success needs none
        ("upr", {("seal", "leak", "quadruped", 5.0)}, {"leak": "finding"}),
        ("ssr", {("rescue", f"victim[{n}]", "vessel", 50.0) for n in (1, 2, 3)}, {"victim": "detection"}),
    ],
)
def test_success_says_which_interactions_are_left_to_do(name, tasks, groups):
    played = instance(name)
    assert {(task.name, task.target, *engines(played, task), task.within_m) for task in required_tasks(played)} == tasks
    assert reported(played) == groups


def test_goods_are_named_at_both_ends():
    played = instance("cd")
    delivery = required_tasks(played)[0]
    assert (delivery.takes, delivery.source, delivery.moves_goods) == ("demand", "load", True)
    depot = next(entity for entity in played.entities if entity.id == "depot")
    assert [(task.gives, task.up_to) for task in possible(depot, played)] == [("load", "payload")]
