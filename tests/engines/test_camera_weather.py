"""Weather in pictures of a city: fog, rain, dusk and night change colours, never ids and depth."""

from collections.abc import Iterator

import numpy as np
import pytest

from lingjing.engines.camera.light import light_of
from lingjing.mission.instance import EventSpec, Weather
from lingjing.plugins.engine import BodyState, Frame
from lingjing.scene.city import Building
from tests.engines.camera_town import CLASSES, WHY_NOT, CameraEngine, box, instance, look, ready, town

pytestmark = pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)
STREET = (-290.0, 0.0, 1.6), "front", 90.0
CLEAR = Weather(visibility_m=20_000.0, cloud=0.1)
RAIN = Weather(visibility_m=20_000.0, cloud=0.95, rain=0.8)
FOG = Weather(visibility_m=150.0, cloud=1.0)
NIGHT = Weather(visibility_m=20_000.0, cloud=0.1, sun_elevation_deg=-15.0)


@pytest.fixture(scope="module")
def engine() -> Iterator[CameraEngine]:
    made = CameraEngine()
    yield made
    made.close()


def street(engine: CameraEngine, weather: Weather) -> Frame:
    ready(engine, instance(weather=weather))
    return look(engine, *STREET)


def test_weather_changes_colours_and_nothing_else(engine: CameraEngine) -> None:
    clear = street(engine, CLEAR)
    for weather in (RAIN, FOG, NIGHT):
        other = street(engine, weather)
        assert np.mean(clear.rgb != other.rgb) > 0.5
        same = clear.semantic == other.semantic
        assert same.mean() > (0.97 if weather is FOG else 0.9999), "fog ends the drawn world earlier, no more"
        assert clear.depth is not None and other.depth is not None
        near = same & (clear.depth < 150.0)
        assert np.array_equal(clear.depth[near], other.depth[near])


def test_snow_covers_the_ground_only_with_weather_effects(engine: CameraEngine) -> None:
    frozen = Weather(visibility_m=20_000.0, cloud=0.1, ice=0.9)
    clear, bare = street(engine, CLEAR), street(engine, frozen)
    assert np.array_equal(clear.rgb, bare.rgb), "`ice` does nothing without `effects`"
    white = street(engine, Weather(visibility_m=20_000.0, cloud=0.1, ice=0.9, effects=True))
    flakes = street(engine, Weather(visibility_m=20_000.0, cloud=0.1, ice=0.9, rain=0.5, effects=True))
    assert clear.depth is not None and white.depth is not None and clear.semantic is not None
    near = (clear.depth < 60.0) & (clear.semantic == CLASSES["road"])
    assert np.array_equal(clear.depth[near], white.depth[near]) and np.array_equal(clear.semantic, white.semantic)
    assert white.rgb[near].mean() > clear.rgb[near].mean() + 40.0
    assert np.mean(white.rgb != flakes.rgb) > 0.05 and np.array_equal(white.semantic, flakes.semantic)


def test_fog_takes_contrast_with_distance(engine: CameraEngine) -> None:
    clear, fog = street(engine, CLEAR), street(engine, FOG)
    assert clear.depth is not None

    def contrast(frame: Frame, near: float, far: float) -> float:
        assert clear.depth is not None
        return float(frame.rgb[(clear.depth > near) & (clear.depth < far)].astype(float).mean(axis=1).std())

    assert contrast(fog, 0.0, 30.0) > 0.35 * contrast(clear, 0.0, 30.0)
    assert contrast(fog, 150.0, 400.0) < 0.15 * contrast(clear, 150.0, 400.0)


def test_night_is_dark_with_lit_windows(engine: CameraEngine) -> None:
    day, night = street(engine, CLEAR), street(engine, NIGHT)
    assert night.rgb.mean() < 0.45 * day.rgb.mean()
    block = Building(id="b", polygon=box(-270, 10, -150, 40), base_m=0.0, top_m=40.0, levels=12, facade="curtain")
    ready(engine, instance(weather=NIGHT), town(buildings=(block,), props=()))
    lit = look(engine, (-210.0, -30.0, 20.0), "front")
    assert (lit.rgb.max(axis=2) > 140).mean() > 0.02
    assert (lit.rgb.max(axis=2) < 70).mean() > 0.3


def test_vehicles_have_lights_at_night(engine: CameraEngine) -> None:
    car = BodyState(id="traffic/1", kind="car", position=(-270.0, 0.0, 0.0), heading_deg=90.0)
    ready(engine, instance(weather=NIGHT))
    frame = look(engine, *STREET, mirrors=(car,))
    red = frame.rgb.astype(int)
    assert ((red[..., 0] > 110) & (red[..., 0] > 2 * red[..., 1])).any(), "its tail lights"


def test_rain_wets_the_street_and_falls(engine: CameraEngine) -> None:
    dry = street(engine, Weather(visibility_m=20_000.0, cloud=0.95))
    wet = street(engine, RAIN)
    assert wet.rgb[-40:].mean() < dry.rgb[-40:].mean()
    later = look(engine, *STREET, time_s=10.5)
    assert np.mean(later.rgb != wet.rgb) > 0.02 and np.array_equal(later.semantic, wet.semantic)


def test_the_weather_of_an_event_is_seen_from_its_tick_on(engine: CameraEngine) -> None:
    ready(engine, instance(weather=CLEAR, events=(EventSpec(name="front", tick=3, weather=FOG),)))
    before, after = look(engine, *STREET, time_s=20.0), look(engine, *STREET, time_s=30.0)
    ready(engine, instance(weather=FOG))
    assert np.array_equal(look(engine, *STREET, time_s=30.0).rgb, after.rgb)
    assert np.mean(before.rgb != after.rgb) > 0.5


def test_light_fades_without_steps() -> None:
    suns = np.arange(60.0, -20.0, -0.5)
    lights = [light_of(Weather(sun_elevation_deg=float(sun)), 50.0) for sun in suns]
    sky = np.array([sum(light.skylight) + sum(light.haze) for light in lights])
    assert np.abs(np.diff(sky)).max() < 0.2 and sky[-1] < 0.2 * sky[0]
    assert [light.dark for light in lights] == sorted(light.dark for light in lights)
    assert lights[0].dark == 0.0 and lights[-1].dark == 1.0 and not lights[0].lamps and lights[-1].lamps


def test_fog_is_thinner_for_a_camera_in_orbit() -> None:
    weather = Weather(visibility_m=5_000.0)
    low, high = light_of(weather, 100.0), light_of(weather, 550e3)
    assert high.fog * 550e3 < low.fog * 1600.0
