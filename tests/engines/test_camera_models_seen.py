"""Targets through the real renderer: tight ground-truth boxes from the distances of the missions."""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot

import msgspec
import numpy as np
import pytest

from lingjing.mission.instance import CameraSpec, Entity, Instance, SceneSpec, Weather
from lingjing.plugins.engine import CaptureRequest, EngineSpec, Frame
from lingjing.plugins.geometry import focal_px
from lingjing.scene.city import Bridge, Building, City, Lane, PaintedArea, Pipe, Road, Water
from lingjing.testing import bare_instance, declared
from lingjing.trace.records import BodyState, Box
from tests.engines.camera_town import WHY_NOT, CameraEngine

pytestmark = pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)

DAY, NIGHT = 45.0, -20.0
LANE = Lane(id="r_0", shape=((400.0, -300.0, 9.0), (400.0, 300.0, 9.0)), width_m=3.4)
CITY = City(
    id="yard",
    origin=(31.0, 121.0),
    bounds=(-300.0, -300.0, 500.0, 300.0),
    areas=(PaintedArea(polygon=((-300, -300), (300, -300), (300, 300), (-300, 300)), surface="concrete"),),
    waters=(Water(polygon=((310, -300), (500, -300), (500, 300), (310, 300)), level_m=0.0),),
    buildings=(
        Building(id="hall", polygon=((-20, -15), (20, -15), (20, 15), (-20, 15)), base_m=0.0, top_m=18.0),
        Building(id="home", polygon=((-20, 60), (20, 60), (20, 75), (-20, 75)), base_m=0.0, top_m=12.0),
    ),
    bridges=(Bridge(id="span", path=((400.0, -300.0, 9.0), (400.0, 300.0, 9.0)), width_m=13.0),),
    roads=(Road(id="r", lanes=(LANE,), bridge=True),),
    pipes=(Pipe(id="pipe", path=((100.0, -80.0, 1.2), (100.0, 80.0, 1.2))),),
)
TARGETS = {
    "building_fire": (2.0, 3.0, 18.0),
    "fire_source": (-100.0, 0.0, 0.0),
    "pipeline_leak": (100.0, 10.0, 1.2),
    "bridge_fracture": (400.0, 20.0, 9.0),
    "reference_building": (0.0, 58.0, 0.0),
}
CAMERAS = {
    "nadir": CameraSpec(name="nadir", view="nadir", width=1920, height=1080, hfov_deg=84.0,
                        channels=("rgb", "depth"), capture="on_request"),
    "eye": CameraSpec(name="eye", view="front", width=1280, height=720, hfov_deg=90.0, channels=("rgb",),
                      capture="on_request"),
}  # fmt: skip


def instance(kind: str, viewer: Entity) -> Instance:
    target = declared(
        Entity(
            id="target",
            group="target",
            index=1,
            role="target",
            type=kind,
            engine="city",
            position=TARGETS[kind],
            properties={"width_m": 8.0, "colour": "red"},
        )
    )
    weather = Weather(wind_mps=4, wind_from_deg=220)
    return bare_instance((target, viewer), seed=3, scene=SceneSpec(kind="x"), weather=weather)


@pytest.fixture(scope="module")
def engine() -> Iterator[CameraEngine]:
    made = CameraEngine()
    yield made
    made.close()


def take(engine: CameraEngine, kind: str, above_m: float = 0.0, away_m: float = 0.0, status: str = "") -> Frame:
    """Return a nadir picture from above, or a dog's picture from the south at a distance."""
    x, y, z = TARGETS[kind]
    view = "eye" if away_m else "nadir"
    place = (x, y - away_m, 0.3) if away_m else (x, y, z + above_m)
    viewer = declared(
        Entity(
            id="viewer",
            group="viewer",
            index=1,
            role="asset",
            type="robot_dog" if away_m else "quadrotor",
            engine="x",
            position=place,
            cameras=(CAMERAS[view],),
        )
    )
    episode = instance(kind, viewer)
    engine.reset(EngineSpec(engine="camera", instance=episode, owns=()), CITY, 3)
    engine.advance(20.0, [BodyState(id="target", position=TARGETS[kind], status=status)])
    (frame,) = engine.capture([CaptureRequest(frame="f", entity="viewer", camera=view, tick=1, time_s=20.0)])
    return frame


def box_of(frame: Frame) -> Box:
    (box,) = [box for box in frame.info.boxes if box.entity == "target"]
    return box


def extent_m(frame: Frame, box: Box, away_m: float) -> tuple[float, float]:
    """Return width and height of a box in metres at a distance."""
    scale = away_m / focal_px(frame.info.pose)
    return (box.box[2] - box.box[0]) * frame.info.pose.width * scale, (
        box.box[3] - box.box[1]
    ) * frame.info.pose.height * scale


@pytest.mark.parametrize("above", [80.0, 110.0, 150.0])
def test_a_building_fire_has_a_tight_box_from_patrol_height(engine: CameraEngine, above: float) -> None:
    frame = take(engine, "building_fire", above)
    box = box_of(frame)
    wide, high = extent_m(frame, box, above)
    assert 4.0 < wide < 10.0 and 4.0 < high < 10.0 and box.pixels > 900
    assert hypot((box.box[0] + box.box[2]) / 2 - 0.5, (box.box[1] + box.box[3]) / 2 - 0.5) < 0.03
    crop = pixels(frame, box)
    assert (crop[..., 0] > crop[..., 2] + 60).mean() > 0.35, "flames are orange from above"


def pixels(frame: Frame, box: Box) -> np.ndarray:
    height, width = frame.rgb.shape[:2]
    x0, y0, x1, y1 = (round(v * s) for v, s in zip(box.box, (width, height, width, height), strict=True))
    return frame.rgb[y0:y1, x0:x1].astype(int)


@pytest.mark.parametrize("away", [2.5, 8.0, 20.0])
def test_a_ground_fire_has_a_tight_box_in_the_picture_of_a_robot_dog(engine: CameraEngine, away: float) -> None:
    frame = take(engine, "fire_source", away_m=away)
    box = box_of(frame)
    wide, high = extent_m(frame, box, away)
    assert 0.9 < wide < 3.2 and 0.6 < high < 4.0
    crop = pixels(frame, box)
    assert (crop[..., 0] > crop[..., 2] + 60).mean() > 0.2


def test_smoke_and_wet_ground_are_in_no_box(engine: CameraEngine) -> None:
    assert not [box for box in take(engine, "building_fire", 110.0, status="out").info.boxes if box.entity == "target"]
    frame = take(engine, "pipeline_leak", 30.0)
    wide, high = extent_m(frame, box_of(frame), 30.0)
    assert max(wide, high) < 8.5, "the wet ground is larger than that"


@pytest.mark.parametrize("above", [12.0, 30.0, 60.0])
def test_the_box_of_a_leak_encloses_its_spray(engine: CameraEngine, above: float) -> None:
    frame = take(engine, "pipeline_leak", above)
    box = box_of(frame)
    long, short = sorted(extent_m(frame, box, above), reverse=True)
    assert 3.0 < long < 9.0 and 0.8 < short < 5.5 and box.pixels > 150
    sealed = box_of(take(engine, "pipeline_leak", above, status="sealed"))
    assert sealed.pixels < box.pixels


@pytest.mark.parametrize("above", [40.0, 60.0, 100.0])
def test_a_fractures_box_spans_the_gap_and_the_deck(engine: CameraEngine, above: float) -> None:
    frame = take(engine, "bridge_fracture", above)
    box = box_of(frame)
    wide, high = extent_m(frame, box, above)
    assert 10.0 < wide < 15.5 and 7.0 < high < 12.5
    assert frame.depth is not None
    height, width = frame.depth.shape
    gap = frame.depth[int(0.44 * height) : int(0.56 * height), int(0.45 * width) : int(0.55 * width)]
    assert (gap > above + 5.0).mean() > 0.05, "through the gap one sees the water"


def test_the_reference_building_fills_its_box_in_its_colour(engine: CameraEngine) -> None:
    frame = take(engine, "reference_building", away_m=40.0)
    box = box_of(frame)
    assert box.box[2] - box.box[0] > 0.3 and box.pixels > 20_000
    crop = pixels(frame, box)
    assert (crop[..., 0] > crop[..., 1] + 40).mean() > 0.2, "red walls"


def test_a_fire_lights_the_ground_about_it_at_night_and_not_by_day(engine: CameraEngine) -> None:
    x, y, _ = TARGETS["fire_source"]
    viewer = declared(
        Entity(
            id="viewer",
            group="viewer",
            index=1,
            role="asset",
            type="quadrotor",
            engine="x",
            position=(x, y, 40.0),
            cameras=(CAMERAS["nadir"],),
        )
    )
    beside = {}
    for up in (DAY, NIGHT):
        weather = Weather(wind_mps=4, wind_from_deg=220, sun_elevation_deg=up)
        episode = msgspec.structs.replace(instance("fire_source", viewer), weather=weather)
        for status in ("", "out"):
            engine.reset(EngineSpec(engine="camera", instance=episode, owns=()), CITY, 3)
            engine.advance(20.0, [BodyState(id="target", position=TARGETS["fire_source"], status=status)])
            (frame,) = engine.capture([CaptureRequest(frame="f", entity="viewer", camera="nadir", tick=1, time_s=20.0)])
            ground = frame.rgb[590:630, 930:990].astype(float)
            beside[up, status] = ground.mean(axis=(0, 1))
    assert (beside[NIGHT, ""] - beside[NIGHT, "out"])[0] > 25.0, "red light"
    assert (beside[NIGHT, ""] / beside[NIGHT, "out"])[0] > (beside[NIGHT, ""] / beside[NIGHT, "out"])[2]
    assert np.abs(beside[DAY, ""] - beside[DAY, "out"]).max() < 6.0
