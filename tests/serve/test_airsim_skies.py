"""Weather and time of day of a free flight: the sun, compared with an almanac, and the effects in pictures."""

from __future__ import annotations

import io
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest
from PIL import Image

from lingjing.plugins.engine import PictureWeather
from lingjing.serve.airsim.skies import FOG, RAIN, ROAD_SNOW, SNOW, Skies, SunClock, local_time, sun_angles
from lingjing.testing import run_command
from tests.serve.conftest import Serve
from tests.serve.test_airsim_client import airsim, connected, leave, loop, rpc_error

__all__ = ["loop"]
HERE = (31.0, 121.5)


@pytest.mark.parametrize(
    ("place", "moment", "azimuth", "elevation"),
    [
        # the solstice and the equinox have a known declination: 23.44 degrees (21 June 2020, 21:44 UTC) and 0
        ((23.44, 0.0), datetime(2020, 6, 21, 12, 2, tzinfo=UTC), None, 90.0),
        ((51.5, 0.0), datetime(2020, 12, 21, 11, 58, tzinfo=UTC), 180.0, 90.0 - 51.5 - 23.44),
        ((0.0, 0.0), datetime(2020, 3, 20, 18, 7, tzinfo=UTC), 270.0, 0.0),
        ((-33.9, 18.4), datetime(2020, 12, 21, 10, 45, tzinfo=UTC), 0.0, 90.0 - (33.9 - 23.44)),
    ],
)
def test_the_position_of_the_sun_agrees_with_an_almanac(
    place: tuple[float, float], moment: datetime, azimuth: float | None, elevation: float
) -> None:
    computed = sun_angles(place, moment)
    assert computed[1] == pytest.approx(elevation, abs=0.2)
    if azimuth is not None:
        assert abs((computed[0] - azimuth + 180.0) % 360.0 - 180.0) < 1.5


def test_times_of_day_are_local_times_of_the_place() -> None:
    assert local_time("2018-02-12 15:20:00", 121.5, summer=False) == datetime(2018, 2, 12, 7, 20, tzinfo=UTC)
    assert local_time("2018-07-12 15:20:00", -74.0, summer=True) == datetime(2018, 7, 12, 19, 20, tzinfo=UTC)
    clock = SunClock(datetime(2020, 1, 1, tzinfo=UTC), since_s=10.0, speed=100.0, step_s=60.0)
    assert clock.at(69.0) == clock.start and clock.at(70.0) == clock.start + timedelta(seconds=6000)


def test_weather_levels_apply_only_while_the_weather_is_enabled() -> None:
    skies = Skies(levels={RAIN: 0.4, FOG: 1.0})
    assert skies.arguments(HERE, 0.0) == {}
    skies.enabled = True
    assert skies.arguments(HERE, 0.0) == {"rain": 0.4, "cloud": 0.4, "visibility": pytest.approx(30.0)}
    skies.levels = {SNOW: 0.2, ROAD_SNOW: 0.9}
    assert skies.arguments(HERE, 0.0) == {"rain": 0.2, "cloud": 0.2, "ice": 0.9}
    assert PictureWeather.of_arguments({"camera": "front"}) is None
    assert PictureWeather.of_arguments({"camera": "front", "ice": 0.9}) == PictureWeather(ice=0.9)


def test_a_client_changes_the_weather_and_the_sun_and_the_trace_replays(serve: Serve) -> None:
    served = serve("--scene", "bay", "--camera", "160x90")
    client = connected(served)
    client.takeoffAsync().join()

    def seen() -> Any:
        (image,) = client.simGetImages([airsim.ImageRequest("0", airsim.ImageType.Scene)])
        return np.asarray(Image.open(io.BytesIO(image.image_data_uint8)), np.float64)

    client.simSetTimeOfDay(True, "2018-02-12 12:20:00", celestial_clock_speed=0)
    day = seen()
    client.simSetWeatherParameter(airsim.WeatherParameter.Fog, 1.0)
    assert np.abs(seen() - day).mean() < 1.0, "a level applies only after `simEnableWeather`"
    client.simEnableWeather(True)
    fog = seen()
    assert fog.std() < 0.7 * day.std(), "fog reduces the contrast"
    client.simSetWeatherParameter(airsim.WeatherParameter.Fog, 0.0)
    client.simSetWeatherParameter(airsim.WeatherParameter.Rain, 1.0)
    assert np.abs(seen() - day).mean() > 3.0, "rain dims the light"
    client.simEnableWeather(False)
    client.simSetTimeOfDay(True, "2018-02-12 23:50:00", celestial_clock_speed=0)
    assert seen().mean() < 0.5 * day.mean(), "it is night"
    client.simSetTimeOfDay(False)
    for call, message in (
        (lambda: client.simSetWeatherParameter(9, 0.5), "`param` is a WeatherParameter"),
        (lambda: client.simSetWeatherParameter(0, 1.5), "`val` is a level from 0 to 1"),
        (lambda: client.simSetTimeOfDay(True, "noon"), "a time like 2018-02-12 15:20:00, not `noon`"),
    ):
        with pytest.raises(rpc_error, match=message):
            call()
    leave(client)
    served.finish()
    assert run_command(["replay", str(served.folder / "trace.mcap"), "--pictures"]) == 0
