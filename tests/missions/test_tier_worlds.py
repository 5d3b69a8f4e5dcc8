"""Tier 1 of the nine missions: worlds that change with the seed, and the values that agents do not observe there."""

from __future__ import annotations

import math

import pytest

from lingjing import Mission
from lingjing.plugins.policy import Instance
from lingjing.testing import at_tier, compile_file, instantiate, mission_file

NINE = ("bi", "cd", "cr", "idf", "ld", "ssr", "ufr", "upr", "vdn")
TARGETS = {
    "bi": ("fracture",), "cd": ("point",), "cr": ("goal_place", "jam"), "idf": ("fire",), "ld": ("house", "stop_node"),
    "ssr": ("victim",), "ufr": ("fire",), "upr": ("leak",), "vdn": ("home",),
}  # fmt: skip
APART_M = 10.0


def mission(name: str) -> Mission:
    made = compile_file(str(mission_file(name))).mission
    assert made is not None
    return made


def places(instance: Instance) -> list[tuple[float, float]]:
    return [entity.position[:2] for entity in instance.entities if entity.group in TARGETS[instance.mission]]


def worlds(name: str, seeds: int = 100) -> list[tuple[int, list[tuple[float, float]]]]:
    made = mission(name)
    instances = (instantiate(made, seed=seed, tier=1) for seed in range(seeds))
    return [(instance.scene.layout, places(instance)) for instance in instances]


def differ(world: tuple[int, list[tuple[float, float]]], other: tuple[int, list[tuple[float, float]]]) -> bool:
    return world[0] != other[0] or any(math.dist(a, b) > APART_M for a, b in zip(world[1], other[1], strict=True))


@pytest.mark.parametrize(("name", "least"), [(name, 60 if name in ("upr", "vdn", "bi") else 95) for name in NINE])
def test_a_hundred_seeds_give_at_least_60_or_95_different_worlds(name: str, least: int) -> None:
    kept: list[tuple[int, list[tuple[float, float]]]] = []
    for world in worlds(name):
        if all(differ(world, known) for known in kept):
            kept.append(world)
    assert len(kept) >= least


@pytest.mark.parametrize("name", NINE)
def test_layouts_are_drawn_and_kept_within_sweeps(name: str) -> None:
    """Eight can be learnt by heart: in VDN and LD their houses are the places that a target can have."""
    made = mission(name)
    layouts = {instantiate(made, seed=seed, tier=1).scene.layout for seed in range(80)}
    assert len(layouts) >= 79 if name in ("vdn", "ld") else len(layouts) == 8
    swept = [sweep.parameters[0] for sweep in made.sweeps]
    lowest = {param.name: param.bounds.low.value for param in made.parameters if param.name in swept}
    instances = [instantiate(made, seed=3, tier=1, settings=settings) for settings in ({}, lowest)]
    assert len({instance.scene.layout for instance in instances}) == 1


@pytest.mark.parametrize("name", NINE)
def test_weather_at_tier_1_is_drawn_from_few_values(name: str) -> None:
    made = mission(name)
    weathers = [instantiate(made, seed=seed, tier=1).weather for seed in range(60)]
    for field in ("sun_elevation_deg", "sun_azimuth_deg", "cloud", "wind_mps", "wave_height_m"):
        assert len({getattr(weather, field) for weather in weathers}) <= 6, field


@pytest.mark.parametrize("name", NINE)
def test_tier_0_has_no_part_of_tier_1(name: str) -> None:
    plain, other = (instantiate(mission(name), seed=seed) for seed in (3, 4))
    assert plain.scene.layout == other.scene.layout and plain.failure is None
    assert not any(counted.kind == "claims" for limit in plain.limits for counted in limit.counts)
    rivals = {group.name for group in mission(name).groups if group.when is not None and group.role == "target"}
    assert rivals.isdisjoint(entity.group for entity in plain.entities)
    assert not any("look_variant" in entity.properties for entity in plain.entities)


def observed(instance: Instance, agent: str) -> set[str]:
    spec = next(each for each in instance.agents if each.id == agent)
    return {f"{channel.name.partition('[')[0]}.{field}" for channel in spec.observes for field in channel.fields}


@pytest.mark.parametrize(
    ("name", "mode", "agent", "absent"),
    [
        ("cd", "star", "driver[1]", {"point.position", "point.demand_kg"}),
        ("cd", "broadcast", "driver[1]", {"point.demand_kg"}),
        ("cd", "broadcast", "driver[2]", {"point.position"}),
        ("cd", "broadcast", "driver[3]", {"point.position", "point.demand_kg"}),
        ("upr", "star", "walker", {"dog.position", "dog.heading_deg"}),
        ("cr", "star", "driver", {"goal_place.position", "van.*", "van.route"}),
        ("cr", "star", "inspector", {"van.position"}),
        ("ld", "star", "driver", {"van.*", "van.route"}),
    ],
)
def test_values_that_other_agents_must_report_are_not_observed(
    name: str, mode: str, agent: str, absent: set[str]
) -> None:
    made = mission(name)
    assert not absent & observed(instantiate(made, mode=mode, tier=1), agent)
    assert observed(instantiate(made, mode=mode, tier=1), agent) != observed(instantiate(made, mode=mode), agent)


def test_the_courier_of_tier_1_has_no_reference_picture() -> None:
    roles = [{reveal.role for reveal in instantiate(mission("ld"), tier=tier).reveals} for tier in (0, 1)]
    assert roles == [{"courier", "coordinator"}, {"coordinator"}]


@pytest.mark.parametrize("name", NINE)
def test_at_tier_resolves_the_alternatives_of_a_mission(name: str) -> None:
    made = mission(name)
    plain, hard = at_tier(made), at_tier(made, 1)
    assert plain != hard and not any(group.alternatives for group in (*plain.groups, *hard.groups))
    names = [{group.name for group in each.groups} for each in (plain, hard)]
    assert names[0] <= names[1]


@pytest.mark.parametrize("name", ["bi", "cr", "upr"])
def test_cameras_of_tier_1_give_colours_alone_where_depth_shows_the_targets(name: str) -> None:
    plain, hard = (instantiate(mission(name), seed=3, tier=tier) for tier in (0, 1))
    assert any("depth" in camera.channels for entity in plain.entities for camera in entity.cameras)
    assert {camera.channels for entity in hard.entities for camera in entity.cameras} == {("rgb",)}


def test_no_plates_of_a_bridge_hide_its_fracture() -> None:
    for seed in range(40):
        drawn = instantiate(mission("bi"), seed=seed, tier=1)
        (gap,) = (entity.position for entity in drawn.entities if entity.group == "fracture")
        plates = [entity.position for entity in drawn.entities if entity.group == "plates"]
        assert len(plates) == 8 and min(math.dist(gap[:2], place[:2]) for place in plates) >= 15.0
