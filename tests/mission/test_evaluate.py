"""Static expressions."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lingjing.errors import MissionError
from lingjing.mission.evaluate import Area, Interval, Members, Place, Scope, evaluate, further_place, number, whole
from lingjing.testing import expressions as ex

SCOPE = Scope(
    parameters={"uavs": 3.0},
    mode="star",
    areas={"field": Area(((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)))},
    members={"uav": ("uav[1]", "uav[2]"), "boat": ("boat",)},
    names={"i": 2.0},
    tick_s=10.0,
)


def n(value: float) -> ex.Number:
    return ex.Number(value)


def p(*items: float) -> ex.Point:
    return ex.Point(tuple(n(item) for item in items))


UAV, INDEX = ex.Ref("uav", "group"), ex.Ref("i", "local")
FIELD = ex.Ref("field", "region")
PADS = ex.Sequence((p(0, 0, 1), p(100, 0, 1)))


@pytest.mark.parametrize(
    ("expr", "value"),
    [
        (ex.Binary("+", n(1), ex.Binary("*", n(2), n(3))), 7.0),
        (ex.Binary("/", ex.Binary("-", n(1), n(4)), n(2)), -1.5),
        (ex.Unary("-", ex.Ref("uavs", "param")), -3.0),
        (ex.Binary("==", ex.Ref("mode", "mode"), ex.Symbol("star")), True),
        (ex.Binary("!=", ex.Ref("mode", "mode"), ex.Symbol("star")), False),
        (ex.Unary("not", ex.Binary("<", n(1), n(2))), False),
        (ex.Binary("or", ex.Flag(False), ex.Binary(">=", n(2), n(2))), True),
        (ex.Binary("in", n(2), ex.Range(n(1), n(3))), True),
        (ex.Binary("in", p(11, 5), FIELD), False),
        (ex.Binary("in", p(10, 5), FIELD), True),
        (ex.Binary("+", p(1, 2), p(3, 4, 5)), Place(4.0, 6.0, 5.0)),
        (ex.Range(n(1), n(3)), Interval(1.0, 3.0)),
        (ex.Index(UAV, INDEX), Members(("uav[2]",))),
        (ex.Index(ex.Sequence((n(7), n(8))), INDEX), 8.0),
        (ex.Attr(FIELD, "centre"), Place(5.0, 5.0)),
        (ex.Attr(FIELD, "area"), 100.0),
        (ex.Attr(p(1, 2, 3), "elevation"), 3.0),
        (ex.Ref("tick", "clock"), 10.0),
        (ex.Call("max", (n(1), n(5), n(2))), 5.0),
        (ex.Call("distance", (p(0, 0, 0), p(3, 4, 12))), 13.0),
        (ex.Call("distance_xy", (p(0, 0, 0), p(3, 4, 12))), 5.0),
        (ex.Call("at", (n(2), PADS)), Place(100.0, 0.0, 1.0)),
        (ex.Call("at", (n(3), ex.Sequence((n(30), n(40))))), 30.0),
        (ex.Call("box", (p(4, 1), p(0, 3))), Area(((0.0, 1.0), (4.0, 1.0), (4.0, 3.0), (0.0, 3.0)))),
        (ex.Call("polygon", (p(0, 0), p(0, 1), p(1, 0))), Area(((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))),
    ],
)
def test_static_expressions_have_the_expected_values(expr: ex.Expr, value: object) -> None:
    assert evaluate(expr, SCOPE) == value


@pytest.mark.parametrize(
    ("expr", "words"),
    [
        (ex.Binary("/", n(1), n(0)), "division by zero"),
        (ex.Binary("+", n(1), ex.Symbol("red")), "'+' does not apply to the number 1 and the word 'red'"),
        (ex.Binary("+", n(1), ex.Flag(True)), "does not apply"),
        (ex.Binary("and", ex.Flag(True), n(1)), "expected true or false, got the number 1"),
        (ex.Ref("victims", "param"), "there is no param 'victims'"),
        (ex.Index(UAV, n(3)), "there is no member 3, the group has 2"),
        (ex.Index(UAV, n(0)), "there is no member 0"),
        (ex.Index(UAV, n(1.5)), "expected a whole number, got 1.5"),
        (ex.Attr(ex.Ref("boat", "group"), "speed"), "boat has no 'speed' before the mission runs"),
        (ex.Range(n(3), n(1)), "3..1 is empty"),
        (p(1), "2 or 3 components, not 1"),
        (ex.Call("truth", (UAV, n(1))), "needs a running mission"),
        (ex.Call("matched", rule=True), "needs a running mission"),
        (ex.Quantified("exists", "r", "detection", ex.Flag(True)), "needs a running mission"),
        (ex.Draw("uniform", (n(0), n(1))), "must be the whole value"),
        (ex.Call("at", (n(3), PADS)), "member 3 has no place: the list has 2"),
        (ex.Call("at", (n(3), PADS), (("spread", n(0)),)), "spread = 0 m"),
        (ex.Call("at", (n(0), PADS)), "counts from 1"),
        (ex.Call("sqrt", (n(-1),)), "sqrt(-1) has no value"),
        (ex.Call("circle", (p(0, 0), n(-1))), "length above 0"),
        (ex.Call("polygon", (p(0, 0), p(9, 9), p(9, 0), p(0, 8))), "crosses itself"),
    ],
)
def test_a_faulty_expression_raises_an_error_with_the_reason(expr: ex.Expr, words: str) -> None:
    with pytest.raises(MissionError) as caught:
        evaluate(expr, SCOPE)
    assert words in str(caught.value)


def test_an_overflow_is_an_error_and_whole_returns_an_integer() -> None:
    with pytest.raises(MissionError, match="too large"):
        number(ex.Binary("*", n(1e300), n(1e300)), SCOPE)
    assert whole(ex.Ref("uavs", "param"), SCOPE) == 3


@given(st.integers(3, 60), st.floats(1.0, 50.0))
def test_further_members_keep_their_distance_and_do_not_move_earlier_members(count: int, spread: float) -> None:
    pads = (Place(0.0, 0.0, 1.0), Place(200.0, 0.0, 1.0))
    places = [pads[0], pads[1], *(further_place(pads, spread, k) for k in range(3, count + 1))]
    assert places[2:-1] == [further_place(pads, spread, k) for k in range(3, count)]
    gaps = (math.dist((a.east, a.north), (b.east, b.north)) for k, a in enumerate(places) for b in places[:k])
    assert min(gaps) >= min(spread, 200.0) - 2e-3
    assert all(place.elevation == 1.0 for place in places)
