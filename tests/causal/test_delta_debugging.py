"""Delta debugging on sets of numbers."""

from collections.abc import Sequence

import pytest

from lingjing.causal.delta_debugging import minimize


def finder(needed: set[int], tried: list[tuple[int, ...]]):
    def first_failing(candidates: Sequence[tuple[int, ...]]) -> int | None:
        for number, candidate in enumerate(candidates):
            tried.append(candidate)
            if needed <= set(candidate):
                return number
        return None

    return first_failing


@pytest.mark.parametrize("needed", [{3}, {0, 15}, {4, 5, 6}, set(range(16)), {7, 2, 11, 13}])
def test_only_the_needed_parts_remain(needed: set[int]) -> None:
    tried: list[tuple[int, ...]] = []
    assert set(minimize(range(16), finder(needed, tried))) == needed
    assert len(tried) <= 16 * 16 + 3 * 16  # the bound of the paper


def test_no_part_remains_if_none_is_needed() -> None:
    tried: list[tuple[int, ...]] = []
    assert minimize(range(8), finder(set(), tried)) == ()
    assert tried == [()]


def test_no_single_part_of_the_result_can_be_removed() -> None:
    def fails(candidate: set[int]) -> bool:  # not monotone: 1 needs 2, and 3 spoils it unless 4 is there
        return 1 in candidate and 2 in candidate and (3 not in candidate or 4 in candidate)

    def first_failing(candidates: Sequence[tuple[int, ...]]) -> int | None:
        return next((number for number, candidate in enumerate(candidates) if fails(set(candidate))), None)

    kept = set(minimize(range(6), first_failing))
    assert fails(kept)
    assert not any(fails(kept - {part}) for part in kept)
