"""The multirotor engine on the real JSBSim: arrival, hovering, wind, battery, crashes and repeatability."""

import hashlib
import math
import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import msgspec
import pytest

from lingjing.engines.multirotor.drone import MultirotorEngine
from lingjing.engines.multirotor.power import hover_power
from lingjing.mission.instance import Entity, EventSpec, StateSpec, Weather
from lingjing.scene.city import Building
from lingjing.trace.records import BodyState

HERE = Path(__file__)
LOAD = StateSpec(name="load", unit="kg")


@pytest.fixture
def fly(player, instance_of, uav, open_sea):
    def start(weather=None, city=open_sea, sync_s=0.5, seed=1, **kwargs):
        instance = instance_of([uav(**kwargs)], weather, sync_s)
        return player(MultirotorEngine(), instance, city, "multirotor", seed)

    return start


def wind(speed, turbulence=0.0):
    return Weather(wind_mps=speed, wind_from_deg=220.0, turbulence=turbulence)


@pytest.mark.parametrize(("speed", "turbulence"), [(0.0, 0.0), (4.0, 0.1), (10.0, 0.1)])
def test_a_multirotor_arrives_within_two_metres_and_holds_its_position_in_wind(fly, speed, turbulence):
    play = fly(wind(speed, turbulence))
    receipt = play.command("uav[1]", "setDestination", x=150.0, y=80.0, z=60.0)
    assert receipt.status == "accepted"
    assert play.until_ended(receipt.request).status == "completed"
    goal = (150.0, 80.0, 60.0)
    assert math.dist(play.state.position, goal) < 2.0
    assert [event.kind for event in play.events] == ["arrived"]
    play.run(10.0)  # settle
    away = [math.dist(play.step().states[0].position, goal) for _ in range(60)]
    assert max(away) < 0.3
    assert play.state.status == "hovering"


@pytest.mark.parametrize(
    ("speed", "turbulence", "word", "least_m", "most_m"),
    [(0.0, 0.0, "hovering", 0.0, 0.1), (14.0, 0.3, "hovering", 0.5, 3.0), (25.0, 0.0, "drifting", 300.0, 900.0)],
)
def test_a_vehicle_that_the_wind_carries_away_drifts(fly, speed, turbulence, word, least_m, most_m):
    play = fly(wind(speed, turbulence), position=(0.0, 0.0, 80.0))
    states = [play.step().states[0] for _ in range(240)]
    assert least_m <= max(math.dist(state.position, (0.0, 0.0, 80.0)) for state in states) < most_m
    assert {state.status for state in states[20:]} == {word}


def test_a_vehicle_without_a_command_hovers_again_after_the_gale(fly, uav, instance_of, player, open_sea):
    gale = EventSpec(name="gale", tick=1, weather=wind(25.0), weather_fields=("wind_mps",))
    calm = EventSpec(name="calm", tick=3, weather=wind(0.0), weather_fields=("wind_mps",))
    instance = msgspec.structs.replace(instance_of([uav(position=(0.0, 0.0, 80.0))], wind(0.0)), events=(gale, calm))
    play = player(MultirotorEngine(), instance, open_sea, "multirotor")
    words = [play.step().states[0].status for _ in range(200)]
    assert words[0] == words[-1] == "hovering" and "drifting" in words
    assert math.dist(play.state.position, (0.0, 0.0, 80.0)) < 0.5


def test_a_multirotor_flies_263_metres_at_cruise_speed_without_overshoot(fly):
    play = fly(wind(4.0), position=(0.0, 0.0, 100.0))
    receipt = play.command("uav[1]", "setDestination", x=263.0, y=0.0, z=100.0)
    assert 20.0 < play.until_ended(receipt.request).time_s < 35.0
    speeds = [math.hypot(*boundary.states[0].velocity) for boundary in play.history]
    assert 11.5 < max(speeds) < 12.8
    steps = [abs(b - a) / 0.5 for a, b in pairwise(speeds)]
    assert max(steps) < 4.0
    play.run(5.0)
    assert max(boundary.states[0].position[0] for boundary in play.history) < 263.5
    assert max(abs(boundary.states[0].position[1]) for boundary in play.history) < 2.0


def test_takeoff_has_a_status_word_for_each_phase(fly, quay):
    play = fly(city=quay)
    assert play.state.status == "grounded"
    receipt = play.command("uav[1]", "takeoff")
    play.run(1.0)
    assert play.state.status == "moving"
    assert play.until_ended(receipt.request).status == "completed"
    assert play.state.status == "hovering"
    assert play.run(10.0).states[0].position[2] == pytest.approx(11.1, abs=0.3)
    assert play.command("uav[1]", "takeoff").reason == "airborne"


def test_a_flight_from_the_ground_climbs_first(fly, quay):
    play = fly(city=quay)
    play.command("uav[1]", "setDestination", x=0.0, y=200.0, z=50.0)
    play.run(40.0)
    left = next(b.states[0].position for b in play.history if b.states[0].position[1] > 2.0)
    assert left[2] > 8.0
    assert play.state.heading_deg == pytest.approx(0.0, abs=2.0) or play.state.heading_deg > 358.0


@pytest.mark.parametrize(
    ("verb", "moved"),
    [
        ("forward", (20.0, 0.0, 0.0)),
        ("backward", (-20.0, 0.0, 0.0)),
        ("left", (0.0, 20.0, 0.0)),
        ("right", (0.0, -20.0, 0.0)),
        ("up", (0.0, 0.0, 20.0)),
        ("down", (0.0, 0.0, -20.0)),
    ],
)
def test_moves_are_metres_relative_to_the_heading_and_keep_it(fly, uav, instance_of, player, open_sea, verb, moved):
    entity = msgspec.structs.replace(uav(position=(10.0, 20.0, 80.0)), heading_deg=90.0)
    play = player(MultirotorEngine(), instance_of([entity]), open_sea, "multirotor")
    receipt = play.command("uav[1]", verb, distance=20.0)
    play.until_ended(receipt.request)
    play.run(5.0)
    wanted = tuple(a + b for a, b in zip((10.0, 20.0, 80.0), moved, strict=True))
    assert math.dist(play.state.position, wanted) < 0.3
    assert play.state.heading_deg == pytest.approx(90.0, abs=1.0)


def test_stop_brakes_and_pre_empts(fly):
    play = fly(position=(0.0, 0.0, 100.0))
    first = play.command("uav[1]", "setDestination", x=500.0, y=0.0, z=100.0)
    play.run(10.0)
    before = play.state.position[0]
    assert play.command("uav[1]", "forward", distance=10.0).reason == "busy"
    stop = play.command("uav[1]", "stop")
    assert play.until_ended(stop.request).status == "completed"
    ended = {receipt.request: receipt for receipt in play.receipts if receipt.status != "running"}
    assert (ended[first.request].status, ended[first.request].reason) == ("rejected", "preempted")
    play.run(5.0)
    assert math.hypot(*play.state.velocity) < 0.1
    assert 20.0 < play.state.position[0] - before < 60.0


def test_wind_costs_energy_on_a_round_trip(fly):
    spent = []
    for weather in (wind(0.0), wind(8.0)):
        play = fly(weather, position=(0.0, 0.0, 100.0))
        for x, y in ((-160.0, -190.0), (0.0, 0.0)):  # into the wind and back
            play.until_ended(play.command("uav[1]", "setDestination", x=x, y=y, z=100.0).request)
        spent.append(play.history[0].states[0].resources["battery_wh"] - play.state.resources["battery_wh"])
    assert spent[1] > 1.1 * spent[0]


def test_hovering_uses_the_battery_at_the_rate_of_the_declared_endurance(fly):
    play = fly(position=(0.0, 0.0, 100.0), endurance_s=600.0)
    full = play.state.resources["battery_wh"]
    assert full == pytest.approx(hover_power() * 600.0 / 3600.0)
    play.run(60.0)
    assert play.state.resources["battery"] == pytest.approx(0.9, abs=0.005)


def test_a_multirotor_with_an_empty_battery_descends_and_is_dead(fly):
    play = fly(position=(0.0, 0.0, 30.0), endurance_s=20.0)
    receipt = play.command("uav[1]", "setDestination", x=100.0, y=0.0, z=30.0)
    play.run(10.0)
    other = play.command("uav[1]", "stop")
    assert (receipt.status, other.status) == ("accepted", "accepted")
    play.run(40.0)
    assert [event.kind for event in play.events] == ["battery_empty"]
    assert play.state.status == "dead"
    assert play.state.resources["battery"] == 0.0
    assert play.state.position[2] == pytest.approx(-3.5, abs=0.3)
    assert play.state.velocity == (0.0, 0.0, 0.0)
    refused = play.command("uav[1]", "takeoff")
    assert (refused.status, refused.reason) == ("rejected", "battery")


def test_a_battery_that_ends_on_the_way_ends_the_request(fly):
    play = fly(position=(0.0, 0.0, 30.0), endurance_s=20.0)
    receipt = play.command("uav[1]", "setDestination", x=300.0, y=0.0, z=30.0)
    ended = play.until_ended(receipt.request)
    assert (ended.status, ended.reason) == ("rejected", "battery")


def test_flying_into_a_tower_is_a_collision_and_a_fall(fly, quay):
    play = fly(city=quay, position=(60.0, 0.0, 30.0))
    receipt = play.command("uav[1]", "setDestination", x=160.0, y=0.0, z=30.0)
    ended = play.until_ended(receipt.request)
    assert (ended.status, ended.reason) == ("rejected", "collided")
    assert [(event.kind, event.entities) for event in play.events] == [("collided", ("uav[1]", "tower"))]
    assert play.state.position[0] == pytest.approx(94.7, abs=0.5)
    play.run(10.0)
    assert play.state.status == "dead"
    assert play.state.position[2] == pytest.approx(-3.5)
    assert play.command("uav[1]", "stop").reason == "dead"


def test_two_multirotors_that_collide_are_both_dead(player, instance_of, uav, open_sea):
    pair = [uav(1, (0.0, 0.0, 50.0)), uav(2, (100.0, 0.0, 50.0)), uav(3, (50.0, 10.0, 50.0))]
    play = player(MultirotorEngine(), instance_of(pair), open_sea, "multirotor")
    play.command("uav[1]", "setDestination", x=100.0, y=0.0, z=50.0)
    play.command("uav[2]", "setDestination", x=0.0, y=0.0, z=50.0)
    play.run(20.0)
    assert [event.entities for event in play.events] == [("uav[1]", "uav[2]"), ("uav[2]", "uav[1]")]
    assert [state.status for state in play.boundary.states] == ["dead", "dead", "hovering"]


def test_a_multirotor_with_an_empty_battery_lands_on_the_roof_below(fly, quay):
    play = fly(city=quay, position=(100.0, 0.0, 90.0), endurance_s=5.0)
    play.run(40.0)
    assert play.state.status == "dead"
    assert play.state.position[2] == pytest.approx(60.0, abs=0.5)


@pytest.mark.parametrize(
    ("verb", "arguments", "reason"),
    [
        ("dance", {}, "unknown_verb"),
        ("setDestination", {"x": 1.0, "y": 2.0}, "bad_argument"),
        ("setDestination", {"x": 1.0, "y": 2.0, "z": "high"}, "bad_argument"),
        ("setDestination", {"x": math.nan, "y": 2.0, "z": 50.0}, "bad_argument"),
        ("setDestination", {"x": 0.0, "y": 0.0, "z": -3.0}, "unreachable"),
        ("setDestination", {"x": 100.0, "y": 0.0, "z": 30.0}, "unreachable"),
        ("setDestination", {"x": 1e6, "y": 0.0, "z": 50.0}, "battery"),
        ("forward", {"distance": -5.0}, "bad_argument"),
        ("takeoff", {"altitude": 0.0}, "bad_argument"),
    ],
)
def test_impossible_commands_are_refused_with_a_reason(fly, quay, verb, arguments, reason):
    receipt = fly(city=quay).command("uav[1]", verb, **arguments)
    assert (receipt.status, receipt.reason) == ("rejected", reason)
    assert receipt.detail
    assert receipt.by == "multirotor"


def test_moves_on_the_ground_and_unknown_vehicles_are_rejected(fly, quay):
    play = fly(city=quay)
    assert play.command("uav[1]", "forward", distance=5.0).reason == "grounded"
    assert play.command("uav[2]", "takeoff").reason == "unknown_resource"


def test_progress_is_reported_at_decision_boundaries(fly):
    play = fly(position=(0.0, 0.0, 50.0))
    play.command("uav[1]", "setDestination", x=300.0, y=0.0, z=50.0)
    play.run(25.0)
    running = [(receipt.time_s, receipt.progress) for receipt in play.receipts if receipt.status == "running"]
    assert [time for time, _ in running] == [10.0, 20.0]
    assert 0.2 < running[0][1] < running[1][1] < 0.9


def test_position_is_the_integral_of_velocity_over_two_kilometres(fly):
    play = fly(wind(4.0, 0.2), position=(0.0, 0.0, 100.0), sync_s=0.02)
    play.command("uav[1]", "setDestination", x=1500.0, y=1400.0, z=100.0)
    reckoned = list(play.state.position)
    before = play.state.velocity
    for _ in range(round(190.0 / 0.02)):
        now = play.step().states[0].velocity
        for axis in range(3):
            reckoned[axis] += 0.01 * (before[axis] + now[axis])
        before = now
    assert math.dist(play.state.position, (1500.0, 1400.0, 100.0)) < 2.0
    assert math.dist(reckoned, play.state.position) < 0.01


def test_the_length_of_macro_steps_does_not_change_a_flight(fly):
    ends = []
    for sync_s in (0.1, 0.5):
        play = fly(wind(4.0, 0.2), sync_s=sync_s)
        play.command("uav[1]", "setDestination", x=50.0, y=20.0, z=40.0)
        ends.append(play.run(20.0).states)
    assert ends[0] == ends[1]


def test_a_macro_step_between_control_steps_reports_the_state_at_its_own_time(fly):
    play = fly(position=(0.0, 0.0, 50.0), sync_s=0.25)
    play.command("uav[1]", "setDestination", x=100.0, y=0.0, z=50.0)
    play.run(6.25)
    assert play.boundary.time_s == 6.25
    east = [boundary.states[0].position[0] for boundary in play.history[-3:]]
    assert east[2] - east[1] == pytest.approx(0.25 * play.state.velocity[0], abs=0.05)


SCRIPT = """
import importlib.util, sys
spec = importlib.util.spec_from_file_location("multirotor_flight", sys.argv[1])
module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
print(module.flight())
"""


def flight():
    """Return a digest of two turbulent flights, on which two processes must agree."""
    sys.path.insert(0, str(HERE.parents[2]))
    from lingjing.scene.city import City, Water
    from lingjing.testing import EngineRun, square
    from tests.conftest import build_instance, build_uav

    sea = City(
        id="sea",
        origin=(31.0, 121.5),
        bounds=(-5e3, -5e3, 5e3, 5e3),
        waters=(Water(polygon=square(0.0, 0.0, 5e3), level_m=-3.5),),
    )
    vehicles = [build_uav(1), build_uav(2, (8.0, 0.0, 1.1))]
    play = EngineRun(MultirotorEngine(), build_instance(vehicles, wind(6.0, 0.2)), sea, "multirotor", 7)
    play.command("uav[1]", "setDestination", x=120.0, y=60.0, z=80.0)
    play.command("uav[2]", "takeoff")
    play.run(30.0)
    return hashlib.sha256(msgspec.msgpack.encode(play.history)).hexdigest()


def test_flights_in_two_processes_are_bit_equal():
    digests = []
    for hash_seed in ("1", "2"):
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT, str(HERE)],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "PYTHONHASHSEED": hash_seed},
            cwd="/",
        )
        assert done.stderr == ""
        digests.append(done.stdout)
    assert len(digests[0]) == 65  # silent apart from the digest
    assert digests[0] == digests[1]


def test_gusts_depend_on_the_seed(fly):
    places = []
    for seed in (1, 2):
        play = fly(wind(8.0, 0.3), position=(0.0, 0.0, 50.0), seed=seed)
        places.append(play.run(5.0).states[0].position)
    assert places[0] != places[1]


def tower(**more):
    outline = ((90.0, -10.0), (110.0, -10.0), (110.0, 10.0), (90.0, 10.0))
    return Building(**{"id": "way/4711", "polygon": outline, "base_m": 0.0, "top_m": 60.0, **more})


@pytest.fixture
def street(quay):
    return msgspec.structs.replace(quay, solids=(), buildings=(tower(),))


def test_flying_into_a_building_names_both(fly, street):
    play = fly(city=street, position=(60.0, 0.0, 30.0))
    ended = play.until_ended(play.command("uav[1]", "setDestination", x=160.0, y=0.0, z=30.0).request)
    assert (ended.status, ended.reason) == ("rejected", "collided")
    (hit,) = play.events
    assert (hit.kind, hit.entities) == ("collided", ("uav[1]", "way/4711"))
    assert hit.values["speed_mps"] > 5.0
    assert play.command("uav[1]", "setDestination", x=100.0, y=0.0, z=30.0).reason == "dead"


def test_a_courtyard_is_free_to_fly_in(fly, street):
    yard = ((93.0, -7.0), (107.0, -7.0), (107.0, 7.0), (93.0, 7.0))
    open_city = msgspec.structs.replace(street, buildings=(tower(holes=(yard,)),))
    play = fly(city=open_city, position=(100.0, 0.0, 90.0))
    receipt = play.command("uav[1]", "setDestination", x=100.0, y=0.0, z=20.0)
    assert play.until_ended(receipt.request).status == "completed"


def test_a_multirotor_takes_off_from_a_roof_and_lands_on_one_without_a_collision(fly, street):
    play = fly(city=street, position=(100.0, 0.0, 60.1))
    assert play.state.status == "grounded"
    assert play.until_ended(play.command("uav[1]", "takeoff").request).status == "completed"
    low = fly(city=street, position=(100.0, 0.0, 75.0), endurance_s=5.0)
    low.run(40.0)
    assert [event.kind for event in low.events] == ["battery_empty"]  # no crash
    assert low.state.status == "dead"
    assert low.state.position[2] == pytest.approx(60.0, abs=0.3)


@pytest.mark.parametrize(
    ("height_m", "status"),
    [(0.2, "grounded"), (1.1, "grounded"), (1.3, "hovering"), (5.0, "hovering"), (7.0, "hovering")],
)
def test_a_multirotor_that_starts_in_the_air_hovers(fly, street, height_m, status):
    """Regression: at 5 m over bare ground it was grounded in the air for the whole episode."""
    for x, surface_m in ((0.0, 0.9), (100.0, 60.0)):
        play = fly(city=street, position=(x, 0.0, surface_m + height_m))
        play.run(20.0)
        assert play.state.status == status and not play.events
        assert play.state.position[2] == pytest.approx(surface_m + height_m, abs=0.2)


def truck(position, **more):
    return BodyState(id="traffic/17", kind="truck", position=position, heading_deg=90.0, **more)


def test_a_multirotor_collides_with_a_truck_on_its_path(fly, quay):
    play = fly(city=quay, position=(0.0, 0.0, 3.0))
    play.command("uav[1]", "setDestination", x=30.0, y=0.0, z=3.0)
    for step in range(20):  # it comes from the east at 5 m/s
        play.step([truck((40.0 - 2.5 * step, 0.0, 0.9), velocity=(-5.0, 0.0, 0.0))])
    assert [(event.kind, event.entities) for event in play.events][-1] == ("collided", ("uav[1]", "traffic/17"))


@pytest.mark.parametrize(
    "body", [truck((20.0, 0.0, -3.5)), truck((20.0, 5.0, 0.9)), truck((20.0, 0.0, 0.9), status="dormant")]
)
def test_a_multirotor_does_not_collide_with_a_truck_below_beside_or_dormant(fly, quay, body):
    play = fly(city=quay, position=(0.0, 0.0, 3.0))
    play.command("uav[1]", "setDestination", x=30.0, y=0.0, z=3.5)
    play.run(30.0, [body])
    assert [event.kind for event in play.events] == ["arrived"]


@pytest.mark.parametrize(
    ("role", "sizes", "aside_m", "hit"),
    [
        ("asset", {}, 0.0, True),
        ("asset", {}, 1.0, False),
        ("asset", {"length_m": 4.0, "width_m": 3.0, "height_m": 2.0}, 1.0, True),
        ("target", {}, 0.0, False),
    ],
)
def test_assets_of_unknown_types_are_obstacles_and_targets_of_unknown_types_are_not(
    player, instance_of, uav, open_sea, role, sizes, aside_m, hit
):
    crane = Entity(
        id="crane", group="crane", index=1, role=role, type="crane", engine="yard", position=(20.0, 0.0, 30.0),
        properties=sizes,
    )  # fmt: skip
    instance = instance_of([uav(position=(0.0, 0.0, 30.0))])
    instance = msgspec.structs.replace(instance, entities=(*instance.entities, crane))
    play = player(MultirotorEngine(), instance, open_sea, "multirotor", 5)
    play.command("uav[1]", "setDestination", x=40.0, y=0.0, z=30.2)
    play.run(20.0, [BodyState(id="crane", position=(20.0, aside_m, 30.0), heading_deg=90.0)])
    assert [event.kind for event in play.events] == ["collided" if hit else "arrived"]


BLIMP = {"length_m": 20.0, "width_m": 8.0, "height_m": 8.0, "origin": "middle"}


@pytest.mark.parametrize(
    ("more", "aside_m", "above_m", "hit"),
    [
        ({}, 9.0, 0.0, True),  # half of its length, whichever way it points
        ({}, 11.0, 0.0, False),
        ({}, 0.0, 3.5, True),
        ({}, 0.0, 4.8, False),
        ({"origin": "base"}, 0.0, 7.5, True),
        ({"origin": "base"}, 0.0, -1.0, False),
        ({"shape": "none"}, 0.0, 0.0, False),
    ],
)
def test_collisions_in_a_fleet_use_the_declared_sizes(player, instance_of, uav, open_sea, more, aside_m, above_m, hit):
    blimp = uav(index=1, position=(20.0, aside_m, 60.0))
    blimp = msgspec.structs.replace(blimp, properties={**blimp.properties, **BLIMP, **more})
    small = uav(index=2, position=(0.0, 0.0, 60.0 + above_m))
    play = player(MultirotorEngine(), instance_of([blimp, small]), open_sea, "multirotor", 5)
    play.command("uav[2]", "setDestination", x=40.0, y=0.0, z=60.0 + above_m)
    play.run(20.0)
    events = [(event.kind, event.entities) for event in play.events]
    crash = [("collided", ("uav[1]", "uav[2]")), ("collided", ("uav[2]", "uav[1]"))]
    assert events == (crash if hit else [("arrived", ("uav[2]",))])


def test_a_flying_multirotor_collides_with_a_parked_one(player, instance_of, uav, quay):
    parked = uav(index=1, position=(20.0, 0.0, 1.1), **{**BLIMP, "height_m": 12.0, "origin": "base"})
    flier = uav(index=2, position=(0.0, 0.0, 8.0))
    play = player(MultirotorEngine(), instance_of([parked, flier]), quay, "multirotor", 5)
    assert play.boundary.states[0].status == "grounded"
    play.command("uav[2]", "setDestination", x=40.0, y=0.0, z=8.0)
    play.run(20.0)
    hits = [event.entities for event in play.events if event.kind == "collided"]
    assert hits == [("uav[1]", "uav[2]"), ("uav[2]", "uav[1]")]
    assert {state.status for state in play.boundary.states} == {"dead"}


def test_a_wide_multirotor_collides_with_a_building_beside_its_path(fly, street):
    assert [event.kind for event in _past_the_tower(fly(city=street, position=(60.0, 16.0, 30.0))).events] == [
        "arrived"
    ]
    wide = fly(city=street, position=(60.0, 16.0, 30.0), length_m=14.0, width_m=14.0, height_m=2.0)
    assert [event.kind for event in _past_the_tower(wide).events] == ["collided"]


def _past_the_tower(play):
    play.command("uav[1]", "setDestination", x=140.0, y=16.0, z=30.0)
    play.run(20.0)
    return play


def energy(player, instance_of, uav, city, weather, events=(), **more):
    instance = instance_of([uav(position=(0.0, 0.0, 100.0), **more)], weather)
    play = player(MultirotorEngine(), msgspec.structs.replace(instance, events=events), city, "multirotor", 5)
    full = play.state.resources["battery_wh"]
    play.command("uav[1]", "setDestination", x=200.0, y=100.0, z=100.0)
    play.run(60.0)
    return full - play.state.resources["battery_wh"], play


def test_gusts_cost_energy(player, instance_of, uav, open_sea):
    def mean(weather):  # a gust helps or hinders by chance, so several flights show its mean cost
        fleet = [uav(index=number, position=(0.0, 100.0 * number, 100.0)) for number in range(1, 6)]
        play = player(MultirotorEngine(), instance_of(fleet, weather), open_sea, "multirotor", 5)
        full = sum(state.resources["battery_wh"] for state in play.boundary.states)
        play.run(100.0)
        return (full - sum(state.resources["battery_wh"] for state in play.boundary.states)) / len(fleet)

    assert mean(wind(8.0, 0.4)) > 1.01 * mean(wind(8.0))


def test_the_wind_changes_at_the_tick_of_its_event_and_not_before(player, instance_of, uav, open_sea):
    front = EventSpec(name="front", tick=3, weather=wind(14.0, 0.2))
    calm, quiet = energy(player, instance_of, uav, open_sea, wind(0.0))
    stormy, storm = energy(player, instance_of, uav, open_sea, wind(0.0), (front,))
    before, after = 60, 61  # macro-steps of half a second: 30 s is boundary 3
    assert quiet.history[before].states == storm.history[before].states
    assert quiet.history[after].states != storm.history[after].states
    assert stormy > 1.05 * calm


def test_a_load_reduces_speed_and_endurance(player, instance_of, uav, open_sea):
    def flight(load_kg):
        entity = msgspec.structs.replace(uav(position=(0.0, 0.0, 100.0), load_kg=load_kg), state=(LOAD,))
        play = player(MultirotorEngine(), instance_of([entity]), open_sea, "multirotor")
        assert play.state.resources["load_kg"] == load_kg
        full = play.state.resources["battery_wh"]
        ended = play.until_ended(play.command("uav[1]", "setDestination", x=300.0, y=0.0, z=100.0).request)
        return ended.time_s, full - play.state.resources["battery_wh"]

    light, heavy = flight(0.0), flight(0.8)
    assert heavy[0] > 1.1 * light[0]
    assert heavy[1] > 1.3 * light[1]


def test_the_load_follows_the_accounts_of_other_engines_and_an_overload_is_rejected(player, instance_of, uav, open_sea):
    entity = msgspec.structs.replace(uav(position=(0.0, 0.0, -3.0), load_kg=0.2), state=(LOAD,))
    play = player(MultirotorEngine(), instance_of([entity]), open_sea, "multirotor")
    depot = BodyState(id="depot", position=(0.0, 0.0, 0.0), resources={"load@uav[1]": 0.5, "load@uav[2]": 9.0})
    play.run(0.5, [depot])
    assert play.state.resources["load_kg"] == pytest.approx(0.7)
    assert play.command("uav[1]", "takeoff").status == "accepted"
    play.until_ended("c0-1")
    play.run(0.5, [msgspec.structs.replace(depot, resources={"load@uav[1]": 5.0})])
    assert play.command("uav[1]", "forward", distance=5.0).reason == "overloaded"
    play.run(0.5, [msgspec.structs.replace(depot, resources={"load@uav[1]": -0.2})])
    assert play.state.resources["load_kg"] == 0.0


def steer(play, east, north, up, **more):
    return play.command("uav[1]", "steer", east=east, north=north, up=up, **more)


def test_a_set_point_flies_at_a_velocity_until_the_next_one_and_zero_holds_the_place(fly):
    play = fly(wind(6.0), position=(0.0, 0.0, 50.0), sync_s=0.05)
    assert steer(play, 5.0, -3.0, 1.0, heading=200.0).status == "accepted"
    play.run(8.0)
    assert math.dist(play.state.velocity, (5.0, -3.0, 1.0)) < 0.3
    assert play.state.heading_deg == pytest.approx(200.0, abs=3.0) and play.state.status == "moving"
    assert steer(play, 60.0, 0.0, -9.0).status == "accepted"
    play.run(10.0)
    assert math.hypot(*play.state.velocity[:2]) == pytest.approx(12.0, abs=0.6), "no faster than its cruise speed"
    assert play.state.velocity[2] == pytest.approx(-3.0, abs=0.3)
    steer(play, 0.0, 0.0, 0.0)
    play.run(12.0)
    place = play.state.position
    play.run(10.0)
    assert math.dist(play.state.position, place) < 0.3 and play.state.status == "hovering"


def test_set_points_take_off_again_after_a_landing(fly, quay):
    play = fly(city=quay)
    assert play.state.status == "grounded"
    assert steer(play, 3.0, 0.0, 0.0).reason == "grounded"
    for _ in range(2):
        assert steer(play, 0.0, 0.0, 2.0).status == "accepted"
        play.run(6.0)
        assert play.state.position[2] > 5.0
        steer(play, 0.3, 0.0, 0.0)
        play.run(4.0)
        assert play.command("uav[1]", "land").status == "accepted"
        play.run(25.0)
        assert play.state.status == "grounded" and play.state.velocity == (0.0, 0.0, 0.0)
        assert play.state.position[2] == pytest.approx(1.1, abs=0.3)
    assert not [event for event in play.events if event.kind == "collided"]


def test_a_multirotor_that_lands_on_water_is_dead(fly):
    play = fly(position=(0.0, 0.0, 20.0))
    play.command("uav[1]", "land")
    play.run(30.0)
    assert play.state.status == "dead"


def test_a_set_point_during_a_request_is_rejected_and_stop_ends_a_set_point(fly):
    play = fly(position=(0.0, 0.0, 50.0))
    play.command("uav[1]", "setDestination", x=100.0, y=0.0, z=50.0)
    assert steer(play, 1.0, 0.0, 0.0).reason == "busy"
    assert play.until_ended(play.command("uav[1]", "stop").request).status == "completed"
    steer(play, 0.0, 5.0, 0.0)
    play.run(5.0)
    assert play.until_ended(play.command("uav[1]", "stop").request).status == "completed"
    assert math.hypot(*play.state.velocity) < 0.5
