"""The oracle's plans: paths around obstacles, tours, loads of goods."""

from __future__ import annotations

import math
from itertools import pairwise, permutations
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from lingjing_agents.capability import walks
from lingjing_agents.ground_plane import between, inside
from lingjing_agents.oracle import deliveries
from lingjing_agents.oracle.dogs import DogPath
from lingjing_agents.oracle.privileged_state import InstanceIndex, PrivilegedState
from lingjing_agents.paths.clearance_paths import NARROW_M, find_path
from lingjing_agents.paths.visiting_order import shares, shortest
from msgspec.structs import replace

from lingjing.kernel.cities import CityBuilder
from lingjing.mission.instance import ArgumentSpec, VerbSpec
from lingjing.mission.kinds_format import VerbMotion
from lingjing.plugins.policy import BodyState
from lingjing.plugins.tasks import Task
from lingjing.plugins.terrain import ObstacleMap
from lingjing.testing import PluginHost, instantiate
from lingjing.testing.documents import templates_beside


def ground(*walls: tuple[float, float, float, float], side_m: int = 60) -> ObstacleMap:
    """Return a square with its south-west corner at (0, 0); walls are (west, south, east, north)."""
    cells = 2 * side_m
    ys, xs = np.meshgrid((np.arange(cells) + 0.5) * 0.5, (np.arange(cells) + 0.5) * 0.5, indexing="ij")
    clear = np.full((cells, cells), 1.6, np.float32)
    for west, south, east, north in walls:
        dx, dy = np.maximum(np.maximum(west - xs, xs - east), 0), np.maximum(np.maximum(south - ys, ys - north), 0)
        clear = np.minimum(clear, np.hypot(dx, dy).astype(np.float32))
    return ObstacleMap(0.0, 0.0, 0.5, 1.6, clear)


def test_a_path_is_found_on_a_large_map_with_a_distant_gap():
    """More than 60,000 cells lie before the wall, and its only gap is at the far end."""
    points = find_path(ground((0.0, 150.0, 154.0, 151.0), side_m=160), (2.0, 2.0), (2.0, 158.0), 1.0)
    assert points and math.dist(points[-1], (2.0, 158.0)) <= 1.0


@pytest.mark.parametrize(("motion", "is_dog"), [("step", True), ("straight", False), ("route", False)])
def test_only_a_body_that_turns_and_steps_walks_like_a_dog(motion: VerbMotion, is_dog: bool):
    turn = VerbSpec(name="left", motion="turn", arguments=(ArgumentSpec(name="angle", unit="deg"),))
    assert walks((turn, VerbSpec(name="go", motion=motion))) is is_dog


def test_a_free_way_is_one_straight_leg_to_within_reach():
    (end,) = find_path(ground(), (5.0, 5.0), (50.0, 5.0), 3.0)
    assert math.dist(end, (50.0, 5.0)) <= 3.0


def test_a_way_leads_through_the_gap_and_keeps_clear_of_the_wall():
    place = ground((29.0, 0.0, 31.0, 40.0), (29.0, 44.0, 31.0, 60.0))
    way = [(5.0, 5.0), *find_path(place, (5.0, 5.0), (55.0, 5.0), 1.0)]
    points = [
        (a[0] + k / 50 * (b[0] - a[0]), a[1] + k / 50 * (b[1] - a[1])) for a, b in pairwise(way) for k in range(51)
    ]
    assert min(float(place.clearance_m[place.cell(*point)]) for point in points) >= NARROW_M - 0.3
    assert any(abs(x - 30.0) < 1.0 and 40.0 < y < 44.0 for x, y in points)
    assert math.dist(way[-1], (55.0, 5.0)) <= 1.0


def test_no_path_crosses_a_closed_wall_and_a_path_avoids_blocked_places():
    assert find_path(ground((29.0, 0.0, 31.0, 60.0)), (5.0, 5.0), (55.0, 5.0), 1.0) == []
    around = find_path(ground(), (5.0, 30.0), (55.0, 30.0), 1.0, shut=((30.0, 30.0),))
    assert len(around) >= 2
    assert all(math.dist(point, (30.0, 30.0)) >= 1.0 for point in around)


def test_the_shortest_tour_is_the_minimum_of_all_permutations():
    places = {"a": (10.0, 0.0), "b": (-5.0, 3.0), "c": (20.0, -4.0), "d": (1.0, 9.0)}

    def length(order: tuple[str, ...]) -> float:
        return sum(math.dist(p, q) for p, q in pairwise([(0.0, 0.0), *(places[name] for name in order)]))

    assert length(shortest((0.0, 0.0), places)) == min(map(length, permutations(places)))


def test_each_target_is_assigned_to_the_body_that_reaches_it_first():
    assigned = shares({"w": (0.0, 0.0), "e": (100.0, 0.0)}, ["x", "y", "z"], {"x": (10, 0), "y": (90, 0), "z": (60, 0)})
    assert assigned == {"w": ["x"], "e": ["y", "z"]}


class DeliveryView:
    """The part of the ground truth that the plan of deliveries needs."""

    def __init__(self, demands: dict[str, float]) -> None:
        self._demands = demands
        angles = {name: math.tau * n / len(demands) for n, name in enumerate(demands)}
        self._places = {name: (400.0 * math.cos(a), 400.0 * math.sin(a)) for name, a in angles.items()}

    def place(self, name: str) -> tuple[float, float]:
        return self._places.get(name, (0.0, 0.0))

    def stock(self, name: str, stock: str) -> float:
        assert stock == "demand"
        return self._demands[name]


class Van:
    def __init__(self, name: str) -> None:
        self.id = name


@pytest.mark.parametrize("vans", [1, 3, 5])
def test_tours_deliver_all_demands_in_loads_that_fit_a_van_and_split_the_large_order(vans):
    demands = {"big": 250.0, **{f"p{n}": 100.0 for n in range(9)}}
    goods = {"takes": "demand", "source": "load", "within_m": 30.0}
    tasks = tuple(Task(name="deliver", by="road", target=name, actors=("road",), **goods) for name in demands)
    stock = {"gives": "load", "up_to": "payload", "within_m": 50.0}
    supply = Task(name="restock", by="road", target="depot", actors=("road",), **stock)
    trade = deliveries.SupplyChain(tasks, supply, tuple(Van(f"v{n}") for n in range(vans)), 200.0)
    loads = [tour for mine in deliveries.vehicle_tours(DeliveryView(demands), trade).values() for tour in mine]
    brought = {name: sum(a for load in loads for s, a in zip(load.stops, load.amounts, strict=True) if s == name)
               for name in demands}  # fmt: skip
    assert brought == demands
    assert max(load.load for load in loads) <= 200.0
    assert sum("big" in load.stops for load in loads) == 2
    assert len(loads) <= 7


def test_a_stock_is_not_confused_with_a_stock_of_a_similar_name():
    """`load` is `load_kg`, and not `load_reserve_kg`."""
    van = BodyState(id="van", position=(0.0, 0.0, 0.0), resources={"load_reserve_kg": 9.0, "load_kg": 4.0})
    truth = SimpleNamespace(states={"van": van})
    assert PrivilegedState.stock(truth, "van", "load") == 4.0
    assert PrivilegedState.stock(truth, "van", "load_reserve") == 9.0
    assert PrivilegedState.stock(truth, "van", "reserve") == 0.0


def test_a_dog_outside_of_the_wall_goes_in_by_the_gate():
    """The dog starts north of the walled compound, nearer to the wall beside its target than to the gate."""
    instance = instantiate(templates_beside(Path("nowhere"))("vdn"), seed=1)
    start = (-69.0, 221.0)
    bodies = tuple(
        replace(entity, position=(*start, 0.5)) if entity.id == "dog" else entity for entity in instance.entities
    )
    instance, city = CityBuilder(PluginHost()).place(replace(instance, entities=bodies), imported=True)
    plan = InstanceIndex(instance)
    (task,) = plan.tasks
    truth = SimpleNamespace(known=SimpleNamespace(city=city), place=lambda name: plan.entities[name].position[:2])
    path = DogPath(plan.entities["dog"], plan)
    way = path._way(truth, task, start, truth.place("home"))
    compound = next(region for region in instance.regions if region.name == "compound")
    assert inside(compound.polygon, way[-1]) and math.dist(way[-1], truth.place("home")) <= task.within_m
    gate = next(region for region in instance.regions if region.name == "gate")
    points = [between(a, b, k / 200.0) for a, b in pairwise([start, *way]) for k in range(201)]
    assert any(inside(gate.polygon, point) for point in points)
