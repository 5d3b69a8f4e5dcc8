"""The subtask completion rate against counts by hand: targets or stages, without weights and penalties."""

import pytest

from lingjing.kernel.subtasks import required_groups
from lingjing.testing import does
from lingjing.testing import rescue as kit
from lingjing.testing.declarations import Constraint, Stage
from lingjing.testing.expressions import Binary, Call, Flag, Number, Point, Quantified, Ref

NEVER = Flag(value=False)
THREE = ((100.0, 0.0), (0.0, -100.0), (-100.0, 0.0))


def reached():
    """The boat has been within 5 m of the victim."""
    return kit.rule(
        "reached",
        Binary("<=", Call("distance_xy", (Ref("boat", "entity"), kit.local("v"))), Number(5.0)),
        ("v", "victim"),
    )


def each(body):
    return Quantified(quantifier="forall", variable="v", domain="victim", body=body)


def after(seconds):
    return Binary(operator=">=", left=Ref(name="now", kind="clock"), right=Number(value=seconds))


def played(*moves, **changes):
    """Return the boundaries of an episode in which the boat goes from place to place."""
    base = {"rules": (reached(),), "unlocks": (), "stages": (), "relations": (), "victims": THREE}
    kernel = kit.kernel(kit.instance(**{**base, **changes}))
    yield kernel.reset()
    for x, y in moves:
        yield kernel.step(kit.decisions(skipper=does("go", x=x, y=y)))


def rates(boundaries):
    return [round(output.record.scr, 6) for output in boundaries]


SUCCESS = each(kit.called("reached", "v"))


def test_the_rate_counts_required_targets_whatever_the_weights_of_stages():
    """Detection has a weight but is not required."""
    stages = (
        Stage(name="detect", condition=after(0.0), variable="v", domain="victim"),
        Stage(name="execute", condition=kit.called("reached", "v"), variable="v", domain="victim", weight=Number(2.0)),
    )
    boundaries = list(played((50.0, -50.0), (100.0, 0.0), success=SUCCESS, stages=stages))
    assert rates(boundaries) == [round(1 / 3, 6), round(1 / 3, 6), round(2 / 3, 6)]
    assert boundaries[-1].evaluation.reward == pytest.approx((1 + 2 * 2 / 3) / 3)  # 0.778


def test_the_rate_is_one_if_all_targets_are_reached_whatever_else_success_requires():
    """Twenty of twenty deliveries give 1, although a vehicle is elsewhere and the score is lower."""
    home = Binary("<=", Call("distance_xy", (Ref("boat", "entity"), Point((Number(0.0), Number(0.0))))), Number(1.0))
    success = kit.both(SUCCESS, Quantified("forall", "u", "uav", home))
    boundaries = list(played((100.0, 0.0), *[(-100.0, 0.0)] * 4, success=success))
    assert (boundaries[-1].record.scr, boundaries[-1].evaluation.done) == (1.0, False)
    assert boundaries[-1].evaluation.reward == pytest.approx(3 / 5)


def test_penalties_and_broken_hard_constraints_do_not_change_the_rate():
    soft = Constraint(name="late", kind="soft", condition=NEVER, penalty=Number(0.2))
    hard = Constraint(name="fence", kind="hard", condition=NEVER)
    for constraint, score in ((soft, 1 / 3 - 0.2), (hard, 1 / 3)):
        (first,) = played(success=SUCCESS, constraints=(constraint,))
        assert first.record.scr == pytest.approx(1 / 3)
        assert first.evaluation.reward == pytest.approx(score)
    assert first.evaluation.reason != ""


def test_without_required_targets_stages_and_their_subjects_are_counted():
    stages = (
        Stage(name="one", condition=after(10.0), weight=Number(3.0)),
        Stage(name="two", condition=after(20.0)),
        Stage(name="each", condition=kit.called("reached", "v"), variable="v", domain="victim"),
        Stage(name="never", condition=NEVER),
    )
    boundaries = list(played((0.0, -100.0), (0.0, -100.0), success=NEVER, stages=stages))
    assert rates(boundaries) == [round(1 / 6, 6), round(2 / 6, 6), round(3 / 6, 6)]


def test_without_stages_the_parts_of_success_are_counted():
    assert rates(played((0.0, 0.0), success=kit.both(after(0.0), after(100.0)))) == [0.5, 0.5]


def test_the_rate_of_a_successful_episode_is_one_even_if_a_stage_is_skipped():
    stages = (Stage(name="skipped", condition=NEVER),)
    boundaries = list(played((0.0, 0.0), success=after(10.0), stages=stages))
    assert rates(boundaries) == [0.0, 1.0]


def test_only_groups_of_targets_are_required():
    vehicles = Quantified("forall", "u", "uav", after(0.0))
    assert required_groups(kit.instance(success=kit.both(vehicles, SUCCESS))) == (SUCCESS,)
    assert required_groups(kit.instance(success=kit.called("reached", "v"))) == ()
