"""The quadruped engine with the real model, policy and physics."""

import itertools
import math
from collections.abc import Callable

import msgspec
import pytest

from lingjing.engines.quadruped import dog_model, engine, tasks
from lingjing.mission.instance import Entity, EventSpec, Instance, StateSpec, VerbSpec
from lingjing.plugins.conformance import check_engine
from lingjing.scene.city import Building, City, Land, Slope, Solid, Water
from lingjing.testing import PluginHost, declared
from lingjing.trace.records import BodyState, Command

VERBS = ("forward", "left", "right", "stop")


def rectangle(west: float, south: float, east: float, north: float) -> tuple[tuple[float, float], ...]:
    return ((west, south), (east, south), (east, north), (west, north))


def city_of(**pieces: object) -> City:
    return City(id="yard", origin=(31.0, 121.5), bounds=(-500.0, -500.0, 500.0, 500.0), **pieces)


def dog(index: int = 1, x: float = 0.0, y: float = 0.0, z: float = 0.0, heading: float = 0.0, **more: object) -> Entity:
    properties = {"speed_mps": 1.5, "endurance_s": 5400.0}
    properties.update(more.pop("properties", {}))
    return declared(
        Entity(
            id=f"dog[{index}]",
            group="dog",
            index=index,
            role="asset",
            type="robot_dog",
            engine="quadruped",
            position=(x, y, z),
            heading_deg=heading,
            properties=properties,
            verbs=tuple(VerbSpec(name=name) for name in VERBS),
            **more,
        )
    )


def truck(x: float, y: float, speed: float = 0.0, heading: float = 90.0) -> BodyState:
    course = math.radians(heading)
    return BodyState(
        id="traffic/7",
        kind="truck",
        position=(x, y, 0.0),
        velocity=(speed * math.sin(course), speed * math.cos(course), 0.0),
        heading_deg=heading,
    )


@pytest.fixture
def play(player: Callable, instance_of: Callable[..., Instance]) -> Callable:
    def begin(city: City, *dogs: Entity, sync_s: float = 0.1):
        return player(engine.QuadrupedEngine(), instance_of(dogs or (dog(),), sync_s=sync_s), city, "quadruped")

    return begin


def ended(session, request: str, mirrors=(), limit_s: float = 60.0):
    while session.time_s < limit_s:
        for receipt in session.step(mirrors).receipts:
            if receipt.request == request and receipt.status != "running":
                return receipt
    raise AssertionError(f"{request} did not end: {session.boundary.states}")


def test_a_robot_dog_walks_ten_metres_north(play):
    session = play(city_of())
    assert session.state.status == "standing"
    assert 0.25 < session.state.position[2] < 0.36
    receipt = session.command("dog[1]", "forward", distance=10.0)
    session.run(2.0)
    assert session.state.status == "walking"
    assert 1.2 < session.state.velocity[1] < 1.8
    end = ended(session, receipt.request)
    assert (end.status, end.progress) == ("completed", 1.0)
    assert 7.0 < end.time_s < 9.5
    assert session.state.position[:2] == pytest.approx((0.0, 10.0), abs=0.15)
    assert min(session.state.heading_deg, 360.0 - session.state.heading_deg) < 3.0
    assert len(session.state.joints) == 12


@pytest.mark.parametrize(("verb", "angle", "heading"), [("left", 90.0, 330.0), ("right", 170.0, 230.0)])
def test_a_robot_dog_turns_on_the_spot(play, verb, angle, heading):
    session = play(city_of(), dog(x=5.0, heading=60.0))
    receipt = session.command("dog[1]", verb, angle=angle)
    session.run(0.6)
    assert session.state.status == "turning"
    assert ended(session, receipt.request).status == "completed"
    assert session.state.heading_deg == pytest.approx(heading, abs=3.0)
    assert session.state.position[:2] == pytest.approx((5.0, 0.0), abs=0.1)


def test_stop_pre_empts_a_walk_and_the_dog_comes_to_rest(play):
    session = play(city_of())
    walk = session.command("dog[1]", "forward", distance=50.0)
    session.run(3.0)
    assert session.command("dog[1]", "forward", distance=1.0).reason == "busy"
    stop = session.command("dog[1]", "stop")
    assert ended(session, stop.request).status == "completed"
    assert [r.reason for r in session.receipts if r.request == walk.request] == ["preempted"]
    assert session.state.status == "standing"
    assert math.hypot(*session.state.velocity) < 0.15  # it is reported as standing while its trunk settles
    still = session.state.position
    session.run(20.0)
    assert session.state.position == pytest.approx(still, abs=0.03)


def stairs(rise: float, tread: float = 0.4) -> City:
    edges = (rectangle(3.0 + tread * k, -6.0, 30.0, 6.0) for k in range(5))
    steps = (Solid(id=f"step-{k}", polygon=edge, base_m=-0.2, top_m=rise * (k + 1)) for k, edge in enumerate(edges))
    return city_of(solids=tuple(steps))


def slope(angle_deg: float) -> City:
    rise = 4.0 * math.tan(math.radians(angle_deg))
    ramp = ((2.0, -6.0, 0.0), (6.0, -6.0, rise), (6.0, 6.0, rise), (2.0, 6.0, 0.0))
    deck = Solid(id="deck", polygon=rectangle(6.0, -6.0, 30.0, 6.0), base_m=-0.2, top_m=rise)
    return city_of(slopes=(Slope(id="ramp", top=ramp),), solids=(deck,))


KERB = city_of(solids=(Solid(id="kerb", polygon=rectangle(3.0, -6.0, 30.0, 6.0), base_m=-0.2, top_m=0.12),))

APPROACHES = [
    (80.0, 0.0),
    (89.5, 0.37),
    pytest.param(90.0, 0.0, marks=pytest.mark.thorough),
    pytest.param(95.0, 0.37, marks=pytest.mark.thorough),
]
"""Compass headings, and the extra distance of the start: the feet meet the edge in other phases of the gait."""


@pytest.mark.parametrize(("heading", "back"), APPROACHES)
@pytest.mark.parametrize(
    ("city", "top"),
    [
        pytest.param(KERB, 0.12, id="kerb"),
        pytest.param(stairs(0.12), 0.6, id="stairs"),
        pytest.param(stairs(0.12, 0.3), 0.6, id="steep-stairs"),
        pytest.param(slope(15.0), 4.0 * math.tan(math.radians(15.0)), id="slope"),
    ],
)
def test_a_robot_dog_climbs_kerbs_stairs_and_slopes_from_every_approach(play, city, top, heading, back):
    session = play(city, dog(x=-back, y=-0.5 * (6.0 + back) * math.tan(math.radians(90.0 - heading)), heading=heading))
    receipt = session.command("dog[1]", "forward", distance=10.0 + back)
    assert ended(session, receipt.request, limit_s=90.0).status == "completed"
    assert session.state.position[0] > 9.5
    assert 0.2 < session.state.position[2] - top < 0.4
    assert not [event for event in session.events if event.kind == "fell"]


def turned(city: City, angle_deg: float) -> City:
    """Return the city turned clockwise about its origin, to show that no result depends on the direction."""
    east, north = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))

    def there(x: float, y: float, *z: float) -> tuple[float, ...]:
        return (x * east + y * north, y * east - x * north, *z)

    solids = (msgspec.structs.replace(part, polygon=tuple(there(*at) for at in part.polygon)) for part in city.solids)
    slopes = (msgspec.structs.replace(part, top=tuple(there(*at) for at in part.top)) for part in city.slopes)
    return msgspec.structs.replace(city, solids=tuple(solids), slopes=tuple(slopes))


@pytest.mark.parametrize(
    ("heading", "turn"),
    [
        (80.0, 0.0),
        (89.5, 134.5),
        *(
            pytest.param(heading, turn, marks=pytest.mark.thorough)
            for heading, turn in ((90.0, 0.0), (95.0, 0.0), (90.0, 269.5))
        ),
    ],
)
@pytest.mark.parametrize(("city", "top"), [(stairs(0.14), 0.7), (slope(20.0), 4.0 * math.tan(math.radians(20.0)))])
def test_a_robot_dog_climbs_more_than_the_documented_limits(play, city, top, heading, turn):
    """The margin: steps and slopes above the documented 12 cm and 15 degrees, in every direction."""
    aside, angle = -3.0 * math.tan(math.radians(90.0 - heading)), math.radians(turn)
    start = dog(x=aside * math.sin(angle), y=aside * math.cos(angle), heading=(heading + turn) % 360.0)
    session = play(turned(city, turn), start)
    receipt = session.command("dog[1]", "forward", distance=10.0)
    assert ended(session, receipt.request, limit_s=120.0).status == "completed"
    assert 0.2 < session.state.position[2] - top < 0.4


@pytest.mark.parametrize("start", [0.0, 0.04, 0.08, 0.12])
def test_no_edge_is_missed_between_two_samples_of_the_terrain(play, start):
    """A rib narrower than the distance between two samples slows the dog before it, wherever the samples are."""
    rib = Solid(id="rib", polygon=rectangle(6.0, -6.0, 6.08, 6.0), base_m=-0.2, top_m=0.1)
    session = play(city_of(solids=(rib,)), dog(x=start, heading=90.0))
    receipt = session.command("dog[1]", "forward", distance=10.0)
    assert ended(session, receipt.request).status == "completed"
    states = [boundary.states[0] for boundary in session.history]
    free = [state.velocity[0] for state in states if 2.0 < state.position[0] < 4.0]
    before = [state.velocity[0] for state in states if 5.5 < state.position[0] < 6.0]
    assert min(free) > 1.2
    assert max(before) < 1.1


def test_a_walk_blocked_by_a_riser_steps_back_by_a_different_length_each_time():
    """A retry of the same length would meet the riser in the same phase of the gait, for ever."""
    there = dog_model.DogState((0.0, 0.0, 0.3), (0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    walk = tasks.WalkTask(x=0.0, y=0.0, yaw=0.0, length=10.0, cruise=1.5, climbing=True)
    ahead = [walk.wanted(there)[0] > 0.0 for _ in range(round(9.3 / tasks.PERIOD_S))]
    runs_s = [(forward, len(list(same)) * tasks.PERIOD_S) for forward, same in itertools.groupby(ahead)]
    assert [forward for forward, _ in runs_s] == [True, False] * 4 + [True]
    assert [length for _, length in runs_s[1:8:2]] == pytest.approx([0.7, 1.0, 0.5, 1.2], abs=2.5 * tasks.PERIOD_S)
    assert [length for _, length in runs_s[:8:2]] == pytest.approx([1.4] * 4, abs=2.5 * tasks.PERIOD_S)


def test_a_wall_stops_a_dog_and_is_named(play):
    house = Building(id="house-3", polygon=((4.0, -4.0), (9.0, -6.0), (11.0, 5.0), (4.0, 4.0)), base_m=0.0, top_m=12.0)
    session = play(city_of(buildings=(house,)), dog(heading=90.0))
    receipt = session.command("dog[1]", "forward", distance=20.0)
    end = ended(session, receipt.request)
    assert (end.status, end.reason) == ("rejected", "blocked")
    assert "house-3" in end.detail
    assert 3.2 < session.state.position[0] < 4.0
    (hit,) = (event for event in session.events if event.kind == "collided")
    assert hit.entities == ("dog[1]", "house-3")
    assert 0.5 < hit.values["speed_mps"] < 2.0


def test_a_parked_truck_stops_a_dog_until_the_truck_leaves(play):
    session = play(city_of(), dog(heading=90.0))
    receipt = session.command("dog[1]", "forward", distance=12.0)
    session.run(5.0, [truck(6.0, 0.0, heading=0.0)])
    assert session.state.position[0] < 6.0 - 1.25
    assert receipt.request not in {r.request for r in session.receipts if r.status != "running"}
    assert ended(session, receipt.request).status == "completed"
    assert session.state.position[0] == pytest.approx(12.0, abs=0.2)


def test_a_truck_that_stays_is_named(play):
    session = play(city_of(), dog(heading=90.0))
    receipt = session.command("dog[1]", "forward", distance=12.0)
    end = ended(session, receipt.request, [truck(6.0, 0.0, heading=0.0)])
    assert (end.status, end.reason) == ("rejected", "blocked")
    assert "traffic/7" in end.detail
    assert ("dog[1]", "traffic/7") in {event.entities for event in session.events if event.kind == "collided"}


def test_a_dog_hit_by_a_truck_falls_and_gets_up(play):
    session = play(city_of(), dog(heading=0.0))
    while session.time_s < 4.0:
        session.step([truck(-14.0 + 7.0 * session.time_s, 0.0, speed=7.0)])
        if any(event.kind == "fell" for event in session.events):
            break
    assert [event.kind for event in session.events] == ["collided", "fell"]
    assert session.events[0].values["speed_mps"] > 4.0
    assert session.state.status == "fallen"
    assert session.command("dog[1]", "forward", distance=3.0).reason == "fallen"
    session.run(6.0)
    assert session.state.status == "standing"
    receipt = session.command("dog[1]", "forward", distance=3.0)
    assert ended(session, receipt.request).status == "completed"


def test_water_and_drops_end_a_walk(play):
    river = Water(polygon=rectangle(6.0, -50.0, 12.0, 50.0), level_m=-1.0)
    session = play(city_of(waters=(river,)), dog(heading=90.0))
    receipt = session.command("dog[1]", "forward", distance=9.0)
    end = ended(session, receipt.request)
    assert (end.status, end.reason) == ("rejected", "unreachable")
    session.run(3.0)
    assert 4.0 < session.state.position[0] < 5.8
    assert session.state.status == "standing"

    pier = Solid(id="pier", polygon=rectangle(-3.0, -2.0, 40.0, 2.0), base_m=-3.0, top_m=1.0)
    session = play(city_of(waters=(river,), solids=(pier,)), dog(heading=90.0, z=1.0))
    assert ended(session, session.command("dog[1]", "forward", distance=9.0).request).status == "completed"

    session = play(city_of(lands=(Land(polygon=rectangle(-9.0, -9.0, 5.0, 9.0), top_m=2.0),)), dog(heading=90.0, z=2.0))
    assert session.state.position[2] > 2.2
    end = ended(session, session.command("dog[1]", "forward", distance=9.0).request)
    assert (end.reason, "drop" in end.detail) == ("unreachable", True)
    session.run(3.0)
    assert session.state.position[2] > 2.2


def test_dogs_in_one_simulation_block_each_other(play):
    session = play(city_of(), dog(1, y=0.0, heading=90.0), dog(2, y=2.0, heading=90.0), dog(3, x=5.0, heading=270.0))
    meet = session.command("dog[1]", "forward", distance=8.0)
    free = session.command("dog[2]", "forward", distance=8.0)
    assert ended(session, free.request).status == "completed"
    end = ended(session, meet.request)
    assert end.reason == "blocked"
    assert "dog[3]" in end.detail
    assert ("dog[1]", "dog[3]") in {event.entities for event in session.events}


def test_the_simulated_terrain_follows_a_long_walk(play):
    """New models are built on the way: the wall 150 m away is not in the first one, and stops the dog at the end."""
    wall = Solid(id="wall", polygon=rectangle(-5.0, 150.0, 5.0, 151.0), base_m=0.0, top_m=3.0)
    kerbs = tuple(
        Solid(id=f"post-{k}", polygon=rectangle(2.0, 3.0 * k, 2.5, 3.0 * k + 0.5), base_m=0.0, top_m=1.0)
        for k in range(60)
    )
    session = play(city_of(solids=(wall, *kerbs)), sync_s=0.5)
    receipt = session.command("dog[1]", "forward", distance=200.0)
    end = ended(session, receipt.request, limit_s=200.0)
    assert (end.reason, "wall" in end.detail) == ("blocked", True)
    assert session.state.position[:2] == pytest.approx((0.0, 149.5), abs=0.5)
    speeds = [boundary.states[0].velocity[1] for boundary in session.history if 5.0 < boundary.time_s < 90.0]
    assert sum(speeds) / len(speeds) == pytest.approx(1.5, rel=0.06)  # the policy's gait follows to within 4 %


@pytest.mark.parametrize("endurance", [8.1, 8.2, 8.3, 20.0])
def test_walking_uses_the_battery_and_ends_when_it_is_empty(play, endurance):
    session = play(city_of(), dog(properties={"endurance_s": endurance}))
    receipt = session.command("dog[1]", "forward", distance=100.0)
    end = ended(session, receipt.request)
    assert end.reason == "battery"
    assert end.time_s == pytest.approx(endurance, rel=0.1)
    assert session.state.resources == {"battery": 0.0, "battery_wh": 0.0}
    assert session.state.status == "dead"
    assert [event.kind for event in session.events] == ["battery_empty"]
    assert session.command("dog[1]", "left", angle=10.0).reason == "battery"
    session.run(3.0)
    assert session.state.position[2] < 0.14  # its belly is on the ground, in whatever stride the motors lost power


def test_a_load_slows_a_dog_and_increases_its_energy_use(play):
    def walk(load: float):
        carrier = dog(properties={"load_kg": 0.0, "payload_kg": 8.0}, state=(StateSpec(name="load", unit="kg"),))
        session = play(city_of(), carrier)
        shop = BodyState(id="shop", position=(0.0, 30.0, 0.0), resources={"load@dog[1]": load})
        receipt = session.command("dog[1]", "forward", distance=15.0)
        end = ended(session, receipt.request, [shop])
        assert end.status == "completed"
        assert session.state.resources["load_kg"] == load
        used = session.history[0].states[0].resources["battery_wh"] - session.state.resources["battery_wh"]
        return end.time_s, used / end.time_s

    (free_s, free_w), (loaded_s, _) = walk(0.0), walk(8.0)
    assert 1.25 * free_s < loaded_s < 1.9 * free_s
    slow = dog(properties={"speed_mps": 0.9})
    session = play(city_of(), slow)
    end = ended(session, session.command("dog[1]", "forward", distance=15.0).request)
    assert end.time_s == pytest.approx(loaded_s, rel=0.1)
    used = session.history[0].states[0].resources["battery_wh"] - session.state.resources["battery_wh"]
    assert walk(8.0)[1] > 1.15 * used / end.time_s
    assert free_w > used / end.time_s


def test_wrong_commands_are_refused(play):
    session = play(city_of())
    assert session.command("dog[1]", "forward").reason == "bad_argument"
    assert session.command("dog[1]", "forward", distance=-1.0).reason == "bad_argument"
    assert session.command("dog[1]", "left", angle=math.nan).reason == "bad_argument"
    assert session.command("dog[1]", "fly").reason == "unknown_verb"
    assert session.command("cat", "stop").reason == "unknown_resource"
    assert ended(session, session.command("dog[1]", "forward", distance=0.0).request).status == "completed"


def test_a_dormant_dog_appears_where_it_is_declared(player, instance_of):
    sleeper = dog(2, x=0.0, y=4.0, dormant=True)
    instance = instance_of((dog(1), sleeper), sync_s=0.5)
    instance = Instance(
        **{name: getattr(instance, name) for name in instance.__struct_fields__ if name != "events"},
        events=(EventSpec(name="deploy", tick=1, appear=("dog[2]",)),),
    )
    session = player(engine.QuadrupedEngine(), instance, city_of(), "quadruped")
    walk = session.command("dog[1]", "forward", distance=3.0)
    assert session.command("dog[2]", "forward", distance=3.0).reason == "dormant"
    assert session.boundary.states[1].status == "dormant"
    session.run(10.5)
    assert {r.request: r.status for r in session.receipts}[walk.request] == "completed"
    assert session.boundary.states[1].status == "standing"
    late = session.command("dog[2]", "forward", distance=3.0)
    assert ended(session, late.request).status == "completed"
    assert session.boundary.states[1].position[:2] == pytest.approx((0.0, 7.0), abs=0.15)


def test_conformance(instance_of):
    plugin = PluginHost().engine("quadruped")
    wall = Solid(id="wall", polygon=rectangle(-2.0, 6.0, 2.0, 7.0), base_m=0.0, top_m=2.0)
    commands = (
        Command(id="c0-1", tick=0, sender="me", resource="dog[1]", verb="forward", arguments={"distance": 20.0}),
        Command(id="c0-2", tick=0, sender="me", resource="dog[2]", verb="right", arguments={"angle": 120.0}),
    )
    instance = instance_of((dog(1), dog(2, x=6.0)), sync_s=0.5)
    check_engine(plugin, instance, city_of(solids=(wall,)), commands, mirrors=(truck(-8.0, 3.0, 1.0),), seconds=12.0)
