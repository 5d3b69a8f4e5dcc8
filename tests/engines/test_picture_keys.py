"""Keys of pictures: equal keys mean equal pictures, and moving things out of sight are no part of a key."""

import math
import random
from collections.abc import Iterator

import numpy as np
import pytest

from lingjing.mission.instance import Weather
from lingjing.plugins.conformance import EngineCase, check_capture
from lingjing.plugins.engine import BodyState, CaptureRequest, Frame, KeyedPictures
from lingjing.testing import PluginHost
from tests.engines.camera_town import WHY_NOT, CameraEngine, entity, instance, ready, town

pytestmark = pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)

OTHERS = (("car", "car"), ("boat", "boat"), ("dog", "quadruped"), ("wing", "quadrotor"), ("fire", "fire_source"))
WEATHERS = {
    "noon": Weather(sun_azimuth_deg=180.0),
    "evening": Weather(sun_azimuth_deg=250.0, sun_elevation_deg=7.0),
    "rainy night": Weather(sun_azimuth_deg=180.0, sun_elevation_deg=-15.0, rain=0.6),
}
States = dict[str, BodyState]


@pytest.fixture(scope="module")
def engine() -> Iterator[CameraEngine]:
    camera = CameraEngine()
    yield camera
    camera.close()


def set_scene(engine: CameraEngine, weather: str) -> None:
    others = (entity(name, kind, (0.0, 0.0, 0.0)) for name, kind in OTHERS)
    ready(engine, instance(*others, weather=WEATHERS[weather]))


def state(name: str, east: float, north: float, up: float = 0.0, **more: object) -> BodyState:
    return BodyState(id=name, position=(east, north, up), **{"heading_deg": 0.0, **more})


def request(engine: CameraEngine, view: str, states: States, time_s: float = 10.0) -> CaptureRequest:
    """Return the request for a picture of the uav, after the engine has received the states."""
    engine.advance(time_s, list(states.values()))
    return CaptureRequest(frame="f", entity="uav", camera=view, tick=1, time_s=time_s)


def key(engine: CameraEngine, view: str, states: States, time_s: float = 10.0) -> bytes:
    return engine.picture_key(request(engine, view, states, time_s))


def picture(engine: CameraEngine, view: str, states: States) -> Frame:
    (frame,) = engine.capture([request(engine, view, states)])
    return frame


def alike(first: Frame, second: Frame) -> bool:
    layers = ((first.rgb, second.rgb), (first.depth, second.depth), (first.semantic, second.semantic))
    return first.info == second.info and all(np.array_equal(a, b) for a, b in layers if a is not None and b is not None)


@pytest.mark.parametrize("weather", WEATHERS)
def test_pictures_with_equal_keys_are_equal(engine: CameraEngine, weather: str) -> None:
    set_scene(engine, weather)
    chance = random.Random(4)

    def somewhere(name: str) -> BodyState:
        away, turn = abs(chance.gauss(0.0, 120.0)), chance.uniform(0.0, 2.0 * math.pi)
        up = chance.uniform(5.0, 90.0) if name == "wing" else 0.0
        speed = (chance.uniform(-8.0, 8.0), chance.uniform(-8.0, 8.0), 0.0)
        heading = chance.uniform(0.0, 360.0)
        return state(name, away * math.cos(turn), away * math.sin(turn), up, heading_deg=heading, velocity=speed)

    equal = other = 0
    while equal < 8 or other < 4:
        view = chance.choice(("nadir", "front", "oblique"))
        uav = state("uav", 0.0, -20.0, chance.uniform(20.0, 80.0), heading_deg=chance.uniform(0.0, 360.0))
        states = {"uav": uav, **{name: somewhere(name) for name, _ in OTHERS}}
        moved = {name: somewhere(name) for name, _ in chance.sample(OTHERS, chance.choice((1, 2)))}
        if key(engine, view, states) != key(engine, view, {**states, **moved}):
            other += 1
            continue
        equal += 1
        assert alike(picture(engine, view, states), picture(engine, view, {**states, **moved}))


@pytest.fixture
def scene(engine: CameraEngine) -> States:
    set_scene(engine, "noon")
    far = {name: state(name, 3000.0, 3000.0) for name, _ in OTHERS}
    return {**far, "uav": state("uav", 0.0, 0.0, 60.0), "car": state("car", -20.0, 0.0)}


def test_visible_changes_are_part_of_the_key(engine: CameraEngine, scene: States) -> None:
    before = key(engine, "nadir", scene)
    assert before == key(engine, "nadir", scene)
    for changed in (
        state("car", -20.1, 0.0),
        state("car", -20.0, 0.0, heading_deg=1.0),
        state("uav", 0.0, 0.0, 60.1),
        state("dog", 10.0, 0.0),
        state("dog", 3000.0, 3000.0),
    ):
        same = scene[changed.id] == changed
        assert (key(engine, "nadir", {**scene, changed.id: changed}) == before) is same
    assert key(engine, "nadir", scene, time_s=20.0) != before
    assert key(engine, "front", scene) != before


def test_changes_out_of_sight_are_no_part_of_the_key(engine: CameraEngine, scene: States) -> None:
    before = key(engine, "nadir", scene)
    for changed in (state("dog", -900.0, 0.0), state("boat", 900.0, -100.0, velocity=(6.0, 0.0, 0.0))):
        assert key(engine, "nadir", {**scene, changed.id: changed}) == before


def test_a_visible_shadow_is_part_of_the_key_even_if_its_body_is_out_of_sight(
    engine: CameraEngine, scene: States
) -> None:
    high_m, sun = 40.0, WEATHERS["noon"].sun_elevation_deg
    south_m = high_m / math.tan(math.radians(sun))
    states = {**scene, "uav": state("uav", -60.0, 20.0, 15.0), "wing": state("wing", -60.0, 20.0 - south_m, high_m)}
    beside = {**states, "wing": state("wing", -59.0, 20.0 - south_m, high_m)}
    assert not alike(picture(engine, "nadir", states), picture(engine, "nadir", beside))
    assert key(engine, "nadir", states) != key(engine, "nadir", beside)


def test_the_camera_conforms_to_the_contract_of_picture_keys(engine: CameraEngine) -> None:
    assert isinstance(engine, KeyedPictures)
    others = (entity(name, kind, (0.0, 0.0, 0.0)) for name, kind in OTHERS)
    check_capture(EngineCase(PluginHost().engine("camera"), instance(*others), town()))
