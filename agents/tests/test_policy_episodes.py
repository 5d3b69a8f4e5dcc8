"""Episodes of the sea rescue with the real engines, cut short."""

import itertools
import math
from pathlib import Path

import pytest

import lingjing
from lingjing import Session, Trace
from lingjing import read as read_trace
from lingjing.testing import shortened

SCENARIO = Path(__file__).parents[2] / "scenarios" / "ssr.ljs"


@pytest.mark.slow
def test_the_heuristic_breaks_no_rule_and_reports_no_person_in_blank_pictures(tmp_path: Path):
    with Session() as session:
        first = session.run(shortened(SCENARIO, 14), seed=7, out=tmp_path / "seeing", overview=False, world="inline")
        blank = session.run(
            shortened(SCENARIO, 14), seed=7, out=tmp_path / "blank", overview=False, world="inline", blank_pictures=True
        )
    trace = read_trace(first.trace)
    assert {binding.privileged for binding in trace.header.bindings} == {False}
    refused = [
        receipt
        for record in trace.boundaries
        for receipt in record.receipts
        if receipt.status in {"rejected", "substituted"} and receipt.reason not in {"busy", "conflict"}
    ]
    assert refused == []
    assert len(trace.frames) >= 6
    assert any(message.kind == "progress" for record in trace.boundaries for message in record.messages)
    assert reports(trace) > 0
    assert read_trace(blank.trace).frames
    assert reports(read_trace(blank.trace)) == 0


def reports(trace: Trace) -> int:
    """Return the number of detections that were sent."""
    return sum(message.kind == "detection" for record in trace.boundaries for message in record.messages)


@pytest.mark.slow
@pytest.mark.parametrize("policy", [pytest.param("heuristic", marks=pytest.mark.thorough), "oracle"])
def test_aircraft_that_start_from_pads_eight_metres_apart_do_not_collide(policy: str, tmp_path: Path):
    text = SCENARIO.read_text("utf-8").replace("ticks <= 60", "ticks <= 10").replace("1920 by 1080", "160 by 90")
    (tmp_path / "short.ljs").write_text(text, "utf-8")
    mission = lingjing.compile(tmp_path / "short.ljs")
    result = lingjing.run(
        mission, policy=policy, seed=3, settings={"uavs": 10}, overview=False, world="inline", out=tmp_path / "run"
    )
    trace = read_trace(result.trace)
    assert not [event for record in trace.boundaries for event in record.task_events if event.kind == "collided"]
    flown, nearest = set(), math.inf
    for moment in (moment for record in trace.boundaries for moment in record.snapshots):
        aloft = [state for state in moment.states if state.id.startswith("uav") and state.status != "grounded"]
        flown |= {state.id for state in aloft}
        pairs = itertools.combinations(aloft, 2)
        nearest = min([nearest, *(math.dist(first.position, other.position) for first, other in pairs)])
    assert len(flown) == (10 if policy == "heuristic" else 3)  # the oracle needs one for each victim
    assert nearest > 2.0, nearest
