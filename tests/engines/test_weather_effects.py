"""Weather with `effects`: size and direction of its effects on drivers, dogs, boats and pictures; off by default."""

import math
from collections.abc import Callable, Iterator

import msgspec
import numpy as np
import pytest
from pytest import approx

from lingjing.engines.quadruped.engine import QuadrupedEngine
from lingjing.engines.quadruped.wind_load import wind_force
from lingjing.engines.road.driving_conditions import DRY_DAY, driving_conditions
from lingjing.engines.vessel.engine import VesselEngine
from lingjing.mission.instance import EventSpec, Weather
from lingjing.scene.city import City, Land
from tests.engines.camera_town import CLASSES, WHY_NOT, CameraEngine, Frame, entity, instance, look, ready
from tests.engines.test_camera_weather import STREET
from tests.engines.test_quadruped import city_of, dog, rectangle
from tests.engines.test_road_engine import Play, grid, mission, vehicle

DAY = Weather(visibility_m=10_000.0)
SHAPES = {
    "rain": msgspec.structs.replace(DAY, rain=1.0),
    "drizzle": msgspec.structs.replace(DAY, rain=0.01),
    "ice": msgspec.structs.replace(DAY, ice=1.0),
    "fog": msgspec.structs.replace(DAY, visibility_m=300.0),
    "thick": msgspec.structs.replace(DAY, visibility_m=25.0),
    "night": msgspec.structs.replace(DAY, sun_elevation_deg=-20.0),
}


def acting(weather: Weather) -> Weather:
    return msgspec.structs.replace(weather, effects=True)


# -- drivers


@pytest.mark.parametrize(
    ("name", "speed", "headway", "grip"),
    [
        ("rain", 0.75, 1.165, 0.875),
        ("drizzle", 0.8985, 1.001, 0.999),
        ("ice", 0.60, 1.289, 0.25),
        ("fog", 0.89, 1.117, 1.0),
        ("night", 0.97, 1.0, 1.0),
    ],
)
def test_drivers_slow_down_keep_away_and_brake_as_published(
    name: str, speed: float, headway: float, grip: float
) -> None:
    now = driving_conditions(acting(SHAPES[name]))
    assert (now.speed_share, now.headway_share, now.grip) == approx((speed, headway, grip), abs=1e-3)


def test_a_driver_can_stop_within_sight() -> None:
    now = driving_conditions(acting(SHAPES["thick"]))
    assert 2.5 * now.sight_mps + now.sight_mps**2 / (2.0 * 3.4) == approx(25.0)
    assert driving_conditions(acting(SHAPES["night"])).sight_mps > 16.0


def test_without_effects_and_on_a_dry_day_nothing_changes() -> None:
    assert all(driving_conditions(weather) == DRY_DAY for weather in SHAPES.values())
    dry = driving_conditions(acting(DAY))
    assert (dry.speed_share, dry.headway_share, dry.grip) == (1.0, 1.0, 1.0) and dry.sight_mps > 200.0


@pytest.fixture(scope="module")
def city() -> City:
    return grid()


@pytest.fixture
def drive(city: City) -> Iterator[Callable[..., Play]]:
    plays: list[Play] = []

    def start(weather: Weather, traffic: int = 0, events: tuple[EventSpec, ...] = ()) -> Play:
        for old in plays:
            old.engine.close()
        instance_ = msgspec.structs.replace(mission([vehicle()], traffic=traffic, events=events), weather=weather)
        plays.append(Play(instance_, city))
        return plays[-1]

    yield start
    for old in plays:
        old.engine.close()


def speed_and_braking(played: Play) -> tuple[float, float]:
    """Return the cruising speed of the van (m/s), and the length of its braking after `stop` (m)."""
    played.command("setDestination", x=700.0, y=0.0)
    played.run(25.0)
    cruise = math.hypot(*played.state.velocity)
    before = played.state.position[0]
    stop = played.command("stop")
    assert played.until_ended(stop.request).status == "completed"
    return cruise, played.state.position[0] - before


def test_a_vehicle_drives_slower_in_rain_and_brakes_longer_on_ice(drive: Callable[..., Play]) -> None:
    dry, dry_m = speed_and_braking(drive(DAY))
    assert speed_and_braking(drive(SHAPES["ice"])) == approx((dry, dry_m))
    rain, _ = speed_and_braking(drive(acting(SHAPES["rain"])))
    assert rain == approx(0.75 * dry, abs=0.1)
    ice, ice_m = speed_and_braking(drive(acting(SHAPES["ice"])))
    assert ice == approx(0.60 * dry, abs=0.1)
    # A quarter of the friction leaves a quarter of the comfortable braking of 4.5 m/s^2.
    assert ice_m == approx(ice * ice / (2.0 * 4.5 / 4.0), rel=0.05)
    assert dry_m == approx(dry * dry / (2.0 * 2.0), rel=0.05)
    fog, _ = speed_and_braking(drive(acting(SHAPES["thick"])))
    assert fog == approx(driving_conditions(acting(SHAPES["thick"])).sight_mps, abs=0.2) and fog < 7.1


def test_background_traffic_slows_with_a_front_and_recovers(drive: Callable[..., Play]) -> None:
    rain, dry = acting(SHAPES["rain"]), acting(DAY)
    events = (
        EventSpec(name="front", tick=6, weather=rain, weather_fields=("rain",)),
        EventSpec(name="end", tick=12, weather=dry, weather_fields=("rain",)),
    )
    played = drive(dry, 40, events)

    def fastest(seconds: float) -> float:
        bodies = [body for _ in range(round(seconds / 0.5)) for body in played.step().ambient]
        return max(math.hypot(*body.velocity[:2]) for body in bodies)

    before = fastest(60.0)
    played.run(15.0)
    during = fastest(45.0)
    played.run(15.0)
    after = fastest(45.0)
    assert during == approx(0.75 * before, abs=0.4) and after == approx(before, abs=0.4)


# -- wind


def test_the_force_of_the_wind_has_its_direction_and_the_size_of_the_drag_area() -> None:
    east, north = wind_force((20.0, 0.0, 0.0), (0.0, 0.0, 0.0), math.pi / 2)  # from abeam
    at_trunk = 20.0 * math.log(10.0) / math.log(1000.0 / 3.0)
    assert at_trunk == approx(7.93, abs=0.01)
    assert (east, north) == (approx(0.5 * 1.225 * 1.1 * 0.5 * 0.28 * at_trunk**2), approx(0.0, abs=1e-9))
    ahead, _ = wind_force((20.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)
    assert 0.4 < ahead / east < 0.6
    assert wind_force((20.0, 0.0, 0.0), (8.0, 0.0, 0.0), 0.0)[0] < 0.0  # it walks faster than the air at its trunk


def gale(from_deg: float, speed_mps: float = 32.0) -> Weather:
    return Weather(wind_mps=speed_mps, wind_from_deg=from_deg)


@pytest.fixture
def dog_track(player, instance_of) -> Callable[..., np.ndarray]:
    yard = city_of(lands=(Land(polygon=rectangle(-50, -50, 50, 50), top_m=0.0),))

    def track(weather: Weather, steps: int, walk_m: float = 0.0) -> np.ndarray:
        play = player(QuadrupedEngine(), instance_of([dog()], weather, 0.5), yard, "quadruped")
        if walk_m:
            play.command("dog[1]", "forward", distance=walk_m)
        return np.array([play.step().states[0].position[:2] for _ in range(steps)])

    return track


def test_a_gale_pushes_a_walking_dog_downwind_before_it_corrects(dog_track: Callable[..., np.ndarray]) -> None:
    """The dog walks north; the wind comes from the west, from the east and from ahead."""
    calm = dog_track(Weather(), 6, 12.0)
    assert np.array_equal(dog_track(gale(270.0), 6, 12.0), calm)
    assert 0.02 < (dog_track(acting(gale(270.0)), 6, 12.0) - calm)[:3, 0].mean() < 0.2
    assert -0.2 < (dog_track(acting(gale(90.0)), 6, 12.0) - calm)[:3, 0].mean() < -0.02
    assert (dog_track(acting(gale(0.0)), 6, 12.0) - calm)[-1, 1] < -0.02


def test_a_standing_dog_stands_in_a_gale_and_not_in_a_tornado(dog_track: Callable[..., np.ndarray]) -> None:
    assert np.abs(dog_track(acting(gale(270.0)), 10)).max() < 0.01
    assert dog_track(acting(gale(270.0, 120.0)), 10)[-1, 0] > 0.3


def test_gusts_push_a_boat_and_are_seeded(player, instance_of, boat, open_sea) -> None:
    def track(weather: Weather, seed: int) -> np.ndarray:
        play = player(VesselEngine(), instance_of([boat()], weather, 0.5), open_sea, "vessel", seed)
        return np.array([play.step().states[0].position[:2] for _ in range(240)])

    weather = Weather(wind_mps=12.0, wind_from_deg=270.0, turbulence=0.5)
    steady, same = track(weather, 1), track(weather, 2)
    assert np.array_equal(steady, same)  # without effects no gusts
    first, again, second = track(acting(weather), 1), track(acting(weather), 1), track(acting(weather), 2)
    assert np.array_equal(first, again) and not np.array_equal(first, second)
    assert np.abs(first - steady).max() > 0.2
    assert first[:40, 0].mean() > 0.0  # downwind


# -- pictures


@pytest.fixture(scope="module")
def camera() -> Iterator[CameraEngine]:
    if WHY_NOT:
        pytest.skip(WHY_NOT)
    engine = CameraEngine()
    yield engine
    engine.close()


def test_nothing_beyond_the_visibility_has_a_depth_a_class_or_a_box(camera: CameraEngine) -> None:
    fog = Weather(visibility_m=120.0)
    cars = entity("near", "car", (-230.0, 0.0, 0.0)), entity("far", "car", (-130.0, 8.0, 0.0))

    def taken(weather: Weather) -> Frame:
        ready(camera, instance(*cars, weather=weather))
        return look(camera, *STREET)

    plain, veiled = taken(fog), taken(acting(fog))
    assert plain.depth is not None and veiled.depth is not None
    assert plain.semantic is not None and veiled.semantic is not None
    assert np.array_equal(plain.rgb, veiled.rgb)
    beyond = plain.depth > 120.0
    assert 0.05 < beyond.mean() < 0.95
    assert np.isinf(veiled.depth[beyond]).all() and (veiled.semantic[beyond] == CLASSES["sky"]).all()
    assert np.array_equal(veiled.depth[~beyond], plain.depth[~beyond])
    assert np.array_equal(veiled.semantic[~beyond], plain.semantic[~beyond])
    assert [box.entity for box in plain.info.boxes] == ["near", "far"]
    assert [box.entity for box in veiled.info.boxes] == ["near"]


def test_the_visibility_reveals_no_hidden_target(camera: CameraEngine) -> None:
    """A hidden target stands before a wall that is just beyond the visibility, and within it."""
    target = entity("goal", "fire_source", (-230.0, 0.0, 0.0), hidden=("position",))
    target = msgspec.structs.replace(target, role="target")
    for visibility_m in (40.0, 70.0, 200.0):
        pictures = []
        for others in ((), (target,)):
            ready(camera, instance(*others, weather=acting(Weather(visibility_m=visibility_m))))
            pictures.append(look(camera, *STREET))
        assert np.array_equal(pictures[0].semantic, pictures[1].semantic)
        assert not np.array_equal(pictures[0].rgb, pictures[1].rgb)
