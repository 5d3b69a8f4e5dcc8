"""The limit of claims: claims and repeated claims, the behaviour beyond the limit, and receipts that do not show it."""

from __future__ import annotations

from typing import Any

import pytest
from msgspec.structs import replace

from lingjing.kernel.inspections import Inspections
from lingjing.kernel.rules import evaluate
from lingjing.mission.instance import CountedSpec, EventSpec, InspectionSpec, LimitSpec, PermitSpec
from lingjing.testing import does, says, together
from lingjing.testing import rescue as kit
from lingjing.testing.declarations import Rule
from lingjing.testing.expressions import Aggregate, Attr, Binary, Call, Number, Quantified, Sequence, Symbol, Text
from lingjing.testing.rescue import decisions
from lingjing.trace.records import BoundaryRecord, CameraPose, Route, Snapshot

FRAME = "f1-uav[1]-nadir"
WRONG = [(0.01 * k, 0.0, 0.01 * k + 0.01, 0.01) for k in range(8)]


def limited(most: int, **changes: Any) -> Any:
    limit = LimitSpec(name="positives", most=most, counts=(CountedSpec(kind="claims"),))
    kernel = kit.kernel(kit.instance(limits=(limit,), **changes))
    kernel.reset()
    kernel.step(decisions(scout_1=does("takePhoto")))
    return kernel


def events(record: BoundaryRecord) -> list[str]:
    return [event.kind for event in record.events]


@pytest.mark.parametrize(("most", "guesses", "matched"), [(3, 2, True), (3, 3, False), (1, 0, True), (1, 1, False)])
def test_a_true_claim_counts_only_within_the_limit(most: int, guesses: int, matched: bool) -> None:
    kernel = limited(most)
    record = kernel.step(
        decisions(scout_1=together(*(kit.report(FRAME, box=box) for box in WRONG[:guesses]), kit.report(FRAME)))
    ).record
    assert ("matched" in events(record)) is matched
    assert kernel.state.registry.progress.used["positives"] == min(most, guesses + 1)


def test_a_claim_repeated_by_any_agent_counts_once() -> None:
    kernel = limited(2)
    for _ in range(3):
        kernel.step(decisions(scout_1=kit.report(FRAME, box=WRONG[0]), scout_2=kit.report(FRAME, box=WRONG[0])))
    record = kernel.step(decisions(scout_2=kit.report(FRAME))).record
    assert "matched" in events(record) and kernel.state.registry.progress.used["positives"] == 2


def test_one_box_with_another_position_is_another_claim() -> None:
    """Otherwise one box could be tried with every possible position."""
    kernel = limited(2)
    for east in (10.0, 20.0, 30.0):
        kernel.step(decisions(scout_1=kit.report(FRAME, box=WRONG[0], position=(east, 0.0, 0.0))))
    assert kernel.state.registry.progress.used["positives"] == 2


def test_reports_that_differ_only_in_fields_that_no_rule_reads_are_one_claim() -> None:
    kernel = limited(2)
    for confidence in (0.1, 0.5, 0.9):
        kernel.step(decisions(scout_1=kit.report(FRAME, box=WRONG[0], confidence=confidence)))
    assert kernel.state.registry.progress.used["positives"] == 1


def test_a_box_with_a_class_that_no_rule_asks_for_is_no_claim() -> None:
    """It can match nothing, so a report of a jam or a car leaves the limit to the finds."""
    kernel = limited(1)
    kernel.step(decisions(scout_1=together(*(kit.report(FRAME, box=box, cls="craft") for box in WRONG))))
    assert kernel.state.registry.progress.used.get("positives", 0) == 0
    assert "matched" in events(kernel.step(decisions(scout_1=kit.report(FRAME))).record)


def test_a_report_of_another_class_that_requests_a_route_is_still_a_claim() -> None:
    check = InspectionSpec(name="check", asset="boat", by=("uav[1]",), within_m=5.0, replan="detection", order="any")
    kernel = limited(1, inspections=(check,))
    for east in (10.0, 20.0, 30.0):
        kernel.step(decisions(scout_1=kit.report(FRAME, cls="craft", position=(east, 0.0))))
    assert kernel.state.registry.progress.used["positives"] == 1


def test_every_class_is_a_claim_where_a_condition_takes_any() -> None:
    """Nothing is free if a rule, or a part of another condition, reads reports of any class."""
    (_, *others), near = kit.instance().rules, Binary(operator="<=", left=Attr(base=kit.local("r"), name="confidence"),
                                                      right=Number(value=0.1))  # fmt: skip
    any_class = Rule(name="sure", parameters=kit.MATCHED.parameters, condition=near)
    loose = Quantified(quantifier="exists", variable="r", domain="detection", body=near)
    either = Binary(operator="or", left=kit.SUCCESS, right=loose)
    counted = Aggregate(function="count", variable="r", domain="detection", body=near)
    many = Binary(operator=">=", left=counted, right=Number(value=9.0))
    every = Quantified(quantifier="forall", variable="r", domain="detection", body=kit.MATCHED.condition.left)
    permit = PermitSpec(resource="boat", condition=loose)
    event = EventSpec(name="news", condition=loose)
    for changes in (
        {"rules": (kit.MATCHED, *others, any_class)}, {"success": either}, {"success": kit.both(kit.SUCCESS, many)},
        {"success": kit.both(kit.SUCCESS, every)}, {"permits": (permit,)}, {"events": (event,)},
    ):  # fmt: skip
        kernel = limited(9, **changes)
        kernel.step(decisions(scout_1=together(*(kit.report(FRAME, box=box, cls="craft") for box in WRONG[:3]))))
        assert kernel.state.registry.progress.used["positives"] == 3


def test_receipts_and_messages_do_not_reveal_the_limit() -> None:
    """Agents receive the same with a limit of 1 and with one of 50, as long as no report is a true claim."""
    seen = []
    for most in (1, 50):
        kernel = limited(most)
        outputs = [
            kernel.step(decisions(scout_1=kit.report(FRAME, box=box), scout_2=kit.report(FRAME, box=box)))
            for box in WRONG
        ]
        seen.append([(each.inboxes, each.record.receipts, each.record.messages) for each in outputs])
    assert seen[0] == seen[1]


def test_a_message_without_a_box_is_no_claim() -> None:
    kernel = limited(1)
    for _ in range(4):
        kernel.step(decisions(scout_1=says("order", assignee="boat", position=(5.0, 5.0))))
    assert kernel.state.registry.progress.used.get("positives", 0) == 0
    assert "matched" in events(kernel.step(decisions(scout_1=kit.report(FRAME))).record)


def test_replan_requests_count_as_one_claim_per_position() -> None:
    check = InspectionSpec(
        name="check", asset="boat", by=("uav[1]",), within_m=5.0, replan="order", destination="uav[2]"
    )
    kernel = limited(2, inspections=(check,))
    routes = []
    for place in ((1.0, 1.0), (1.0, 1.0), (2.0, 2.0), (3.0, 3.0)):
        record = kernel.step(decisions(scout_1=says("order", assignee="boat", position=place))).record
        routes.append([command.arguments for command in record.commands if command.verb == "replan"])
    assert routes == [[{"x": 1.0, "y": 1.0}], [{"x": 1.0, "y": 1.0}], [{"x": 2.0, "y": 2.0}], []]


def test_the_claims_of_an_earlier_boundary_are_not_modified() -> None:
    kernel = limited(2)
    claims = []
    for box in WRONG[:3]:
        before = kernel.state.registry.progress
        kernel.step(decisions(scout_1=kit.report(FRAME, box=box)))
        claims.append((len(before.claims), len(kernel.state.registry.progress.claims)))
    assert claims == [(0, 1), (1, 2), (2, 2)]


# -- the ray of a box

HIGH = "f1-uav[1]-high"
"""A nadir picture from 100 m over (100 m, 0 m)."""


def with_high_picture(kernel: Any) -> Any:
    registry = kernel.state.registry
    (frame,) = [info for info in registry.frames.values() if info.id == FRAME]
    pose = CameraPose(position=(100.0, 0.0, 100.0), heading_deg=0.0, tilt_deg=90.0)
    return replace(registry, frames=registry.frames.extended({HIGH: replace(frame, id=HIGH, pose=pose)}))


def ray_distance(frame: str, box: tuple[float, ...], place: tuple[float, ...]) -> object:
    kernel = limited(1)
    registry = with_high_picture(kernel)
    at = kernel._adjudicator.context_at(registry, registry.states, registry.time_s)
    items = Sequence(tuple(Number(each) for each in box)), Sequence(tuple(Number(each) for each in place))
    return evaluate(Call("ray_distance", (Text(frame), *items)), {}, at)


@pytest.mark.parametrize(
    ("box", "place", "metres"),
    [
        ((0.4, 0.4, 0.6, 0.6), (100.0, 0.0), 0.0),
        ((0.4, 0.4, 0.6, 0.6), (130.0, 40.0), 50.0),
        # At 84° the picture shows 90.04 m to each side of the ground: its middle right is 54.02 m to the east.
        ((0.75, 0.45, 0.85, 0.55), (154.0, 0.0), 0.0),
        ((0.75, 0.45, 0.85, 0.55), (120.0, 0.0), 0.0),  # a roof on the way
        ((0.75, 0.45, 0.85, 0.55), (164.02, 0.0), 10.0),  # behind the place where the ray meets the ground
        ((0.75, 0.45, 0.85, 0.55), (150.0, 12.0), 12.0),
        ((0.75, 0.45, 0.85, 0.55), (90.0, 0.0), 10.0),  # on the other side
    ],
)
def test_the_distance_from_a_ray_is_measured_up_to_the_ground(
    box: tuple[float, ...], place: tuple[float, ...], metres: float
) -> None:
    assert ray_distance(HIGH, box, place) == pytest.approx(metres, abs=0.05)


@pytest.mark.parametrize("frame", ["f9-uav[1]-nadir", ""])
def test_an_unknown_picture_has_no_ray(frame: str) -> None:
    assert ray_distance(frame, (0.4, 0.4, 0.6, 0.6), (0.0, 0.0)) is None


# -- pictures of waypoints


@pytest.mark.parametrize(
    ("pictured", "later", "seen"), [(False, 0, {0, 1}), (True, 0, {0}), (False, 1, {0, 1}), (True, 1, set())]
)
def test_a_waypoint_counts_only_with_a_picture_that_shows_it(pictured: bool, later: int, seen: set[int]) -> None:
    """The UAV stands near both waypoints; its picture of this boundary shows the first one alone."""
    kernel = limited(1)
    registry = with_high_picture(kernel)
    uav = registry.states["uav[1]"].position
    waypoints = ((110.0, 0.0, 0.0), (uav[0], uav[1] + 400.0, 0.0))
    spec = InspectionSpec(name="check", asset="boat", by=("uav[1]",), within_m=2000.0, pictured=pictured, order="any")
    route = Route(entity="boat", number=1, waypoints=waypoints, length_m=9.0, duration_s=9.0, time_s=0.0, request="r")
    known = replace(registry, routes={"boat": route}, tick=registry.tick + later)
    snapshot = Snapshot(time_s=registry.time_s, states=tuple(registry.states.values()))
    after = Inspections(kit.instance(inspections=(spec,))).advance(known, known, [snapshot])
    inspected = after.progress.inspected.get("check")
    assert (inspected.seen if inspected else frozenset()) == frozenset(seen)


@pytest.mark.parametrize(
    ("pictured", "east_m", "clear"), [(False, 20.0, True), (True, 20.0, False), (True, 20.1, True)]
)
def test_a_jam_between_two_waypoints_blocks_the_route_if_pictures_are_required(
    pictured: bool, east_m: float, clear: bool
) -> None:
    kernel = limited(1)
    registry = kernel.state.registry
    at = kernel._adjudicator.context_at(registry, registry.states, registry.time_s)
    jam = next(entity for entity in at.instance.entities if entity.id == "victim[1]")
    x, y, _ = registry.states[jam.id].position
    route = Route(
        entity="boat", number=1, waypoints=((x + east_m, y - 90.0, 0.0), (x + east_m, y + 90.0, 0.0)), length_m=180.0,
        duration_s=9.0, time_s=0.0, request="r",
    )  # fmt: skip
    check = InspectionSpec(name="check", asset="boat", by=("uav[1]",), within_m=25.0, pictured=pictured)
    blocking = replace(jam, properties={**jam.properties, "blocks": True, "radius_m": 20.0})
    at.instance = replace(at.instance, inspections=(check,), entities=(blocking,))
    at.registry = replace(registry, routes={"boat": route})
    assert evaluate(Call("clear", (Symbol("check"),)), {}, at) is clear


def test_rules_read_the_number_of_used_claims() -> None:
    kernel = limited(4)
    kernel.step(decisions(scout_1=kit.report(FRAME, box=WRONG[0])))
    registry = kernel.state.registry
    at = kernel._adjudicator.context_at(registry, registry.states, registry.time_s)
    assert evaluate(Call("used", (Symbol("positives"),)), {}, at) == 1.0


@pytest.mark.parametrize(
    ("moved_px", "error"), [((0, 0, 0, 0), 0.0), ((2, 0, 2, 0), 2.0), ((0, -3, 0, 1), 3.0), ((-5, 0, 5, 0), 5.0)]
)
def test_the_error_of_edges_is_in_pixels_of_the_picture(moved_px: tuple[int, ...], error: float) -> None:
    """The picture has 1920 by 1080 pixels: a pixel is not the same share of its width and of its height."""
    kernel = limited(1)
    registry = with_high_picture(kernel)
    at = kernel._adjudicator.context_at(registry, registry.states, registry.time_s)
    true = (0.4, 0.4, 0.41, 0.41)
    sizes = (1920, 1080, 1920, 1080)
    box = tuple(edge + moved / size for edge, moved, size in zip(true, moved_px, sizes, strict=True))
    boxes = [Sequence(tuple(Number(edge) for edge in each)) for each in (box, true)]
    assert evaluate(Call("edge_error", (Text(HIGH), *boxes)), {}, at) == pytest.approx(error)
    assert evaluate(Call("edge_error", (Text("f9-uav[1]-nadir"), *boxes)), {}, at) is None
