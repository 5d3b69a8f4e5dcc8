"""The plane engine on the real JSBSim: arrival, circling, fuel, climbs, crashes and repeatability."""

import math

import msgspec
import pytest
from pytest import approx

from lingjing.engines.fixed_wing import guidance
from lingjing.engines.fixed_wing.aeroplane import PlaneEngine
from lingjing.mission.instance import Entity, EventSpec, VerbSpec, Weather
from lingjing.scene.city import Building
from lingjing.testing import declared
from lingjing.trace.records import BodyState


def wing(index=1, position=(0.0, 0.0, 300.0), heading_deg=0.0, **properties):
    return declared(
        Entity(
            id=f"wing[{index}]",
            group="wing",
            index=index,
            role="asset",
            type="fixed_wing",
            engine="plane",
            position=position,
            heading_deg=heading_deg,
            properties={"cruise_mps": 40.0, "endurance_s": 14_400.0, **properties},
            verbs=(VerbSpec(name="setDestination"), VerbSpec(name="takePhoto")),
        )
    )


@pytest.fixture
def fly(player, instance_of, open_sea):
    def start(*wings, weather=None, city=open_sea, sync_s=0.5, seed=1, events=(), others=()):
        instance = instance_of([*(wings or (wing(),)), *others], weather, sync_s)
        return player(PlaneEngine(), msgspec.structs.replace(instance, events=events), city, "plane", seed)

    return start


def speeds(play):
    return [math.hypot(*boundary.states[0].velocity) for boundary in play.history]


@pytest.mark.parametrize(("height_m", "status"), [(1.4, "grounded"), (2.3, "grounded"), (12.0, "loitering")])
def test_an_aircraft_that_starts_in_the_air_flies(fly, height_m, status):
    play = fly(wing(position=(0.0, 0.0, -3.5 + height_m)))
    play.run(20.0)
    assert play.state.status == status and not play.events


def test_an_aeroplane_flies_to_its_destination_at_cruise_speed_and_circles_it(fly):
    play = fly()
    receipt = play.command("wing[1]", "setDestination", x=2000.0, y=1000.0, z=350.0)
    assert receipt.status == "accepted"
    ended = play.until_ended(receipt.request)
    assert ended.status == "completed"
    assert 50.0 < ended.time_s < 75.0  # 2236 m at 40 m/s and a turn
    assert math.dist(play.state.position[:2], (2000.0, 1000.0)) < 65.0
    assert [event.kind for event in play.events] == ["arrived"]
    assert min(speeds(play)) > 36.0 and max(speeds(play)) < 43.0
    play.run(60.0)
    assert play.state.status == "loitering"
    circle = guidance.circle_radius(40.0)
    laps = [play.step().states[0].position for _ in range(360)]
    away = [math.dist(place[:2], (2000.0, 1000.0)) for place in laps]
    assert max(abs(distance - circle) for distance in away) < 25.0
    assert max(abs(place[2] - 350.0) for place in laps) < 3.0


@pytest.mark.parametrize("goal", [(100.0, 0.0), (-150.0, 50.0), (0.0, -400.0), (0.0, 3.0)])
def test_a_destination_inside_the_turning_circle_is_reached(fly, goal):
    play = fly()
    receipt = play.command("wing[1]", "setDestination", x=goal[0], y=goal[1], z=300.0)
    assert play.until_ended(receipt.request, 150.0).status == "completed"
    assert math.dist(play.state.position[:2], goal) < 65.0


def test_an_aeroplane_without_a_command_circles_from_the_start(fly):
    play = fly(wing(heading_deg=90.0))
    assert play.boundary.states[0].status == "loitering"
    assert math.hypot(*play.boundary.states[0].velocity) == approx(40.0, abs=0.5)
    play.run(60.0)
    east, north, up = play.state.position
    assert math.dist((east, north), (0.0, -guidance.circle_radius(40.0))) == approx(
        guidance.circle_radius(40.0), abs=25
    )
    assert up == approx(300.0, abs=3.0)


@pytest.mark.parametrize("turbulence", [0.0, 0.2])
def test_an_aeroplane_keeps_its_circle_in_wind(fly, turbulence):
    play = fly(weather=Weather(wind_mps=10.0, wind_from_deg=220.0, turbulence=turbulence))
    play.until_ended(play.command("wing[1]", "setDestination", x=800.0, y=800.0, z=300.0).request)
    play.run(60.0)
    away = [math.dist(play.step().states[0].position[:2], (800.0, 800.0)) for _ in range(240)]
    assert max(away) < guidance.circle_radius(40.0) + 90.0
    assert min(away) > guidance.circle_radius(40.0) - 90.0


def test_a_parked_aircraft_is_launched_by_its_first_destination(fly, quay):
    play = fly(wing(position=(0.0, 0.0, 1.9)), city=quay)
    assert play.state.status == "grounded"
    assert play.run(10.0).states[0].position == (0.0, 0.0, 1.9)
    receipt = play.command("wing[1]", "setDestination", x=0.0, y=2000.0, z=150.0)
    assert play.until_ended(receipt.request, 200.0).status == "completed"
    assert min(boundary.states[0].position[2] for boundary in play.history) > 0.9
    assert play.events[-1].kind == "arrived"


def test_stop_makes_an_aeroplane_circle_at_its_position(fly):
    play = fly()
    first = play.command("wing[1]", "setDestination", x=0.0, y=5000.0, z=300.0)
    play.run(10.0)
    assert play.command("wing[1]", "setDestination", x=0.0, y=0.0, z=300.0).reason == "busy"
    stop = play.command("wing[1]", "stop")
    assert play.until_ended(stop.request).status == "completed"
    ended = {
        receipt.request: (receipt.status, receipt.reason) for receipt in play.receipts if receipt.status != "running"
    }
    assert ended[first.request] == ("rejected", "preempted")
    here = play.state.position
    play.run(120.0)
    assert math.dist(play.state.position[:2], here[:2]) < 2.2 * guidance.circle_radius(40.0)


def test_level_flight_uses_fuel_at_the_rate_of_the_declared_endurance(fly):
    play = fly(wing(endurance_s=3600.0))
    play.command("wing[1]", "setDestination", x=0.0, y=30_000.0, z=300.0)
    play.run(360.0)
    assert play.state.resources["fuel"] == approx(0.9, abs=0.01)


def test_an_aeroplane_without_fuel_glides_down_and_is_dead(fly):
    play = fly(wing(position=(0.0, 0.0, 120.0), endurance_s=20.0))
    receipt = play.command("wing[1]", "setDestination", x=0.0, y=1500.0, z=120.0)
    ended = play.until_ended(receipt.request)
    assert (ended.status, ended.reason) == ("rejected", "fuel")
    dry = play.time_s
    play.run(60.0)
    assert [event.kind for event in play.events] == ["fuel_empty"]
    assert play.state.status == "dead" and play.state.resources["fuel"] == 0.0
    glide = [b.states[0] for b in play.history if b.time_s > dry + 5.0 and b.states[0].velocity != (0.0, 0.0, 0.0)]
    assert max(-state.velocity[2] for state in glide) < 6.0
    assert play.state.position[2] == approx(-3.5, abs=2.0)
    assert play.command("wing[1]", "setDestination", x=0.0, y=0.0, z=300.0).reason == "fuel"


def test_climbing_costs_fuel(fly):
    def spent(weather, height):
        play = fly(weather=weather)
        play.command("wing[1]", "setDestination", x=0.0, y=9000.0, z=height)
        return play.state.resources["fuel_kg"] - play.run(60.0).states[0].resources["fuel_kg"]

    calm = spent(None, 300.0)
    assert spent(None, 450.0) > 1.2 * calm


def test_flying_into_a_tower_names_the_building(fly, quay):
    tower = Building(id="way/77", polygon=((-20, 900), (20, 900), (20, 940), (-20, 940)), base_m=0.0, top_m=400.0)
    play = fly(city=msgspec.structs.replace(quay, buildings=(tower,)))
    receipt = play.command("wing[1]", "setDestination", x=0.0, y=2500.0, z=300.0)
    ended = play.until_ended(receipt.request)
    assert (ended.status, ended.reason) == ("rejected", "collided")
    (hit,) = play.events
    assert (hit.kind, hit.entities) == ("collided", ("wing[1]", "way/77"))
    assert hit.values["speed_mps"] == approx(40.0, abs=2.0)
    play.run(20.0)
    assert play.state.status == "dead"


def test_an_aeroplane_collides_with_a_present_body_but_not_with_a_dormant_one(fly):
    bus = BodyState(id="traffic/3", kind="bus", position=(0.0, 300.0, 298.5), heading_deg=90.0)
    for status, hits in (("", [("wing[1]", "traffic/3")]), ("dormant", [])):
        play = fly()
        play.command("wing[1]", "setDestination", x=0.0, y=2000.0, z=300.0)
        play.run(15.0, [msgspec.structs.replace(bus, status=status)])
        assert [event.entities for event in play.events] == hits


def test_two_aeroplanes_that_collide_are_both_dead(fly):
    play = fly(wing(1), wing(2, (24.0, 1200.0, 300.0), heading_deg=180.0))  # each drifts 12 m to its right
    play.command("wing[1]", "setDestination", x=0.0, y=4000.0, z=300.0)
    play.command("wing[2]", "setDestination", x=24.0, y=-4000.0, z=300.0)
    play.run(60.0)
    assert [event.entities for event in play.events] == [("wing[1]", "wing[2]"), ("wing[2]", "wing[1]")]
    assert {state.status for state in play.boundary.states} == {"dead"}


@pytest.mark.parametrize(
    ("verb", "arguments", "reason"),
    [
        ("takeoff", {}, "unknown_verb"),
        ("setDestination", {"x": 1.0, "y": 2.0}, "bad_argument"),
        ("setDestination", {"x": math.nan, "y": 2.0, "z": 50.0}, "bad_argument"),
        ("setDestination", {"x": 0.0, "y": 0.0, "z": 10.0}, "unreachable"),
        ("setDestination", {"x": 100.0, "y": 0.0, "z": 70.0}, "unreachable"),
        ("setDestination", {"x": 1e7, "y": 0.0, "z": 300.0}, "fuel"),
    ],
)
def test_impossible_commands_are_refused_with_a_reason(fly, quay, verb, arguments, reason):
    receipt = fly(city=quay).command("wing[1]", verb, **arguments)
    assert (receipt.status, receipt.reason) == ("rejected", reason)
    assert receipt.detail and receipt.by == "plane"


def test_the_wind_changes_at_the_tick_of_its_event(fly):
    storm = EventSpec(name="front", tick=2, weather=Weather(wind_mps=12.0, wind_from_deg=0.0))
    calm, windy = fly(), fly(events=(storm,))
    for play in (calm, windy):
        play.command("wing[1]", "setDestination", x=0.0, y=9000.0, z=300.0)
        play.run(20.0)
    assert calm.state == windy.state
    for play in (calm, windy):
        play.run(20.0)
    assert windy.state.position[1] < calm.state.position[1] - 100.0


def test_a_flight_is_identical_when_repeated_and_with_other_macro_steps(fly):
    ends = []
    for sync_s in (0.5, 0.5, 0.25):
        play = fly(weather=Weather(wind_mps=6.0, turbulence=0.2), sync_s=sync_s)
        play.command("wing[1]", "setDestination", x=500.0, y=200.0, z=340.0)
        ends.append(play.run(20.0).states)
    assert ends[0] == ends[1] == ends[2]


def test_nothing_is_written_into_the_working_folder(fly, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fly().run(2.0)
    assert list(tmp_path.iterdir()) == []
