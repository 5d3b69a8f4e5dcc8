"""The heuristic's rules, one situation at a time, without engines."""

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from lingjing_agents.heuristic import aerial_searcher as searching
from lingjing_agents.heuristic.aerial_searcher import AerialSearcher
from lingjing_agents.heuristic.policy import rules_for
from lingjing_agents.heuristic.rescuer import Rescuer
from lingjing_agents.heuristic.search_coordinator import SearchCoordinator
from lingjing_agents.heuristic.target_types import PEOPLE
from lingjing_agents.perception.people_at_sea import FoundBox

from agents.tests.agent_kit import ASSIGNMENT, REPORT, STATUS, EventView, Inbox, brief, envelope, observe, picture, view
from lingjing.plugins.policy import Absent, Decision

CENTRE = (0.497, 0.495, 0.503, 0.505)


def go(decision: Decision) -> tuple[float, ...]:
    assert decision.command is not None
    assert decision.command.verb in {"setDestination", "moveTo"}
    return tuple(float(value) for value in decision.command.arguments.values())


def report(x: float, y: float, confidence: float = 0.9) -> dict:
    return {"position": (x, y, -3.5), "confidence": confidence, "class": "person_in_water"}


def rescued(tick: int) -> tuple[EventView, ...]:
    return (EventView(id=f"t{tick}-1", kind="rescue", tick=tick, entities=("boat",)),)


@pytest.mark.parametrize(
    ("agent", "mode", "kind"),
    [("scout[1]", "broadcast", AerialSearcher), ("skipper", "star", Rescuer), ("commander", "star", SearchCoordinator)],
)
def test_rules_follow_from_the_agent_and_the_mode(agent: str, mode: str, kind: type):
    assert isinstance(rules_for(brief(agent, mode)), kind)


class AircraftControl:
    """A searcher in a world without delay: each flight is completed at the next tick."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, finds=lambda height: (), agent="scout[1]", mode="broadcast"):
        kind = replace(PEOPLE, find=lambda rgb, pose, level: finds(pose.position[2] - level))
        monkeypatch.setattr(searching, "target_type_of", lambda brief: (kind, "person_in_water"))
        self.rules = rules_for(brief(agent, mode))
        self.here, self.heading, self.tick, self.agent = (306.0, -620.0, 1.1), 0.0, 0, agent
        self.shots: list[tuple[float, float, float]] = []
        self.sent: list = []

    def step(self, *inbox, absent=False, busy=False, events=()):
        pictures = ()
        missing = (Absent(entity="uav[1]", camera="nadir", tick=self.tick, reason="late"),) if absent else ()
        if self.shots and self.shots[-1] is not None and self.due:
            pictures = (picture(self.here, tick=self.tick),)
        own = view("uav[1]", self.here, heading=self.heading, busy=busy)
        seen = observe(self.agent, self.tick, own, pictures=pictures, absent=missing, events=events)
        decision = self.rules.act(seen, Inbox(messages=tuple(inbox)))
        self.tick, self.due = self.tick + 1, False
        self.sent.extend(decision.messages)
        if decision.command is not None and decision.command.verb == "setDestination":
            there = go(decision)
            self.heading = math.degrees(math.atan2(there[0] - self.here[0], there[1] - self.here[1]))
            self.here = there
        elif decision.command is not None and decision.command.verb == "takePhoto":
            self.shots.append(self.here)
            self.due = not absent
        return decision

    due = False


def test_a_searcher_photographs_its_third_of_the_region_and_reports_it(monkeypatch):
    flight = AircraftControl(monkeypatch)
    for _ in range(25):
        flight.step()
    first_pass = [shot for shot in flight.shots if abs(shot[2] - 96.5) < 1][:6]
    assert len({(round(x), round(y)) for x, y, _ in first_pass}) == len(first_pass) >= 5
    searched = {note.body["cell"] for note in flight.sent if note.kind == "progress"}
    assert {"cells-1-1", "cells-2-1", "cells-3-1"} <= searched


def test_a_confident_detection_is_reported_once_with_its_place(monkeypatch):
    flight = AircraftControl(monkeypatch, finds=lambda height: (FoundBox(CENTRE, 0.9),) if height > 60 else ())
    while not flight.sent:
        flight.step()
    (note,) = flight.sent
    assert note.kind == "detection"
    assert note.body["frame"] == f"f{flight.tick - 1}-uav[1]-nadir"
    shot = flight.shots[-1]
    assert math.dist(note.body["position"][:2], shot[:2]) < 2.0
    assert note.body["box"] == CENTRE


def test_an_uncertain_detection_is_first_checked_from_a_lower_height(monkeypatch):
    flight = AircraftControl(monkeypatch, finds=lambda height: (FoundBox(CENTRE, 0.2 if height > 60 else 0.7),))
    while not flight.shots:
        flight.step()
    first = flight.shots[0]
    flight.step()
    assert not [note for note in flight.sent if note.kind == "detection"]
    assert flight.here[2] < 60.0
    assert math.dist(flight.here[:2], first[:2]) < 5.0
    flight.step()
    flight.step()
    assert len([note for note in flight.sent if note.kind == "detection"]) == 1


def test_an_uncertain_detection_that_is_absent_at_a_lower_height_is_dropped(monkeypatch):
    flight = AircraftControl(monkeypatch, finds=lambda height: (FoundBox(CENTRE, 0.2),) if height > 60 else ())
    for _ in range(8):
        flight.step()
    assert not [note for note in flight.sent if note.kind == "detection"]


def test_a_target_that_a_peer_has_reported_is_not_reported_again(monkeypatch):
    flight = AircraftControl(monkeypatch, finds=lambda height: (FoundBox(CENTRE, 0.9),))
    while not flight.shots:
        flight.step()
    x, y, _ = flight.shots[-1]
    flight.step(envelope("scout[2]", REPORT, report(x + 5, y - 5)))
    assert not [note for note in flight.sent if note.kind == "detection"]


def test_a_missing_picture_is_requested_again(monkeypatch):
    flight = AircraftControl(monkeypatch)
    while not flight.shots:
        flight.step()
    flight.due = False
    again = flight.step(absent=True)
    assert again.command is not None
    assert again.command.verb == "takePhoto"


def test_a_busy_or_dead_vehicle_receives_no_command(monkeypatch):
    flight = AircraftControl(monkeypatch)
    assert flight.step(busy=True).command is None
    dead = observe("scout[1]", 1, view("uav[1]", (0.0, 0.0, -3.5), status="dead"))
    assert flight.rules.act(dead, Inbox()).command is None


def test_a_searcher_under_a_hub_waits_for_its_cells_and_then_flies_to_them(monkeypatch):
    flight = AircraftControl(monkeypatch, mode="star")
    assert flight.step().command is None
    orders = [
        envelope("commander", ASSIGNMENT, {"assignee": who, "task": "search", "cell": cell})
        for cell, who in [
            ("cells-1-3", "scout[1]"),
            ("cells-2-1", "scout[2]"),
            ("cells-3-1", "scout[2]"),
            ("cells-1-1", "scout[2]"),
        ]
    ]
    x, _, _ = go(flight.step(*orders))
    assert x > 400.0


def test_a_searcher_waits_three_ticks_for_a_silent_hub(monkeypatch):
    flight = AircraftControl(monkeypatch, mode="star")
    commands = [flight.step().command for _ in range(4)]
    assert commands[:3] == [None] * 3
    assert commands[3] is not None


def test_searchers_over_one_place_fly_at_different_heights(monkeypatch):
    heights = []
    for agent in ("scout[1]", "scout[2]", "scout[3]"):
        rules = rules_for(brief(agent))
        own = view(f"uav[{agent[6]}]", (300.0, -620.0, 1.1))
        heights.append(go(rules.act(observe(agent, 0, own), Inbox()))[2])
    assert min(b - a for a, b in pairwise(heights)) >= 2.0


def test_a_searcher_sends_an_idle_boat_only_after_a_delay(monkeypatch):
    rules = rules_for(brief("scout[1]"))
    report_inbox = Inbox(messages=(envelope("scout[2]", REPORT, report(100.0, -900.0)),))
    boat = view("boat", (12.4, -1351.8, -3.5), busy=None)
    verbs = []
    for tick in range(8):
        seen = observe("scout[1]", tick, view("uav[1]", (0.0, -900.0, 96.5), busy=True), boat)
        command = rules.act(seen, report_inbox if tick == 0 else Inbox()).command
        verbs.append(command.verb if command else None)
    assert verbs.index("moveTo") >= 3
    assert verbs.count("moveTo") <= 2


def sail(rules, tick, here, *inbox, busy=False, events=()):
    seen = observe("skipper", tick, view("boat", (*here, -3.5), busy=busy), events=events)
    return rules.act(seen, Inbox(messages=tuple(inbox)))


def test_a_rescuer_without_reports_approaches_the_region_in_short_legs():
    x, y = go(sail(rules_for(brief("skipper")), 0, (12.4, -1351.8)))
    assert 10.0 < math.dist((x, y), (12.4, -1351.8)) <= 60.1
    assert y > -1351.8


def test_a_rescuer_goes_to_the_nearest_report_first_and_to_the_next_after_a_rescue():
    rules = rules_for(brief("skipper"))
    far, near = report(500.0, -800.0), report(50.0, -1000.0)
    first = go(sail(rules, 1, (12.4, -1351.8), envelope("s", REPORT, far), envelope("s", REPORT, near)))
    assert math.dist(first, (50.0, -1000.0)) < 40.0
    assert sail(rules, 5, (30.0, -1200.0), busy=True).command is None
    done = sail(rules, 14, (52.0, -1001.0), events=rescued(14))
    assert [note.body["state"] for note in done.messages] == ["rescued"]
    assert math.dist(go(done), (500.0, -800.0)) < 60.0


def test_a_rescuer_gives_up_after_some_ticks_and_reports_it():
    rules = rules_for(brief("skipper"))
    sail(rules, 1, (12.4, -1351.8), envelope("s", REPORT, report(50.0, -1000.0)))
    states = [note.body["state"] for tick in range(14, 20) for note in sail(rules, tick, (60.0, -990.0)).messages]
    assert states == ["missed"]


def test_a_rescuer_obeys_only_its_own_orders():
    rules = rules_for(brief("skipper", "star"))
    other = envelope("commander", ASSIGNMENT, {"assignee": "scout[1]", "task": "rescue", "position": (600.0, -800.0)})
    mine = envelope("commander", ASSIGNMENT, {"assignee": "skipper", "task": "rescue", "position": (50.0, -1000.0)})
    assert math.dist(go(sail(rules, 1, (12.4, -1351.8), other, mine)), (50.0, -1000.0)) < 40.0


def test_one_rescue_with_two_events_counts_once():
    rules = rules_for(brief("skipper"))
    sail(
        rules,
        1,
        (12.4, -1351.8),
        envelope("s", REPORT, report(50.0, -1000.0)),
        envelope("s", REPORT, report(135.0, -1000.0)),
    )
    sail(rules, 14, (70.0, -1000.0), events=rescued(14))
    judged = (EventView(id="e14-1", kind="rescued", tick=14, entities=()),)
    assert math.dist(go(sail(rules, 15, (70.0, -1000.0), events=judged)), (135.0, -1000.0)) < 40.0


def orders(decision: Decision, task: str) -> list:
    return [note for note in decision.messages if note.body.get("task") == task]


def test_a_coordinator_assigns_all_cells_at_once():
    rules = rules_for(brief("commander", "star"))
    first = rules.act(observe("commander", 0), Inbox())
    search = orders(first, "search")
    assert len({note.body["cell"] for note in search}) == 9
    assert {note.body["assignee"] for note in search} == {"scout[1]", "scout[2]", "scout[3]"}
    assert all(set(note.to) == {"scout[1]", "scout[2]", "scout[3]"} for note in search)
    assert orders(rules.act(observe("commander", 1), Inbox()), "search") == []


def test_a_coordinator_orders_one_rescue_at_a_time():
    rules = rules_for(brief("commander", "star"))
    rules.act(observe("commander", 0), Inbox())
    reports = Inbox(
        messages=(
            envelope("scout[1]", REPORT, report(0.0, -900.0)),
            envelope("scout[2]", REPORT, report(300.0, -900.0)),
        )
    )
    (order,) = orders(rules.act(observe("commander", 5), reports), "rescue")
    assert order.body["assignee"] == "skipper"
    assert "skipper" in order.to
    assert orders(rules.act(observe("commander", 6), Inbox()), "rescue") == []
    (following,) = orders(rules.act(observe("commander", 9, events=rescued(9)), Inbox()), "rescue")
    assert math.dist(following.body["position"][:2], order.body["position"][:2]) > 200.0


def test_a_coordinator_orders_another_rescue_after_a_missed_one():
    rules = rules_for(brief("commander", "star"))
    reports = (envelope("scout[1]", REPORT, report(0.0, -900.0)), envelope("scout[2]", REPORT, report(300.0, -900.0)))
    rules.act(observe("commander", 0), Inbox(messages=reports))
    missed = envelope("skipper", STATUS, {"task": "rescue", "state": "missed", "position": (0.0, -900.0)})
    assert len(orders(rules.act(observe("commander", 9), Inbox(messages=(missed,))), "rescue")) == 1


def test_sightings_drift_with_the_current():
    rules = rules_for(brief("skipper"))
    sail(rules, 0, (12.4, -1351.8), envelope("s", REPORT, report(50.0, -1000.0)), busy=True)
    x, y = go(sail(rules, 40, (12.4, -1351.8)))
    assert x > 50.0 + 0.15 * 400 * math.sin(math.radians(60)) - 1
    assert y > -1000.0


def test_a_searcher_among_pads_climbs_vertically_and_waits_for_an_aircraft_overhead(monkeypatch):
    rules = rules_for(brief("scout[1]"))
    own, beside = view("uav[1]", (300.0, -620.0, 1.1), status="grounded"), view("uav[2]", (308.0, -620.0, 1.1))
    assert go(rules.act(observe("scout[1]", 0, own, beside), Inbox()))[:2] == (300.0, -620.0)
    overhead = view("uav[2]", (302.0, -621.0, 30.0))
    assert rules.act(observe("scout[1]", 1, own, overhead), Inbox()).command is None
    for tick in (2, 3, 4):
        command = rules.act(observe("scout[1]", tick, own, overhead), Inbox()).command
    assert command is not None and command.verb == "setDestination"
    away = rules_for(brief("scout[1]"))
    far = view("uav[2]", (340.0, -620.0, 1.1))
    assert go(away.act(observe("scout[1]", 0, own, far), Inbox()))[:2] != (300.0, -620.0)
