"""Tests of the later starts that are tried for a pair."""

import pytest

from lingjing.causal.later_starts import later_starts


@pytest.mark.parametrize(
    ("departed", "agreed", "expected"),
    [
        ((7,), (), []),
        ((1, 3), (), [3]),
        (tuple(range(60)), (), [30, 15, 45]),
        ((1, 11, 20, 24, 28, 32), (15,), [20, 24, 11, 28]),  # anew at 20; a half, a quarter and three
        # quarters of six at 24, 11 and 28
        ((0, 3, 5, 7, 9, 13, 14, 15, 16), (2, 4, 6, 8, 10, 11), [13, 3, 5, 7]),
    ],
)
def test_starts_of_runs_of_departures_come_before_middle_and_quarters(
    departed: tuple[int, ...], agreed: tuple[int, ...], expected: list[int]
) -> None:
    assert later_starts(departed, agreed) == expected
