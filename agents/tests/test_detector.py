"""The detector on frames of the real camera, from seeds that no threshold was tuned on, and on blank pictures."""

import math
import random
from pathlib import Path

import numpy as np
import pytest
from lingjing_agents.perception.people_at_sea import find_people

import lingjing
from agents.tests.agent_kit import NADIR
from lingjing.errors import InfrastructureError
from lingjing.plugins.engine import BodyState, CaptureRequest, EngineSpec
from lingjing.plugins.geometry import box_to_plane, camera_pose, offset_xy
from lingjing.testing import PluginHost, decode_jpeg, encode_jpeg, instantiate

SCENARIO = Path(__file__).parents[2] / "scenarios" / "ssr.ljs"
LEVEL = -3.5
SEEDS = (9002,)
"""The rest is in `tests/episodes/test_detection_rates.py`."""


def overlap(a, b) -> float:
    wide, high = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    shared = max(wide, 0.0) * max(high, 0.0)
    return shared / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - shared)


@pytest.fixture(scope="module")
def camera():
    engine = PluginHost().engine("camera").factory()
    yield engine
    engine.close()


def shoot(engine, seed: int, height: float):
    """Return for each of six people one picture with them in it, as a policy would receive it."""
    instance = instantiate(lingjing.compile(SCENARIO), seed=seed, settings={"victims": 6.0})
    city = PluginHost().scene(instance.scene.kind).build(instance.scene)
    try:
        engine.reset(EngineSpec(engine="camera", instance=instance, owns=()), city, seed)
    except InfrastructureError as error:
        pytest.skip(f"no picture can be drawn here: {error}")
    dice = random.Random(seed)
    people = [entity for entity in instance.entities if entity.role == "target"]
    wide = 2 * height * math.tan(math.radians(42))
    for number, person in enumerate(people, 1):
        heading = dice.uniform(0, 360)
        x, y = offset_xy(person.position, heading, dice.uniform(-0.22, 0.22) * wide)
        x, y = offset_xy((x, y), heading + 90, dice.uniform(-0.4, 0.4) * wide)
        body = BodyState(id="uav[1]", position=(x, y, LEVEL + height), heading_deg=heading)
        engine.advance(10.0 * number, [body])
        request = CaptureRequest(frame=f"f{number}", entity="uav[1]", camera="nadir", tick=number, time_s=10.0 * number)
        (frame,) = engine.capture([request])
        truth = {box.entity: box.box for box in frame.info.boxes if box.cls == "person_in_water"}
        yield decode_jpeg(encode_jpeg(frame.rgb)), frame.info.pose, truth, {each.id: each.position for each in people}


def count(engine, height: float, sure: float, seeds=SEEDS):
    hits = misses = false = 0
    errors = []
    for seed in seeds:
        for rgb, pose, truth, places in shoot(engine, seed, height):
            finds = [find for find in find_people(rgb, pose, LEVEL) if find.confidence >= sure]
            detected = set()
            for find in finds:
                names = [name for name, box in truth.items() if overlap(find.box, box) >= 0.5]
                detected.update(names)
                false += not names
                for name in names:
                    place = box_to_plane(pose, find.box, LEVEL)
                    assert place is not None
                    errors.append(math.dist(place[:2], places[name][:2]))
            hits += len(detected)
            misses += len(truth) - len(detected)
    return hits / (hits + misses), hits / max(1, hits + false), max(errors, default=0.0)


@pytest.mark.slow
def test_most_people_are_found_from_search_height_with_few_false_positives(camera):
    recall, precision, error_m = count(camera, 100.0, 0.05)
    assert recall >= 0.7
    assert precision >= 0.7
    assert error_m < 2.0


@pytest.mark.slow
def test_recall_and_precision_are_higher_from_a_lower_height(camera):
    recall, precision, _ = count(camera, 50.0, 0.3)
    assert recall >= 0.8
    assert precision >= 0.9


@pytest.mark.slow
def test_people_in_dark_clothes_are_found_from_lower_down(camera):
    hits = 0
    for rgb, pose, truth, _ in shoot(camera, 2006, 60.0):
        for name in ("victim[3]", "victim[6]"):
            if name in truth:
                boxes = [find.box for find in find_people(rgb, pose, LEVEL) if find.confidence >= 0.3]
                hits += any(overlap(box, truth[name]) >= 0.4 for box in boxes)
    assert hits == 2


POSE = camera_pose((0.0, 0.0, 96.5), 0.0, NADIR)


def test_nothing_is_found_in_blank_plain_or_noisy_pictures():
    black = np.zeros((1080, 1920, 3), np.uint8)
    water = np.full_like(black, (36, 76, 90))
    noise = np.clip(water + np.random.default_rng(1).normal(0, 6, water.shape), 0, 255).astype(np.uint8)
    for rgb in (black, water, noise, np.full_like(black, 255)):
        assert find_people(rgb, POSE, LEVEL) == ()


def paint(shape: str) -> np.ndarray:
    import cv2

    rgb = np.full((1080, 1920, 3), (36, 76, 90), np.uint8)
    if shape == "buoy":
        cv2.circle(rgb, (900, 500), 5, (220, 110, 50), -1)
    elif shape == "tarpaulin":
        cv2.rectangle(rgb, (900, 500), (922, 522), (230, 180, 60), -1)
    elif shape == "whitecap":
        cv2.ellipse(rgb, (900, 500), (9, 5), 30, 0, 360, (215, 220, 222), -1)
    elif shape == "person":
        cv2.ellipse(rgb, (900, 500), (3, 5), 0, 0, 360, (230, 120, 40), -1)
        cv2.line(rgb, (896, 498), (892, 493), (196, 202, 204), 1)
        cv2.line(rgb, (904, 498), (908, 494), (196, 202, 204), 1)
        cv2.circle(rgb, (900, 494), 1, (60, 45, 40), -1)
    return rgb


@pytest.mark.parametrize("shape", ["buoy", "tarpaulin", "whitecap"])
def test_round_large_or_white_objects_are_not_people(shape: str):
    assert find_people(paint(shape), POSE, LEVEL) == ()


def test_a_painted_person_is_boxed_tightly():
    finds = find_people(paint("person"), POSE, LEVEL)
    assert len(finds) == 1
    truth = (892 / 1920, 493 / 1080, 909 / 1920, 505 / 1080)
    assert overlap(finds[0].box, truth) >= 0.7
    assert 0.0 < finds[0].confidence <= 1.0


@pytest.mark.parametrize("far", [(60, 40), (1040, 1850), (500, 1500)])
def test_warm_colours_elsewhere_do_not_change_the_detection_of_a_person(far: tuple[int, int]):
    alone = paint("person")
    beside = alone.copy()
    beside[far[0] : far[0] + 30, far[1] : far[1] + 40] = (230, 180, 60)
    assert find_people(beside, POSE, LEVEL) == find_people(alone, POSE, LEVEL) != ()


@pytest.mark.parametrize("cut", ["top", "left", "bottom", "right"])
def test_a_person_cut_by_the_picture_border_is_not_reported(cut: str):
    shown = {"top": np.s_[499:], "left": np.s_[:, 900:], "bottom": np.s_[:499], "right": np.s_[:, :900]}
    rgb = np.ascontiguousarray(paint("person")[shown[cut]])
    assert find_people(rgb, POSE, LEVEL) == ()


def test_a_camera_under_water_detects_nothing():
    below = camera_pose((0.0, 0.0, LEVEL - 1.0), 0.0, NADIR)
    assert find_people(paint("person"), below, LEVEL) == ()
