"""Detectors of fires, gaps and queues on pictures of the real camera, from seeds that no threshold was tuned on."""

import math
import random
from pathlib import Path

import numpy as np
import pytest
from lingjing_agents.perception.bridge_gaps import find_gaps
from lingjing_agents.perception.fires_from_above import find_fires_from_above
from lingjing_agents.perception.road_queues import corners, find_queues

import lingjing
from agents.tests.agent_kit import NADIR
from lingjing.errors import InfrastructureError
from lingjing.plugins.engine import BodyState, CaptureRequest, EngineSpec
from lingjing.plugins.geometry import camera_pose, offset_xy
from lingjing.plugins.policy import CameraPose
from lingjing.scene.anchor import anchor
from lingjing.testing import PluginHost, decode_jpeg, encode_jpeg, instantiate

SCENARIOS = Path(__file__).parents[2] / "scenarios"
PICTURES = Path(__file__).with_name("pictures")


def overlap(a, b) -> float:
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    shared = max(wide, 0.0) * max(high, 0.0)
    return shared / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - shared)


@pytest.fixture(scope="module")
def camera():
    engine = PluginHost().engine("camera").factory()
    yield engine
    engine.close()


def shoot(engine, mission: str, group: str, seed: int, height: float, heading: float | None, away: float = 0.0):
    """Return a picture of each target of a group, near its centre, with the true boxes of the targets."""
    settings = {"fires": 6.0} if mission == "ufr" else {}
    instance = instantiate(lingjing.compile(SCENARIOS / f"{mission}.ljs"), seed=seed, settings=settings)
    city = PluginHost().scene(instance.scene.kind).build(instance.scene)
    instance = anchor(instance, city)
    try:
        engine.reset(EngineSpec(engine="camera", instance=instance, owns=()), city, seed)
    except InfrastructureError as error:
        pytest.skip(f"no picture can be drawn here: {error}")
    dice = random.Random(seed)
    pilot = next(entity.id for entity in instance.entities if entity.id.startswith("uav"))
    for number, target in enumerate([each for each in instance.entities if each.group == group], 1):
        course = dice.uniform(0.0, 360.0) if heading is None else heading
        x, y = offset_xy(target.position, course, dice.uniform(-0.1, 0.1) * height + away)
        body = BodyState(id=pilot, position=(x, y, height), heading_deg=course)
        engine.advance(20.0 * number, [body])
        request = CaptureRequest(frame=f"f{number}", entity=pilot, camera="nadir", tick=number, time_s=20.0 * number)
        (frame,) = engine.capture([request])
        truth = [box.box for box in frame.info.boxes if box.entity == target.id and box.pixels > 300]
        yield decode_jpeg(encode_jpeg(frame.rgb)), frame.info.pose, truth


def test_almost_every_visible_fire_is_found_and_no_orange_roof_is_reported(camera):
    seen = wrong = detected = 0
    for rgb, pose, truth in shoot(camera, "ufr", "fire", 9001, 130.0, None):
        finds = find_fires_from_above(rgb, pose, 0.0)
        seen += len(truth)
        detected += sum(any(overlap(find.box, box) >= 0.5 for find in finds) for box in truth)
        wrong += sum(find.box[0] > 0.02 and not truth for find in finds)
    assert seen >= 4
    assert detected >= seen - 1
    assert wrong == 0


def test_the_gap_in_a_deck_is_found_from_both_directions(camera):
    for heading in (87.0, 267.0):
        ((rgb, pose, (box,)),) = shoot(camera, "bi", "fracture", 9001, 60.0, heading)
        (find,) = find_gaps(rgb, pose, -3.0)
        assert overlap(find.box, box) >= 0.6
        assert find.confidence > 0.5


def test_a_sheet_with_the_colour_of_water_on_a_deck_is_no_gap_because_the_rim_is_whole():
    """A stretch of 7 m has the colour of water: within the rims of a deck, or from edge to edge."""
    pose = CameraPose(position=(0.0, 0.0, 57.0), heading_deg=0.0, tilt_deg=90.0, hfov_deg=84.0, width=1920, height=1080)
    metre = 1920 / 2 / math.tan(math.radians(42.0)) / 60.0
    for inset_m, count in ((1.2, 0), (0.0, 1)):
        picture = np.full((1080, 1920, 3), (30, 68, 88), np.uint8)
        left, right = int(960 - 8 * metre), int(960 + 8 * metre)
        picture[:, left:right] = (90, 90, 92)
        picture[500 : 500 + int(7 * metre), left + int(inset_m * metre) : right - int(inset_m * metre)] = (30, 68, 88)
        assert len(find_gaps(picture, pose, -3.0)) == count


def test_a_whole_deck_has_no_gap(camera):
    ((rgb, pose, truth),) = shoot(camera, "bi", "fracture", 9002, 60.0, 87.0, away=-90.0)
    assert truth == []
    assert find_gaps(rgb, pose, -3.0) == ()


def test_a_blank_picture_shows_nothing():
    blank, pose = np.zeros((1080, 1920, 3), np.uint8), camera_pose((0.0, 0.0, 100.0), 0.0, NADIR)
    assert find_fires_from_above(blank, pose, 0.0) == ()
    assert find_gaps(blank, pose, 0.0) == ()
    assert find_queues(blank, pose, 0.0, ((0.0, -50.0), (0.0, 50.0))) == ()


def road(name: str, x: float, y: float, heading: float) -> tuple[np.ndarray, CameraPose]:
    """Return a stored picture of a road: the middle columns of a frame, so that its focal length is the frame's."""
    rgb = decode_jpeg((PICTURES / f"road-{name}.jpg").read_bytes())
    high, wide = rgb.shape[:2]
    focal = NADIR.width / 2 / math.tan(math.radians(NADIR.hfov_deg / 2))
    field = 2 * math.degrees(math.atan(wide / 2 / focal))
    pose = CameraPose(
        position=(x, y, 119.9), heading_deg=heading, tilt_deg=90.0, hfov_deg=field, width=wide, height=high
    )
    return rgb, pose


def test_a_queue_on_the_route_is_seen_and_an_empty_road_is_clear():
    rgb, pose = road("queue", 187.5, 198.35, 87.914)
    queue = find_queues(rgb, pose, 0.0, ((4.95, 191.7), (187.5, 198.35), (380.0, 198.35)))[0]
    assert queue.vehicles >= 4
    assert math.dist(queue.place, (165.0, 198.35)) < 15.0
    assert queue.box[3] - queue.box[1] > 0.3
    rgb, pose = road("clear", 4.95, -208.3, 4.81)
    assert find_queues(rgb, pose, 0.0, ((-11.6, -404.95), (4.95, -208.3), (4.95, -11.6))) == ()


def test_the_missing_corners_of_a_route_are_restored():
    path = corners(((-200.0, -405.0), (-12.0, -405.0), (5.0, -208.0), (5.0, -12.0)))
    assert path[1] == pytest.approx((5.0, -405.0))
    assert path[-1] == (5.0, -12.0)
    assert len(path) == 3
