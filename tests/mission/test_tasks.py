"""The tasks of a mission, from its rules."""

from __future__ import annotations

from pathlib import Path

import pytest

import lingjing
from lingjing.mission.tasks import entry_regions, possible, reported, required_tasks
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
        ("upr", {("seal", "leak[1]", "quadruped", 5.0)}, {"leak": "finding"}),
        ("ssr", {("rescue", f"victim[{n}]", "vessel", 50.0) for n in (1, 2, 3)}, {"victim": "detection"}),
    ],
)
def test_required_tasks_are_the_interactions_that_success_needs(name, tasks, groups):
    played = instance(name)
    assert {(task.name, task.target, *engines(played, task), task.within_m) for task in required_tasks(played)} == tasks
    assert reported(played) == groups


def test_tasks_that_move_goods_name_the_states_of_both_sides():
    played = instance("cd")
    delivery = required_tasks(played)[0]
    assert (delivery.takes, delivery.source, delivery.moves_goods) == ("demand", "load", True)
    depot = next(entity for entity in played.entities if entity.id == "depot")
    assert [(task.gives, task.up_to) for task in possible(depot, played)] == [("load", "payload")]


YARD = (Path(__file__).parents[1] / "kernel" / "data" / "locker.ljs").read_text()


@pytest.mark.parametrize(
    ("condition", "regions"),
    [
        ("boat in pool and now > 20 s", ["pool"]),
        ("exists r in detection: boat in pool", ["pool"]),
        ("boat in pool or now > 20 s", []),
        ("not (boat in pool)", []),
        ("now > 20 s", []),
    ],
)
def test_an_unlock_names_the_regions_that_an_actor_must_enter(condition, regions):
    played = instantiate(YARD.replace("CONDITION", condition), seed=1)
    (task,) = possible(next(entity for entity in played.entities if entity.id == "box"), played)
    assert [region.name for region in entry_regions(task, played)] == regions


def test_shipped_missions_have_one_region_that_must_be_entered():
    regions = {
        (name, task.target): [region.name for region in entry_regions(task, played)]
        for name in MISSIONS
        for played in (instance(name),)
        for entity in played.entities
        for task in possible(entity, played)
    }
    assert {key: names for key, names in regions.items() if names} == {("vdn", "home"): ["compound"]}
