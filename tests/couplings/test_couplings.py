"""Couplings: the effects of one engine on the bodies of another, with all engines real and in one world."""

from collections.abc import Callable, Iterator
from typing import Any

import msgspec
import numpy as np
import pytest

import tests.couplings.mixed_world as kit
from lingjing.kernel.step import Kernel
from lingjing.mission.instance import EventSpec, Weather
from lingjing.testing import decode_jpeg
from lingjing.testing.worlds import World, WorldRun, length_m, open_world
from lingjing.trace.records import Action, Decision, DecisionRecord

pytestmark = pytest.mark.slow

STREET = kit.HERE / "street.ljs"
CROSSING = (-80.0, -201.65)
Start = Callable[..., WorldRun]


@pytest.fixture(scope="module")
def world() -> Iterator[World]:
    world = open_world("inline", host=kit.host())
    yield world
    world.close()


@pytest.fixture
def play(world: World) -> Start:
    def start(settings: dict[str, float] | None = None, **changed: dict[str, Any]) -> WorldRun:
        return WorldRun(world, *kit.staged(STREET, changed=changed, **(settings or {})))

    return start


def driven(play: Start, *, crossing: bool) -> WorldRun:
    """Play a van that drives down the street. A dog may cross in front of it and stand in its lane for a while."""
    played = play()
    played.tick(played.order("van", "setDestination", x=-20.0, y=-201.6), count=5)
    for metres, seconds in ((5.4, 9), (8.6, 14)):
        played.tick(*([played.order("dog", "forward", distance=metres)] if crossing else []), count=seconds)
    return played


def test_a_car_brakes_for_a_dog_that_crosses_and_drives_on(play: Start) -> None:
    met, alone = driven(play, crossing=True), driven(play, crossing=False)
    speeds = met.series("van", "speed_mps")
    slowest = min(range(80, 160), key=speeds.__getitem__)
    gap = CROSSING[0] - met.path("van")[slowest].position[0]
    assert speeds[slowest] < 1.0 < 10.0 < min(alone.series("van", "speed_mps")[80:130])
    assert 1.0 < gap < 15.0
    assert max(speeds[slowest:]) > 10.0
    assert met.now("van").status == alone.now("van").status == "arrived"
    assert met.now("dog").position[1] > -194.0
    assert not met.events("collided")
    assert met.events("arrived")[0].time_s > alone.events("arrived")[0].time_s + 1.0


def test_a_parked_truck_stops_a_dog(play: Start) -> None:
    parked = {"position": (-100.0, -198.35, 0.0), "heading_deg": 270.0}
    played = play(truck=parked, dog={"position": (-100.0, -206.0, 0.1)})
    played.tick(played.order("dog", "forward", distance=14.0), count=12)
    (receipt,) = (
        receipt for boundary in played.boundaries for receipt in boundary.receipts if receipt.status == "rejected"
    )
    assert (receipt.reason, "`truck` is in the way" in receipt.detail) == ("blocked", True)
    assert played.events("collided")[0].entities == ("dog", "truck")
    assert played.now("dog").position[1] < played.now("truck").position[1] - 1.0


def test_a_background_car_stops_a_dog(play: Start) -> None:
    """A dog walks into the side of a car that stands in the background traffic."""
    scout = play({"cars": 60})
    scout.tick(count=25)
    before, after = ({m.id: m for m in b.snapshots[-1].ambient} for b in scout.boundaries[-6:][::5])
    standing = [m for name, m in after.items() if name in before and _apart(before[name], m) < 0.05 and m.kind == "car"]
    assert standing
    car = min(standing, key=lambda mover: mover.id)
    east, north = _side(car.heading_deg)
    x, y, _ = car.position
    spot = (x + 2.6 * east, y + 2.6 * north, 0.0)
    played = play({"cars": 60}, dog={"position": spot, "heading_deg": (car.heading_deg - 90.0) % 360.0})
    played.tick(count=20)
    played.tick(played.order("dog", "forward", distance=6.0), count=5)
    assert {hit.entities for hit in played.events("collided")} == {("dog", car.id)}
    assert length_m(played.path("dog")[-51:]) < 3.0


def _apart(first, second) -> float:
    return float(np.hypot(first.position[0] - second.position[0], first.position[1] - second.position[1]))


def _side(heading_deg: float) -> tuple[float, float]:
    """Return the unit vector to the right of a heading: east, north."""
    angle = np.radians(heading_deg)
    return float(np.cos(angle)), float(-np.sin(angle))


def test_a_dog_climbs_the_kerb(play: Start) -> None:
    played = play(dog={"position": (-80.0, -199.0, 0.0)})
    before = played.now("dog").position[2]
    played.tick(played.order("dog", "forward", distance=6.0), count=9)
    assert played.now("dog").position[2] - before == pytest.approx(0.1, abs=0.05)
    assert played.now("dog").position[1] == pytest.approx(-193.0, abs=0.6)
    assert not played.events("collided") + played.events("fell")


def flown(world: World, *gusts: EventSpec) -> WorldRun:
    """Play a UAV at 60 m that flies 250 m east in still air, except for the gusts."""
    still = {"wind_mps": 0.0, "turbulence": 0.0}
    start = {"position": (-200.0, 60.0, 60.0)}
    instance, city = kit.staged(STREET, changed={"weather": still, "uav": start})
    played = WorldRun(world, msgspec.structs.replace(instance, events=gusts), city)
    played.tick(played.order("uav", "setDestination", x=50.0, y=60.0, z=60.0), count=40)
    return played


def test_wind_moves_a_uav_and_a_gust_costs_it_energy(world: World) -> None:
    gust = Weather(wind_mps=13.0, wind_from_deg=45.0, turbulence=0.3)
    still = msgspec.structs.replace(gust, wind_mps=0.0, turbulence=0.0)
    met = flown(world, EventSpec(name="gust", tick=8, weather=gust), EventSpec(name="lull", tick=16, weather=still))
    spared = flown(world)
    aside = [abs(state.position[1] - 60.0) for state in met.path("uav")]
    assert max(aside[:80]) < 0.1 < 0.5 < max(aside)
    arrivals = [played.events("arrived")[0].time_s for played in (met, spared)]
    costs = [np.subtract(*np.array(played.series("uav", "battery_wh"))[[0, -1]]) for played in (met, spared)]
    assert costs[0] > 1.03 * costs[1], (costs, arrivals, max(aside))


def seen(play: Start, **weather: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a UAV's picture ahead: brightness 0..1 and depth in metres."""
    played = play(weather=weather, uav={"position": (-60.0, -60.0, 40.0), "heading_deg": 225.0})
    frame = played.look("uav", "ahead")
    assert frame.depth is not None
    return decode_jpeg(frame.jpeg).astype(float).mean(axis=2) / 255.0, frame.depth


def test_fog_shortens_what_a_camera_sees(play: Start) -> None:
    clear, depth = seen(play, visibility_m=10_000.0)
    foggy, same = seen(play, visibility_m=150.0)
    near, far = depth < 80.0, (depth > 200.0) & np.isfinite(depth)
    assert np.allclose(depth[near], same[near], atol=0.5)
    assert foggy[far].std() < 0.3 * clear[far].std()
    assert foggy[near].std() > 2.0 * foggy[far].std()


def test_a_uav_flown_into_a_tower_is_a_collision_with_both_names(world: World) -> None:
    town = {"scene": {"kind": "commercial"}, "weather": {"wind_mps": 0.0, "turbulence": 0.0}}
    _, city = kit.staged(STREET, changed=town)
    tower = max(city.buildings, key=lambda building: building.top_m)
    centre = np.mean(tower.polygon, axis=0)
    away = np.array([60.0, 0.0])
    (x, y), beyond = (centre - away).tolist(), (centre + away).tolist()
    height = tower.top_m - 5.0
    played = WorldRun(world, *kit.staged(STREET, changed={**town, "uav": {"position": (x, y, height)}}))
    played.tick(played.order("uav", "setDestination", x=beyond[0], y=beyond[1], z=height), count=15)
    (hit,) = played.events("collided")
    named = {building.id: building for building in city.buildings}
    assert hit.entities[0] == "uav"
    assert named[hit.entities[1]].top_m > 20.0
    assert hit.values["speed_mps"] > 2.0
    assert played.now("uav").status == "dead"


def test_goods_taken_on_at_the_warehouse_make_a_van_slower(play: Start) -> None:
    runs = []
    for filled in (False, True):
        played = play(depot={"position": (-150.0, -201.6, 0.0)}, van={"properties": {"load_kg": 0.0}})
        orders = [played.order("van", "setDestination", x=180.0, y=-201.6)]
        played.tick(*orders, *([played.order("depot", "unlock.restock")] if filled else []), count=20)
        runs.append(played)
    empty, full = runs
    assert (empty.now("van").resources["load_kg"], full.now("van").resources["load_kg"]) == (0.0, 200.0)
    assert [(e.entities, e.values["amount_kg"]) for e in full.events("restock")] == [(("depot", "van"), 200.0)]
    assert full.series("van", "speed_mps")[50] < 0.95 * empty.series("van", "speed_mps")[50]
    assert full.now("van").resources["speed_mps"] < 0.98 * empty.now("van").resources["speed_mps"]
    assert full.now("van").position[0] < empty.now("van").position[0] - 2.0


def test_a_command_to_one_engine_is_observed_by_agents_of_another(world: World) -> None:
    """A dog walks in front of a van or not. The driver observes the van and events, but not the dog."""
    inputs = []
    for walk in (True, False):
        kernel = Kernel(*kit.staged(STREET), world)
        records = [kernel.reset().record]
        for tick in range(12):
            go = {0: ("driver", "setDestination", {"x": -20.0, "y": -201.6})}.get(tick)
            if walk and tick == 6:
                go = ("walker", "forward", {"distance": 14.0})
            records.append(kernel.step([_decided(*go)] if go else ()).record)
        inputs.append([{o.agent: o.sha256 for o in record.observations} for record in records])
    met, alone = inputs
    assert all(len({seen[agent] for seen in met}) > 6 for agent in ("driver", "walker"))
    assert met[:7] == alone[:7]
    assert met[12]["driver"] != alone[12]["driver"]
    assert [seen["flyer"] for seen in met] == [seen["flyer"] for seen in alone]


def _decided(agent: str, verb: str, arguments: dict[str, float]) -> DecisionRecord:
    return DecisionRecord(agent=agent, decision=Decision(command=Action(verb=verb, arguments=arguments)))
