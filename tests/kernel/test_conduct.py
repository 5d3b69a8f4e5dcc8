"""The constraints on agents while a mission runs: permits, counted budgets, allowances, constraints, inspections,
stages.
"""

import msgspec
import pytest

from lingjing.kernel.barrier import PolicyBarrier
from lingjing.kernel.episode import play
from lingjing.kernel.rules import evaluate
from lingjing.mission.instance import (
    Allowance,
    CommsSpec,
    CountedSpec,
    InspectionSpec,
    LimitSpec,
    PermitSpec,
    RevealSpec,
)
from lingjing.testing import does, says
from lingjing.testing import rescue as kit
from lingjing.testing.declarations import Constraint, Relation, Stage
from lingjing.testing.expressions import Binary, Call, Number, Ref, Symbol
from lingjing.testing.rescue import decisions
from lingjing.trace.records import Decision, Route, Usage

BOAT = Ref(name="boat", kind="entity")
NOW = Ref(name="now", kind="clock")
ALWAYS_FALSE = Binary(operator="<", left=NOW, right=Number(value=-1.0))


def after(seconds):
    return Binary(operator=">=", left=NOW, right=Number(value=seconds))


def refused(published, agent):
    return [(r.status, r.reason) for r in published.inboxes[agent].receipts if r.status == "rejected"]


def started(**changes):
    kernel = kit.kernel(kit.instance(**changes))
    kernel.reset()
    return kernel


# -- permits


def test_a_command_without_its_permit_is_rejected_and_stop_needs_none():
    kernel = started(permits=(PermitSpec(resource="boat", verb="go", condition=after(20.0)),))
    answers = [refused(kernel.step(decisions(skipper=does("go", x=10, y=0))), "skipper") for _ in range(3)]
    assert answers == [[("rejected", "not_permitted")], [("rejected", "not_permitted")], []]
    all_of_them = started(permits=(PermitSpec(resource="boat", condition=ALWAYS_FALSE),))
    assert refused(all_of_them.step(decisions(skipper=does("stop"))), "skipper") == []


def test_a_permit_without_a_verb_applies_to_all_verbs_of_its_resource_only():
    kernel = started(permits=(PermitSpec(resource="boat", condition=ALWAYS_FALSE),))
    out = kernel.step(decisions(scout_1=does("go", x=1, y=1), skipper=does("hop", distance=1)))
    assert refused(out, "skipper") == [("rejected", "not_permitted")]
    assert refused(out, "scout[1]") == []


# -- counted budgets


def test_a_limit_counts_admitted_commands_and_refuses_the_next():
    limit = LimitSpec(name="moves", most=2, counts=(CountedSpec(kind="command", resource="boat"),))
    kernel = started(limits=(limit,))
    for _ in range(2):
        assert refused(kernel.step(decisions(skipper=does("stop"))), "skipper") == []
    assert refused(kernel.step(decisions(skipper=does("stop"))), "skipper") == [("rejected", "limit")]
    assert kernel.state.registry.progress.used == {"moves": 2}


def test_rejected_commands_do_not_count_towards_a_limit():
    limit = LimitSpec(name="moves", most=1, counts=(CountedSpec(kind="command", resource="boat", name="go"),))
    kernel = started(limits=(limit,))
    kernel.step(decisions(skipper=does("go", x="far", y=0)))
    kernel.step(decisions(skipper=does("stop")))
    assert kernel.state.registry.progress.used == {}


def test_messages_of_a_kind_are_counted_in_policy_order():
    limit = LimitSpec(name="words", most=1, counts=(CountedSpec(kind="message", name="order"),))
    kernel = started(limits=(limit,))
    out = kernel.step(decisions(scout_1=says("order", assignee="skipper"), scout_2=says("order", assignee="skipper")))
    assert refused(out, "scout[1]") == []
    assert refused(out, "scout[2]") == [("rejected", "limit")]
    assert [message.sender for message in out.record.messages] == ["scout[1]", "scout[1]"]


def test_a_limit_inside_a_stage_counts_while_the_stage_runs():
    stages = (Stage(name="first", condition=after(20.0)), Stage(name="second", condition=after(1000.0)))
    limit = LimitSpec(name="moves", most=1, counts=(CountedSpec(kind="command", resource="boat"),), stage="second")
    kernel = started(
        stages=stages, limits=(limit,), relations=(Relation(kind="dependency", source="first", target="second"),)
    )
    answers = [refused(kernel.step(decisions(skipper=does("stop"))), "skipper") for _ in range(5)]
    assert answers == [[], [], [], [("rejected", "limit")], [("rejected", "limit")]]


# -- allowances


def test_the_policy_of_an_agent_without_tokens_is_not_called_any_more():
    base = kit.instance()
    agents = tuple(
        msgspec.structs.replace(entry, budget=Allowance(tokens=100)) if entry.id == "skipper" else entry
        for entry in base.agents
    )
    kernel = started(agents=agents)
    thinking = Decision(usage=Usage(calls=1, prompt_tokens=60, completion_tokens=20))
    kernel.step(decisions(skipper=thinking))
    assert kernel.exhausted() == {}
    kernel.step(decisions(skipper=thinking))
    assert list(kernel.exhausted()) == ["skipper"]
    observed_ticks = []

    class Recording:
        async def reset(self, brief):
            pass

        async def act(self, observation, inbox):
            observed_ticks.append(observation)
            return Decision()

    barrier = PolicyBarrier({"skipper": Recording(), "scout[1]": Recording()}, 5.0)
    try:
        made = barrier.act({"skipper": (1, 2), "scout[1]": (3, 4)}, kernel.exhausted())
    finally:
        barrier.close()
    assert observed_ticks == [3]
    assert [(entry.agent, entry.substituted) for entry in made] == [("skipper", "allowance"), ("scout[1]", "")]


def test_a_shared_allowance_of_money_ends_for_all():
    base = kit.instance()
    kernel = started(budget=msgspec.structs.replace(base.budget, money_usd=0.10))
    kernel.step(decisions(scout_1=Decision(usage=Usage(cost_usd=0.06)), scout_2=Decision(usage=Usage(cost_usd=0.06))))
    assert list(kernel.exhausted()) == ["scout[1]", "scout[2]", "skipper"]


def test_messages_beyond_the_allowance_are_refused():
    base = kit.instance()
    kernel = started(budget=msgspec.structs.replace(base.budget, messages=1))
    out = kernel.step(decisions(scout_1=says("order", assignee="skipper"), scout_2=says("order", assignee="skipper")))
    assert refused(out, "scout[2]") == [("rejected", "allowance")]


# -- constraints


def test_a_broken_hard_constraint_fails_the_episode_at_the_macro_step_it_was_broken_in():
    near = Binary(
        operator="<=",
        left=Call(function="distance_xy", arguments=(BOAT, Ref(name="uav", kind="group"))),
        right=Number(value=150.0),
    )
    kernel = started(constraints=(Constraint(name="leash", kind="hard", condition=near),))
    out = kernel.step(decisions(skipper=does("go", x=0, y=-200)))
    (broken,) = [event for event in out.record.events if event.kind == "leash"]
    assert broken.time_s == pytest.approx(1.5)  # 148.7 m apart after 1 s, 152.4 m after 1.5 s
    assert (out.evaluation.done, out.evaluation.reason) == (True, "constraint")
    assert out.evaluation.detail == "the constraint `leash` was broken at 1.5 s"


def test_a_broken_hard_constraint_names_its_entities_and_overrides_a_success():
    here = Constraint(name="early", kind="hard", condition=ALWAYS_FALSE, variable="u", domain="uav")
    kernel = kit.kernel(kit.instance(constraints=(here,), success=after(0.0)))
    ended = kernel.reset().evaluation
    assert (ended.done, ended.reason) == (True, "constraint")
    assert ended.detail == "the constraint `early` was broken at 0 s by uav[1], at 0 s by uav[2]"


def test_a_soft_constraint_costs_its_penalty_once_per_violating_entity():
    constraint = Constraint(
        name="early", kind="soft", condition=Binary(operator="<", left=NOW, right=Number(value=15.0)),
        variable="u", domain="uav", penalty=Number(value=0.2),
    )  # fmt: skip
    stages = (Stage(name="begin", condition=after(0.0), weight=Number(value=1.0)),)
    kernel = started(constraints=(constraint,), stages=stages, relations=())
    assert kernel.step(()).evaluation.reward == 1.0
    for _ in range(2):
        out = kernel.step(())
        assert out.evaluation.reward == pytest.approx(0.6)
        assert not out.evaluation.done


# -- stages


def test_a_late_stage_ends_the_episode_with_its_own_reason():
    stage = Stage(name="soon", condition=ALWAYS_FALSE, ticks=Number(value=3.0))
    kernel = started(stages=(stage,), relations=())
    ended = [kernel.step(()).evaluation for _ in range(3)]
    assert [each.reason for each in ended] == ["", "", "late"]
    assert ended[-1].detail == "the stage `soon` was not done in the 3 ticks it had (from tick 0 to tick 3)"


def test_a_stage_or_a_success_in_the_last_permitted_tick_is_not_late():
    stage = Stage(name="soon", condition=after(30.0), ticks=Number(value=3.0))
    kernel = started(stages=(stage,), relations=())
    assert [kernel.step(()).evaluation.reason for _ in range(4)] == [""] * 4
    never = msgspec.structs.replace(stage, condition=ALWAYS_FALSE)
    kernel = started(stages=(never,), relations=(), success=after(30.0))
    assert [kernel.step(()).evaluation.reason for _ in range(3)] == ["", "", "success"]


def test_all_stages_that_are_late_at_the_same_tick_are_named():
    each = Stage(name="find", condition=ALWAYS_FALSE, variable="v", domain="victim", ticks=Number(value=1.0))
    other = Stage(name="go", condition=ALWAYS_FALSE, ticks=Number(value=1.0))
    ended = started(stages=(each, other), relations=()).step(()).evaluation
    assert ended.detail == (
        "the stage `find` of victim[1] was not done in the 1 tick it had (from tick 0 to tick 1); "
        "so were `find` of victim[2], `go`"
    )


@pytest.mark.parametrize(("ticks", "reason"), [(2.0, "late"), (3.0, "late"), (4.0, "budget")])
def test_a_stage_that_is_late_at_the_last_tick_is_the_reason_of_the_end(ticks, reason):
    """The stage would also end a longer mission, even if success does not need it."""
    stage = Stage(name="bonus", condition=ALWAYS_FALSE, ticks=Number(value=ticks))
    kernel = kit.kernel(kit.instance(stages=(stage,), relations=(), ticks=3))
    outcome = play(kernel, PolicyBarrier({}, 5.0))
    assert (outcome.reason, outcome.ticks, outcome.success) == (reason, min(3, int(ticks)), False)
    assert outcome.detail.startswith("the stage `bonus`") == (reason == "late")


def test_the_ticks_of_a_stage_count_from_the_end_of_its_dependency():
    stages = (
        Stage(name="first", condition=after(20.0)),
        Stage(name="second", condition=ALWAYS_FALSE, ticks=Number(value=2.0)),
    )
    kernel = started(stages=stages, relations=(Relation(kind="dependency", source="first", target="second"),))
    assert [kernel.step(()).evaluation.reason for _ in range(4)] == ["", "", "", "late"]


def test_the_score_is_weighted_by_stage():
    stages = (
        Stage(name="one", condition=after(10.0), weight=Number(value=3.0)),
        Stage(name="two", condition=after(20.0)),
    )
    kernel = started(stages=stages, relations=())
    assert [kernel.step(()).evaluation.reward for _ in range(2)] == [0.75, 1.0]


def test_a_successful_mission_has_full_reward_even_if_a_stage_is_skipped():
    stages = (
        Stage(name="skipped", condition=ALWAYS_FALSE, weight=Number(value=3.0)),
        Stage(name="last", condition=after(10.0)),
    )
    kernel = started(stages=stages, relations=(), success=after(20.0))
    evaluations = [kernel.step(()).evaluation for _ in range(2)]
    assert [(each.reward, each.reason) for each in evaluations] == [(0.25, ""), (1.0, "success")]


# -- inspections


class Planner(kit.PointMasses):
    """A glider that plans routes: straight on, or by the north if a place is to be avoided."""

    def reset(self, spec, city, seed):
        self.routes = []
        return super().reset(spec, city, seed)

    def admit(self, command):
        if command.verb in ("route", "replan"):
            assert command.origin == "kernel"
            north = 60.0 if command.verb == "replan" else 0.0
            number = len(self.routes) + 1
            points = tuple((x, north, 0.0) for x in (100.0, 130.0, 160.0))
            self.routes.append(
                Route(entity=command.resource, number=number, waypoints=points, length_m=100.0, duration_s=10.0,
                      time_s=self.time_s, request=command.id)
            )  # fmt: skip
            self.fresh = self.routes[-1:]
        return super().admit(command)

    def advance(self, until, mirrors):
        fresh, self.fresh = tuple(getattr(self, "fresh", ())), []
        return msgspec.structs.replace(super().advance(until, mirrors), routes=fresh)


INSPECTION = InspectionSpec(
    name="check", asset="boat", by=("uav[1]",), within_m=5.0, replan="order", destination="uav[2]"
)
INSPECTED = Call(function="inspected", arguments=(Symbol(name="check"),))


def inspecting(**changes):
    instance = kit.instance(inspections=(msgspec.structs.replace(INSPECTION, **changes),))
    permits = (PermitSpec(resource="boat", verb="go", condition=INSPECTED),)
    kernel = kit.kernel(msgspec.structs.replace(instance, permits=permits), kit.RescueEngines(glider=Planner))
    kernel.reset()
    return kernel


def test_the_kernel_requests_the_route_and_counts_each_inspected_waypoint():
    kernel = inspecting()
    out = kernel.step(decisions(scout_1=does("go", x=130, y=0)))
    assert next((command.verb, command.origin) for command in out.record.commands) == ("route", "kernel")
    assert [route.number for route in out.record.routes] == [1]
    assert sorted(kernel.state.registry.progress.inspected["check"].seen) == [0, 1]
    out = kernel.step(decisions(scout_1=does("go", x=160, y=0), skipper=does("go", x=0, y=0)))
    assert refused(out, "skipper") == [("rejected", "not_permitted")]
    assert kernel.state.registry.progress.inspected["check"].complete_s == pytest.approx(12.5)
    assert refused(kernel.step(decisions(skipper=does("go", x=0, y=0))), "skipper") == []


@pytest.mark.parametrize(("order", "seen"), [("strict", []), ("any", [1, 2])])
def test_waypoints_out_of_order_count_only_if_any_order_is_declared(order, seen):
    kernel = inspecting(order=order, within_m=3.0)  # it has left the first waypoint before the first macro-step ends
    kernel.step(decisions(scout_1=does("go", x=160, y=0)))
    assert sorted(kernel.state.registry.progress.inspected["check"].seen) == seen


def test_a_replan_begins_the_inspection_again():
    kernel = inspecting()
    kernel.step(decisions(scout_1=does("go", x=160, y=0)))
    assert kernel.state.registry.progress.inspected["check"].complete_s is not None
    out = kernel.step(decisions(scout_2=says("order", assignee="boat", position=(130.0, 0.0))))
    assert ("replan", {"x": 130.0, "y": 0.0}) in [(command.verb, command.arguments) for command in out.record.commands]
    known = kernel.state.registry.progress.inspected["check"]
    assert (known.route, known.complete_s, known.seen) == (2, None, frozenset())
    at = kernel._adjudicator.context_at(kernel.state.registry, kernel.state.registry.states, out.record.time_s)
    replans = Call(function="replans", arguments=(Symbol(name="check"),))
    assert evaluate(replans, {}, at) == 1.0


# -- single mode and reference pictures


def test_in_single_mode_a_report_reaches_only_the_adjudicator():
    base = kit.instance()
    kernel = started(
        agents=base.agents[:1], comms=CommsSpec(mode="single", hub=None), relations=(), victims=((100.0, 0.0),)
    )
    frame = kernel.step(decisions(scout_1=does("takePhoto"))).observations["scout[1]"].pictures[0].frame
    out = kernel.step(decisions(scout_1=kit.report(frame)))
    assert out.record.messages == ()
    assert {"matched", "reported"} <= {event.kind for event in out.record.events}


def test_a_reference_picture_goes_once_to_its_role_without_position_and_supports_no_report():
    kernel = kit.kernel(kit.instance(reveals=(RevealSpec(what="image", entities=("victim[1]",), role="searcher"),)))
    out = kernel.reset()
    (picture,) = out.observations["scout[1]"].pictures
    assert (picture.frame, picture.camera, picture.pose.position) == ("r0-victim[1]", "reference", (0.0, 0.0, 0.0))
    assert out.observations["skipper"].pictures == ()
    later = kernel.step(decisions(scout_1=kit.report(picture.frame)))
    assert refused(later, "scout[1]") == [("rejected", "bad_field")]
    assert later.observations["scout[1]"].pictures == ()


@pytest.mark.parametrize(("declared", "away_m", "up_m"), [({}, 24.0, 4.0), ({"portrait_m": 6.0}, 6.0, 1.5)])
def test_a_reference_picture_is_taken_from_the_front_at_the_declared_distance(
    declared: dict[str, float], away_m: float, up_m: float
) -> None:
    """In a dense quarter a camera 24 m away stands behind another house."""
    reveal = RevealSpec(what="image", entities=("victim[1]",), role="searcher")
    base = kit.instance(reveals=(reveal,))
    entities = tuple(
        msgspec.structs.replace(each, properties={**each.properties, **declared}, heading_deg=90.0)
        if each.id == "victim[1]"
        else each
        for each in base.entities
    )
    kernel = kit.kernel(msgspec.structs.replace(base, entities=entities))
    (frame,) = (frame for frame in kernel.reset().record.frames if frame.camera == "reference")
    assert frame.pose.position == pytest.approx((100.0 + away_m, 0.0, up_m)) and frame.pose.heading_deg == 270.0
