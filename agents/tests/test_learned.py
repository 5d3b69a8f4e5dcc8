"""The trained detector: whole numbers on every processor, its boxes, its use in the rules, and its training."""

import hashlib
import json
from importlib import resources
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from lingjing_agents.heuristic.policy import rules_for
from lingjing_agents.perception.fires_ahead import find_fires_ahead, fires_in_boxes
from lingjing_agents.perception.learned import network as net
from lingjing_agents.perception.learned.detector import LearnedDetector, learned_detector, learned_detectors
from lingjing_agents.perception.learned.network import (
    CELL_PX,
    DILATIONS,
    MIDDLE,
    STRIDES,
    TOP,
    IntegerLayer,
    IntegerNetwork,
    taps,
)
from lingjing_agents.perception.learned.targets import SCALES, TargetScale, reduced
from lingjing_agents.perception.people_at_sea import FoundBox

from agents.tests.agent_kit import EYE, NADIR, brief, observe, picture, view
from lingjing.plugins.geometry import camera_pose
from lingjing.plugins.policy import Inbox, Picture
from lingjing.testing import PluginHost, build_policy

WEIGHTS = resources.files("lingjing_agents.perception.learned") / "weights"
POSE = camera_pose((0.0, 0.0, 100.0), 0.0, NADIR)


def made_network(seed: int, channels: tuple[int, ...] = (3, 6, 8, 8, 8, 8)) -> IntegerNetwork:
    """Return a network of random whole weights."""
    dice = np.random.default_rng(seed)
    shapes = [*((9 * a, b) for a, b in pairwise(channels)), (channels[-1], 5)]
    return IntegerNetwork(tuple(
        IntegerLayer(
            dice.integers(-127, 128, shape).astype(np.float32),
            dice.integers(-5000, 5000, shape[1]).astype(np.float32),
            dice.uniform(0.001, 0.004, shape[1]).astype(np.float32),
        )
        for shape in shapes
    ))  # fmt: skip


def in_integers(network: IntegerNetwork, picture: np.ndarray) -> np.ndarray:
    """Return the same result, computed with sums of 64-bit integers, which no BLAS computes."""
    values = picture[None].astype(np.float32) - np.float32(MIDDLE)
    for layer, stride, dilation in zip(network.layers, STRIDES, DILATIONS, strict=False):
        seen = taps(values, stride, dilation).astype(np.int64)
        sums = seen @ layer.weights.astype(np.int64) + layer.bias.astype(np.int64)
        values = np.clip(np.rint(sums.astype(np.float32) * layer.scale), 0, TOP).astype(np.float32)
    top = network.layers[-1]
    sums = values.astype(np.int64) @ top.weights.astype(np.int64) + top.bias.astype(np.int64)
    return (sums.astype(np.float32) * top.scale)[0]


@pytest.mark.parametrize("seed", range(4))
def test_the_network_computes_exactly_the_integer_result(seed: int) -> None:
    picture = np.random.default_rng(seed).integers(0, 256, (50 + seed, 71, 3)).astype(np.uint8)
    network = made_network(seed)
    assert np.array_equal(network.answer(picture), in_integers(network, picture))


def test_a_picture_split_into_bands_has_the_same_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    picture = np.random.default_rng(9).integers(0, 256, (203, 60, 3)).astype(np.uint8)
    network = made_network(9)
    whole = network.answer(picture)
    monkeypatch.setattr(net, "BAND_ROWS", 7)
    assert np.array_equal(network.answer(picture), whole)


def test_weights_whose_sums_could_be_rounded_are_refused() -> None:
    scale = np.ones(1, np.float32)
    IntegerLayer(np.full((500, 1), 127, np.float32), scale, scale)
    for weights in (np.full((600, 1), 127, np.float32), np.full((5, 1), 0.5, np.float32)):
        with pytest.raises(ValueError, match="whole numbers are exact"):
            IntegerLayer(weights, scale, scale)


def test_a_picture_is_reduced_by_averaging_squares_of_pixels() -> None:
    rgb = np.zeros((5, 7, 3), np.uint8)
    rgb[0, 0], rgb[0, 1], rgb[1, 0] = 255, 255, 254
    small = reduced(rgb, 2)
    assert small.shape == (2, 3, 3)
    assert small[0, 0].tolist() == [191] * 3  # 764 / 4
    assert small.sum() == 3 * 191
    assert reduced(rgb, 1) is rgb


def test_the_scale_follows_from_the_height_and_is_absent_below_the_ground() -> None:
    scale = TargetScale(metres_per_px=0.09)
    heights = {100.0: (1,), 50.0: (2,), 25.0: (4,), -1.0: ()}
    assert {h: scale.factors_for(camera_pose((0.0, 0.0, h), 0.0, NADIR), 0.0) for h in heights} == heights
    assert TargetScale(factors=(1, 2)).factors_for(POSE, 500.0) == (1, 2)


def test_overlapping_boxes_are_reduced_to_one_and_confidence_follows_a_curve() -> None:
    """The network reports a target that reaches 8 px to each side of bright cells."""
    top = np.zeros((1, 5), np.float32)
    top[0, 0] = 1.0
    answer = np.zeros((20, 30, 5), np.float32)
    answer[..., 0] = -9.0
    answer[..., 1:] = 8.0
    answer[5, 5, 0], answer[5, 6, 0], answer[15, 20, 0] = 3.0, 2.0, 1.0

    class Fixed(IntegerNetwork):
        def answer(self, picture: np.ndarray) -> np.ndarray:
            return answer

    detector = LearnedDetector(TargetScale(factors=(2,)), Fixed(()), (0.0, 2.0, 4.0), (0.0, 0.5, 1.0))
    boxes = detector.find(np.full((160, 240, 3), 9, np.uint8), POSE, 0.0)
    assert [round(each.confidence, 3) for each in boxes] == [0.75, 0.25]
    x, y = 2 * (5 * CELL_PX + 0.5), 2 * (5 * CELL_PX + 0.5)
    assert boxes[0].box == pytest.approx(((x - 16) / 240, (y - 16) / 160, (x + 16) / 240, (y + 16) / 160))
    assert detector.find(np.zeros((160, 240, 3), np.uint8), POSE, 0.0) == ()


def test_fires_in_boxes_are_where_the_rules_would_put_them() -> None:
    rgb = np.full((720, 1280, 3), (90, 95, 100), np.uint8)
    rgb[300:420, 600:680] = (240, 150, 40)
    rgb[300:420, 600:680:2, 1] = 130  # flames differ from pixel to pixel
    pose = camera_pose((0.0, 0.0, 0.37), 0.0, EYE)
    (ruled,) = find_fires_ahead(rgb, pose)
    (boxed,) = fires_in_boxes([FoundBox(ruled.box, 0.8), FoundBox((0.1, 0.4, 0.2, 0.5), 0.4)], pose, 0.0)
    assert boxed.distance_m == pytest.approx(ruled.distance_m, rel=0.05)
    assert boxed.bearing_deg == pytest.approx(ruled.bearing_deg, abs=0.1)
    assert (boxed.box, boxed.confidence) == (ruled.box, 0.8)


def test_a_searcher_reports_the_detections_of_a_trained_detector_instead_of_the_rules() -> None:
    levels_m = []

    def find(seen: Picture, level_m: float) -> tuple[FoundBox, ...]:
        levels_m.append(level_m)
        return (FoundBox((0.49, 0.48, 0.51, 0.52), 0.9),)

    searcher = brief("scout[1]", "broadcast")
    rules = rules_for(searcher, {"person_in_water": find})
    here = (200.0, -900.0, 96.5)
    decision = rules.act(observe("scout[1]", 3, view("uav[1]", here), pictures=(picture(here, tick=3),)), Inbox())
    (report,) = [message for message in decision.messages if message.kind == "detection"]
    assert report.body["confidence"] == 0.9
    assert levels_m == [searcher.water_level_m]
    assert rules_for(searcher, {"whale": find}).act(
        observe("scout[1]", 3, view("uav[1]", here), pictures=(picture(here, tick=3),)), Inbox()
    ).messages == ()  # fmt: skip


def test_the_policy_uses_every_shipped_detector() -> None:
    policy = build_policy(PluginHost().policy("learned"), {})
    assert set(policy._detectors) == set(learned_detectors()) != set()  # type: ignore[attr-defined]
    assert not PluginHost().policy("learned").privileged


def test_shipped_weights_are_small_and_match_their_model_cards() -> None:
    files = [Path(str(each)) for each in WEIGHTS.iterdir() if each.name.endswith(".npz")]
    assert files
    assert sum(each.stat().st_size for each in files) < 5_000_000
    for file in files:
        card = json.loads(file.with_suffix(".json").read_text())
        assert card["weights_sha256"] == hashlib.sha256(file.read_bytes()).hexdigest()
        assert card["class"] == file.stem in SCALES
        assert min(card["seeds"]) >= 2000  # no seed of an evaluation
        assert f"`{file.stem}`" in (WEIGHTS / "CARD.md").read_text()
        assert learned_detector(file.stem) is not None
    assert learned_detector("whale") is None
