"""Pictures from orbit: a city by the sea in a wide-area frame, with country and sea as far as the picture."""

from collections.abc import Iterator

import msgspec
import numpy as np
import numpy.typing as npt
import pytest

from lingjing.engines.camera.far_country import SPAN_M, build_far_country
from lingjing.engines.camera.town_ground import build_town_ground
from lingjing.mission.instance import CameraSpec, Instance
from lingjing.plugins.engine import Frame
from lingjing.plugins.geometry import camera_axes, focal_px
from lingjing.scene.city import City, Land, Water
from lingjing.testing import PluginHost, compile_text, instantiate
from tests.engines.camera_town import (
    CLASSES,
    WHY_NOT,
    CameraEngine,
    box,
    entity,
    instance,
    look,
    mounts,
    ready,
    share,
    town,
)

MISSION = """\
ljs 1
use std.orbit { satellite }
use std.sensors { orbit }
mission wide "A wide area" {
  goal "Look."
  scene city { extent = 1200 m, datum = sea level at -3 m }
  clock { tick = 10 s, sync = 1 s }
  budget { ticks <= 24 }
  asset sat : satellite { camera wide : orbit { size = 480 by 270 }, actions { takePhoto } }
  agent orbiter as orbiter controls sat { observes sat.*, events }
  success when sat.position.x < 0 m
}
"""
HEIGHT_M = 550e3
OVERHEAD = (0.0, 0.0, HEIGHT_M)
drawn = pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)


@pytest.fixture(scope="module")
def mission() -> Instance:
    compilation = compile_text(MISSION)
    assert compilation.diagnostics == () and compilation.mission is not None
    return instantiate(compilation.mission, seed=1)


@pytest.fixture(scope="module")
def coastal(mission: Instance) -> City:
    return PluginHost().scene(mission.scene.kind).build(mission.scene)


@pytest.fixture(scope="module")
def engine() -> Iterator[CameraEngine]:
    made = CameraEngine()
    yield made
    made.close()


def preset(mission: Instance) -> CameraSpec:
    (camera,) = mission.entities[0].cameras
    return camera


def photo(engine: CameraEngine, city: City, camera: CameraSpec, at: tuple[float, float, float] = OVERHEAD,
          pitch_deg: float = -90.0, heading: float = 0.0) -> Frame:  # fmt: skip
    camera = msgspec.structs.replace(camera, name="nadir")
    ready(engine, instance(entity("sat", "satellite", at, cameras=(camera,))), city)
    return look(engine, at, viewer="sat", pitch_deg=pitch_deg, heading=heading)


def rays(frame: Frame) -> npt.NDArray[np.float64]:
    """Return the rays through the pixels, (rows, columns, 3), one metre along the axis."""
    pose = frame.info.pose
    right, down, axis = (np.asarray(a) for a in camera_axes(pose))
    x, y = np.meshgrid(np.arange(pose.width) + 0.5 - pose.width / 2, np.arange(pose.height) + 0.5 - pose.height / 2)
    return np.asarray(axis + (x[..., None] * right + y[..., None] * down) / focal_px(pose))


def test_the_preset_of_std_sensors_is_a_wide_area_camera(mission: Instance) -> None:
    camera = preset(mission)
    across_km = 2.0 * HEIGHT_M / 1000.0 * np.tan(np.radians(camera.hfov_deg) / 2.0)
    assert 10.0 < across_km < 30.0
    assert abs(across_km - float(mission.entities[0].properties["swath_m"]) / 1000.0) < 0.5
    assert camera.channels == ("rgb", "depth", "semantic")


@drawn
@pytest.mark.parametrize("hfov", [2.0, 2.1])
def test_sea_and_country_fill_a_frame_around_a_coastal_city(
    engine: CameraEngine, mission: Instance, coastal: City, hfov: float
) -> None:
    frame = photo(engine, coastal, msgspec.structs.replace(preset(mission), hfov_deg=hfov))
    assert frame.depth is not None and frame.semantic is not None
    assert share(frame, "sky") == 0.0
    assert 0.3 < share(frame, "water") < 0.6 and 0.3 < share(frame, "grass") < 0.7 and share(frame, "building") > 5e-4
    assert np.abs(frame.depth - HEIGHT_M).max() < 150.0
    place = rays(frame) * HEIGHT_M
    assert (frame.semantic[place[..., 0] > 2500.0] == CLASSES["water"]).all(), "the sea goes on"
    assert (frame.semantic[place[..., 0] < -2500.0] == CLASSES["grass"]).all(), "the land goes on"
    sea = frame.rgb[frame.semantic == CLASSES["water"]].astype(int)
    assert (sea[:, 2] > sea[:, 0]).mean() > 0.99, "no foam or sky where the sea is"


@drawn
def test_an_oblique_picture_has_the_depth_of_the_ground_plane(
    engine: CameraEngine, mission: Instance, coastal: City
) -> None:
    frame = photo(engine, coastal, preset(mission), (60e3, -90e3, HEIGHT_M), -78.9, -33.0)
    assert frame.depth is not None
    assert share(frame, "sky") == 0.0 and share(frame, "water") > 0.2 and share(frame, "building") > 5e-4
    assert np.allclose(frame.depth, -HEIGHT_M / rays(frame)[..., 2], rtol=3e-4)


@drawn
@pytest.mark.parametrize("kind", ["coastal", "inland"])
def test_the_sky_fills_exactly_the_area_above_the_horizon(
    engine: CameraEngine, mission: Instance, coastal: City, kind: str
) -> None:
    camera = msgspec.structs.replace(preset(mission), hfov_deg=84.0)
    city = coastal if kind == "coastal" else town(waters=())
    for pitch, heading in ((-10.0, 270.0), (-40.0, 90.0), (-90.0, 0.0)):
        frame = photo(engine, city, camera, OVERHEAD, pitch, heading)
        assert frame.depth is not None and frame.semantic is not None
        down = rays(frame)[..., 2] < 0.0
        assert ((frame.semantic == CLASSES["sky"]) == ~down).all()
        assert np.isfinite(frame.depth[down]).all() and np.isinf(frame.depth[~down]).all()
        assert np.allclose(frame.depth[down], -HEIGHT_M / rays(frame)[..., 2][down], rtol=1e-3)
        assert (share(frame, "water") > 0.0) == (kind == "coastal")


@drawn
def test_an_inland_city_is_surrounded_by_countryside(engine: CameraEngine, mission: Instance) -> None:
    frame = photo(engine, town(), preset(mission))
    assert frame.semantic is not None
    aside = np.abs(rays(frame)[..., :2] * HEIGHT_M).max(axis=-1) > 1500.0
    assert (frame.semantic[aside] == CLASSES["grass"]).all()
    assert share(frame, "water") > 0.0 and share(frame, "building") > 0.0


@drawn
def test_islands_are_drawn_over_the_sea_from_orbit(engine: CameraEngine, mission: Instance) -> None:
    island = Land(polygon=box(-2000, -2000, 2000, 2000), top_m=20.0, surface="grass")
    sea = Water(polygon=box(-3000, -3000, 3000, 3000), level_m=-1.0)
    city = City(id="i", origin=(31.0, 121.5), bounds=(-3000.0, -3000.0, 3000.0, 3000.0), lands=(island,), waters=(sea,))
    frame = photo(engine, city, preset(mission))
    assert share(frame, "sky") == 0.0 and abs(share(frame, "grass") - 4.0**2 / (20.16 * 11.34)) < 0.01
    assert share(frame, "grass") + share(frame, "sand") + share(frame, "water") > 0.999


@drawn
def test_pictures_from_high_altitude_and_from_orbit_are_repeatable(
    engine: CameraEngine, mission: Instance, coastal: City
) -> None:
    low = msgspec.structs.replace(mounts()[0], name="nadir")
    before = photo(engine, coastal, low, (0.0, 0.0, 400.0), 0.0)
    high = [photo(engine, coastal, preset(mission)) for _ in range(2)]
    after = photo(engine, coastal, low, (0.0, 0.0, 400.0), 0.0)
    assert np.array_equal(high[0].rgb, high[1].rgb)
    assert np.array_equal(before.rgb, after.rgb) and np.array_equal(before.semantic, after.semantic)


def test_a_land_continues_beyond_the_bounds_in_the_direction_of_its_borders() -> None:
    coast = ((100.0, -5000.0), (200.0, -400.0), (200.0, 400.0), (0.0, 5000.0), (-4000.0, 5000.0), (-4000.0, -5000.0))
    sea = Water(polygon=box(-6000, -6000, 6000, 6000), level_m=-3.0)
    pier = Land(polygon=box(150, -50, 450, 50), top_m=0.0, surface="concrete")
    city = City(id="c", origin=(31.0, 121.5), bounds=(-500.0, -500.0, 500.0, 500.0), waters=(sea,),
                lands=(Land(polygon=coast, top_m=0.0, surface="grass"), pier))  # fmt: skip
    country = build_far_country(city, build_town_ground(city))
    assert country.waters == ()
    points = country.lands.vertices["position"].astype(float)
    assert set(country.lands.vertices["id"].tolist()) == {CLASSES["grass"]} and np.ptp(points[:, 2]) == 0.0
    south = points[points[:, 1] < -0.9 * SPAN_M]
    east = south[np.argmax(south[:, 0] / -south[:, 1])]
    assert east[0] / east[1] == pytest.approx(100.0 / 4600.0, rel=0.01)
    assert not ((np.abs(points[:, :2]) < 499.0).all(axis=1)).any(), "nothing within the bounds"
