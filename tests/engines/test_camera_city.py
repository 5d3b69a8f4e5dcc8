"""The camera in a city: classes, ids and distances of drawn things, mounts, repeatability."""

from collections.abc import Iterator
from math import atan2, degrees
from typing import Any

import msgspec
import numpy as np
import pytest

from lingjing.engines.camera import cityscape
from lingjing.mission.instance import EventSpec, Weather
from lingjing.plugins.engine import BodyState
from lingjing.plugins.geometry import pixel_to_world
from lingjing.scene.city import Building
from lingjing.testing.declarations import BodyPart
from tests.engines.camera_town import (
    CLASSES,
    SIZE,
    WHY_NOT,
    CameraEngine,
    box,
    entity,
    instance,
    look,
    mounts,
    ready,
    seen_at,
    share,
    town,
)

pytestmark = pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)


@pytest.fixture(scope="module")
def engine() -> Iterator[CameraEngine]:
    made = CameraEngine()
    yield made
    made.close()


def test_pixels_have_the_class_and_depth_of_the_object_that_they_show(engine: CameraEngine) -> None:
    ready(engine)
    frame, inland = look(engine, (0.0, -20.0, 120.0)), look(engine, (-45.0, 50.0, 120.0))
    for picture, east, north, up, cls in (
        (frame, -100.0, 0.0, 0.0, "road"),
        (frame, 0.0, 0.0, 0.0, "road"),
        (frame, 0.0, -50.0, 8.0, "road"),
        (frame, 60.0, -50.0, -1.5, "water"),
        (frame, 80.0, -5.0, 0.0, "concrete"),
        (inland, -45.0, 55.0, 36.0, "building"),
    ):
        drawn, depth, _ = seen_at(picture, east, north, up)
        assert drawn == CLASSES[cls], (east, north, drawn)
        assert abs(depth - (119.9 - up)) < (4.0 if cls == "building" else 0.06), (cls, depth)  # a roof has a lift house
    aside = look(engine, (170.0, 5.0, 60.0))
    assert seen_at(aside, 120.0, 0.0, 0.0)[0] == CLASSES["grass"]
    assert seen_at(aside, 170.0, 5.0, 0.0)[0] == CLASSES["sidewalk"], "the later area lies on the earlier one"


def test_a_part_that_glows_is_as_bright_at_night_as_by_day(engine: CameraEngine) -> None:
    """A part of the same colour without light of its own is dark at night; a glow lights nothing else."""
    measures: dict[str, Any] = {"shape": "box", "length_m": 6.0, "width_m": 6.0, "height_m": 2.0, "colour": "amber"}
    lamps = [
        entity(name, "lamp", (east, 0.0, 0.0), properties={"look": "none"},
               parts=(BodyPart(name="light", above_m=1.0, glow=glow, **measures),))
        for name, east, glow in (("dull", -12.0, 0.0), ("bright", 12.0, 0.8))
    ]  # fmt: skip
    shown = {}
    for sun in (40.0, -12.0):
        ready(engine, instance(*lamps, weather=Weather(sun_elevation_deg=sun, sun_azimuth_deg=180.0)))
        frame = look(engine, (0.0, 0.0, 60.0))
        shown[sun] = [seen_at(frame, east, 0.0, 2.0)[2] for east in (-12.0, 12.0, 20.0)]
    (dull_day, bright_day, _), (dull, bright, beside) = shown[40.0], shown[-12.0]
    assert bright[0] > 230 and bright[0] - bright[2] > 110 and abs(int(bright[0]) - int(bright_day[0])) < 15
    assert dull[0] < 90 < dull_day[0] and beside.max() < 90


def test_a_tunnel_does_not_show(engine: CameraEngine) -> None:
    ready(engine)
    assert seen_at(look(engine, (-100.0, 8.0, 60.0)), -100.0, 8.0, 0.0)[0] != CLASSES["road"]


def test_walls_have_windows_and_face_the_camera(engine: CameraEngine) -> None:
    ready(engine)
    frame = look(engine, (-225.0, 0.0, 12.0), "front")
    assert share(frame, "building") > 0.3
    wall = frame.rgb[100:135, 190:290].astype(float).mean(axis=2)
    assert wall.std() > 8.0, "panes differ from the wall"


@pytest.mark.parametrize("roof", ["flat", "gabled", "hipped", "pyramidal", "dome"])
def test_roofs_keep_their_height(engine: CameraEngine, roof: str) -> None:
    house = Building(id="b", polygon=box(-20, -10, 20, 10), base_m=0.0, top_m=20.0, roof=roof, roof_m=6.0, levels=4)
    ready(engine, city=town(buildings=(house,), props=(), roads=(), junctions=(), bridges=()))
    frame = look(engine, (0.0, 0.3, 80.0))
    assert frame.depth is not None
    nearest = 79.9 - float(frame.depth.min())
    assert 19.0 < nearest < 20.8 + (2.5 if roof == "flat" else 0.0)


def test_a_building_with_a_courtyard_shows_its_ground(engine: CameraEngine) -> None:
    house = Building(id="b", polygon=box(-30, -30, 30, 30), holes=(box(-12, -12, 12, 12),), base_m=0.0, top_m=15.0)
    ready(engine, city=town(buildings=(house,), props=(), roads=(), junctions=(), bridges=()))
    frame = look(engine, (0.0, 0.0, 90.0))
    assert abs(seen_at(frame, 0.0, 0.0, 0.0)[1] - 89.9) < 0.05
    assert seen_at(frame, 20.0, 0.0, 15.0)[0] == CLASSES["building"]


def test_shadows_fall_away_from_the_sun(engine: CameraEngine) -> None:
    tower = Building(id="b", polygon=box(-10, -10, 10, 10), base_m=0.0, top_m=40.0)
    city = town(buildings=(tower,), props=(), roads=(), junctions=(), bridges=())
    ready(engine, city=city)
    frame = look(engine, (0.0, 20.0, 150.0))
    north, south = seen_at(frame, 0.0, 32.0, 0.0)[2], seen_at(frame, 0.0, -25.0, 0.0)[2]
    assert north.sum() < 0.75 * south.sum()
    ready(engine, instance(weather=Weather(sun_azimuth_deg=0.0)), city)
    frame = look(engine, (0.0, 10.0, 150.0))
    assert seen_at(frame, 0.0, -25.0, 0.0)[2].sum() < 0.75 * seen_at(frame, 0.0, 32.0, 0.0)[2].sum()


def test_pictures_do_not_depend_on_earlier_pictures(engine: CameraEngine, monkeypatch: pytest.MonkeyPatch) -> None:
    spots = [((0.0, 0.0, 100.0), "nadir", 0.0), ((-200.0, -100.0, 30.0), "front", 20.0), ((0, -200, 60), "oblique", 0)]
    ready(engine)
    first = [look(engine, *spot) for spot in spots]
    monkeypatch.setattr(cityscape, "KEPT_TILES", 1)
    for spot in reversed(spots):
        look(engine, *spot)
    again = [look(engine, *spot) for spot in spots]
    fresh = CameraEngine()
    ready(fresh)
    others = [look(fresh, *spot) for spot in reversed(spots)][::-1]
    fresh.close()
    for a, b, c in zip(first, again, others, strict=True):
        for other in (b, c):
            assert a.depth is not None and other.depth is not None
            assert a.rgb.tobytes() == other.rgb.tobytes() and a.depth.tobytes() == other.depth.tobytes()
            assert np.array_equal(a.semantic, other.semantic) and a.info == other.info


def test_a_fracture_opens_the_bridge_for_its_mission_only(engine: CameraEngine) -> None:
    broken = entity("f", "bridge_fracture", (0.0, -100.0, 8.0), properties={"width_m": 12.0})
    ready(engine)
    whole = look(engine, (0.0, -100.0, 60.0))
    ready(engine, instance(broken))
    gap = look(engine, (0.0, -100.0, 60.0), mirrors=(BodyState(id="f", position=broken.position, status="fractured"),))
    ready(engine)
    mended = look(engine, (0.0, -100.0, 60.0))
    assert seen_at(whole, 0.0, -100.0, 8.0)[0] == CLASSES["road"]
    through = [seen_at(gap, 0.8 * k, -100.0, 8.0)[1] for k in range(-4, 5)]
    assert max(through) > 54.0, "the water or rubble under the deck shows"
    assert [b.entity for b in gap.info.boxes] == ["f"]
    assert whole.rgb.tobytes() == mended.rgb.tobytes()


def test_a_reference_building_has_a_box_of_its_entity(engine: CameraEngine) -> None:
    target = entity("tower", "reference_building", (-225.0, 40.0, 0.0), properties={"colour": "red"})
    ready(engine, instance(target))
    frame = look(engine, (-225.0, 55.0, 100.0))
    assert [b.entity for b in frame.info.boxes] == ["tower"]
    assert seen_at(frame, -225.0 - 60.0, 55.0, 20.0)[0] == CLASSES["building"]


def test_traffic_is_drawn_by_its_kind_and_only_at_its_boundary(engine: CameraEngine) -> None:
    ready(engine)
    car = BodyState(id="traffic/1", kind="car", position=(-60.0, 0.0, 0.0), heading_deg=90.0)
    frame = look(engine, (-60.0, 0.0, 40.0), mirrors=(car,))
    cls = CLASSES.get("car", CLASSES["entity"])
    assert seen_at(frame, -60.0, 0.0, 1.2)[0] == cls and frame.info.boxes == ()
    empty = look(engine, (-60.0, 0.0, 40.0))
    assert empty.semantic is not None and not (empty.semantic == cls).any()


def test_an_entity_before_its_appearance_is_not_drawn(engine: CameraEngine) -> None:
    car = entity("car", "car", (-60.0, 0.0, 0.0), dormant=True)
    episode = instance(car, events=(EventSpec(name="e", tick=2, appear=("car",)),))
    ready(engine, episode)
    at = BodyState(id="car", position=car.position)
    assert look(engine, (-60.0, 0.0, 40.0), mirrors=(at,), time_s=10.0).info.boxes == ()
    assert [b.entity for b in look(engine, (-60.0, 0.0, 40.0), mirrors=(at,), time_s=20.0).info.boxes] == ["car"]


def test_the_camera_of_a_robot_dog_is_low_and_tilts_with_the_body(engine: CameraEngine) -> None:
    dog = entity("dog", "robot_dog", (-60.0, 0.0, 0.32), cameras=mounts())
    ready(engine, instance(dog))
    level = look(engine, dog.position, "front", 90.0, viewer="dog").info.pose
    assert 0.35 < level.position[2] < 0.45 and level.roll_deg == 0.0
    tilted = look(engine, dog.position, "front", 90.0, viewer="dog", pitch_deg=8.0, roll_deg=5.0).info.pose
    assert tilted.tilt_deg == level.tilt_deg - 8.0 and tilted.roll_deg == 5.0 and tilted.position[2] > level.position[2]


def test_the_front_camera_of_a_fire_truck_sees_the_road(engine: CameraEngine) -> None:
    car = entity("car", "fire_truck", (-200.0, 0.0, 0.0), cameras=mounts())
    ready(engine, instance(car))
    frame = look(engine, car.position, "front", 90.0, viewer="car")
    assert 2.0 < frame.info.pose.position[2] < 2.5 and share(frame, "road") > 0.1


def test_a_picture_from_orbit_shows_the_city_with_correct_depth(engine: CameraEngine) -> None:
    camera = msgspec.structs.replace(mounts()[0], hfov_deg=0.16)
    ready(engine, instance(entity("sat", "satellite", (0.0, 0.0, 550e3), cameras=(camera,))))
    frame = look(engine, (0.0, 0.0, 550e3), viewer="sat", pitch_deg=-90.0)
    assert frame.depth is not None and np.isfinite(frame.depth).all()
    assert abs(float(np.median(frame.depth)) - 550e3) < 50.0
    assert share(frame, "water") > 0.05 and share(frame, "building") > 0.001
    for row, column in ((10, 10), (135, 240), (260, 470)):
        point = pixel_to_world(frame.info.pose, column + 0.5, row + 0.5, float(frame.depth[row, column]))
        assert -3.0 < point[2] < 40.0


def test_the_horizon_is_level_whatever_the_heading(engine: CameraEngine) -> None:
    ready(engine)
    for heading in (0.0, 77.0, 200.0):
        frame = look(engine, (0.0, -100.0, 300.0), "front", heading)
        assert frame.semantic is not None
        sky = (frame.semantic == CLASSES["sky"]).sum(axis=0)
        assert np.ptp(sky) <= 3, heading
        focal = SIZE[0] / 2 / np.tan(np.radians(42.0))
        assert abs(degrees(atan2(SIZE[1] / 2 - sky[0], focal)) - 10.0) < 1.0


def test_no_shadow_extends_beyond_the_shadow_map(engine: CameraEngine) -> None:
    weather = Weather(sun_azimuth_deg=215.0, sun_elevation_deg=12.0, cloud=0.0)
    frames = []
    for top_m in (150.0, 1.0):
        tower = Building(id="b", polygon=box(-40, -40, 40, 40), base_m=0.0, top_m=top_m)
        city = town(buildings=(tower,), props=(), roads=(), junctions=(), bridges=(), areas=(), waters=())
        ready(engine, instance(weather=weather), city)
        frames.append(look(engine, (-200.0, -200.0, 90.0), "front", 45.0))
    frame, low = frames
    assert frame.depth is not None and frame.semantic is not None
    far = np.isfinite(frame.depth) & (frame.depth > 1500.0) & (frame.semantic != CLASSES["building"])
    assert far.sum() > 5000
    off = np.abs(frame.rgb[far].astype(int) - low.rgb[far]).max()
    assert off < 8, "no streak of shadow runs on beyond the map"
