"""The vessel engine: speed, line keeping in current and wind, station keeping, land and waves."""

import math

import msgspec
import pytest
from pytest import approx

from lingjing.engines import sea
from lingjing.engines.vessel.engine import VesselEngine
from lingjing.mission.instance import EventSpec, StateSpec, Weather
from lingjing.scene.city import Bridge, Building, Land

ROUGH = Weather(
    wind_mps=10.0, wind_from_deg=300.0, wave_height_m=0.8, wave_period_s=5.0, current_mps=0.5, current_to_deg=60.0
)


@pytest.fixture
def sail(player, instance_of, boat, open_sea):
    def start(weather=None, city=open_sea, sync_s=0.5, **kwargs):
        return player(VesselEngine(), instance_of([boat(**kwargs)], weather, sync_s), city, "vessel")

    return start


def plane(state):
    return state.position[:2]


def test_a_vessel_makes_thirty_metres_per_tick_at_full_speed(sail):
    play = sail()
    play.command("boat", "moveTo", x=0.0, y=500.0)
    first = plane(play.run(10.0).states[0])
    second = plane(play.run(10.0).states[0])
    assert 22.0 < math.dist(first, (0.0, 0.0)) < 30.0
    assert 29.5 < math.dist(first, second) <= 30.1


def test_top_speed_is_through_the_water(sail):
    play = sail(Weather(current_mps=1.0, current_to_deg=0.0))
    play.command("boat", "moveTo", x=0.0, y=500.0)
    play.run(30.0)
    assert math.hypot(*play.state.velocity[:2]) == approx(4.0, abs=0.05)


@pytest.mark.parametrize("weather", [Weather(), ROUGH], ids=["calm", "rough"])
def test_a_vessel_keeps_its_line_and_arrives_within_six_metres(sail, weather):
    play = sail(weather)
    play.run(10.0)
    start = plane(play.state)
    receipt = play.command("boat", "moveTo", x=100.0, y=150.0)
    ended = play.until_ended(receipt.request, 200.0)
    assert ended.status == "completed"
    assert math.dist(plane(play.state), (100.0, 150.0)) < 6.0
    along = math.atan2(100.0 - start[0], 150.0 - start[1])
    off = [
        (b.states[0].position[0] - start[0]) * math.cos(along) - (b.states[0].position[1] - start[1]) * math.sin(along)
        for b in play.history
        if b.time_s > 10.0
    ]
    assert max(map(abs, off)) < 12.0
    assert [event.kind for event in play.events] == ["arrived"]


@pytest.mark.parametrize("weather", [Weather(), ROUGH], ids=["calm", "rough"])
def test_a_vessel_keeps_its_station_after_arrival(sail, weather):
    play = sail(weather)
    play.until_ended(play.command("boat", "moveTo", x=60.0, y=0.0).request, 200.0)
    play.run(60.0)
    away = [math.dist(plane(play.step().states[0]), (60.0, 0.0)) for _ in range(240)]
    assert max(away) < 8.0
    assert play.state.status == "idle"


def test_a_boat_without_orders_stays(sail):
    play = sail(ROUGH)
    play.run(300.0)
    assert math.dist(plane(play.state), (0.0, 0.0)) < 10.0


def test_progress_is_reported_at_decision_boundaries(sail):
    play = sail()
    play.command("boat", "moveTo", x=0.0, y=300.0)
    play.run(30.0)
    running = [(r.time_s, r.progress) for r in play.receipts if r.status == "running"]
    assert [time for time, _ in running] == [10.0, 20.0, 30.0]
    assert 0.0 < running[0][1] < running[1][1] < running[2][1] < 1.0


def test_a_second_order_is_busy_and_stop_pre_empts(sail):
    play = sail()
    first = play.command("boat", "moveTo", x=0.0, y=300.0)
    play.run(10.0)
    assert play.command("boat", "moveTo", x=50.0, y=0.0).reason == "busy"
    assert play.until_ended(play.command("boat", "stop").request).status == "completed"
    ended = {r.request: (r.status, r.reason) for r in play.receipts if r.status != "running"}
    assert ended[first.request] == ("rejected", "preempted")
    where = plane(play.state)
    assert math.dist(plane(play.run(60.0).states[0]), where) < 5.0


@pytest.mark.parametrize(
    ("verb", "arguments", "reason"),
    [
        ("moveTo", {"x": 0.0, "y": 0.0}, "unreachable"),
        ("moveTo", {"x": 100.0, "y": 0.0}, "unreachable"),
        ("moveTo", {"x": 9000.0, "y": 0.0}, "unreachable"),
        ("moveTo", {"x": 50.0}, "bad_argument"),
        ("moveTo", {"x": math.inf, "y": 0.0}, "bad_argument"),
        ("takeoff", {}, "unknown_verb"),
    ],
)
def test_impossible_commands_are_refused_with_a_reason(sail, quay, verb, arguments, reason):
    receipt = sail(city=quay, position=(0.0, -100.0, -3.5)).command("boat", verb, **arguments)
    assert (receipt.status, receipt.reason) == ("rejected", reason)
    assert receipt.detail


def test_a_place_outside_of_the_scene_is_not_called_land(sail, quay):
    play = sail(city=quay, position=(0.0, -100.0, -3.5))
    details = {x: play.command("boat", "moveTo", x=x, y=0.0).detail for x in (0.0, 9000.0)}
    assert details[0.0].endswith("is on land or too close to it")
    assert details[9000.0].endswith("lies outside of the scene's waters")


def test_a_vessel_stops_before_land_on_its_path(sail, quay):
    play = sail(city=quay, position=(0.0, -150.0, -3.5))
    receipt = play.command("boat", "moveTo", x=0.0, y=150.0)
    ended = play.until_ended(receipt.request)
    assert (ended.status, ended.reason) == ("rejected", "unreachable")
    play.run(60.0)
    assert max(b.states[0].position[1] for b in play.history) < -42.0
    assert play.state.status == "idle"


def test_a_vessel_placed_on_land_is_aground(sail, quay):
    play = sail(city=quay)
    assert play.state.status == "aground"
    assert play.command("boat", "moveTo", x=0.0, y=-100.0).reason == "aground"
    assert plane(play.run(10.0).states[0]) == (0.0, 0.0)


def test_land_under_water_is_no_obstacle(sail, quay):
    shoal = Land(polygon=((-50.0, 50.0), (50.0, 50.0), (50.0, 100.0), (-50.0, 100.0)), top_m=-6.0, surface="sand")
    play = sail(city=msgspec.structs.replace(quay, lands=(shoal,)))
    assert play.until_ended(play.command("boat", "moveTo", x=0.0, y=75.0).request).status == "completed"


def test_a_vessel_moves_with_the_waves_and_lies_still_without_waves(sail):
    calm = sail()
    calm.run(10.0)
    assert {b.states[0].position[2] for b in calm.history} == {-3.5}
    assert {(b.states[0].pitch_deg, abs(b.states[0].roll_deg)) for b in calm.history} == {(0.0, 0.0)}
    rough = sail(ROUGH)
    rough.run(60.0)
    heights = [b.states[0].position[2] + 3.5 for b in rough.history]
    assert 0.2 < max(heights) < 0.8
    assert -0.8 < min(heights) < -0.2
    assert max(abs(b.states[0].roll_deg) for b in rough.history) > 1.0


def test_vertical_velocity_is_the_rate_of_the_height(sail):
    play = sail(ROUGH, sync_s=0.1)
    play.command("boat", "moveTo", x=0.0, y=300.0)
    play.run(20.0)
    for a, b in zip(play.history[-50:], play.history[-49:], strict=False):
        rate = (b.states[0].position[2] - a.states[0].position[2]) / 0.1
        mean = 0.5 * (a.states[0].velocity[2] + b.states[0].velocity[2])
        assert rate == approx(mean, abs=0.03)


def test_head_seas_and_head_wind_slow_a_vessel_down(sail):
    speeds = []
    for towards in (300.0, 120.0):
        play = sail(Weather(wind_mps=10.0, wind_from_deg=300.0, wave_height_m=0.8))
        bearing = math.radians(towards)
        play.command("boat", "moveTo", x=400.0 * math.sin(bearing), y=400.0 * math.cos(bearing))
        play.run(60.0)
        speeds.append(math.hypot(*play.state.velocity[:2]))
    assert speeds[0] < speeds[1] - 0.05
    assert speeds[0] > 2.5


def test_the_sea_has_its_declared_significant_wave_height():
    waves = sea.waves(ROUGH)
    assert 4 <= len(waves) <= 6
    assert waves[0].amplitude_m == max(wave.amplitude_m for wave in waves)
    assert waves[0].direction_deg == 120.0
    samples = [sea.elevation(waves, 13.0 * k, 7.0 * k, 0.37 * k) for k in range(20_000)]
    deviation = math.sqrt(sum(value * value for value in samples) / len(samples))
    assert 4.0 * deviation == approx(0.8, rel=0.03)
    assert sea.waves(Weather()) == ()


def test_slope_and_rise_of_the_sea_are_derivatives_of_its_elevation():
    waves = sea.waves(ROUGH)
    x, y, t, step = 31.0, -77.0, 12.3, 1e-4
    east, north = sea.slope(waves, x, y, t)
    assert east == approx((sea.elevation(waves, x + step, y, t) - sea.elevation(waves, x - step, y, t)) / (2 * step))
    assert north == approx((sea.elevation(waves, x, y + step, t) - sea.elevation(waves, x, y - step, t)) / (2 * step))
    rise = (sea.elevation(waves, x, y, t + step) - sea.elevation(waves, x, y, t - step)) / (2 * step)
    assert sea.rise(waves, x, y, t) == approx(rise, rel=1e-5)


def test_a_vessel_passes_under_a_bridge_and_stops_before_its_pier(sail, open_sea):
    path = ((-100.0, 100.0, 8.0), (100.0, 100.0, 8.0))
    bridged = msgspec.structs.replace(open_sea, bridges=(Bridge(id="span", path=path, width_m=9.0),))
    between = sail(city=bridged, position=(0.0, 0.0, -3.5))
    assert between.until_ended(between.command("boat", "moveTo", x=0.0, y=200.0).request).status == "completed"
    against = sail(city=bridged, position=(16.7, 0.0, -3.5))
    ended = against.until_ended(against.command("boat", "moveTo", x=16.7, y=200.0).request)
    assert (ended.status, ended.reason) == ("rejected", "unreachable")
    against.run(30.0)
    assert against.state.position[1] < 95.0
    assert against.state.status == "idle"


def test_a_building_in_the_water_is_in_the_way(sail, open_sea):
    house = Building(id="h", polygon=((-5.0, 80.0), (5.0, 80.0), (5.0, 90.0), (-5.0, 90.0)), base_m=-4.0, top_m=9.0)
    play = sail(city=msgspec.structs.replace(open_sea, buildings=(house,)))
    assert play.command("boat", "moveTo", x=0.0, y=85.0).reason == "unreachable"


def test_sea_and_current_change_at_the_tick_of_their_event(player, instance_of, boat, open_sea):
    events = (EventSpec(name="front", tick=2, weather=ROUGH),)
    instance = msgspec.structs.replace(instance_of([boat()], Weather()), events=events)
    play = player(VesselEngine(), instance, open_sea, "vessel")
    play.run(19.5)
    assert play.state.position == (0.0, 0.0, -3.5)
    play.run(20.0)
    assert abs(play.state.position[2] + 3.5) > 0.01
    assert math.dist(plane(play.state), (0.0, 0.0)) > 0.3


def test_a_loaded_vessel_is_slower(player, instance_of, boat, open_sea):
    speeds = []
    for load_kg in (0.0, 1600.0):
        entity = boat()
        entity = msgspec.structs.replace(
            entity, properties={**entity.properties, "load_kg": load_kg}, state=(StateSpec(name="load", unit="kg"),)
        )
        play = player(VesselEngine(), instance_of([entity]), open_sea, "vessel")
        play.command("boat", "moveTo", x=0.0, y=500.0)
        play.run(40.0)
        assert play.state.resources["load_kg"] == load_kg
        speeds.append(play.state.velocity[1])
    assert speeds[1] == approx(speeds[0] * 2.0 ** (-2.0 / 9.0), rel=0.02)
