"""Seeded instances: a seed draws targets and weather and does not affect the layout. The same instance results for
every agent and mode. The paper's sweeps are declared and can be set by hand.
"""

from __future__ import annotations

import functools
import hashlib
import itertools
from pathlib import Path

import msgspec
import pytest

from lingjing.errors import UsageError
from lingjing.mission.evaluate import Scope, number
from lingjing.scene.city import City
from lingjing.testing import instantiate
from tests.missions import staging as kit

SEEDS = range(5)
NINE = tuple(dict.fromkeys(name for name, _ in kit.COLUMNS))
TWO_MODES = ("ufr", "ssr", "cd")
nine = pytest.mark.parametrize("name", NINE)


@functools.cache
def drawn(name, seed=0, mode=None, **settings):
    return instantiate(kit.mission(name), seed=seed, mode=mode, settings=settings)


def content(city: City) -> str:
    """A digest of the city without boats, buoys and flotsam, and without the names of its files."""
    fixed = tuple(prop for prop in city.props if not prop.floating)
    bare = msgspec.structs.replace(city, id="", sha256="", network="", props=fixed)
    return hashlib.sha256(msgspec.json.encode(bare)).hexdigest()


def network(city: City) -> bytes:
    return Path(city.network).read_bytes() if city.network else b""


def wordless(agents):
    """Agents without their prompts, which name drawn places (a destination)."""
    return tuple(msgspec.structs.replace(agent, prompt="") for agent in agents)


def targets(instance):
    return {entity.id: (entity.position, entity.properties) for entity in instance.entities if entity.role == "target"}


def varied(instance):
    """The values that a seed may draw: targets and the weather."""
    return targets(instance), instance.weather


# -- the layout and the draw


@nine
def test_a_seed_does_not_change_the_layout(name):
    """Streets, buildings, regions, cells, agents, assets, rules: the same for all seeds; the city's bytes too."""
    first = drawn(name)
    for seed in SEEDS[1:]:
        b = drawn(name, seed)
        assert b.scene.layout == first.scene.layout and b.scene.options == first.scene.options
        assert wordless(b.agents) == wordless(first.agents)
        kept = ("regions", "cells", "messages", "rules", "unlocks", "stages", "success", "budget", "clock")
        for field in kept:
            assert getattr(b, field) == getattr(first, field), field
        assert [e for e in b.entities if e.role == "asset"] == [e for e in first.entities if e.role == "asset"]
    a, b = (kit.staged(name, None, seed)[1] for seed in (0, 1))
    assert content(a) == content(b)
    assert network(a) == network(b)


@nine
def test_a_seed_draws_the_targets(name):
    """Two seeds may draw the same targets, because a bridge has eight places. Five seeds give at least three draws."""
    assert len({msgspec.json.encode(varied(drawn(name, seed))) for seed in SEEDS}) >= 3


@nine
def test_assets_begin_at_the_same_place_in_the_city_for_every_seed(name):
    places = [
        [entity.position for entity in kit.staged(name, None, seed)[0].entities if entity.role == "asset"]
        for seed in SEEDS[:2]
    ]
    assert places[0] == places[1]


# -- the same seed


@nine
def test_the_same_seed_gives_the_same_instance(name):
    again = instantiate(kit.mission(name), seed=3)
    assert again == drawn(name, 3)
    assert msgspec.json.encode(again) == msgspec.json.encode(drawn(name, 3))


@pytest.mark.parametrize("name", TWO_MODES)
@pytest.mark.parametrize("seed", SEEDS)
def test_star_and_broadcast_are_played_on_the_same_instance(name, seed):
    """Targets, weather, assets and city are the same; the coordinator and the allowed messages differ."""
    star, broadcast = drawn(name, seed, "star"), drawn(name, seed, "broadcast")
    assert star.entities == broadcast.entities
    assert (star.weather, star.scene, star.budget, star.regions) == (
        broadcast.weather,
        broadcast.scene,
        broadcast.budget,
        broadcast.regions,
    )
    assert (star.success, star.rules, star.unlocks) == (broadcast.success, broadcast.rules, broadcast.unlocks)
    hub = {star.comms.hub}
    assert {agent.id for agent in star.agents} - {agent.id for agent in broadcast.agents} == hub


@pytest.mark.parametrize("name", TWO_MODES)
def test_star_and_broadcast_are_played_in_the_same_places(name):
    assert kit.staged(name, "star")[0].entities == kit.staged(name, "broadcast")[0].entities


@nine
def test_an_instance_contains_no_name_of_a_policy(name):
    """An instance contains no policy, so that it is the same for all of them."""
    text = msgspec.json.encode(drawn(name)).decode()
    assert not any(f'"{word}"' in text for word in ("oracle", "heuristic", "random", "react", "scripted"))


@pytest.mark.parametrize(("name", "count"), [("ssr", "victims"), ("ufr", "fires"), ("cd", "points")])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_larger_group_keeps_the_members_of_a_smaller_one(name, count, seed):
    """In studies over a count, the first victims, fires and points are the same."""
    few, many = (targets(drawn(name, seed, **{count: number})) for number in (2.0, 4.0))
    assert few.items() <= many.items() and len(many) > len(few)


OTHER = {
    "ssr": {"altitude": 60.0, "side": 2.0},
    "cr": {"replans_most": 6.0},
    "upr": {"guidance_steps": 30.0},
    "ld": {"moves_most": 25.0},
}


@pytest.mark.parametrize(("name", "other"), OTHER.items())
def test_other_parameters_do_not_change_the_targets(name, other):
    assert targets(drawn(name, 4)) == targets(drawn(name, 4, **other))


# -- sweeps

SWEEPS = {
    ("ssr", "team"): (("uavs",), (1, 2, 3), "broadcast"),
    ("ssr", "altitude"): (("altitude",), (60, 100, 140), None),
    ("ssr", "cells"): (("side",), (2, 3, 4), None),
    ("ssr", "overlap"): (("overlap",), (0.1, 0.2, 0.4), None),
    ("ufr", "workload"): (("fires",), (2, 3, 4, 5, 6), "broadcast"),
    ("cd", "workload"): (("points",), (5, 10, 15, 20), "star"),
    ("ld", "moves"): (("moves_most",), (25, 50, 75), None),
    ("cr", "replans"): (("replans_most",), (0, 3, 6), None),
    ("upr", "guidance"): (("guidance_steps",), (10, 20, 30), None),
}


@pytest.mark.parametrize(("name", "sweep"), SWEEPS)
def test_the_sweeps_of_the_paper_are_declared(name, sweep):
    parameters, values, _ = SWEEPS[name, sweep]
    (declared,) = (each for each in kit.mission(name).sweeps if each.name == sweep)
    assert declared.parameters == parameters
    assert tuple(number(value, Scope()) for value in declared.values[0]) == pytest.approx(values)


@pytest.mark.parametrize(("name", "sweep"), SWEEPS)
def test_every_value_of_a_sweep_makes_an_instance(name, sweep):
    (parameter,), values, mode = SWEEPS[name, sweep]
    made = [drawn(name, 1, mode, **{parameter: float(value)}) for value in values]
    assert [each.settings[parameter] for each in made] == pytest.approx(values)


def test_every_declared_sweep_is_in_the_table():
    declared = {(name, sweep.name) for name in NINE for sweep in kit.mission(name).sweeps}
    assert declared == set(SWEEPS)


@pytest.mark.parametrize("side", [2, 3, 4])
def test_the_grid_has_the_requested_number_of_cells(side):
    cells = drawn("ssr", 0, None, side=float(side)).cells
    assert len(cells) == side * side
    assert {(cell.row, cell.column) for cell in cells} == {
        (r, c) for r in range(1, side + 1) for c in range(1, side + 1)
    }


def test_overlap_makes_cells_wider_and_keeps_their_centres():
    narrow, wide = (drawn("ssr", 0, None, overlap=share).cells for share in (0.1, 0.4))
    for before, after in zip(narrow, wide, strict=True):
        assert before.centre == pytest.approx(after.centre)

    def width(cell):
        xs = [x for x, _ in cell.polygon]
        return max(xs) - min(xs)

    assert all(width(b) > width(a) for a, b in zip(narrow, wide, strict=True))


def test_five_uavs_search_for_any_number_of_fires():
    for fires in range(2, 7):
        instance = drawn("ufr", 0, "broadcast", fires=float(fires))
        groups = [entity.group for entity in instance.entities]
        assert (groups.count("fire"), groups.count("uav"), groups.count("truck")) == (fires, 5, 1)


def test_five_vans_serve_any_number_of_points():
    for points in (5, 10, 15, 20):
        instance = drawn("cd", 0, "star", points=float(points))
        demands = [e.properties["demand_kg"] for e in instance.entities if e.group == "point"]
        assert demands == [250.0] + [100.0] * (points - 1)
        vans = [entity for entity in instance.entities if entity.group == "van"]
        assert len(vans) == 5 and {van.properties["payload_kg"] for van in vans} == {200.0}


def test_the_number_of_victims_can_be_set_to_six_at_most():
    instance = drawn("ssr", 2, None, victims=6.0)
    assert sum(entity.group == "victim" for entity in instance.entities) == 6
    with pytest.raises(UsageError, match="victims"):
        instantiate(kit.mission("ssr"), settings={"victims": 7.0})


# -- budgets and speeds

CLOCKS = {
    "vdn": (140, 20.0), "bi": (60, 10.0), "ld": (50, 20.0), "idf": (300, 10.0), "upr": (300, 5.0), "ufr": (60, 20.0),
    "cr": (60, 20.0), "ssr": (60, 10.0), "cd": (60, 20.0),
}  # fmt: skip
SPEEDS = {"quadruped": 1.5, "vessel": 3.0}


@nine
def test_budgets_ticks_and_speeds_are_those_of_the_paper(name):
    instance = drawn(name)
    assert (instance.budget.ticks, instance.clock.tick_s) == CLOCKS[name]
    for entity in instance.entities:
        if entity.role == "asset" and entity.engine in SPEEDS:
            assert entity.properties["speed_mps"] == SPEEDS[entity.engine]
        if entity.engine == "multirotor":
            assert (entity.properties["cruise_mps"], entity.properties["endurance_s"]) == (12.0, 35 * 60.0)


def test_the_bridge_is_no_longer_than_one_flight():
    points = drawn("bi").scene.options["bridge"]
    length = sum(((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2) ** 0.5 for a, b in itertools.pairwise(points))
    assert 1000.0 < length <= 1200.0


OTHERS_PICTURES = {
    ("ld", "coordinator"): {"uav.nadir", "uav.front", "van.front", "dog.front"},
    ("cr", "coordinator"): {"uav.nadir", "uav.front", "van.front"},
    ("ufr", "dispatcher"): {"truck.front"}
    | {f"uav[{number}].{camera}" for number in range(1, 6) for camera in ("nadir", "front")},
    ("ssr", "commander"): {f"uav[{number}].{camera}" for number in range(1, 4) for camera in ("nadir", "front")},
}
"""The cameras of bodies that an agent does not control, but with pictures that it receives."""


@pytest.mark.parametrize(("name", "mode"), [*kit.COLUMNS, ("queue", "star")])
def test_an_agent_receives_its_own_pictures_and_those_that_its_channels_name(name, mode):
    made = drawn(name, mode=mode)
    received = {
        agent.name: {
            f"{body.id}.{camera.name}"
            for body in made.entities
            for camera in body.cameras
            if agent.receives_pictures(body.id, camera.name) and body.id not in agent.controls
        }
        for agent in made.agents
    }
    assert {(name, agent): cameras for agent, cameras in received.items() if cameras} == {
        at: cameras for at, cameras in OTHERS_PICTURES.items() if at[0] == name and at[1] in received
    }
    for agent in made.agents:
        own = [body for body in made.entities if body.id in agent.controls]
        assert all(agent.receives_pictures(body.id, camera.name) for body in own for camera in body.cameras)
