"""Flight levels: no two aircraft of a team share one, whatever heights their tasks need."""

import itertools
import math

import pytest
from lingjing_agents.flight_levels import LAYER_M, FlightLevels, crowded, overhead


@pytest.mark.parametrize("count", [2, 3, 10])
@pytest.mark.parametrize("band", [(20.0, 160.0), (0.0, math.inf), (-5.0, 45.0)])
def test_two_aircraft_never_share_a_flight_level(count: int, band: tuple[float, float]) -> None:
    fleet = [FlightLevels(index, count, *band, anchor_m=96.5) for index in range(count)]
    levels = [{round(layers.level(float(z)), 6) for z in range(-20, 300, 3)} for layers in fleet]
    for mine, others in itertools.combinations(levels, 2):
        assert min(abs(own - other) for own in mine for other in others) >= LAYER_M - 1e-6
    assert all(band[0] <= z <= band[1] for own in levels for z in own)


@pytest.mark.parametrize("z", [25.0, 40.0, 96.5, 150.0])
def test_the_level_of_each_aircraft_is_just_above_the_requested_height(z: float) -> None:
    for index in range(4):
        assert 0.0 <= FlightLevels(index, 4, 0.0, 1000.0).level(z) - z < LAYER_M * 4.0
    assert [FlightLevels(index, 3, 20.0, 160.0, anchor_m=96.5).level(96.5) for index in range(3)] == [96.5, 99.0, 101.5]


def test_a_thin_band_is_shared_out() -> None:
    levels = [FlightLevels(index, 5, 30.0, 38.0).level(100.0) for index in range(5)]
    assert levels == [30.0, 32.0, 34.0, 36.0, 38.0]


def test_a_single_aircraft_flies_at_the_requested_height_within_the_band() -> None:
    assert FlightLevels(0, 1, 20.0, 160.0).level(77.7) == 77.7
    assert FlightLevels(0, 1, 20.0, 160.0).level(3.0) == 20.0


def test_a_pad_is_crowded_by_near_aircraft_and_blocked_by_an_aircraft_overhead() -> None:
    here = (0.0, 0.0, 1.0)
    assert crowded(here, [(8.0, 0.0, 1.0)]) and not crowded(here, [(30.0, 0.0, 1.0)])
    assert overhead(here, [(3.0, 0.0, 20.0)]) and not overhead(here, [(8.0, 0.0, 1.0)])
