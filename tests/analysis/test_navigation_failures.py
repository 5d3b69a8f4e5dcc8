"""Failure families of navigations, idle teams and ignored orders, on synthetic traces of shipped missions."""

from __future__ import annotations

import msgspec
import pytest

import lingjing
from lingjing import Trace
from lingjing.analysis.families import attribute
from lingjing.testing import instantiate, shipped_missions
from lingjing.trace.records import (
    Action,
    AdjudicatedEvent,
    BodyState,
    BoundaryRecord,
    Box,
    Command,
    Decision,
    DecisionRecord,
    Envelope,
    FrameInfo,
    Outcome,
    Receipt,
    Snapshot,
    StageChange,
)
from tests.analysis.test_metrics import POSE, boundary

FILES = {path.stem: path for path in shipped_missions()}
SEEN_AT = 3
"""Tick of the first picture that shows the target."""


def lost(
    trace: Trace, name: str, records: tuple[BoundaryRecord, ...], reason: str = "budget", **settings: float
) -> Trace:
    """A lost episode of a shipped mission with these boundaries."""
    instance = instantiate(lingjing.compile(FILES[name]), seed=1, settings=settings)
    outcome = Outcome(success=False, reason=reason, scr=0.0, ticks=len(records) - 1, digest="", frames_digest="")
    header = msgspec.structs.replace(trace.header, instance=instance)
    return Trace(trace.path, header, records, outcome, True)


def walk(trace: Trace, away_m: list[float], *, seen: bool = True, stop_at: int | None = None) -> Trace:
    """A navigation: the dog is `away_m` east of the white building at each tick."""
    records = []
    for tick, away in enumerate(away_m):
        states = (BodyState(id="home", position=(0.0, 0.0, 0.0)), BodyState(id="dog", position=(away, 0.0, 0.0)))
        fields: dict[str, object] = {"snapshots": (Snapshot(time_s=20.0 * tick, states=states),)}
        if seen and tick == SEEN_AT:
            box = Box(entity="home", cls="reference_building", box=(0.4, 0.4, 0.6, 0.6), pixels=900)
            info = FrameInfo(id="f", entity="dog", camera="front", tick=tick, time_s=20.0 * tick, pose=POSE,
                             channels=("rgb",), boxes=(box,))  # fmt: skip
            fields["frames"] = (info,)
        if tick == stop_at:
            made = DecisionRecord(agent="navigator", decision=Decision(command=Action(verb="stop")))
            receipt = Receipt(request=f"c{tick}", tick=tick, sender="navigator", resource="dog", status="completed")
            fields |= {"decisions": (made,), "receipts": (receipt,)}
        records.append(boundary(tick, **fields))
    return lost(trace, "vdn", tuple(records), "late")


CONSTANT = [150.0] * 41


@pytest.mark.parametrize(
    ("away", "how", "family", "tick"),
    [
        (CONSTANT, {"seen": False}, "perception_miss", 40),
        (CONSTANT, {}, "perception_miss", SEEN_AT),
        (CONSTANT, {"seen": False, "stop_at": 8}, "object_confusion", 8),
        ([150.0] * 3 + [60.0] * 38, {"stop_at": 8}, "perception_miss", SEEN_AT),
        ([150.0 - 2.5 * tick for tick in range(41)], {"stop_at": 8}, "localisation_error", 8),
        ([abs(150.0 - 10.0 * tick) + 40.0 for tick in range(41)], {}, "context_drift", 15),
    ],
)
def test_a_lost_navigation_has_a_family(
    trace: Trace, away: list[float], how: dict[str, object], family: str, tick: int
) -> None:
    attribution = attribute(walk(trace, away, **how))  # type: ignore[arg-type]
    assert attribution is not None and (attribution.family, attribution.target, attribution.tick) == (
        family,
        "home",
        tick,
    )
    assert attribution.chain


def test_a_team_that_never_acts_is_a_deadlock(trace: Trace) -> None:
    agents = ("coordinator", "inspector", "driver", "courier")
    idle = tuple(DecisionRecord(agent=name, decision=Decision()) for name in agents)
    attribution = attribute(lost(trace, "ld", tuple(boundary(tick, decisions=idle) for tick in range(51))))
    assert attribution is not None and (attribution.family, attribution.tick) == ("coordination_deadlock", 0)


def drive(tick: int, van: str, target: str) -> dict[str, object]:
    """The fields of a boundary at which a driver sends its van to the place of a target."""
    arguments = {"x": PLACES[target][0], "y": PLACES[target][1]}
    made = Decision(command=Action(verb="setDestination", arguments=arguments))  # type: ignore[arg-type]
    driver = f"driver{van.removeprefix('van')}"
    command = Command(id=f"c{tick}", tick=tick, sender=driver, resource=van, verb="setDestination",
                      arguments=arguments)  # type: ignore[arg-type]  # fmt: skip
    receipt = Receipt(request=command.id, tick=tick, sender=driver, resource=van, status="accepted")
    return {"decisions": (DecisionRecord(agent=driver, decision=made),), "commands": (command,), "receipts": (receipt,)}


PLACES = {"van[1]": (0.0, 0.0), "point[1]": (300.0, 0.0), "point[2]": (-300.0, 0.0)}


def test_drivers_that_return_to_served_points_drift(trace: Trace) -> None:
    states = tuple(BodyState(id=name, position=(*place, 0.0)) for name, place in PLACES.items())
    records = []
    for tick in range(61):
        fields: dict[str, object] = {"snapshots": (Snapshot(time_s=20.0 * tick, states=states),)}
        if tick == 1:
            served = AdjudicatedEvent(id="e1", kind="served", tick=1, time_s=20.0, bindings=("point[1]",))
            fields["events"] = (served,)
        if tick >= 2:
            fields |= drive(tick, "van[1]", "point[1]")
        records.append(boundary(tick, **fields))
    attribution = attribute(lost(trace, "cd", tuple(records), points=2))
    assert attribution is not None and (attribution.family, attribution.tick) == ("context_drift", 2)


def test_an_ignored_order_is_drift(trace: Trace) -> None:
    states = tuple(BodyState(id=name, position=(*place, 0.0)) for name, place in PLACES.items())
    body = {"assignee": "driver[1]", "stops": ("point[1]", "point[2]")}
    order = Envelope(id="m1-1", tick=1, sender="planner", recipient="driver[1]", kind="plan", category="assignment",
                     body=body, bytes=9, deliver_at=2)  # type: ignore[arg-type]  # fmt: skip
    assigned = tuple(StageChange(stage="assign", subject=f"point[{n}]", tick=1, time_s=20.0) for n in (1, 2))
    records = []
    for tick in range(61):
        fields: dict[str, object] = {"snapshots": (Snapshot(time_s=20.0 * tick, states=states),)}
        if tick == 1:
            fields |= {"messages": (order,), "stages": assigned}
        if tick >= 2:
            made = Decision(command=Action(verb="left"))
            receipt = Receipt(request=f"c{tick}", tick=tick, sender="driver[1]", resource="van[1]", status="accepted")
            fields |= {"decisions": (DecisionRecord(agent="driver[1]", decision=made),), "receipts": (receipt,)}
        records.append(boundary(tick, **fields))
    attribution = attribute(lost(trace, "cd", tuple(records), points=2))
    assert attribution is not None and (attribution.family, attribution.tick) == ("context_drift", 2)
