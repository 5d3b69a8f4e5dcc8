"""The satellite engine: published SGP4 results, the Earth's rotation, passes, views, and generated orbits."""

import math

import msgspec
import pytest
from pytest import approx

from lingjing.engines.satellite.earth import Horizon, earth_fixed, elevation_deg, sidereal
from lingjing.engines.satellite.engine import SatelliteEngine
from lingjing.engines.satellite.orbit import from_lines, instant
from lingjing.errors import UsageError
from lingjing.mission.instance import CameraSpec, Entity, Region, VerbSpec
from lingjing.plugins.geometry import mounted_camera_pose, world_to_pixel
from lingjing.scene.city import City
from lingjing.testing import declared
from lingjing.trace.records import BodyState

ISS = (
    "1 25544U 98067A   19343.69339541  .00001764  00000-0  38792-4 0  9991",
    "2 25544  51.6439 211.2001 0007417  17.6667  85.6398 15.50103472202482",
)
"""The example of the sgp4 library's own documentation."""

VALLADO = (
    "1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753",
    "2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667",
)
"""The first case of "Revisiting Spacetrack Report #3" (Vallado et al. 2006)."""


def satellite(index=1, **properties):
    return declared(
        Entity(
            id=f"eye[{index}]",
            group="eye",
            index=index,
            role="asset",
            type="satellite",
            engine="satellite",
            position=(0.0, 0.0, 550_000.0),
            properties={"swath_m": 20_000.0, "tle1": "", "tle2": "", "epoch": "", **properties},
            verbs=(VerbSpec(name="takePhoto"),),
        )
    )


@pytest.fixture
def watch(player, instance_of):
    def start(*satellites, regions=(), origin=(31.0, 121.5), sync_s=1.0, options=None):
        instance = instance_of(satellites or (satellite(),), None, sync_s)
        scene = msgspec.structs.replace(instance.scene, options=options or {})
        instance = msgspec.structs.replace(instance, regions=regions, scene=scene)
        city = City(id="plain", origin=origin, bounds=(-5e3, -5e3, 5e3, 5e3))
        return player(SatelliteEngine(), instance, city, "satellite")

    return start


def test_positions_are_those_of_the_published_verification():
    orbit = from_lines("v", *VALLADO)
    position, velocity = orbit.at(orbit.epoch)
    assert position == approx((7022.46529266, -1400.08296755, 0.03995155), abs=1e-6)
    assert velocity == approx((1.893841015, 6.405893759, 4.534807250), abs=1e-8)
    later, _ = orbit.at(orbit.epoch.later(360.0 * 60.0))
    assert later == approx((-7154.03120202, -3783.17682504, -3536.19412294), abs=1e-5)


def test_sidereal_time_is_that_of_the_almanac():
    # Meeus, Astronomical Algorithms, example 12.b: 1987 April 10, 19:21:00 UT, 8h34m57.0896s
    assert math.degrees(sidereal(instant("1987-04-10T19:21:00Z"))) == approx(128.7378734, abs=1e-6)


def test_the_iss_has_its_published_altitude_and_period():
    orbit = from_lines("iss", *ISS)
    heights, north = [], []
    for minute in range(200):
        (x, y, z), velocity = earth_fixed(orbit, orbit.epoch.later(60.0 * minute))
        heights.append(math.sqrt(x * x + y * y + z * z) - 6371.0)
        north.append(z)
        assert 7.0 < math.sqrt(sum(part * part for part in velocity)) < 7.5  # 7.66 km/s less Earth's rotation
    assert min(heights) > 405.0 and max(heights) < 440.0
    rising = [k for k in range(1, 200) if north[k - 1] < 0.0 <= north[k]]
    assert rising[1] - rising[0] == approx(92.9, abs=1.1)


def test_velocity_is_the_rate_of_the_position():
    orbit = from_lines("iss", *ISS)
    (before, _), (_, velocity), (after, _) = (earth_fixed(orbit, orbit.epoch.later(500.0 + dt)) for dt in (-1, 0, 1))
    assert [(b - a) / 2.0 for a, b in zip(before, after, strict=True)] == approx(velocity, abs=1e-4)


def test_a_point_above_a_place_is_at_its_zenith():
    place = Horizon.at(31.0, 121.5)
    above = tuple(p + 500.0 * u for p, u in zip(place.place, place.up, strict=True))
    assert place.relative(above) == approx((0.0, 0.0, 500.0), abs=1e-9)
    assert elevation_deg(place.relative(above)) == approx(90.0)
    assert math.dist(Horizon.at(0.0, 0.0).place, (6378.137, 0.0, 0.0)) < 1e-9
    assert math.dist(Horizon.at(90.0, 0.0).place, (0.0, 0.0, 6356.752314)) < 1e-5


@pytest.mark.parametrize(
    "origin", [(31.0, 121.5), (-33.9, 18.4), (0.0, 0.0), (60.2, 24.9), (78.2, 15.6), (85.0, -40.0)]
)
def test_a_satellite_without_elements_passes_over_the_origin_at_half_time(watch, origin):
    play = watch(origin=origin)
    play.run(300.0)  # of 600 s
    x, y, z = play.state.position
    assert math.hypot(x, y) < 4000.0  # geocentric and geodetic verticals differ by 0.2 degrees at most
    assert 520_000.0 < z < 590_000.0
    assert play.state.status == "in_view"
    assert play.state.resources["elevation_deg"] > 89.0
    assert math.hypot(*play.state.velocity) == approx(7600.0, abs=600.0)


def test_a_pass_is_announced_lasts_minutes_and_ends(watch):
    play = watch()
    announced = play.state.resources["next_pass_s"]
    assert 150.0 < announced < 250.0
    assert play.state.status == "out_of_view"
    play.run(600.0)
    begin, end = play.events
    assert (begin.kind, begin.entities, end.kind) == ("in_view", ("eye[1]",), "out_of_view")
    assert begin.time_s == math.ceil(announced)
    assert 180.0 < end.time_s - begin.time_s < 280.0
    for boundary in play.history:
        state = boundary.states[0]
        assert (state.status == "in_view") == (begin.time_s <= boundary.time_s < end.time_s)
        assert (state.resources["next_pass_s"] == 0.0) == (state.status == "in_view")
        assert state.status != "in_view" or state.resources["elevation_deg"] >= 30.0


def test_the_passes_of_several_satellites_without_elements_are_spread_over_the_episode(watch):
    play = watch(satellite(1), satellite(2))
    play.run(600.0)
    begins = {event.entities[0]: event.time_s for event in play.events if event.kind == "in_view"}
    assert begins["eye[2]"] - begins["eye[1]"] == approx(200.0, abs=5.0)


def test_a_narrow_swath_off_the_track_sees_nothing(watch):
    far = Region(name="far", polygon=((40e3, 0.0), (60e3, 0.0), (60e3, 20e3), (40e3, 20e3)))
    for swath_m, seen in ((20_000.0, False), (200_000.0, True)):
        play = watch(satellite(swath_m=swath_m), regions=(far,))
        play.run(300.0)
        assert (play.state.status == "in_view") is seen
        assert play.state.resources["elevation_deg"] > 80.0


def test_a_hidden_region_moves_nothing(watch):
    secret = Region(name="s", polygon=((3e3, 3e3), (4e3, 3e3), (4e3, 4e3)), hidden=True)
    assert watch(regions=(secret,)).state == watch().state


def test_pictures_are_refused_out_of_view_and_taken_in_view(watch):
    play = watch()
    refused = play.command("eye[1]", "takePhoto")
    assert (refused.status, refused.reason) == ("rejected", "not_in_view")
    assert "s" in refused.detail and refused.by == "satellite"
    play.run(300.0)
    receipt = play.command("eye[1]", "takePhoto")
    assert receipt.status == "accepted"
    assert play.until_ended(receipt.request, 310.0).status == "completed"
    assert play.command("eye[1]", "forward").reason == "unknown_verb"
    assert play.command("moon", "takePhoto").reason == "unknown_resource"


def test_the_camera_of_a_satellite_points_at_the_middle_of_the_regions(watch):
    area = Region(name="a", polygon=((0.0, -1000.0), (2000.0, -1000.0), (2000.0, 1000.0), (0.0, 1000.0)))
    play = watch(regions=(area,))
    camera = CameraSpec(
        name="wide", view="nadir", width=1000, height=1000, hfov_deg=1.0, channels=("rgb",), capture="on_request"
    )
    for _ in range(3):
        play.run(100.0)
        pose = mounted_camera_pose(play.state, camera, ())
        u, v, depth = world_to_pixel(pose, (1000.0, 0.0, 0.0))
        assert (u, v) == approx((500.0, 500.0), abs=4.0)
        assert depth == approx(play.state.resources["range_m"], rel=1e-3)


def test_an_orbit_starts_at_the_epoch_of_its_elements_or_at_a_declared_date(watch):
    plain = watch(satellite(tle1=ISS[0], tle2=ISS[1]))
    dated = watch(satellite(tle1=ISS[0], tle2=ISS[1], epoch="2019-12-09T16:38:29.363424Z"))
    assert math.dist(plain.state.position, dated.state.position) < 1.0
    hour = watch(satellite(tle1=ISS[0], tle2=ISS[1]), options={"epoch": "2019-12-09T17:38:29.363424+00:00"})
    assert math.dist(plain.state.position, hour.state.position) > 1e6
    assert plain.state.status == "below_horizon"
    assert -90.0 < plain.state.resources["elevation_deg"] < 0.0


def test_the_predicted_pass_of_the_iss_agrees_with_its_elevation(watch):
    play = watch(satellite(tle1=ISS[0], tle2=ISS[1], swath_m=4_000_000.0), origin=(40.0, -74.0), sync_s=10.0)
    wait = play.state.resources["next_pass_s"]
    assert 600.0 < wait < 86_400.0
    play.run(10.0 * (wait // 10.0))
    assert play.state.resources["elevation_deg"] < 30.0
    assert play.state.resources["next_pass_s"] == approx(wait % 10.0, abs=1e-6)
    assert play.step().states[0].status == "in_view"


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"tle1": ISS[0][:40], "tle2": ISS[1]}, "line 1 of the elements of `eye.1.` is not 69 characters"),
        ({"tle1": ISS[0], "tle2": ""}, "line 2 of the elements"),
        ({"tle1": ISS[0][:-1] + "0", "tle2": ISS[1]}, "has the checksum 0, its digits give 1"),
        ({"epoch": "next Tuesday"}, "`next Tuesday` is no epoch"),
    ],
)
def test_invalid_elements_and_dates_are_named(watch, wrong, words):
    with pytest.raises(UsageError, match=words) as caught:
        watch(satellite(**wrong))
    assert caught.value.hint


def test_the_length_of_macro_steps_does_not_change_the_orbit(watch):
    whole, half = watch(sync_s=1.0), watch(sync_s=0.5)
    whole.run(250.0)
    half.run(250.0)
    assert whole.state == half.state
    assert whole.events == half.events


def test_sgp4_is_imported_from_one_module():
    from pathlib import Path

    root = Path(__file__).parents[2] / "lingjing"
    assert [path.name for path in root.rglob("*.py") if "from sgp4" in path.read_text()] == ["orbit.py"]


def test_a_body_in_the_air_keeps_its_gimbal():
    camera = CameraSpec(
        name="n", view="nadir", width=100, height=100, hfov_deg=60.0, channels=("rgb",), capture="on_request"
    )
    pose = mounted_camera_pose(BodyState(id="uav", position=(0.0, 0.0, 100.0), pitch_deg=20.0), camera, ())
    assert (pose.tilt_deg, pose.position[2]) == (90.0, 99.9)
