"""Validation and conflict resolution of physical commands."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import kernel_kit as kit

from lingjing.trace.records import Action, Decision


def kernel_at_zero(*args, **kwargs):
    kernel = kit.make_kernel(*args, **kwargs)
    kernel.reset()
    return kernel


def refusals(record):
    return [(receipt.sender, receipt.reason) for receipt in record.receipts if receipt.status == "rejected"]


@pytest.mark.parametrize(
    ("made", "reason", "word"),
    [
        (kit.does("go", "submarine", x=0.0, y=0.0), "unknown_resource", "uav[1], boat"),
        (kit.does("go", "uav[2]", x=0.0, y=0.0), "no_authority", "only uav[1], boat"),
        (kit.does("fly"), "unknown_verb", "go, hop"),
        (kit.does("go", x=1.0), "bad_argument", "needs `y`"),
        (kit.does("go", x=1.0, y=1.0, w=1.0), "bad_argument", "no argument `w`"),
        (kit.does("go", x=1.0, y="north"), "bad_argument", "finite number"),
        (kit.does("go", x=1.0, y=True), "bad_argument", "finite number"),
        (kit.does("takePhoto", camera="rear"), "bad_argument", "no camera `rear`: nadir"),
        (Decision(command=Action(verb="stop", tick=5)), "stale", "now is 0"),
    ],
)
def test_a_candidate_is_refused_with_reason_and_way_out(made, reason, word):
    record = kernel_at_zero().step(kit.decisions(scout_1=made)).record
    assert refusals(record) == [("scout[1]", reason)]
    assert word in record.receipts[0].detail
    assert record.commands == ()


def test_the_first_valid_request_wins_and_the_rest_are_told_who_did():
    record = (
        kernel_at_zero()
        .step(
            kit.decisions(
                scout_1=kit.does("nonsense", "boat"),
                scout_2=kit.does("go", "boat", x=5.0, y=5.0),
                skipper=kit.does("go", x=9.0, y=9.0),
            )
        )
        .record
    )
    assert [(command.sender, command.resource) for command in record.commands] == [("scout[2]", "boat")]
    assert refusals(record) == [("scout[1]", "unknown_verb"), ("skipper", "conflict")]
    assert "scout[2]" in next(r for r in record.receipts if r.reason == "conflict").detail


def test_a_busy_resource_refuses_everything_but_stop():
    kernel = kernel_at_zero()
    kernel.step(kit.decisions(skipper=kit.does("go", x=0.0, y=300.0)))
    busy = kernel.step(kit.decisions(skipper=kit.does("go", x=0.0, y=0.0))).record
    assert refusals(busy) == [("skipper", "busy")]
    stopped = kernel.step(kit.decisions(skipper=kit.does("stop"))).record
    assert [(c.verb, c.resource) for c in stopped.commands] == [("stop", "boat")]
    assert refusals(stopped) == []


def test_a_rejection_by_the_engine_leaves_the_resource_free():
    kernel = kernel_at_zero()
    record = kernel.step(kit.decisions(skipper=kit.does("go", x=450.0, y=0.0))).record
    assert refusals(record) == [("skipper", "unreachable")]
    assert kernel.state.registry.pending == {}


def test_arguments_are_clipped_and_the_receipt_says_so():
    record = kernel_at_zero().step(kit.decisions(scout_1=kit.does("hop", distance=80.0))).record
    assert record.commands[0].arguments == {"distance": 50.0}
    (receipt,) = (r for r in record.receipts if r.reason == "clipped")
    assert "80 → 50" in receipt.detail


def test_destinations_are_clipped_to_the_altitude_band():
    record = kernel_at_zero().step(kit.decisions(scout_1=kit.does("go", x=0.0, y=0.0, z=400.0))).record
    assert record.commands[0].arguments["z"] == 160.0


def test_a_photo_needs_an_idle_resource_and_completes_in_its_boundary():
    kernel = kernel_at_zero()
    record = kernel.step(kit.decisions(scout_1=kit.does("takePhoto"), scout_2=kit.does("go", x=300.0, y=0.0))).record
    assert [(r.status, r.detail) for r in record.receipts if r.by == "camera"] == [
        ("accepted", ""),
        ("completed", "f1-uav[1]-nadir"),
    ]
    flying = kernel.step(kit.decisions(scout_2=kit.does("takePhoto"))).record
    assert refusals(flying) == [("scout[2]", "busy")]
    assert flying.frames == ()
