"""Upper bounds on heights at many places, and radio links that are tested exactly only where the bounds require it."""

import itertools
import math
import random

import msgspec
import numpy as np
import pytest

from lingjing.engines.city.radio import Coverage, around_m, clearness, edge_loss_db
from lingjing.mission.instance import AgentSpec, CommsSpec, Entity, Instance, Weather
from lingjing.scene.city import Bridge, Building, City, Slope
from lingjing.scene.roofs import Roofs
from lingjing.scene.terrain import Terrain

CLEAR = Weather(visibility_m=10_000.0)


def house(number: int) -> Building:
    """A skewed quadrangle within a square kilometre, on the ground or on stilts."""
    chance = random.Random(number)
    x, y, half = chance.uniform(-500, 500), chance.uniform(-500, 500), chance.uniform(4, 30)
    turn = chance.uniform(0, math.pi)
    corners = tuple(
        (x + half * math.cos(turn + k * math.pi / 2), y + 0.6 * half * math.sin(turn + k * math.pi / 2))
        for k in range(4)
    )
    base = 0.0 if number % 7 else 8.0
    return Building(id=f"h/{number}", polygon=corners, base_m=base, top_m=base + chance.uniform(3, 60))


CITY = City(
    id="town",
    origin=(31.0, 121.5),
    bounds=(-600.0, -600.0, 600.0, 600.0),
    buildings=tuple(house(number) for number in range(150)),
    bridges=(Bridge(id="ramp", path=((-300.0, 0.0, 0.0), (300.0, 40.0, 30.0)), width_m=14.0),),
    slopes=(Slope(id="bank", top=((-80.0, 200.0, 0.0), (90.0, 210.0, 0.0), (60.0, 300.0, 9.0)), thickness_m=1.0),),
)


def test_no_solid_is_higher_than_the_bound_and_most_places_are_known_to_be_free() -> None:
    terrain, chance = Terrain(CITY), random.Random(1)
    x, y = (np.array([chance.uniform(-560, 560) for _ in range(4000)]) for _ in range(2))
    bounds = Roofs(terrain).bound(x, y)
    covered = 0
    for east, north, bound in zip(x.tolist(), y.tolist(), bounds.tolist(), strict=True):
        tops = [block.top_at(east, north) for block in terrain.solids_at(east, north, -100.0, math.inf)]
        covered += bool(tops)
        assert max(tops, default=-math.inf) <= bound + 1e-6
    assert 100 < covered <= np.isfinite(bounds).sum() < 3 * covered


def test_bounds_hold_exactly_on_the_edges_of_blocks_and_squares() -> None:
    edges = [250.0 * k for k in range(-2, 3)] + [5.0 * k for k in range(-4, 5)]
    slabs = tuple(
        Building(
            id=f"s/{x}",
            polygon=((x, -300.0), (x + 5.0, -300.0), (x + 5.0, 300.0), (x, 300.0)),
            base_m=0.0,
            top_m=9.0,
        )
        for x in edges
    )
    roofs = Roofs(Terrain(msgspec.structs.replace(CITY, buildings=slabs)))
    for x in edges:
        places = np.array([x, math.nextafter(x, -math.inf) + 5.0, x + 2.5])
        assert (roofs.bound(places, np.array([0.0, 250.0, -250.0])) >= 9.0).all()


def carriers(count: int, low: float, high: float) -> tuple[Entity, ...]:
    chance = random.Random(f"{low} {high}")
    return tuple(
        Entity(
            id=f"uav[{k}]",
            group="uav",
            index=k,
            role="asset",
            type="quadrotor",
            engine="multirotor",
            position=(chance.uniform(-500, 500), chance.uniform(-500, 500), chance.uniform(low, high)),
        )
        for k in range(count)
    )


def covering(instance: Instance, range_m: float, terrain: Terrain) -> Coverage:
    """The radio of one agent that commands all bodies."""
    names = tuple(entity.id for entity in instance.entities)
    agent = AgentSpec(id="a", name="a", index=0, role="r", controls=names, commands=names, observes=())
    comms = CommsSpec(mode="broadcast", hub=None, range_m=range_m)
    return Coverage(msgspec.structs.replace(instance, agents=(agent,), comms=comms), terrain)


def slowly(entities, heights, terrain, reach_m):
    """The pairs without a radio link, by an exact test at every place along every line."""
    pairs = []
    for sender, receiver in itertools.combinations(entities, 2):
        first, second = ((*e.position[:2], e.position[2] + heights[e.id]) for e in (sender, receiver))
        length = math.dist(first, second)
        if length > reach_m or _is_cut(terrain, first, second, length, 20.0 * math.log10(reach_m / length)):
            pairs.append((sender.id, receiver.id))
    return tuple(pairs)


def _is_cut(terrain, first, second, length, bearable_db):
    count = math.floor(length / 10.0)
    for number in range(1, count + 1):
        share = number / (count + 1)
        x, y, z = (here + share * (there - here) for here, there in zip(first, second, strict=True))
        for block in terrain.solids_at(x, y, z - 10.0, math.inf):
            if block.base_at(x, y) <= z:
                over = min(block.top_at(x, y) - z, around_m(block.area.polygon, first, second))
                if edge_loss_db(over, share * length, (1 - share) * length) > bearable_db:
                    return True
    return False


@pytest.mark.parametrize(("low", "high", "range_m"), [(0.0, 2.0, 900.0), (20.0, 70.0, 1500.0), (90.0, 120.0, 5000.0)])
def test_bounds_give_the_same_blocked_links_as_exact_tests(instance_of, low, high, range_m):
    entities = carriers(24, low, high)
    terrain = Terrain(CITY)
    coverage = covering(instance_of(entities, CLEAR), range_m, terrain)
    silent = coverage.unlinked({e.id: e.position for e in entities}, CLEAR)
    assert silent == slowly(entities, coverage._heights, terrain, range_m * clearness(CLEAR))
    assert 0 < len(silent) < 276 or high > 80.0


def test_bodies_above_the_roofs_need_no_exact_tests(instance_of, monkeypatch):
    entities = carriers(40, 90.0, 120.0)
    terrain, looked = Terrain(CITY), []
    coverage = covering(instance_of(entities, CLEAR), 5000.0, terrain)
    monkeypatch.setattr(terrain, "solids_at", lambda *place: looked.append(place) or ())
    coverage.unlinked({e.id: e.position for e in entities}, CLEAR)
    assert looked == []
