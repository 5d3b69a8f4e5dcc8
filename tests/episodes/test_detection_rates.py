"""Rates of the detector of people at sea over several seeds."""

import pytest

from agents.tests.test_detector import camera, count

pytestmark = pytest.mark.episodes

SEEDS = (9001, 9002, 9003)

__all__ = ["camera"]


@pytest.mark.parametrize(
    ("height_m", "sure", "least_recall", "least_precision", "most_error_m"),
    [(100.0, 0.05, 0.7, 0.7, 2.0), (50.0, 0.3, 0.8, 0.9, float("inf"))],
)
def test_most_people_and_few_other_objects_are_detected(
    camera, height_m: float, sure: float, least_recall: float, least_precision: float, most_error_m: float
) -> None:
    recall, precision, error_m = count(camera, height_m, sure, SEEDS)
    assert recall >= least_recall
    assert precision >= least_precision
    assert error_m < most_error_m
