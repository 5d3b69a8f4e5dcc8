"""All metrics, compared with counts by hand."""

import dataclasses
import math
from pathlib import Path

import msgspec
import pytest

from lingjing import Metrics, Trace, metrics
from lingjing.analysis.detection import aligned_frames, detect, numbers
from lingjing.analysis.metrics import GROUPS, groups_and_units, table
from lingjing.analysis.repetition import (
    ServiceRadius,
    excess_target_events,
    excess_target_rate,
    repeated_target_rate,
    service_radii,
)
from lingjing.mission.instance import AgentSpec, ChannelSpec, Entity, InteractionSpec, StateSpec
from lingjing.testing.declarations import Rule, RuleParameter, Unlock
from lingjing.testing.expressions import Attr, Binary, Call, Number, Quantified, Ref
from lingjing.trace.records import (
    Absent,
    AdjudicatedEvent,
    BodyState,
    BoundaryRecord,
    Box,
    CameraPose,
    Command,
    Decision,
    DecisionRecord,
    Envelope,
    FrameInfo,
    ObservationRecord,
    Outgoing,
    Receipt,
    Snapshot,
    TaskEvent,
)

replace = msgspec.structs.replace
POSE = CameraPose(position=(0.0, 0.0, 100.0), heading_deg=0.0, tilt_deg=90.0)
BOX = (0.4, 0.4, 0.5, 0.5)


def boundary(tick: int, **fields: object) -> BoundaryRecord:
    """Return a boundary that is empty except for `fields`."""
    names = [field.name for field in msgspec.structs.fields(BoundaryRecord) if field.required]
    empty: dict[str, object] = dict.fromkeys(names, ())
    empty.update(tick=tick, time_s=10.0 * tick, reward=0.0, done=False)
    return BoundaryRecord(**{**empty, **fields})  # type: ignore[arg-type]


def frame(name: str, tick: int, *targets: str, pixels: int = 30) -> FrameInfo:
    boxes = tuple(Box(entity=target, cls="person_in_water", box=BOX, pixels=pixels) for target in targets)
    return FrameInfo(
        id=name, entity="uav[1]", camera="nadir", tick=tick, time_s=10.0 * tick, pose=POSE, channels=("rgb",),
        boxes=boxes,
    )  # fmt: skip


def report(number: int, frame_id: str, tick: int, recipients: int = 2, **body: object) -> tuple[Envelope, ...]:
    whole = {"frame": frame_id, "class": "person_in_water", "box": BOX, "position": (3.0, 4.0, 0.0), **body}
    return tuple(
        Envelope(
            id=f"m{tick}-{number}", tick=tick, sender="scout[1]", recipient=f"r{place}", kind="detection",
            category="report", body=whole, bytes=150, deliver_at=tick + 1,  # type: ignore[arg-type]
        )
        for place in range(recipients)
    )  # fmt: skip


def matched(tick: int, target: str, message: str) -> AdjudicatedEvent:
    return AdjudicatedEvent(id=f"e{tick}", kind="matched", tick=tick, time_s=10.0 * tick, bindings=(target, message))


def at(tick: int, **places: tuple[float, float]) -> Snapshot:
    names = {"v1": "victim[1]", "v2": "victim[2]", "boat": "boat"}
    states = tuple(BodyState(id=names[key], position=(*place, 0.0)) for key, place in places.items())
    return Snapshot(time_s=10.0 * tick, states=states)


@pytest.fixture
def of(trace: Trace):  # type: ignore[no-untyped-def]
    def build(*records: BoundaryRecord, header: object = None) -> Trace:
        return Trace(trace.path, header or trace.header, records, None, False)  # type: ignore[arg-type]

    return build


def test_the_metrics_of_the_synthetic_rescue_are_as_counted(trace: Trace) -> None:
    measured = metrics(trace)
    assert (measured.success, measured.scr, measured.reason, measured.ticks, measured.sim_s) == (
        True,
        1.0,
        "success",
        48,
        480.0,
    )
    assert (measured.reports, measured.detections, measured.targets_found, measured.false_positives) == (5, 4, 3, 1)
    assert (measured.messages, measured.rounds, measured.gap) == (24, 3, 0.0)
    assert measured.kilobytes == sum(edge.bytes for record in trace.boundaries for edge in record.messages) / 1000
    assert (measured.precision, measured.first_discovery_tick, measured.conflicts, measured.rejections) == (
        0.8,
        7,
        1,
        1,
    )
    assert (measured.calls, measured.tokens) == (4 * 48, 860 * 4 * 48)
    assert measured.cost_usd == pytest.approx(0.192)
    assert measured.localisation_error_m == pytest.approx(detect(trace).localisation_error_m)
    assert [(stage.name, stage.done, stage.cumulative) for stage in measured.stages] == [
        (name, 3, True) for name in ("detect", "locate", "handoff", "execute")
    ]
    assert measured.coverage is not None and 0.5 < measured.coverage <= 1.0
    assert measured.rep_excess == 0.0


def test_an_empty_trace_has_no_rates(of) -> None:  # type: ignore[no-untyped-def]
    measured = metrics(of())
    for name in ("scr", "precision", "recall", "f1", "miss_rate", "localisation_error_m", "gap", "rep", "wall_s"):
        assert getattr(measured, name) is None, name
    assert (measured.success, measured.ticks, measured.messages, measured.tokens, measured.coverage) == (
        False,
        0,
        0,
        0,
        0.0,
    )


def test_rivals_are_not_missed(of, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    """A buoy that only resembles a person is visible, and no report of it could be right."""
    instance = trace.header.instance
    buoy = replace(instance.entities[0], id="buoy[1]", group="buoy", index=1, role="target", hidden=("position",))
    header = replace(trace.header, instance=replace(instance, entities=(*instance.entities, buoy)))
    seen = frame("a", 1, "victim[1]", "buoy[1]"), frame("b", 2, "buoy[1]")
    faint = replace(seen[1], id="c", tick=3, boxes=(), faint=seen[0].boxes)
    records = (
        boundary(0), boundary(1, frames=seen[:1]),
        boundary(2, frames=seen[1:], messages=report(1, "a", 2), events=(matched(2, "victim[1]", "m2-1"),)),
        boundary(3, frames=(faint,)),
    )  # fmt: skip
    measured = metrics(of(*records, header=header))
    assert (measured.misses, measured.recall, measured.miss_rate, measured.faint_targets) == (0, 1.0, 0.0, 1)


def test_precision_recall_and_rates_are_computed_over_aligned_frames(of) -> None:  # type: ignore[no-untyped-def]
    """Five frames: a hit; a hit and a miss; a false report and a miss; nothing; a target without pixels."""
    detection = detect(
        of(
            boundary(0),
            boundary(1, frames=(frame("a", 1, "victim[1]"),)),
            boundary(2, frames=(frame("b", 2, "victim[1]", "victim[2]"),), messages=report(1, "a", 2),
                     events=(matched(2, "victim[1]", "m2-1"),)),
            boundary(3, frames=(frame("c", 3, "victim[3]", "boat"),), messages=report(1, "b", 3),
                     events=(matched(3, "victim[2]", "m3-1"),)),
            boundary(4, frames=(frame("d", 4),), messages=report(1, "c", 4, confidence=0.9)),
            boundary(5, frames=(frame("e", 5, "victim[1]", pixels=0),), messages=report(1, "nowhere", 5)),
        )
    )  # fmt: skip
    assert (detection.true_positives, detection.false_positives, detection.false_negatives) == (2, 2, 2)
    assert (detection.precision, detection.recall, detection.f1) == (0.5, 0.5, 0.5)
    assert detection.frames == 5
    assert detection.miss_rate == 2 / 5  # frames b and c; a boat is no target
    assert detection.hallucination_rate == 1 / 5  # a report of a frame that is not stored counts for no frame


def test_a_report_counts_once_and_each_of_its_recipients_is_a_message(of) -> None:  # type: ignore[no-untyped-def]
    measured = metrics(of(boundary(1, frames=(frame("a", 1),), messages=report(1, "a", 1, recipients=5))))
    assert (measured.reports, measured.messages, measured.kilobytes) == (1, 5, 0.75)


def test_the_localisation_error_is_measured_at_the_time_of_the_capture(of) -> None:  # type: ignore[no-untyped-def]
    """The target drifts on after the picture. The report has the position (3, 4)."""
    measured = metrics(
        of(
            boundary(0),
            boundary(1, snapshots=(at(1, v1=(0.0, 0.0)),), frames=(frame("a", 1, "victim[1]"),)),
            boundary(2, snapshots=(at(2, v1=(90.0, 0.0)),), messages=report(1, "a", 2),
                     events=(matched(2, "victim[1]", "m2-1"),)),
        )
    )  # fmt: skip
    assert measured.localisation_error_m == 5.0


@pytest.mark.parametrize("position", [None, "here", (1.0,), (float("nan"), 2.0), (None, 3.0)])
def test_a_report_without_a_position_has_no_localisation_error(of, position: object) -> None:  # type: ignore[no-untyped-def]
    record = boundary(
        0,
        snapshots=(at(0, v1=(0.0, 0.0)),),
        frames=(frame("a", 0, "victim[1]"),),
        messages=report(1, "a", 0, position=position),
        events=(matched(0, "victim[1]", "m0-1"),),
    )
    assert metrics(of(record)).localisation_error_m is None
    assert metrics(of(record)).detections == 1


def test_the_calibration_error_is_computed_over_ten_bins(of) -> None:  # type: ignore[no-untyped-def]
    """Bin 0.9..1 has two samples of confidence 0.95 and one hit: |0.5 - 0.95|. Bin 0.2 has one miss: 0.2."""
    record = boundary(
        0,
        frames=(frame("a", 0, "victim[1]"),),
        messages=(*report(1, "a", 0, confidence=0.95), *report(2, "a", 0, confidence=0.95),
                  *report(3, "a", 0, confidence=0.2)),
        events=(matched(0, "victim[1]", "m0-1"),),
    )  # fmt: skip
    assert metrics(of(record)).calibration_error == pytest.approx((2 * 0.45 + 0.2) / 3)
    certain = boundary(0, messages=report(1, "a", 0, confidence=1.0))
    assert metrics(of(certain)).calibration_error == 1.0


def test_rounds_count_ticks_with_an_assignment_or_a_target_status(of) -> None:  # type: ignore[no-untyped-def]
    edge = report(1, "a", 1)[0]
    measured = metrics(
        of(
            boundary(1, messages=(replace(edge, category="assignment"), replace(edge, category="target_status"))),
            boundary(2, messages=(replace(edge, tick=2, category="target_status"),)),
            boundary(3, messages=(replace(edge, tick=3, category="other"), replace(edge, tick=3))),
        )
    )
    assert measured.rounds == 2 and measured.messages == 5


def test_substitutions_rejections_and_absent_frames_are_counted(of) -> None:  # type: ignore[no-untyped-def]
    absent = Absent(entity="uav[1]", camera="nadir", tick=1, reason="late")
    idle = DecisionRecord(agent="a", decision=Decision(), substituted="policy_timeout")
    receipt = Receipt(request="c", tick=1, sender="a", resource="r", status="rejected", reason="conflict")
    measured = metrics(
        of(
            boundary(
                1,
                decisions=(idle, replace(idle, substituted="")),
                receipts=(receipt, replace(receipt, reason="busy"), replace(receipt, status="accepted", reason="")),
                observations=(ObservationRecord(agent="a", absent=(absent,)),) * 2,
            )
        )
    )
    assert (measured.substitutions, measured.idle_fraction, measured.conflicts, measured.rejections) == (1, None, 1, 2)
    assert measured.absent_frames == 1


def test_targets_too_faint_to_see_are_counted_and_not_missed(trace: Trace) -> None:
    """One target is added to every picture without a target. A visible one is missed, a faint one is counted."""
    more = (Box(entity="victim[1]", cls="person_in_water", box=BOX, pixels=9, contrast=3.0),)

    def with_boxes_in(field: str) -> Metrics:
        boundaries = tuple(
            replace(record, frames=tuple(f if f.boxes else replace(f, **{field: more}) for f in record.frames))
            for record in trace.boundaries
        )
        return metrics(dataclasses.replace(trace, boundaries=boundaries))

    empty = sum(not frame.boxes for frame in trace.frames.values())
    assert empty > 0
    seen, faint = with_boxes_in("boxes"), with_boxes_in("faint")
    assert (seen.misses - metrics(trace).misses, seen.faint_targets) == (empty, 0)
    assert (faint.misses, faint.faint_targets) == (metrics(trace).misses, empty)
    assert faint.f1 == metrics(trace).f1


def test_executors_and_their_radii_follow_from_the_rules(trace: Trace) -> None:
    assert service_radii(trace.header.instance) == (ServiceRadius("boat", "victim", 50.0),)


def assignment(tick: int, sender: str, assignee: str, **body: object) -> Envelope:
    whole = {"assignee": assignee, "task": "rescue", **body}
    return Envelope(
        id=f"m{tick}-{sender}", tick=tick, sender=sender, recipient="x", kind="assignment", category="assignment",
        body=whole, bytes=9, deliver_at=tick + 1,  # type: ignore[arg-type]
    )  # fmt: skip


def test_rep_counts_requests_and_entries(of) -> None:  # type: ignore[no-untyped-def]
    far, near = at(0, v1=(0.0, 0.0), v2=(500.0, 0.0), boat=(0.0, 300.0)), (10.0, 0.0)
    there = at(3, v1=(0.0, 0.0), v2=(500.0, 0.0), boat=near)
    steps = [
        boundary(0, snapshots=(far,)),
        boundary(1, snapshots=(far,), messages=(assignment(1, "scout[1]", "boat", position=(5.0, 5.0, 0.0)),)),
        boundary(2, snapshots=(far,), messages=(assignment(2, "scout[2]", "skipper", position=(0.0, 9.0, 0.0)),)),
        boundary(3, snapshots=(there,)),  # the assignee arrives: not repeated
        boundary(4, snapshots=(there,)),  # and stays: no event
    ]
    assert excess_target_rate(of(*steps[:1])) is None
    assert excess_target_rate(of(*steps[:2])) == 0.0
    assert excess_target_rate(of(*steps[:3])) == 1 / 2
    assert excess_target_rate(of(*steps[:4])) == 1 / 3
    assert excess_target_rate(of(*steps)) == 1 / 3
    rescue = TaskEvent(kind="rescue", entities=("victim[1]", "boat"), time_s=30.0)
    done = boundary(4, snapshots=(there,), task_events=(rescue,))
    again = [boundary(5, snapshots=(far,)), boundary(6, snapshots=(there,))]
    assert excess_target_rate(of(*steps[:4], done, *again)) == 2 / 4
    assert [repeated_target_rate(of(*steps[:n])) for n in (1, 2, 3, 4, 5)] == [None, 0.0, 1 / 2, 2 / 3, 2 / 3], (
        "by the paper's words the arrival of the assignee is repeated"
    )
    assert repeated_target_rate(of(*steps[:4], done, *again)) == 3 / 4


def test_rep_counts_commands_of_agents_that_do_not_control_the_executor(of) -> None:  # type: ignore[no-untyped-def]
    far = at(0, v1=(0.0, 0.0), v2=(500.0, 0.0), boat=(0.0, 300.0))

    def go(tick: int, sender: str, x: float) -> Command:
        arguments = {"x": x, "y": 0.0}
        return Command(id="c", tick=tick, sender=sender, resource="boat", verb="moveTo", arguments=arguments)

    own = boundary(1, snapshots=(far,), commands=(go(1, "skipper", 0.0),))
    assert excess_target_rate(of(own)) is None
    first = boundary(2, snapshots=(far,), commands=(go(2, "scout[1]", 0.0), go(2, "scout[1]", 480.0)))
    assert excess_target_rate(of(own, first)) == 0.0
    other = boundary(3, snapshots=(far,), commands=(go(3, "scout[3]", 510.0), go(3, "scout[3]", 250.0)))
    assert excess_target_rate(of(own, first, other)) == 1 / 3


def test_a_message_and_a_command_of_one_sender_are_one_request(of) -> None:  # type: ignore[no-untyped-def]
    far = at(0, v1=(0.0, 0.0), v2=(500.0, 0.0), boat=(0.0, 300.0))
    command = Command(id="c", tick=1, sender="scout[1]", resource="boat", verb="moveTo", arguments={"x": 0.0, "y": 0.0})
    message = assignment(1, "scout[1]", "skipper", position=(0.0, 0.0, 0.0))
    assert excess_target_rate(of(boundary(1, snapshots=(far,), commands=(command,), messages=(message,)))) == 0.0


def test_a_mission_without_targets_has_no_gap(of, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    instance = trace.header.instance
    bare = replace(instance, entities=tuple(e for e in instance.entities if e.role == "asset"), cells=(), stages=())
    cut = Trace(trace.path, replace(trace.header, instance=bare), (), trace.outcome, False)
    assert metrics(cut).gap is None and metrics(cut).coverage is None and metrics(cut).stages == ()
    assert metrics(Trace(trace.path, trace.header, (), trace.outcome, False)).gap == 0.0


def test_an_unobserved_grid_has_no_coverage(of, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    """A grid may only name the quarters of a city. No agent can visit its cells."""
    instance = trace.header.instance
    blind = tuple(
        replace(agent, observes=tuple(channel for channel in agent.observes if channel.source != "grid"))
        for agent in instance.agents
    )
    header = replace(trace.header, instance=replace(instance, agents=blind))
    assert metrics(of(*trace.boundaries)).coverage == metrics(trace).coverage != 0.0
    assert metrics(of(*trace.boundaries, header=header)).coverage is None


def test_metrics_are_plain_data(trace: Trace) -> None:
    measured = metrics(trace)
    assert msgspec.json.decode(msgspec.json.encode(measured), type=Metrics) == measured
    assert all(math.isfinite(v) for v in msgspec.to_builtins(measured).values() if isinstance(v, float))


@pytest.mark.parametrize(
    ("value", "count", "expected"),
    [((1, 2.0, 3), 2, (1.0, 2.0)), ((1,), 2, None), ("12", 2, None), ((1, "2"), 2, None), (None, 1, None)],
)
def test_only_a_tuple_with_enough_numbers_is_read_as_numbers(value: object, count: int, expected: object) -> None:
    assert numbers(value, count) == expected


def test_the_gap_of_a_delivery_is_the_undelivered_mass(of, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    """250 kg and 100 kg are ordered, and 150 kg are confirmed: 200 of 350 kg are incomplete."""
    demand = Attr(base=Ref(name="p", kind="local"), name="demand_kg")
    served = Rule(
        name="served",
        parameters=(RuleParameter(name="p", domain="point"),),
        condition=Binary(operator="<=", left=demand, right=Number(value=0.0, unit="kg")),
    )
    points = tuple(
        Entity(
            id=f"point[{number}]", group="point", index=number, role="target", type="delivery_point", engine="city",
            position=(0.0, 0.0, 0.0), properties={"demand_kg": mass}, state=(StateSpec(name="demand", unit="kg"),),
        )
        for number, mass in ((1, 250.0), (2, 100.0))
    )  # fmt: skip
    call = Call(function="served", arguments=(Ref(name="p", kind="local"),), rule=True)
    success = Quantified(quantifier="forall", variable="p", domain="point", body=call)
    instance = replace(trace.header.instance, entities=points, rules=(served,), success=success)
    states = (
        BodyState(id="point[1]", position=(0.0, 0.0, 0.0), resources={"demand": 100.0}),
        BodyState(id="point[2]", position=(0.0, 0.0, 0.0), resources={"demand": 100.0}),
    )
    played = boundary(1, snapshots=(Snapshot(time_s=10.0, states=states),))
    measured = metrics(of(boundary(0), played, header=replace(trace.header, instance=instance)))
    assert measured.gap == pytest.approx(100.0 * 200.0 / 350.0)


def lone_report(tick: int, status: str = "accepted") -> BoundaryRecord:
    """Return a boundary in which a lone agent reports the target of picture `a` after a rejected message."""
    body = {"frame": "a", "class": "person_in_water", "box": BOX, "position": (3.0, 4.0, 0.0)}
    messages = (Outgoing(kind="hello", body={}), Outgoing(kind="detection", body=body))  # type: ignore[arg-type]
    answers = tuple(
        Receipt(
            request=f"m{tick}-{number}", tick=tick, sender="scout[1]", resource=kind, status=word, by="bus", time_s=0.0
        )
        for number, kind, word in ((1, "hello", "rejected"), (2, "detection", status))
    )  # fmt: skip
    made = DecisionRecord(agent="scout[1]", decision=Decision(messages=messages))
    hits = (matched(tick, "victim[1]", f"m{tick}-2"),) if status == "accepted" else ()
    return boundary(tick, decisions=(made,), receipts=answers, events=hits)


def test_a_report_without_recipients_counts(of) -> None:  # type: ignore[no-untyped-def]
    seen = boundary(1, frames=(frame("a", 1, "victim[1]"),))
    measured = metrics(of(boundary(0), seen, lone_report(2)))
    assert (measured.reports, measured.detections, measured.recall, measured.messages) == (1, 1, 1.0, 0)
    refused = metrics(of(boundary(0), seen, lone_report(2, "rejected")))
    assert (refused.reports, refused.detections, refused.recall) == (0, 0, 0.0)


def test_reports_that_no_rule_judges_are_neither_true_nor_false(of, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    header = replace(trace.header, instance=replace(trace.header.instance, rules=()))
    measured = metrics(of(boundary(1, frames=(frame("a", 1, "victim[1]"),), messages=report(1, "a", 1)), header=header))
    assert (measured.reports, measured.false_positives, measured.misses) == (1, 0, 0)
    assert (measured.precision, measured.recall, measured.hallucination_rate) == (None, None, None)


def courier_service(trace: Trace) -> object:
    """A delivery: two vans with 200 kg, stops that need 250 kg and 100 kg within 30 m, and a depot."""
    deliver = InteractionSpec(name="deliver", by="road", within_m=30.0, takes="demand", source="load")
    restock = InteractionSpec(name="restock", by="road", within_m=50.0, gives="load")

    def thing(name: str, group: str, role: str, *acts: InteractionSpec, **properties: object) -> Entity:
        return Entity(
            id=name, group=group, index=1, role=role, type=group, engine="road" if role == "asset" else "city",
            position=(0.0, 0.0, 0.0), properties=properties, interactions=acts,  # type: ignore[arg-type]
        )  # fmt: skip

    entities = (
        thing("depot", "depot", "target", restock),
        thing("point[1]", "point", "target", deliver, demand_kg=250.0),
        thing("point[2]", "point", "target", deliver, demand_kg=100.0),
        thing("van[1]", "van", "asset", payload_kg=200.0),
        thing("van[2]", "van", "asset", payload_kg=200.0),
    )
    agents = tuple(
        AgentSpec(id=name, name="driver", index=1, role="driver", controls=(van,), commands=(van,), observes=())
        for name, van in (("driver[1]", "van[1]"), ("driver[2]", "van[2]"))
    )
    unlock = Unlock(interaction="deliver", parameters=(), condition=Number(value=1.0))
    served = Call(function="served", arguments=(), rule=True)
    instance = replace(
        trace.header.instance, entities=entities, agents=agents, rules=(), unlocks=(unlock,), success=served
    )
    return replace(trace.header, instance=instance)


def vans(tick: int, first: float, second: float, mps: float = 0.0) -> Snapshot:
    """Return a snapshot with stops 1000 m apart and two vans at the given eastings; the first van has a speed."""
    places = {"depot": -1000.0, "point[1]": 0.0, "point[2]": 1000.0, "van[1]": first, "van[2]": second}
    states = tuple(
        BodyState(id=name, position=(x, 0.0, 0.0), velocity=(mps if name == "van[1]" else 0.0, 0.0, 0.0))
        for name, x in places.items()
    )
    return Snapshot(time_s=10.0 * tick, states=states)


def test_executors_follow_from_the_interactions_of_targets(trace: Trace) -> None:
    header = courier_service(trace)
    assert service_radii(header.instance) == (
        ServiceRadius("van[1]", "point", 30.0),
        ServiceRadius("van[2]", "point", 30.0),
    )  # type: ignore[attr-defined]


def test_rep_does_not_count_an_order_that_is_split_between_two_vans(of, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    """250 kg need two vans. A driver's consent is no request, and the depot is no target."""
    header, away = courier_service(trace), vans(0, -500.0, 500.0)

    def tour(tick: int, driver: str, *stops: str) -> Envelope:
        return assignment(tick, "planner", driver, stops=("depot", *stops))

    def claim(tick: int, driver: str, x: float) -> Envelope:
        return assignment(tick, driver, driver, position=(x, 0.0, 0.0))

    plan = boundary(1, snapshots=(away,), messages=(
        tour(1, "driver[1]", "point[1]"), tour(1, "driver[2]", "point[1]", "point[2]")))  # fmt: skip
    consent = boundary(2, snapshots=(away,), messages=(
        claim(2, "driver[1]", 3.0), claim(2, "driver[2]", 0.0), claim(2, "driver[2]", 990.0)))  # fmt: skip
    assert excess_target_rate(of(plan, header=header)) == 0.0
    assert excess_target_rate(of(plan, consent, header=header)) == 0.0
    again = boundary(3, snapshots=(away,), messages=(claim(3, "driver[1]", 1000.0),))
    assert excess_target_rate(of(plan, consent, again, header=header)) == 1 / 3


def test_rep_counts_each_stay_in_a_region_as_one_entry(of, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    """Driving past is an entry, because the paper requires no stop. A pass at 31 m is none."""
    header = courier_service(trace)
    past = boundary(1, snapshots=(vans(1, 0.0, 500.0, 9.0), vans(1, 29.0, 500.0, 9.0), vans(1, 31.0, 500.0, 9.0)))
    assert excess_target_rate(of(past, header=header)) == 0.0
    assert excess_target_rate(of(boundary(1, snapshots=(vans(1, 31.0, 500.0),)), header=header)) is None
    mine = boundary(
        0, snapshots=(vans(0, 500.0, 500.0),), messages=(assignment(0, "planner", "driver[2]", stop="point[2]"),)
    )
    back = boundary(2, snapshots=(vans(2, 990.0, 500.0, 9.0), vans(2, 500.0, 500.0), vans(2, 990.0, 500.0)))
    assert excess_target_rate(of(mine, back, header=header)) == 2 / 3, "an assignment, and twice another in its region"


def test_rep_counts_an_interaction_from_outside_the_region_as_an_entry(of, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    """Each act is an entry of a van, which is outside again at once. An asset without a region cannot leave it."""
    header = courier_service(trace)
    part = TaskEvent(kind="deliver", entities=("point[1]", "van[1]"), time_s=9.0, values={"left_kg": 50.0})
    by_depot = replace(part, entities=("point[1]", "depot"))
    steps = (vans(1, 500.0, 500.0), vans(2, 500.0, 500.0), vans(3, 500.0, 500.0))
    for acts, entries in (
        ((part, replace(part, time_s=10.0)), 1),  # within one macro-step
        ((part, replace(part, time_s=11.0)), 2),
        ((part, replace(part, time_s=31.0)), 1),  # after the last macro-step
        ((by_depot, replace(by_depot, time_s=11.0)), 1),
    ):
        assert excess_target_events(of(boundary(1, snapshots=steps, task_events=acts), header=header)) == (0, entries)
    near = (vans(1, 500.0, 500.0), vans(2, 20.0, 500.0), vans(3, -20.0, 500.0))
    thrice = (part, replace(part, time_s=19.0), replace(part, time_s=29.0))  # the van is already inside at the last act
    assert excess_target_events(of(boundary(1, snapshots=near, task_events=thrice), header=header)) == (0, 2)


def test_rep_counts_the_entries_of_moving_targets(of) -> None:  # type: ignore[no-untyped-def]
    """The boat lies still. One person drifts into its region, out of it and in again across a boundary. The other one
    is close in eastings only."""
    away, inside = (60.0, 0.0), (50.0, 0.0)
    drift = [
        at(tick, v1=place, v2=(10.0, 70.0), boat=(0.0, 0.0))
        for tick, place in enumerate((away, inside, inside, inside, away, inside))
    ]
    first, second = boundary(2, snapshots=tuple(drift[:3])), boundary(5, snapshots=tuple(drift[3:]))
    assert excess_target_events(of(first)) == (0, 1)
    assert excess_target_events(of(first, second)) == (0, 2)


def test_rep_counts_an_entry_after_the_target_is_completed(of, trace: Trace) -> None:  # type: ignore[no-untyped-def]
    header = courier_service(trace)
    part = TaskEvent(kind="deliver", entities=("point[1]", "van[1]"), time_s=10.0, values={"left_kg": 50.0})
    first = boundary(1, snapshots=(vans(1, 0.0, 500.0, 9.0),), task_events=(part,))
    rest = boundary(2, snapshots=(vans(2, 500.0, 5.0),))
    assert excess_target_rate(of(first, rest, header=header)) == 0.0  # 50 kg were still due
    people = replace(first, task_events=(replace(part, values={"left": 2.0}),))  # a bare number has no unit
    assert excess_target_rate(of(people, rest, header=header)) == 0.0
    whole = replace(first, task_events=(replace(part, values={"left_kg": 0.0}),))
    assert excess_target_rate(of(whole, rest, header=header)) == 1 / 2


def test_a_step_of_guidance_without_a_target_assigns_nothing(of) -> None:  # type: ignore[no-untyped-def]
    far = at(0, v1=(0.0, 0.0), v2=(500.0, 0.0), boat=(0.0, 300.0))
    step = assignment(1, "scout[1]", "skipper", step="left", position=(0.0, 0.0, 0.0))
    assert excess_target_rate(of(boundary(1, snapshots=(far,), messages=(step,)))) is None
    named = assignment(1, "scout[1]", "skipper", step="left", what="victim[1]")
    assert excess_target_rate(of(boundary(1, snapshots=(far,), messages=(named,)))) == 0.0


def test_the_page_has_the_definition_of_every_metric() -> None:
    page = (Path(__file__).parents[2] / "docs" / "metrics.md").read_text(encoding="utf-8")
    assert page.endswith(table()), "python -m lingjing.analysis.metrics docs/metrics.md writes it"
    assert table().count("\n") == len(Metrics.__struct_fields__) + 2
    assert {group for group, _ in groups_and_units().values()} == set(GROUPS)


def test_a_frame_that_no_reporting_agent_receives_is_not_aligned(trace: Trace) -> None:
    """Frames of `uav[1]`: all without a viewer, none if only the skipper receives them, all if a searcher does."""
    instance = trace.header.instance
    channel = ChannelSpec(source="entity", name="uav[1]")
    whole = len(aligned_frames(trace))
    own = sum(frame.entity == "uav[1]" for frame in aligned_frames(trace))
    assert 0 < own < whole

    def shown_to(*names: str) -> int:
        agents = tuple(
            replace(agent, observes=(*agent.observes, channel)) if agent.id in names else agent
            for agent in instance.agents
        )
        messages = tuple(replace(message, senders=("searcher",)) for message in instance.messages)
        header = replace(trace.header, instance=replace(instance, agents=agents, messages=messages))
        return len(aligned_frames(Trace(trace.path, header, trace.boundaries, trace.outcome, False)))

    assert shown_to("skipper") == whole - own
    assert shown_to("skipper", "scout[1]") == whole
