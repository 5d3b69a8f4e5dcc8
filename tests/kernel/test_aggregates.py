"""Aggregates over groups in rules, and features that the kernel rejects."""

import msgspec
import pytest

from lingjing.errors import UsageError
from lingjing.kernel.adjudication import Adjudicator
from lingjing.kernel.registry import initial
from lingjing.kernel.rules import depends_on_motion, evaluate
from lingjing.mission.instance import Region
from lingjing.testing import rescue as kit
from lingjing.testing.expressions import Aggregate, Attr, Binary, Call, Index, Number, Range, Ref, Symbol
from lingjing.trace.records import TaskEvent

EAST = Attr(base=Attr(base=kit.local("v"), name="position"), name="east")


def value(expression, victims=((100.0, 0.0), (-40.0, 0.0), (7.0, 0.0))):
    instance = kit.instance(victims=victims)
    registry = initial(instance)
    return evaluate(expression, {}, Adjudicator(instance).context_at(registry, registry.states, 0.0))


def over(function, body):
    return Aggregate(function=function, variable="v", domain="victim", body=body)


@pytest.mark.parametrize(("function", "expected"), [("sum", 67.0), ("min", -40.0), ("max", 100.0)])
def test_sum_min_and_max_aggregate_over_a_group(function, expected):
    assert value(over(function, EAST)) == expected


def test_count_counts_where_the_condition_holds():
    assert value(over("count", Binary(operator=">", left=EAST, right=Number(value=5.0)))) == 2.0


@pytest.mark.parametrize(("function", "expected"), [("sum", 0.0), ("count", 0.0), ("min", None), ("max", None)])
def test_sum_and_count_of_an_empty_group_are_zero_and_min_and_max_are_undefined(function, expected):
    assert value(over(function, EAST), victims=()) == expected


@pytest.mark.parametrize(("name", "expected"), [("min", -2.0), ("max", 3.0)])
def test_min_max_and_abs_apply_to_numbers_only(name, expected):
    assert value(Call(function=name, arguments=(Number(value=3.0), Number(value=-2.0)))) == expected
    assert value(Call(function="abs", arguments=(Number(value=-2.0),))) == 2.0
    assert value(Call(function=name, arguments=(Number(value=3.0), Ref(name="boat", kind="entity")))) is None


def test_a_mission_with_features_that_the_kernel_does_not_implement_is_rejected():
    instance = msgspec.structs.replace(
        kit.instance(), regions=(Region(name="street", polygon=(), on_map=Number(value=1.0)),)
    )
    with pytest.raises(
        UsageError, match="`kit` cannot be played yet: the kernel does not implement regions along roads"
    ):
        kit.kernel(instance)
    inspected = kit.instance(success=Call(function="levitates", arguments=()))
    with pytest.raises(UsageError, match=r"`levitates\(…\)` in rules"):
        kit.kernel(inspected)


def test_rules_read_the_declared_tick_length_and_the_current_time():
    instance = kit.instance()
    at = Adjudicator(instance).context_at(initial(instance), initial(instance).states, 37.0)
    later = Binary(operator=">", left=Ref("now", "clock"), right=Binary("*", Number(value=3.0), Ref("tick", "clock")))
    assert evaluate(Ref("tick", "clock"), {}, at) == instance.clock.tick_s == 10.0
    assert evaluate(Ref("now", "clock"), {}, at) == 37.0
    assert evaluate(later, {}, at) is True
    assert depends_on_motion(later, {}, frozenset(), frozenset()) and not depends_on_motion(
        later.right, {}, frozenset(), frozenset()
    )


@pytest.mark.parametrize(("low", "high", "there"), [(90.0, 110.0, True), (100.0, 110.0, True), (101.0, 110.0, False)])
def test_the_operator_in_includes_the_lower_bound_of_a_range(low, high, there):
    inside = Binary(operator="in", left=EAST, right=Range(low=Number(value=low), high=Number(value=high)))
    assert value(over("count", inside)) == float(there)


def test_a_condition_on_a_missing_group_member_has_no_value():
    missing = Index(base=Ref(name="victim", kind="group"), index=Number(value=9.0))
    done = Call(function="emitted", arguments=(Symbol(name="rescue"), missing))
    instance = kit.instance()
    registry = initial(instance).with_events((TaskEvent(kind="rescue", entities=("victim[1]",), time_s=0.0),))
    at = Adjudicator(instance).context_at(registry, registry.states, 0.0)
    assert evaluate(done, {}, at) is None
    assert evaluate(msgspec.structs.replace(done, arguments=done.arguments[:1]), {}, at) is True
