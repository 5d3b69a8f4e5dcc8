"""The goals of an instance's success, read from the text of its mission."""

from __future__ import annotations

import pytest

from lingjing.plugins.tasks import (
    Alternatives,
    Goal,
    Judged,
    LevelGoal,
    OpenGoal,
    Ordered,
    PerformGoal,
    ReachGoal,
    ReportGoal,
    StatusGoal,
    goals,
    leaves_of,
)
from lingjing.testing import instantiate

TEXT = """\
ljs 2
use std.ground {{ car }}
use std.messages {{ report }}
use std.sensors {{ dash }}
target blaze {{
  engine = city, on = road
  state heat = 100 %
  interaction extinguish {{ by = road, within = 30 m }}
}}
target halt {{
  engine = city, on = road
  state waiting = 6
  interaction board {{ by = road, within = 20 m, gives = seated, from = waiting, up_to = seats, status = empty }}
}}
target shelter {{
  engine = city, on = road
  state beds = 50
  interaction alight {{ by = road, within = 20 m, takes = beds, from = seated, status = full }}
}}
asset coach : car {{ state seated = 0, seats = 4 }}
mission trial "Trial" {{
  goal "Try it."
  scene commercial {{ extent = 400 m, blocks = 2 by 2, height = 6 m..9 m }}
  clock {{ tick = 10 s, sync = 500 ms }}
  budget {{ ticks <= 30, policy <= 90 s, engine <= 30 s }}
  mode broadcast
  region yard = box((-50 m, -50 m), (50 m, 50 m))
  target f[1..3] : blaze {{ position = at(i, [(0 m, 50 m)], spread 20 m) }}
  target stop : halt {{ position = (0 m, 100 m) }}
  target home : shelter {{ position = (0 m, -100 m) }}
  asset bus : coach {{
    position = (0 m, 0 m)
    camera front : dash
    actions {{ setDestination, stop, takePhoto }}
  }}
  agent driver as driver controls bus {{
    observes bus.*, f.position, stop.position, home.position, events
    prompt "Drive."
  }}
  message note : report from driver to all
  comms {{ delay = 1 tick, payload <= 4 kB }}
  {rules}
  success when {success}
}}
"""


def goal_of(success: str, rules: str = "") -> Goal:
    return goals(instantiate(TEXT.format(success=success, rules=rules), seed=1))


def only(success: str, rules: str = "") -> Goal:
    (leaf,) = leaves_of(goal_of(success, rules))
    return leaf


def test_an_amount_is_lowered_by_the_interactions_that_take_it() -> None:
    leaf = only("f[1].heat <= 0")
    assert isinstance(leaf, LevelGoal)
    assert (leaf.entities, leaf.state, leaf.most, leaf.least) == (("f[1]",), "heat", 0.0, None)
    assert [(way.interaction, way.target, way.actors, way.within_m) for way in leaf.ways] == [
        ("extinguish", "f[1]", ("bus",), 30.0)
    ]
    assert (leaf.at, leaf.text) == ("success", "f[1].heat <= 0")


@pytest.mark.parametrize(
    ("success", "entities", "state", "ways"),
    [
        ("stop.waiting == 0", ("stop",), "waiting", {"board"}),
        ("bus.seated >= 3", ("bus",), "seated", {"board"}),
        ("bus.seated < 1", ("bus",), "seated", {"alight"}),
        ("sum(x.heat for x in f) <= 50 %", ("f[1]", "f[2]", "f[3]"), "heat", {"extinguish"}),
        ("not (home.beds > 20)", ("home",), "beds", {"alight"}),
        ("20 >= home.beds", ("home",), "beds", {"alight"}),
    ],
)
def test_a_level_goal_names_the_interactions_that_change_the_amount(
    success: str, entities: tuple[str, ...], state: str, ways: set[str]
) -> None:
    leaf = next(leaf for leaf in leaves_of(goal_of(success)) if isinstance(leaf, LevelGoal) and leaf.ways)
    assert (leaf.entities, leaf.state, {way.interaction for way in leaf.ways}) == (entities, state, ways)


@pytest.mark.parametrize(
    ("success", "entity", "point", "corners", "radius_m"),
    [
        ("distance_xy(bus, home) <= 30 m", "home", None, 0, 30.0),
        ("30 m >= distance_xy(home, bus)", "home", None, 0, 30.0),
        ("distance_xy(bus, (10 m, 20 m)) < 5 m", "", (10.0, 20.0), 0, 5.0),
        ("bus in yard", "", None, 4, 0.0),
        ("bus.position in yard", "", None, 4, 0.0),
    ],
)
def test_a_condition_on_a_distance_or_a_region_is_a_reach_goal(
    success: str, entity: str, point: tuple[float, float] | None, corners: int, radius_m: float
) -> None:
    leaf = only(success)
    assert isinstance(leaf, ReachGoal)
    assert (leaf.movers, leaf.entity, leaf.point, len(leaf.region), leaf.radius_m) == (
        ("bus",), entity, point, corners, radius_m,
    )  # fmt: skip


def test_a_status_goal_names_the_interaction_that_sets_the_status() -> None:
    leaf = only("stop.status == empty")
    assert isinstance(leaf, StatusGoal)
    assert (leaf.entity, leaf.words, [way.interaction for way in leaf.ways]) == ("stop", ("empty",), ["board"])


def test_alternatives_and_counts_are_kept() -> None:
    either = goal_of("f[1].heat <= 0 or bus in yard")
    assert isinstance(either, Alternatives) and (either.least, len(either.parts)) == (1, 2)
    two = goal_of("count(x.heat <= 0 for x in f) >= 2")
    assert isinstance(two, Alternatives) and (two.least, len(two.parts)) == (2, 3)
    at_most = goal_of("count(x.heat > 0 for x in f) <= 1")
    assert isinstance(at_most, Alternatives) and (at_most.least, len(at_most.parts)) == (2, 3)
    assert goal_of("now > 60 s") == Alternatives(least=0)


def test_an_unlock_comes_before_its_interaction_and_a_rule_keeps_its_arguments() -> None:
    rules = "unlock extinguish(x: f) when stop.waiting == 0\n  adjudicate out(x: f) { when emitted(extinguish, x) }"
    goal = goal_of("out(f[2])", rules)
    assert isinstance(goal, Judged) and (goal.rule, goal.entities) == ("out", ("f[2]",))
    assert isinstance(goal.part, Ordered) and isinstance(goal.part.then, PerformGoal)
    assert any(isinstance(leaf, LevelGoal) and leaf.entities == ("stop",) for leaf in leaves_of(goal.part.first))
    behind_state = goal_of("f[2].heat <= 0", rules)
    assert isinstance(behind_state, Ordered) and isinstance(behind_state.then, LevelGoal)


def test_a_condition_on_a_matching_report_is_a_report_goal() -> None:
    rules = "adjudicate seen(x: f, r: note) { when iou(r.box, truth(x, r.frame).box) >= 0.5 }"
    leaf = only("exists r: seen(f[1], r)", rules)
    assert isinstance(leaf, ReportGoal) and (leaf.kind, leaf.about, leaf.matching) == ("note", "f[1]", True)


def test_a_condition_that_no_goal_covers_is_an_open_goal_with_a_reason() -> None:
    leaf = only("distance_xy(bus, home) >= 300 m")
    assert isinstance(leaf, OpenGoal) and "position" in leaf.reason and "setDestination" in leaf.reason


def test_an_alternative_that_declared_values_rule_out_is_left_out() -> None:
    leaf = only("f[1].heat <= 0 or (f[2].heat <= 0 and bus.seats >= 9)")
    assert isinstance(leaf, LevelGoal) and leaf.entities == ("f[1]",)


@pytest.mark.parametrize(
    ("success", "first", "then"),
    [
        ("bus in yard and before(distance_xy(bus, home) <= 30 m, bus in yard)", "home", ""),
        ("before(distance_xy(bus, home) <= 30 m, bus in yard) and (bus in yard or stop.waiting == 0)", "home", ""),
        ("before(bus in yard, distance_xy(bus, home) <= 30 m) and there()", "", "home"),
    ],
)
def test_the_later_part_of_a_before_condition_is_ordered_after_the_first_part(
    success: str, first: str, then: str
) -> None:
    goal = goal_of(success, "adjudicate there() { when distance_xy(bus, home) <= 30 m }")
    (ordered,) = ordered_goals(goal)
    reached = [leaf for leaf in (ordered.first, ordered.then) if isinstance(leaf, ReachGoal)]
    assert [leaf.entity for leaf in reached] == [first, then]
    assert any(leaf == ordered.first for leaf in parts_of(goal))  # the first is a goal of its own, too


def test_a_before_condition_is_not_ordered_if_success_does_not_need_its_later_part() -> None:
    assert not ordered_goals(goal_of("before(bus in yard, distance_xy(bus, home) <= 30 m) and stop.waiting == 0"))


def parts_of(goal: Goal) -> list[Goal]:
    match goal:
        case Alternatives(parts=parts):
            return [goal, *(inner for part in parts for inner in parts_of(part))]
        case Judged(part=part):
            return [goal, *parts_of(part)]
    return [goal]


def ordered_goals(goal: Goal) -> list[Ordered]:
    return [part for part in parts_of(goal) if isinstance(part, Ordered) and isinstance(part.then, ReachGoal)]
