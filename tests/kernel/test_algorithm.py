"""The paper's operational expansion of the kernel step, one test for each numbered line with an effect.

Lines are counted as printed, from `t ← 0` on. A test's name begins with its lines.
"""

import asyncio
import concurrent.futures
import os
import signal
import sys
import threading

import msgspec
import pytest

from lingjing.errors import InfrastructureError, PluginError
from lingjing.kernel.barrier import PolicyBarrier
from lingjing.kernel.episode import play, policy_barrier
from lingjing.plugins.engine import Boundary
from lingjing.plugins.policy import NoDecisionError
from lingjing.testing import does, says, together
from lingjing.testing import rescue as kit
from lingjing.testing.expressions import Binary, Call, Flag, Number, Point, Ref
from lingjing.testing.traces import next_digest
from lingjing.trace.records import Decision, Usage

MET = kit.rule(
    "met",
    Binary("<=", Call("distance_xy", (Ref("boat", "entity"), Point((Number(0.0), Number(-60.0))))), Number(1.0)),
)
"""The boat has been at a public place."""


class Still:
    """A policy without decisions that stores its inputs."""

    def __init__(self):
        self.seen = []

    async def reset(self, brief):
        self.brief = brief

    async def act(self, observation, inbox):
        self.seen.append((observation, inbox))
        return Decision()


class Table:
    """A policy with a table of decisions by tick."""

    def __init__(self, table):
        self.table = table

    async def reset(self, brief):
        pass

    async def act(self, observation, inbox):
        answer = self.table.get(observation.tick, Decision())
        return answer(observation, inbox) if callable(answer) else answer


class Log:
    """A recorder that stores all boundaries."""

    def __init__(self):
        self.records, self.endings = [], []

    def boundary(self, record, frames):
        self.records.append(record)

    def finish(self, outcome):
        self.endings.append(("finish", outcome))

    def abandon(self, outcome):
        self.endings.append(("abandon", outcome))


def still_policies(instance, **others):
    return {agent.id: others.get(agent.id, Still()) for agent in instance.agents}


def play_kit(instance=None, plugin=None, policies=None, **options):
    log = Log()
    instance = instance or kit.instance(ticks=4)
    kernel = kit.kernel(instance, plugin, record=log.boundary, **options)
    barrier = policy_barrier(kernel, still_policies(instance, **(policies or {})))
    return play(kernel, barrier, log), log


@pytest.fixture
def unhurried_briefs(monkeypatch):
    """Give the policies' `reset` unlimited time: the deadline under test is that of decisions."""
    usual = PolicyBarrier.reset

    def reset(self, briefs):
        limit_s, self._limit_s = self._limit_s, 3600.0
        try:
            return usual(self, briefs)
        finally:
            self._limit_s = limit_s

    monkeypatch.setattr(PolicyBarrier, "reset", reset)


def broken(**methods):
    return kit.RescueEngines(glider=type("Broken", (kit.PointMasses,), methods))


def statuses(record, request=None):
    return [(r.status, r.reason) for r in record.receipts if request is None or r.request == request]


# -- the reset branch ------------------------------------------------------------------------------------------------


def test_line_01_time_starts_at_boundary_zero():
    published = kit.kernel().reset()
    assert (published.record.tick, published.record.time_s) == (0, 0.0)


def test_lines_02_04_every_engine_is_reset_with_the_specification():
    seen = []

    def spy(cls):
        def reset(self, spec, city, seed):
            seen.append((spec.engine, spec.owns, spec.instance.mission, city.id))
            return cls.reset(self, spec, city, seed)

        return type(f"Spy{cls.__name__}", (cls,), {"reset": reset})

    kernel = kit.kernel(plugin=kit.RescueEngines(*(spy(cls) for cls in (kit.PointMasses, kit.Shore, kit.TruthCamera))))
    kernel.reset()
    moving = [
        ("glider", ("uav[1]", "uav[2]", "boat"), "kit", "kit"),
        ("shore", ("victim[1]", "victim[2]"), "kit", "kit"),
    ]
    assert sorted(seen) == moving
    kernel.step(kit.decisions(scout_1=does("takePhoto")))
    assert sorted(seen) == [*moving, ("table", (), "kit", "kit")]  # a sensor at its first picture


def test_lines_05_08_a_rejected_reset_is_an_infrastructure_abort_with_a_partial_trace():
    def reset(self, spec, city, seed):
        raise ValueError("no such place")

    outcome, log = play_kit(plugin=broken(reset=reset))
    assert outcome.reason == "infrastructure-abort"
    assert "glider" in outcome.detail
    assert "no such place" in outcome.detail
    assert [kind for kind, _ in log.endings] == ["abandon"]
    assert log.records == []


def test_lines_10_11_nothing_is_pending_and_no_receipt_exists_at_reset():
    published = kit.kernel().reset()
    record = published.record
    assert (record.decisions, record.commands, record.messages, record.receipts) == ((), (), (), ())
    assert all(inbox.messages == () and inbox.receipts == () for inbox in published.inboxes.values())


def test_lines_12_13_boundary_zero_is_assembled_from_every_engine():
    record = kit.kernel().reset().record
    assert [state.id for state in record.snapshots[-1].states] == ["victim[1]", "victim[2]", "uav[1]", "uav[2]", "boat"]
    assert sorted(status.engine for status in record.engines) == ["glider", "shore"]


def test_line_14_the_registry_holds_boundary_zero():
    kernel = kit.kernel()
    kernel.reset()
    assert kernel.state.registry.states["boat"].position == (0.0, -100.0, 0.0)


def test_line_15_the_first_observation_holds_no_hidden_field():
    published = kit.kernel().reset()
    text = repr(published.observations)
    assert "victim" not in text
    assert published.observations["skipper"].entities[0].position == (0.0, -100.0, 0.0)


def test_line_16_rules_are_adjudicated_at_boundary_zero():
    reached = kit.rule("near", kit.NEAR, ("v", "victim"))
    instance = kit.instance(victims=((0.0, -60.0), (200.0, 0.0)), rules=(reached,), unlocks=(), stages=())
    record = kit.kernel(msgspec.structs.replace(instance, success=kit.SOME_REPORT)).reset().record
    assert [(event.kind, event.bindings, event.time_s) for event in record.events] == [("near", ("victim[1]",), 0.0)]


def test_line_17_boundary_zero_is_evaluated():
    already = kit.instance(victims=())
    assert kit.kernel(already).reset().evaluation.reason == "success"
    assert kit.kernel().reset().evaluation == kit.kernel().reset().evaluation
    assert kit.kernel().reset().evaluation.reward == 0.0


def test_lines_18_19_boundary_zero_is_logged_and_published():
    log = Log()
    published = kit.kernel(record=log.boundary).reset()
    assert log.records == [published.record]
    assert set(published.observations) == {"scout[1]", "scout[2]", "skipper"}


# -- the agent-runtime phase -----------------------------------------------------------------------------------------


def test_line_20_the_loop_stops_at_the_tick_limit_and_when_done():
    outcome, log = play_kit(kit.instance(ticks=3))
    assert (outcome.reason, outcome.ticks, [record.tick for record in log.records]) == ("budget", 3, [0, 1, 2, 3])
    outcome, log = play_kit(kit.instance(victims=()))
    assert (outcome.reason, outcome.success, outcome.ticks) == ("success", True, 0)


def test_line_21_observations_and_pictures_are_read_only():
    kernel = kit.kernel()
    kernel.reset()
    published = kernel.step(kit.decisions(scout_1=does("takePhoto")))
    picture = published.observations["scout[1]"].pictures[0]
    with pytest.raises(ValueError, match="read-only"):
        picture.rgb[0, 0, 0] = 1
    with pytest.raises(AttributeError):
        published.observations["scout[1]"].tick = 9


def test_lines_22_24_all_policies_act_at_the_same_time():
    class Meeting(Still):
        hall = None

        async def act(self, observation, inbox):
            self.hall.wait(timeout=900)  # returns only if all three are here at once
            return Decision()

    Meeting.hall = threading.Barrier(3)
    instance = kit.instance(ticks=1)
    _, log = play_kit(instance, policies={agent.id: Meeting() for agent in instance.agents})
    assert [made.substituted for made in log.records[1].decisions] == ["", "", ""]


@pytest.mark.usefixtures("unhurried_briefs")
def test_line_25_a_policy_past_its_deadline_is_not_waited_for(monkeypatch):
    over, usual = threading.Event(), PolicyBarrier._wait

    def patient(self, name, future, started):
        if name == "scout[2]":  # its answer comes without waiting, on a slow machine too
            concurrent.futures.wait([future])
        return usual(self, name, future, started)

    monkeypatch.setattr(PolicyBarrier, "_wait", patient)

    class Late(Still):
        async def act(self, observation, inbox):
            await asyncio.sleep(3600)

    class Blocked(Still):
        async def act(self, observation, inbox):
            over.wait(3600)

    budget = kit.instance().budget
    instance = kit.instance(budget=msgspec.structs.replace(budget, policy_s=1.0, ticks=2))
    _, log = play_kit(instance, policies={"scout[1]": Late(), "skipper": Blocked()})
    over.set()
    assert [made.substituted for made in log.records[1].decisions] == ["policy_timeout", "", "policy_timeout"]
    assert [made.substituted for made in log.records[2].decisions] == ["policy_timeout", "", "policy_timeout"]


@pytest.mark.usefixtures("unhurried_briefs")
def test_line_26_a_late_answer_never_enters_a_later_tick():
    class Slow(Still):
        async def act(self, observation, inbox):
            if observation.tick == 0:
                over.wait(3600)
                answered.set()
                return does("go", x=1.0, y=1.0)
            over.set()  # the late answer comes while this one is waited for
            answered.wait(3600)
            return Decision()

    over, answered = threading.Event(), threading.Event()
    budget = kit.instance().budget
    instance = kit.instance(budget=msgspec.structs.replace(budget, policy_s=0.5, ticks=4))
    _, log = play_kit(instance, policies={"skipper": Slow()})
    assert answered.wait(3600)
    assert log.records[1].decisions[2].substituted == "policy_timeout"
    assert all(record.commands == () for record in log.records)


@pytest.mark.parametrize(
    ("act", "reason"),
    [
        (lambda o, i: 1 / 0, "policy_error"),
        (lambda o, i: sys.exit(4), "policy_error"),
        (lambda o, i: "forward", "malformed"),
        (lambda o, i: None, "malformed"),
        (lambda o, i: Decision(command="up"), "malformed"),
        (lambda o, i: does("go", x="north", y={}), "malformed"),
    ],
)
def test_line_26_a_missing_or_malformed_return_becomes_a_no_op_with_a_reason(act, reason):
    _, log = play_kit(policies={"scout[1]": Table(dict.fromkeys(range(9), act))})
    made = log.records[1].decisions[0]
    assert (made.substituted, made.decision, bool(made.detail)) == (reason, Decision(), True)
    (receipt,) = (r for r in log.records[1].receipts if r.status == "substituted")
    assert (receipt.sender, receipt.reason, receipt.by) == ("scout[1]", reason, "policy")
    assert log.records[4].decisions[0].substituted == reason  # the episode goes on


def test_line_26_the_usage_of_a_call_without_a_decision_is_recorded():
    def act(observation, inbox):
        raise NoDecisionError("nothing came", Usage(calls=3, prompt_tokens=70))

    _, log = play_kit(policies={"scout[1]": Table(dict.fromkeys(range(9), act))})
    made = log.records[1].decisions[0]
    assert (made.substituted, made.detail) == ("policy_error", "NoDecisionError: nothing came")
    assert made.decision == Decision(usage=Usage(calls=3, prompt_tokens=70))


def test_line_26_an_outage_that_only_the_policy_reports_is_a_policy_error():
    """Without a probe that confirms an outage, the policy's exception is its own failure."""

    def act(observation, inbox):
        raise InfrastructureError("the service is gone", hint="start it")

    outcome, log = play_kit(policies={"scout[2]": Table({2: act})})
    assert outcome.reason == "budget"
    (made,) = (decision for decision in log.records[3].decisions if decision.agent == "scout[2]")
    assert (made.substituted, made.decision) == ("policy_error", Decision())
    assert "the service is gone" in made.detail


def test_line_27_outputs_are_collected_by_name_in_declaration_order():
    barrier = PolicyBarrier({name: Still() for name in ("b", "a", "c")}, 5.0)
    records = barrier.act(dict.fromkeys(("c", "a", "b"), (None, None)))
    barrier.close()
    assert [record.agent for record in records] == ["b", "a", "c"]


# -- the kernel-simulation phase -------------------------------------------------------------------------------------


def test_line_28_inboxes_start_empty_at_every_boundary():
    kernel = kit.kernel()
    kernel.reset()
    order = says("order", assignee="boat")
    first = kernel.step(kit.decisions(scout_1=order))
    second = kernel.step(kit.decisions())
    assert len(first.inboxes["skipper"].messages) == 1
    assert second.inboxes["skipper"].messages == ()


def test_line_29_messages_are_validated_and_expanded_to_edges():
    kernel = kit.kernel()
    kernel.reset()
    record = kernel.step(
        kit.decisions(scout_1=says("order", assignee="boat"), skipper=says("order", assignee="boat"))
    ).record
    assert [(edge.sender, edge.recipient) for edge in record.messages] == [
        ("scout[1]", "scout[2]"),
        ("scout[1]", "skipper"),
    ]
    assert statuses(record) == [("accepted", ""), ("rejected", "no_authority")]


def test_line_30_commands_are_validated_and_resolved():
    kernel = kit.kernel()
    kernel.reset()
    record = kernel.step(
        kit.decisions(scout_1=does("go", "boat", x=0.0, y=0.0), skipper=does("go", x=9.0, y=9.0))
    ).record
    assert [(c.sender, c.resource) for c in record.commands] == [("scout[1]", "boat")]
    assert ("rejected", "conflict") in statuses(record)


def test_line_31_staged_messages_are_lost_if_the_barrier_fails():
    def advance(self, until, mirrors):
        raise RuntimeError("lost")

    kernel = kit.kernel(plugin=broken(advance=advance))
    kernel.reset()
    with pytest.raises(InfrastructureError):
        kernel.step(kit.decisions(scout_1=says("order", assignee="boat")))
    assert kernel.state.bus.committed == ()
    assert len(kernel.state.bus.staged) == 2


def test_line_32_admitted_commands_reach_their_engine_before_it_advances():
    kernel = kit.kernel()
    kernel.reset()
    record = kernel.step(kit.decisions(skipper=does("go", x=0.0, y=-50.0))).record
    assert record.snapshots[-1].states[-1].position == pytest.approx((0.0, -50.0, 0.0))


def test_line_33_an_engine_with_an_incoherent_time_aborts_the_episode():
    def advance(self, until, mirrors):
        return Boundary(engine=self.engine, time_s=until - 0.25, states=tuple(self.states.values()))

    outcome, _ = play_kit(plugin=broken(advance=advance))
    assert outcome.reason == "infrastructure-abort"  # an incoherent time; a hung process is the world's own test


def test_lines_34_36_a_missing_admission_receipt_times_out_without_an_abort():
    kernel = kit.kernel()
    kernel.reset()
    record = kernel.step(kit.decisions(skipper=does("mute"))).record
    assert statuses(record, "c1-1") == [("timed_out", "no_receipt")]
    assert "boat" not in kernel.state.registry.pending


def test_line_37_a_request_admitted_earlier_survives_a_missing_receipt():
    kernel = kit.kernel()
    kernel.reset()
    kernel.step(kit.decisions(skipper=does("go", x=0.0, y=390.0)))
    assert kernel.state.registry.pending["boat"].id == "c1-1"
    record = kernel.step(kit.decisions(skipper=does("mute"))).record
    assert statuses(record, "c2-1") == [("rejected", "busy")]
    assert kernel.state.registry.pending["boat"].id == "c1-1"


@pytest.mark.parametrize("fault", ["raises", "missing entity", "not a number"])
def test_lines_39_41_an_incoherent_engine_aborts_with_the_partial_trace(fault):
    def advance(self, until, mirrors):
        boundary = kit.PointMasses.advance(self, until, mirrors)
        if until < 20:
            return boundary
        if fault == "raises":
            raise OSError("gone")
        if fault == "missing entity":
            return msgspec.structs.replace(boundary, states=boundary.states[1:])
        lost = msgspec.structs.replace(boundary.states[0], position=(float("nan"), 0.0, 0.0))
        return msgspec.structs.replace(boundary, states=(lost, *boundary.states[1:]))

    outcome, log = play_kit(plugin=broken(advance=advance))
    assert (outcome.reason, outcome.success, outcome.ticks) == ("infrastructure-abort", False, 1)
    assert "glider" in outcome.detail
    assert [record.tick for record in log.records] == [0, 1]
    assert [kind for kind, _ in log.endings] == ["abandon"]


def test_line_43_messages_become_readable_when_their_boundary_commits():
    kernel = kit.kernel()
    kernel.reset()
    published = kernel.step(kit.decisions(scout_1=says("order", assignee="boat")))
    (edge,) = published.inboxes["skipper"].messages
    assert (edge.tick, published.record.tick) == (1, 1)


def test_line_44_a_boundary_is_the_last_of_its_macro_steps():
    kernel = kit.kernel()
    kernel.reset()
    record = kernel.step(kit.decisions(skipper=does("go", x=0.0, y=300.0))).record
    assert [snapshot.time_s for snapshot in record.snapshots] == [0.5 * step for step in range(1, 21)]
    assert record.time_s == 10.0


def test_line_45_receipts_of_all_three_kinds_are_in_one_set():
    kernel = kit.kernel()
    kernel.reset()
    record = kernel.step(
        kit.decisions(
            scout_1=together(does("fly"), says("order", assignee="boat")),
            skipper=does("go", x=0.0, y=0.0),
        )
    ).record
    assert [(r.by, r.status) for r in record.receipts] == [
        ("bus", "accepted"),
        ("kernel", "rejected"),
        ("glider", "accepted"),
        ("glider", "completed"),
    ]


def test_line_46_an_inbox_holds_own_receipts_only():
    kernel = kit.kernel()
    kernel.reset()
    inboxes = kernel.step(kit.decisions(scout_1=does("fly"), skipper=does("go", x=0.0, y=0.0))).inboxes
    assert [r.reason for r in inboxes["scout[1]"].receipts] == ["unknown_verb"]
    assert [r.status for r in inboxes["skipper"].receipts] == ["accepted", "completed"]
    assert inboxes["scout[2]"].receipts == ()


def test_line_47_every_active_agent_has_an_inbox():
    assert set(kit.kernel(kit.instance("star")).reset().inboxes) == {
        "scout[1]",
        "scout[2]",
        "skipper",
        "commander",
    }


def test_line_48_completion_releases_the_resource():
    kernel = kit.kernel()
    kernel.reset()
    kernel.step(kit.decisions(skipper=does("go", x=0.0, y=50.0)))
    assert "boat" in kernel.state.registry.pending
    kernel.step(kit.decisions())
    assert "boat" not in kernel.state.registry.pending
    again = kernel.step(kit.decisions(skipper=does("go", x=0.0, y=40.0))).record
    assert statuses(again, "c3-1") == [("accepted", ""), ("completed", "")]


def test_line_49_an_adjudicated_event_is_seen_one_boundary_later():
    """Agents observe events that reveal nothing; verdicts on reports are for the trace."""
    instance = kit.instance()
    kernel = kit.kernel(msgspec.structs.replace(instance, rules=(*instance.rules, MET)))
    kernel.reset()
    kernel.step(kit.decisions(scout_1=does("takePhoto")))
    step = does("go", x=0.0, y=-60.0)
    judged = kernel.step(kit.decisions(scout_1=kit.report("f1-uav[1]-nadir"), skipper=step))
    later = kernel.step(kit.decisions())
    assert [event.kind for event in judged.record.events] == ["met", "matched", "reported"]
    assert [event.kind for event in judged.observations["skipper"].events] == ["arrived"]
    shown = later.observations["skipper"].events
    assert [(event.id, event.kind, event.entities) for event in shown] == [("e2-1", "met", ())]


def test_line_49_a_task_event_is_seen_at_its_own_boundary():
    kernel = kit.kernel()
    kernel.reset()
    published = kernel.step(kit.decisions(skipper=does("go", x=0.0, y=-60.0)))
    assert [(e.kind, e.entities) for e in published.observations["skipper"].events] == [("arrived", ("boat",))]


def test_line_50_proximity_is_adjudicated_at_every_macro_step():
    passing = kit.rule("passed", kit.NEAR, ("v", "victim"))
    instance = kit.instance(
        victims=((60.0, -100.0),), rules=(passing,), unlocks=(), stages=(), success=kit.called("passed", "v")
    )
    instance = msgspec.structs.replace(
        instance,
        success=msgspec.structs.replace(kit.SUCCESS, body=kit.called("passed", "v")),
        clock=msgspec.structs.replace(instance.clock, tick_s=20.0),
    )
    kernel = kit.kernel(instance)
    kernel.reset()
    record = kernel.step(kit.decisions(skipper=does("go", x=190.0, y=-100.0))).record
    (event,) = record.events
    assert record.snapshots[-1].states[-1].position[0] == pytest.approx(190.0)  # it drove through and out again
    assert (event.time_s, event.evidence["distance_m"]) == (1.0, pytest.approx(50.0))


def test_line_51_the_score_is_the_share_of_parts_that_hold():
    kernel = kit.kernel()
    kernel.reset()
    kernel.step(kit.decisions(scout_1=does("takePhoto"), skipper=does("go", x=90.0, y=-40.0)))
    kernel.step(kit.decisions(scout_1=kit.report("f1-uav[1]-nadir")))
    published = kernel.step(kit.decisions())
    assert (published.evaluation.reward, published.evaluation.done) == (0.5, False)


def test_line_52_the_record_holds_the_decisions_frames_and_digest_of_the_boundary():
    log = Log()
    kernel = kit.kernel(record=log.boundary)
    first = kernel.reset()
    made = kit.decisions(scout_1=does("takePhoto"), skipper=does("go", x=0.0, y=0.0))
    second = kernel.step(made)
    assert log.records == [first.record, second.record]
    assert second.record.decisions == made
    assert [frame.id for frame in second.record.frames] == ["f1-uav[1]-nadir"]
    assert second.record.digest == next_digest(first.record.digest, second.record)


def test_line_52_an_interrupt_during_recording_leaves_state_and_record_consistent():
    log = Log()

    def interrupted(record, frames):
        os.kill(os.getpid(), signal.SIGINT)
        log.boundary(record, frames)

    kernel = kit.kernel(record=interrupted)
    with pytest.raises(KeyboardInterrupt):
        kernel.reset()
    assert kernel.state.digest == log.records[-1].digest


def test_line_53_the_published_observation_equals_the_recorded_one():
    kernel = kit.kernel()
    kernel.reset()
    published = kernel.step(kit.decisions(scout_1=does("takePhoto")))
    (seen,) = (o for o in published.record.observations if o.agent == "scout[1]")
    assert seen.entities == published.observations["scout[1]"].entities
    assert seen.frames == tuple(picture.frame for picture in published.observations["scout[1]"].pictures)


def test_an_interrupt_while_an_episode_ends_still_finishes_the_recording_once():
    class Interrupted(Log):
        def finish(self, outcome):
            os.kill(os.getpid(), signal.SIGINT)
            super().finish(outcome)

    log, instance = Interrupted(), kit.instance(ticks=1)
    kernel = kit.kernel(instance, record=log.boundary)
    with pytest.raises(KeyboardInterrupt):
        play(kernel, policy_barrier(kernel, still_policies(instance)), log)
    assert [(kind, outcome.reason) for kind, outcome in log.endings] == [("finish", "budget")]


def test_line_55_the_reason_is_success_failure_or_budget():
    lost = kit.instance(failure=Flag(value=True))
    outcome, log = play_kit(lost)
    assert (outcome.reason, outcome.success) == ("failure", False)
    assert [kind for kind, _ in log.endings] == ["finish"]


def test_the_error_of_a_policy_that_fails_in_reset_names_its_agent():
    class Picky(Still):
        async def reset(self, brief):
            raise ValueError("no key")

    instance = kit.instance()
    with pytest.raises(PluginError, match=r"`skipper`.*no key"):
        policy_barrier(kit.kernel(instance), still_policies(instance, skipper=Picky()))
