"""Seeded draws: in the region, apart, prefix-stable and independent of each other."""

import itertools
import math
import statistics

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lingjing.errors import MissionError
from lingjing.mission import geometry2d
from lingjing.mission.draws import Drawn, draw, sites
from lingjing.mission.evaluate import Area, Place, Scope
from lingjing.testing import expressions as ex

FIELD = ((0.0, 0.0), (800.0, 0.0), (800.0, 300.0), (300.0, 300.0), (300.0, 350.0), (0.0, 350.0))
SCOPE = Scope(areas={"field": Area(FIELD)})
SEEDS = st.integers(0, 2**31)


def n(value: float) -> ex.Number:
    return ex.Number(value)


@given(SEEDS, st.integers(0, 8), st.floats(0.0, 80.0), st.floats(0.0, 40.0))
def test_sites_lie_in_the_region_and_apart(seed: int, count: int, apart: float, clear: float) -> None:
    named = (("apart", n(apart)), ("clear", n(clear)))
    expr = ex.Draw("sites", (ex.Ref("field", "region"),), named)
    places = draw(expr, SCOPE, seed=seed, path="m/v/position", count=count).values
    points = [(place.east, place.north) for place in places if isinstance(place, Place)]
    assert len(points) == count
    assert all(geometry2d.contains(FIELD, *point) for point in points)
    assert all(geometry2d.edge_distance(FIELD, *point) >= clear for point in points)
    assert all(math.dist(a, b) >= apart for a, b in itertools.combinations(points, 2))
    assert all(round(value, 3) == value for point in points for value in point)


@given(SEEDS, st.integers(1, 7), st.floats(0.0, 100.0))
def test_fewer_sites_are_a_prefix_of_more_sites(seed: int, count: int, apart: float) -> None:
    more, anew = sites(FIELD, apart, seed=seed, path="p", count=count + 1)
    assert anew or sites(FIELD, apart, seed=seed, path="p", count=count)[0] == more[:count]


TIGHT = {
    "sites": ex.Draw("sites", (ex.Ref("field", "region"),), (("apart", n(380)),)),
    "subset": ex.Draw(
        "subset",
        tuple(ex.Point((n(100 * east), n(100 * north))) for east in range(4) for north in range(2)),
        (("apart", n(250)),),
    ),
}


@pytest.mark.parametrize("distribution", TIGHT)
def test_a_larger_group_extends_the_smaller_one_or_is_marked_as_drawn_anew(distribution: str) -> None:
    changed = redrawn = 0
    for seed in range(60):
        groups = [_drawn(TIGHT[distribution], seed, count) for count in (1, 2, 3)]
        for fewer, more in itertools.pairwise(groups):
            if fewer is None or more is None:
                continue
            keeps = more.values[: len(fewer.values)] == fewer.values
            assert keeps or more.anew or fewer.anew
            changed += not keeps
            redrawn += more.anew
    assert 0 < changed <= 2 * redrawn, (changed, redrawn)


def _drawn(expr: ex.Draw, seed: int, count: int) -> Drawn | None:
    try:
        return draw(expr, SCOPE, seed=seed, path="p", count=count)
    except MissionError:
        return None


@given(SEEDS, st.sampled_from(["uniform", "normal", "choice", "subset"]), st.integers(1, 5))
def test_fewer_values_are_a_prefix_of_more_values(seed: int, distribution: str, count: int) -> None:
    listed = ex.Sequence(tuple(n(k) for k in range(9)))
    arguments = (n(1), n(4)) if distribution in ("uniform", "normal") else (listed,)
    expr = ex.Draw(distribution, arguments)
    more = draw(expr, SCOPE, seed=seed, path="p", count=count + 1)
    assert draw(expr, SCOPE, seed=seed, path="p", count=count).values == more.values[:count] and not more.anew


@given(SEEDS, st.integers(1, 9))
def test_a_subset_has_no_repeats(seed: int, count: int) -> None:
    expr = ex.Draw("subset", tuple(n(k) for k in range(9)))
    assert len(set(draw(expr, SCOPE, seed=seed, path="p", count=count).values)) == count


@given(SEEDS)
def test_a_bounded_normal_stays_in_its_bounds(seed: int) -> None:
    expr = ex.Draw("normal", (n(0), n(2)), (("low", n(-1)), ("high", n(1))))
    values = draw(expr, SCOPE, seed=seed, path="p", count=20).values
    assert all(isinstance(value, float) and -1 <= value <= 1 for value in values)


@settings(max_examples=1)
@given(st.just(0))
def test_sites_are_uniform(_: int) -> None:
    places = [sites(FIELD, 0.0, seed=seed, path="p", count=1)[0][0] for seed in range(4000)]
    centre = geometry2d.centroid(FIELD)
    assert statistics.fmean(east for east, _ in places) == pytest.approx(centre[0], abs=3 * 231 / math.sqrt(4000))
    notch = sum(north > 300 for _, north in places) / 4000
    assert notch == pytest.approx(300 * 50 / abs(geometry2d.signed_area(FIELD)), abs=0.012)


def test_a_tight_layout_is_retried_before_the_draw_fails() -> None:
    # Two places 900 m apart in a 1000 m strip: four attempts in five fail with their first dart.
    strip = ((0.0, 0.0), (1000.0, 0.0), (1000.0, 1.0), (0.0, 1.0))
    tries = [_placed(strip, seed) for seed in range(20)]
    assert sum(tries) >= 10


def _placed(strip: geometry2d.Polygon, seed: int) -> bool:
    try:
        ((a, b), _) = sites(strip, 900.0, seed=seed, path="p", count=2)
    except MissionError:
        return False
    return math.dist(a, b) >= 900.0


@pytest.mark.parametrize(
    ("expr", "count", "words", "hint"),
    [
        (
            ex.Draw("sites", (ex.Ref("field", "region"),), (("apart", n(900)),)),
            3,
            "3 places at least 900 m apart do not fit into 25.5 ha: 1 fitted at best",
            "lower 'apart'",
        ),
        (ex.Draw("sites", (ex.Ref("field", "region"),), (("part", n(9)),)), 1, "no option 'part'", "apart, clear"),
        (ex.Draw("sites", (n(4),)), 1, "expected a region", ""),
        (
            ex.Draw("poisson", (n(4),)),
            1,
            "no distribution 'poisson'",
            "sites, sites_along, uniform, integer, normal, choice",
        ),
        (ex.Draw("uniform", (n(4), n(1))), 1, "uniform(4, 1) is empty", "lower end first"),
        (ex.Draw("uniform", (n(4),)), 1, "takes two numbers", ""),
        (ex.Draw("normal", (n(4), n(-1))), 1, "deviation of -1", "0 or more"),
        (ex.Draw("normal", (n(0), n(1)), (("low", n(50)),)), 1, "did not fall into 50..inf", "widen"),
        (ex.Draw("subset", (n(4), n(1))), 3, "3 different items cannot be drawn from a list of 2", "choice(…)"),
        (ex.Draw("choice", (ex.Sequence(()),)), 3, "needs a list", ""),
    ],
)
def test_errors_of_draws_state_the_numbers_and_a_hint(expr: ex.Draw, count: int, words: str, hint: str) -> None:
    with pytest.raises(MissionError) as caught:
        draw(expr, SCOPE, seed=1, path="p", count=count)
    assert words in str(caught.value) and hint in caught.value.hint
