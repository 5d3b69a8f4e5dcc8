"""The plain sweep: lawn-mower order, one picture a cell, reports at the UAV's own position, one pass."""

from __future__ import annotations

from dataclasses import replace

import pytest
from lingjing_agents import sweep
from lingjing_agents.heuristic.target_types import PEOPLE
from lingjing_agents.perception.people_at_sea import FoundBox
from lingjing_agents.sweep import SweepPolicy, lawn_mower

from agents.tests.agent_kit import ASSIGNMENT, REPORT, Inbox, brief, envelope, grid, observe, picture, view
from lingjing.plugins.policy import NOTE, Decision

ASIDE = (0.1, 0.1, 0.12, 0.12)
"""A find far from the middle of the picture: the report has the UAV's position all the same."""


def test_rows_are_flown_in_alternating_directions() -> None:
    path = [cell.name for cell in lawn_mower(grid(3, 3))]
    rows = [path[:3], path[3:6], path[6:]]
    assert [[name.split("-")[1] for name in row] for row in rows] in (
        [["1"] * 3, ["2"] * 3, ["3"] * 3],
        [["3"] * 3, ["2"] * 3, ["1"] * 3],
    )
    columns = [[name.split("-")[2] for name in row] for row in rows]
    assert columns[0] == columns[1][::-1] == columns[2]


async def test_the_sweep_takes_one_picture_of_each_cell_and_then_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    kind = replace(PEOPLE, find=lambda rgb, pose, level: (FoundBox(box=ASIDE, confidence=0.9),))
    monkeypatch.setattr(sweep, "target_type_of", lambda brief: (kind, "person_in_water"))
    policy, here, shots, reports = SweepPolicy(), (306.0, -620.0, 1.1), [], []
    await policy.reset(brief())
    status, pictures = "grounded", ()
    for tick in range(40):
        seen = observe("scout[1]", tick, view("uav[1]", here, status=status), pictures=pictures)
        decision = await policy.act(seen, Inbox())
        reports += [message.body["position"] for message in decision.messages]
        pictures, command = (), decision.command
        if command is None:
            break
        if command.verb == "takePhoto":
            shots.append(here[:2])
            pictures = (picture(here, tick=tick + 1),)
        else:
            here = tuple(float(value) for value in command.arguments.values())  # type: ignore[assignment]
            status = "hovering"
    else:
        pytest.fail("the sweep does not end")
    assert len(shots) == 3 == len(set(shots)), "a third of nine cells, each once"
    assert [place[:2] for place in reports] == shots


async def test_a_vessel_goes_to_reported_places_in_the_order_of_their_arrival() -> None:
    policy = SweepPolicy()
    await policy.reset(brief("skipper"))
    far, near = {"position": (600.0, -800.0, -3.5)}, {"position": (20.0, -1300.0, -3.5)}
    boat = view("boat", (12.0, -1350.0, -3.5))
    first = Inbox(messages=(envelope("scout[1]", REPORT, far), envelope("scout[2]", REPORT, near)))
    made = [await policy.act(observe("skipper", tick, boat), first if tick == 1 else Inbox()) for tick in (1, 2, 3)]
    assert [made.command and tuple(made.command.arguments.values()) for made in made] == [
        (600.0, -800.0),
        (20.0, -1300.0),
        None,
    ]


async def test_a_coordinator_passes_reports_on_to_the_bodies_that_do_not_search() -> None:
    policy = SweepPolicy()
    await policy.reset(brief("commander", "star"))
    report = envelope("scout[1]", REPORT, {"position": (600.0, -800.0, -3.5)})
    decision = await policy.act(observe("commander", 1), Inbox(messages=(report,)))
    assert [(sent.kind, sent.to, sent.body["position"][:2]) for sent in decision.messages] == [  # type: ignore[index]
        (ASSIGNMENT.kind, ("skipper",), (600.0, -800.0))
    ]


async def test_an_agent_without_cells_reports_that_it_does_nothing() -> None:
    policy = SweepPolicy()
    await policy.reset(brief(cells=()))
    first = await policy.act(observe("scout[1]", 0), Inbox())
    assert first.command is None and first.thought.startswith(NOTE)
    assert await policy.act(observe("scout[1]", 1), Inbox()) == Decision()
