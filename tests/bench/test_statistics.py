"""Intervals and tests of tables: published numbers, SciPy's and the definitions, on drawn tables."""

import itertools
import math
import random

import numpy as np
import pytest

from lingjing.analysis.shares import wilson
from lingjing.bench.statistics import (
    bootstrap,
    difference_bounds,
    holm,
    macro_average,
    macro_bounds,
    mcnemar,
    smallest_difference,
    trend,
)  # fmt: skip


def test_wilson_interval_matches_published_values() -> None:
    """Brown, Cai and DasGupta (2001); 8 of 10: 0.4902 to 0.9433."""
    assert wilson(8, 10) == pytest.approx((0.4901625, 0.9433178), abs=1e-6)
    assert wilson(0, 10)[0] == 0.0 and wilson(10, 10)[1] == 1.0
    assert wilson(10, 10)[0] == pytest.approx(0.7224672, abs=1e-6)
    assert all(math.isnan(end) for end in wilson(0, 0))


def test_wilson_interval_covers_the_true_rate_in_about_95_percent_of_draws() -> None:
    draws = random.Random(3)
    held = 0
    for _ in range(2000):
        won = sum(draws.random() < 0.3 for _ in range(50))
        low, high = wilson(won, 50)
        held += low <= 0.3 <= high
    assert 0.93 <= held / 2000 <= 0.97


def test_the_bootstrap_is_repeatable_and_near_the_normal_interval() -> None:
    draws = random.Random(1)
    values = [draws.gauss(5.0, 2.0) for _ in range(200)]
    low, high = bootstrap(values)
    assert (low, high) == bootstrap(values)
    mean = sum(values) / 200
    half = 1.96 * math.sqrt(sum((value - mean) ** 2 for value in values) / 200 / 200)
    assert (low, high) == pytest.approx((mean - half, mean + half), abs=0.05)
    assert bootstrap([2.0]) == (2.0, 2.0)
    assert math.isnan(bootstrap([]).low)


def test_the_macro_average_averages_modes_before_missions() -> None:
    columns = {("ufr", "star"): {0: 1.0, 1: 1.0}, ("ufr", "broadcast"): {0: 0.0, 1: 0.0}, ("bi", "single"): {0: 1.0}}
    assert macro_average(columns) == 0.75
    low, high = macro_bounds({name: dict.fromkeys(range(50), 0.0) | {0: 1.0} for name in columns})
    assert 0.0 <= low < 0.02 < high < 0.1


def test_mcnemar_and_holm_match_values_computed_by_hand() -> None:
    first = {seed: seed < 12 for seed in range(20)}
    second = {seed: seed < 2 or seed == 19 for seed in range(25)}
    test = mcnemar(first, second)
    assert test[:3] == (20, 10, 1)
    assert test.p == pytest.approx(2 * sum(math.comb(11, k) for k in (0, 1)) / 2**11)
    assert mcnemar(first, first).p == 1.0
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([]) == []


def test_wilson_interval_equals_its_closed_form() -> None:
    """SciPy's interval equals the formula of Wilson (1927) that computed it before, so published tables stay equal."""
    z = 1.959963984540054  # the standard normal quantile at 0.975
    drawn = np.random.default_rng(1)
    counts = [*range(1, 30), *(int(count) for count in drawn.integers(30, 400, 40)), 10_000, 1_000_000]
    for played in counts:
        for won in {0, 1, int(drawn.integers(0, played + 1)), played - 1, played}:
            share, square = won / played, z * z / played
            middle = (share + square / 2) / (1 + square)
            half = z * math.sqrt(share * (1 - share) / played + square / played / 4) / (1 + square)
            expected = (middle - half if won else 0.0, middle + half if won < played else 1.0)
            assert wilson(won, played) == pytest.approx(expected, abs=1e-12, rel=0)


def test_mcnemars_test_is_the_exact_binomial_over_pairs_that_differ() -> None:
    drawn = np.random.default_rng(2)
    for played in drawn.integers(1, 120, 60):
        shares = drawn.random(2)
        first, second = ({seed: bool(drawn.random() < share) for seed in range(played)} for share in shares)
        second.pop(0)  # an instance that only the first has played
        only = sum(first[seed] > second[seed] for seed in second), sum(first[seed] < second[seed] for seed in second)
        differing = sum(only)
        tail = sum(math.comb(differing, count) for count in range(min(only) + 1)) / 2**differing
        tested = mcnemar(first, second)
        assert tested[:3] == (played - 1, *only)
        assert tested.p == pytest.approx(min(1.0, 2 * tail), abs=1e-9)


@pytest.mark.parametrize("kind", ["shares", "successes"])
def test_the_bootstrap_is_scipys_percentile_bootstrap_of_the_mean(kind: str) -> None:
    drawn = np.random.default_rng(3)
    values = drawn.random(100) if kind == "shares" else (drawn.random(100) < 0.3).astype(float)
    from scipy import stats  # not above: it takes half a second to import, and every run of tests collects this file

    scipys = stats.bootstrap((values,), np.mean, method="percentile", n_resamples=9999, rng=drawn, batch=1000)
    low, high = scipys.confidence_interval
    assert bootstrap(list(values)) == pytest.approx((low, high), abs=0.12 * (high - low))


def test_the_macro_average_weights_missions_equally_and_resamples_seeds_jointly_over_modes() -> None:
    """The mean of VDN and of the mean of two modes; modes that always agree vary as much as one of them does."""
    drawn = np.random.default_rng(4)
    won = {seed: float(drawn.random() < 0.4) for seed in range(60)}
    lost = {seed: 1.0 - value for seed, value in won.items()}
    columns = {("vdn", "single"): won, ("ssr", "star"): won, ("ssr", "broadcast"): lost}
    assert macro_average(columns) == pytest.approx((sum(won.values()) / 60 + 0.5) / 2)
    assert macro_bounds({("ssr", "star"): won, ("ssr", "broadcast"): lost}) == pytest.approx((0.5, 0.5))
    assert macro_bounds({("ssr", "star"): won, ("ssr", "broadcast"): won}) == pytest.approx(
        bootstrap(list(won.values())), abs=0.02
    )


def test_the_smallest_difference_is_detected_in_four_of_five_draws() -> None:
    drawn = np.random.default_rng(5)
    for pairs in (30, 150):
        points = smallest_difference(pairs)
        detected = 0
        for _ in range(400):
            outcome = drawn.choice(3, size=pairs, p=[(0.5 + points) / 2, (0.5 - points) / 2, 0.5])
            first = {seed: bool(outcome[seed] == 0) for seed in range(pairs)}
            second = {seed: bool(outcome[seed] == 1) for seed in range(pairs)}
            detected += mcnemar(first, second).p <= 0.05
        assert 0.74 < detected / 400 < 0.92, (pairs, points)
    assert math.isnan(smallest_difference(5)), "five pairs show nothing"


def test_the_trend_test_matches_the_enumeration_of_all_orders() -> None:
    outcomes = [(True, True, False), (True, False, False), (False, True, True), (True, False, False)]
    observed = sum(level for row in outcomes for level, won in enumerate(row) if won)
    totals = [
        sum(level for row in orders for level, won in enumerate(row) if won)
        for orders in itertools.product(*(list(itertools.permutations(row)) for row in outcomes))
    ]
    assert trend(outcomes) == pytest.approx(sum(total <= observed for total in totals) / len(totals))


def test_a_falling_rate_has_a_small_p_value_and_a_rising_or_flat_rate_has_p_1() -> None:
    falling = [(True, True, True, False, False, False)] * 4
    assert trend(falling) == pytest.approx(1 / 20**4)
    assert trend([tuple(reversed(row)) for row in falling]) == pytest.approx(1.0)
    assert trend([(True,) * 6] * 9) == trend([(False,) * 6]) == 1.0, "no order differs from another"
    assert math.isnan(trend([]))


def test_the_trend_keeps_its_level() -> None:
    draws = random.Random(7)
    rejected = 0
    for _ in range(1000):
        rates = [draws.random() for _ in range(6)]  # instances of different difficulty, levels without an effect
        rejected += trend([[draws.random() < rate for _ in range(6)] for rate in rates]) <= 0.05
    assert rejected / 1000 <= 0.065


def test_newcombe_interval_matches_published_values() -> None:
    """Newcombe (1998), example (a): 56 of 70 less 48 of 80 is 0.20, with 0.0524 to 0.3339."""
    assert difference_bounds((56, 70), (48, 80)) == pytest.approx((0.0524, 0.3339), abs=1e-4)
    assert difference_bounds((10, 10), (0, 20)) == pytest.approx((0.6791, 1.0), abs=1e-4), "example (g)"
    assert all(math.isnan(end) for end in difference_bounds((0, 0), (1, 2)))
