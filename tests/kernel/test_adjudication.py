"""Adjudication: one-to-one matching of boxes, closed radii, unlocks, latching, evidence."""

import msgspec
import pytest

from lingjing.mission.operations import overlap
from lingjing.plugins.engine import Frame
from lingjing.testing import CENTRE_BOX, does, says, together
from lingjing.testing import rescue as kit
from lingjing.trace.records import Box


def photographed(*args, **kwargs):
    kernel = kit.kernel(*args, **kwargs)
    kernel.reset()
    kernel.step(kit.decisions(scout_1=does("takePhoto")))
    return kernel


def judged(kernel, *reports):
    record = kernel.step(kit.decisions(scout_1=together(*reports))).record
    return [(event.kind, *event.bindings) for event in record.events]


def shifted(share):
    """Return `TRUE_BOX` moved right, so that intersection over union is `share`."""
    width = CENTRE_BOX[2] - CENTRE_BOX[0]
    move = width * (1 - share) / (1 + share)
    return (CENTRE_BOX[0] + move, CENTRE_BOX[1], CENTRE_BOX[2] + move, CENTRE_BOX[3])


FRAME = "f1-uav[1]-nadir"


@pytest.mark.parametrize(("share", "hit"), [(0.5 + 1e-9, True), (0.51, True), (0.499, False), (1.0, True)])
def test_boxes_match_at_an_intersection_over_union_of_one_half_or_more(share, hit):
    assert overlap(CENTRE_BOX, shifted(share)) == pytest.approx(share)
    events = judged(photographed(), kit.report(FRAME, box=shifted(share)))
    assert (("matched", "victim[1]", "m2-1") in events) is hit


def test_touching_and_empty_boxes_do_not_overlap():
    assert overlap((0.0, 0.0, 0.5, 0.5), (0.5, 0.0, 1.0, 0.5)) == 0.0
    assert overlap((0.2, 0.2, 0.2, 0.2), (0.2, 0.2, 0.2, 0.2)) == 0.0


def test_the_class_must_be_the_same():
    assert judged(photographed(), kit.report(FRAME, cls="buoy")) == []


def test_a_report_outside_the_region_is_matched_but_not_accepted():
    assert judged(photographed(), kit.report(FRAME, position=(301.0, 0.0))) == [("matched", "victim[1]", "m2-1")]


def test_one_entity_is_matched_once_a_frame():
    events = judged(photographed(), kit.report(FRAME, box=shifted(0.8)), kit.report(FRAME))
    assert [event for event in events if event[0] == "matched"] == [("matched", "victim[1]", "m2-1")]


def test_a_report_matches_only_the_entity_with_the_best_overlap():
    both = kit.instance(victims=((100.0, 0.0), (105.0, 0.0)))

    class Two(kit.TruthCamera):
        def draw(self, request):
            frame = super().draw(request)
            boxes = (
                Box(entity="victim[1]", cls="person", box=shifted(0.6), pixels=9),
                Box(entity="victim[2]", cls="person", box=CENTRE_BOX, pixels=9),
            )
            return Frame(msgspec.structs.replace(frame.info, boxes=boxes), frame.rgb)

    events = judged(photographed(both, kit.RescueEngines(table=Two)), kit.report(FRAME))
    assert [event for event in events if event[0] == "matched"] == [("matched", "victim[2]", "m2-1")]


def test_a_report_of_an_old_frame_is_judged_by_that_frame_and_its_time():
    kernel = photographed()
    kernel.step(kit.decisions(scout_1=does("go", x=0.0, y=200.0)))
    record = kernel.step(kit.decisions(scout_1=kit.report(FRAME, position=(103.0, 4.0)))).record
    assert record.events[0].evidence["loc_error_m"] == pytest.approx(5.0)
    assert record.events[0].evidence["iou"] == pytest.approx(1.0)


@pytest.mark.parametrize(("east", "rescued"), [(50.0, True), (50.001, True), (49.999, False)])
def test_the_radius_is_inclusive(east, rescued):
    """The victim is at (100, 0), the boat stops at (east, 0): exactly 50 m away, just inside, just outside."""
    kernel = photographed(kit.instance(victims=((100.0, 0.0),)))
    kernel.step(kit.decisions(scout_1=kit.report(FRAME), skipper=does("go", x=east, y=0.0)))
    published = [kernel.step(kit.decisions()) for _ in range(3)][-1]
    assert published.evaluation.done is rescued


def test_without_a_report_nothing_is_unlocked_and_nothing_rescued():
    kernel = photographed()
    kernel.step(kit.decisions(skipper=does("go", x=100.0, y=0.0)))
    records = [kernel.step(kit.decisions()).record for _ in range(4)]
    assert all(record.events == () and record.commands == () for record in records)
    assert kernel.state.evaluation.reward == 0.0


def test_a_false_report_causes_no_event_and_no_stage():
    """The policy reports a person in a picture that shows none."""
    kernel = kit.kernel(kit.instance(victims=((250.0, 250.0),)))
    kernel.reset()
    kernel.step(kit.decisions(scout_1=does("takePhoto"), skipper=does("go", x=0.0, y=0.0)))
    kernel.step(kit.decisions(scout_1=kit.report(FRAME, position=(0.0, 0.0), confidence=1.0)))
    records = [kernel.step(kit.decisions()).record for _ in range(3)]
    assert all(record.events == () and record.stages == () for record in records)


def test_an_unlock_is_a_kernel_command_to_the_engine_that_owns_the_target():
    kernel = photographed()
    kernel.step(kit.decisions(scout_1=kit.report(FRAME)))
    record = kernel.step(kit.decisions()).record
    assert [(c.origin, c.verb, c.resource) for c in record.commands] == [("kernel", "unlock.rescue", "victim[1]")]
    assert kernel.step(kit.decisions()).record.commands == ()  # once


def test_an_unlock_that_its_engine_does_not_answer_is_sent_again():
    class Unresponsive(kit.Shore):
        def submit(self, commands):
            self.received = getattr(self, "received", 0) + len(commands)
            return super().submit(commands) if self.received > 1 else ()

    kernel = photographed(plugin=kit.RescueEngines(shore=Unresponsive))
    kernel.step(kit.decisions(scout_1=kit.report(FRAME)))
    records = [kernel.step(kit.decisions()).record for _ in range(3)]
    assert [[(r.request, r.status) for r in record.receipts] for record in records] == [
        [("k3-1", "timed_out")],
        [("k4-1", "accepted")],
        [],
    ]


def test_an_event_is_latched_and_emitted_once():
    kernel = photographed()
    kernel.step(kit.decisions(scout_1=kit.report(FRAME), skipper=does("go", x=100.0, y=-20.0)))
    kinds = [event.kind for _ in range(6) for event in kernel.step(kit.decisions()).record.events]
    assert kinds == ["rescued"]


def test_a_handoff_is_complete_when_a_destination_at_the_target_is_accepted():
    kernel = photographed(kit.instance("star"))
    kernel.step(kit.decisions(scout_1=kit.report(FRAME, position=(160.0, 0.0))))
    wrong = kernel.step(
        kit.decisions(commander=says("order", to=("skipper",), assignee="skipper", position=(0.0, 80.0)))
    )
    right = kernel.step(kit.decisions(skipper=does("go", x=160.0, y=0.0)))
    assert [change.stage for change in wrong.record.stages] == []
    assert [(change.stage, change.subject) for change in right.record.stages] == [("handoff", "victim[1]")]
