"""Boxes of few pixels: shifts that pass, and the chance of a blind box, compared with counts over all shifts."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from lingjing import Trace
from lingjing.analysis.detection import iou
from lingjing.analysis.small_boxes import chance, chance_level, passes, strict_detections, tolerance_of


@pytest.mark.parametrize(("shift", "tolerance", "passed"), [
    ((2, 2), 0, True), ((3, 3), 0, False), ((3, 3), 3, True), ((3, 0), 0, True), ((4, 3), 3, False), ((0, 0), 0, True),
])  # fmt: skip
def test_a_shifted_box_of_15_by_9_pixels_passes_within_its_tolerance(
    shift: tuple[float, float], tolerance: float, passed: bool
) -> None:
    assert passes(15, 9, shift, tolerance) == passed
    moved = (shift[0] / 1920, shift[1] / 1080, (15 + shift[0]) / 1920, (9 + shift[1]) / 1080)
    assert (iou((0.0, 0.0, 15 / 1920, 9 / 1080), moved) >= 0.5) == passes(15, 9, shift)


@pytest.mark.parametrize(("size", "tolerance"), [((15, 9), 0), ((15, 9), 3), ((60, 40), 3), ((8, 8), 5)])
def test_the_chance_is_the_share_of_places_that_pass(size: tuple[int, int], tolerance: float) -> None:
    """Counted over shifts of a tenth of a pixel in a picture of 200 by 100."""
    steps = [n / 10 + 0.05 for n in range(-400, 400)]
    passed = sum(passes(*size, shift, tolerance) for shift in itertools.product(steps, steps)) / 100
    room = (200 - size[0]) * (100 - size[1])
    assert chance(*size, (200, 100), tolerance) == pytest.approx(passed / room, rel=0.02)


def test_both_scores_of_a_mission_without_tolerance_are_the_same(trace: Trace, tmp_path: Path) -> None:
    assert tolerance_of(trace) == 0.0
    level = chance_level(trace, 0.0)
    assert level is not None and 0.0 < level < 0.01
    assert chance_level(trace, 3.0) >= level  # type: ignore[operator]
    assert strict_detections(trace) == 4
