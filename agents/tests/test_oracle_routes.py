"""The oracles' inspection of a route: orders, requests for another route, and waiting."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from lingjing_agents.oracle.policy import OraclePolicy
from lingjing_agents.oracle.routes import PATIENCE_S

import lingjing
from lingjing.mission.instance import Vector
from lingjing.plugins.policy import BodyState, Decision, Envelope, Inbox, Observation, Privileged, Route
from lingjing.testing import brief_of, instantiate

MISSION = """ljs 1
use std.air { quadrotor }
use std.ground { car }
use std.messages { assignment, status, trafficJam }
use std.traffic { congestion, destination }
target heap { engine = city, on = road, look = congestion, blocks = true }

mission convoy "A route that two may inspect" {
  goal "Bring the car to its destination."
  scene commercial { extent = 1000 m, blocks = 5 by 5, height = 9 m..40 m, traffic = 0 }
  clock { tick = 20 s, sync = 500 ms }
  budget { ticks <= 40 }
  mode star in { star, broadcast }
  param lost = 0 in 0..60
  target goal_place : destination { position = (330 m, -2 m) }
  target jam : congestion { hidden position = (177 m, -2 m) }
  asset uav[1..2] : quadrotor { position = at(i, [(-120 m, -220 m, 1 m)], spread 12 m), band = 40 m..120 m }
  asset van : car { position = (-120 m, -202 m), heading = 90 deg, actions { setDestination, stop } }
  agent coordinator as coordinator { observes van.*, events }
  agent inspector as inspector controls uav[1] { observes uav[1].*, events }
  agent driver as driver controls van { observes van.*, events }
  message jammed : trafficJam from coordinator, inspector to all
  message order : assignment from coordinator to inspector, driver
  message progress : status from inspector, driver to coordinator
  comms { hub = coordinator when mode == star, delay = 1 tick, payload <= 4 kB, loss = lost * 1 % }
  inspection check of van by uav { destination = goal_place, within = 25 m, order = strict, replan = jammed }
  unlock arrive(d: goal_place) when inspected(check) and clear(check)
  stage execute { done when emitted(arrive, goal_place) }
  relation information_handoff inspector -> driver carries jammed
  success when emitted(arrive, goal_place)
}
"""

WAYPOINTS: tuple[Vector, ...] = ((-11.6, -201.7, 0.0), (5.0, -11.6, 0.0), (162.5, -5.0, 0.0), (330.0, -5.0, 0.0))
FREE: tuple[Vector, ...] = (*WAYPOINTS[:2], (0.0, 200.0, 0.0), (330.0, 200.0, 0.0))
TOO_LONG = round(PATIENCE_S / 20.0)
"""Ticks after which no vehicle waits any more."""


class Mind:
    """One agent's oracle with a ground truth made by hand."""

    def __init__(self, folder: Path, agent: str, mission: str = MISSION, mode: str = "star", lost: float = 0.0) -> None:
        file = folder / "convoy.ljs"
        file.write_text(mission)
        self._instance = instantiate(lingjing.compile(file), seed=1, mode=mode, settings={"lost": lost})
        spec = next(candidate for candidate in self._instance.agents if candidate.id == agent)
        self._agent, self._policy = agent, OraclePolicy()
        asyncio.run(self._policy.reset(brief_of(self._instance, spec.id)))

    def act(
        self, tick: int, route: int = 1, waypoints: tuple[Vector, ...] = WAYPOINTS, seen: int = 0, *messages: Envelope
    ) -> Decision:
        """Return the decision at a boundary with this number of inspected waypoints."""
        truth = Privileged(
            instance=self._instance,
            states=tuple(BodyState(id=entity.id, position=entity.position) for entity in self._instance.entities),
            frames=(), achieved=(),
            routes=(Route(entity="van", number=route, waypoints=waypoints, length_m=1.0, duration_s=1.0, time_s=0.0),),
            inspected={"check": tuple(range(seen))},
        )  # fmt: skip
        observed = Observation(agent=self._agent, tick=tick, time_s=20.0 * tick, privileged=truth)
        return asyncio.run(self._policy.act(observed, Inbox(messages=messages)))

    def orders(self, tick: int, route: int = 1, waypoints: tuple[Vector, ...] = WAYPOINTS, seen: int = 0) -> list[str]:
        """Return the orders as assignee and task."""
        messages = self.act(tick, route, waypoints, seen).messages
        return [f"{message.body['assignee']} {message.body['task']}" for message in messages if message.kind == "order"]


def from_inspector(kind: str, **body: str | float | Vector) -> Envelope:
    return Envelope(
        id="m1", tick=1, sender="inspector", recipient="coordinator", kind=kind, category="target_status",
        body=body, bytes=90, deliver_at=2,
    )  # fmt: skip


INSPECTION = ["inspector inspect"] * len(WAYPOINTS)


@pytest.mark.parametrize("mode", ["star", "broadcast"])
def test_the_coordinator_orders_each_inspector_that_controls_an_aircraft(mode: str, tmp_path: Path):
    hub = Mind(tmp_path, "coordinator", mode=mode)
    for orders, number in ((hub.orders(2), 4), (hub.orders(3, seen=1), 0), (hub.orders(4, 2, FREE, seen=2), 2)):
        assert [order for order in orders if "inspect" in order] == ["inspector inspect"] * number


def test_the_hub_does_not_repeat_a_request_for_another_route(tmp_path: Path) -> None:
    hub = Mind(tmp_path, "coordinator")
    request = from_inspector("jammed", waypoint=3.0, position=(177.0, -2.0, 0.0))
    assert {message.kind for message in hub.act(2, 2, FREE, 4, request).messages} == {"order"}


def test_no_vehicle_is_sent_into_a_jam_that_another_route_may_avoid(tmp_path: Path) -> None:
    hub, driver = Mind(tmp_path, "coordinator"), Mind(tmp_path, "driver")
    assert hub.orders(1) == INSPECTION
    assert driver.act(1).command is None
    for tick in (2, 3):
        assert hub.orders(tick, seen=4) == []
        assert driver.act(tick, seen=4).command is None
    assert hub.orders(4, 2, FREE) == [*INSPECTION, "driver arrive"]
    assert driver.act(4, 2, FREE).command is not None


def test_a_vehicle_drives_if_the_next_route_has_the_jam_too_or_no_other_route_comes(tmp_path: Path) -> None:
    for later in ((3, 2, WAYPOINTS), (1 + TOO_LONG, 1, WAYPOINTS)):
        hub, driver = Mind(tmp_path, "coordinator"), Mind(tmp_path, "driver")
        assert hub.orders(1) == INSPECTION
        assert driver.act(1).command is None
        assert "driver arrive" in hub.orders(*later)
        assert driver.act(*later).command is not None


def test_a_jam_without_a_radius_blocks_within_the_reach_of_the_engine(tmp_path: Path) -> None:
    heap = MISSION.replace("jam : congestion", "jam : heap")
    driver = Mind(tmp_path, "driver", heap)
    assert driver.act(1).command is None
    assert driver.act(2, 2, FREE).command is not None


@pytest.mark.parametrize(("lost", "again"), [(0.0, {}), (30.0, {8: ["driver arrive"], 9: ["inspector inspect"]})])
def test_orders_that_may_be_lost_are_repeated(lost: float, again: dict[int, list[str]], tmp_path: Path):
    hub = Mind(tmp_path, "coordinator", lost=lost)
    assert hub.orders(2, 1, FREE) == [*INSPECTION, "driver arrive"]
    assert hub.orders(3, 1, FREE, seen=3) == []
    later = {tick: hub.orders(tick, 1, FREE, seen=3) for tick in range(4, 10)}
    assert {tick: orders for tick, orders in later.items() if orders} == again


JAM: Vector = (177.0, -2.0, 0.0)
CLEAR, JAMMED = (
    from_inspector("progress", task="inspect-3", state=state, position=WAYPOINTS[2]) for state in ("clear", "jammed")
)
SEEN = from_inspector("sighting", **{"class": "congestion"}, position=JAM)
SEEN_OTHER = from_inspector("sighting", **{"class": "destination"}, position=JAM)
REQUESTED = from_inspector("jammed", waypoint=3.0, position=JAM)


@pytest.mark.parametrize("mode", ["star", "broadcast"])
@pytest.mark.parametrize(
    ("received", "asks"),
    [
        ([[CLEAR], [JAMMED], [JAMMED]], [0, 1, 0]),
        ([[SEEN_OTHER], [SEEN], [JAMMED]], [0, 1, 0]),
        ([[SEEN, REQUESTED], [JAMMED]], [0, 0]),
        ([[REQUESTED], [SEEN]], [0, 0]),
    ],
)
def test_the_hub_requests_another_route_once_for_a_jam_unless_the_inspector_requested_it(
    mode: str, received: list[list[Envelope]], asks: list[int], tmp_path: Path
) -> None:
    """This holds on the first route and on later ones: a jam that they still pass cannot be avoided."""
    hub = Mind(tmp_path, "coordinator", mode=mode)
    for tick, (messages, number) in enumerate(zip(received, asks, strict=True), 2):
        sent = hub.act(tick, tick, WAYPOINTS, 3, *messages).messages
        assert [message.kind for message in sent].count("jammed") == number


def test_no_vehicle_is_sent_while_a_jam_is_reported(tmp_path: Path) -> None:
    """The distance between the reported position and the jam does not matter."""
    reports = MISSION.replace("assignment, status", "assignment, report, status").replace(
        "carries jammed", "carries sighting"
    )
    reports = reports.replace(
        "  message jammed", "  message sighting : report from inspector to coordinator\n  message jammed"
    )
    hub = Mind(tmp_path, "coordinator", reports)
    hub.act(1, 2, FREE, 4)
    for cls, orders in (("congestion", []), ("destination", ["driver destination"])):
        sent = hub.act(
            2, 2, FREE, 4, from_inspector("sighting", **{"class": cls}, position=(-22.7, -47.6, 0.0))
        ).messages
        assert [f"{message.body['assignee']} {message.body['task']}" for message in sent] == orders


def test_an_inspector_does_not_report_a_waypoint_in_a_jam_as_clear(tmp_path: Path) -> None:
    inspector = Mind(tmp_path, "inspector")
    sent = inspector.act(2, 1, WAYPOINTS, 4).messages
    assert [message.body["task"] for message in sent if message.body["state"] == "clear"] == [
        "inspect-1",
        "inspect-2",
        "inspect-4",
    ]


def test_an_inspector_that_may_not_request_another_route_reports_the_jam(tmp_path: Path) -> None:
    mute = MISSION.replace("from coordinator, inspector to all", "from coordinator to all")
    there = mute.replace("(-120 m, -220 m, 1 m)", "(177 m, -2 m, 60 m)")
    inspector = Mind(tmp_path, "inspector", there)
    inspector.act(2, 1, WAYPOINTS, 3)
    (report,) = inspector.act(3, 1, WAYPOINTS, 3).messages
    assert (report.kind, report.body["task"], report.body["state"]) == ("progress", "inspect-4", "jammed")


def test_each_vehicle_goes_to_the_destination_of_its_own_inspected_route(tmp_path: Path) -> None:
    """The lorry is nearer to the van's destination, and the van to the lorry's."""
    lorry = "asset lorry : car { position = (300 m, -202 m), heading = 90 deg, actions { setDestination, stop } }"
    end = "target yard : destination { position = (-120 m, -402 m) }"
    check = "inspection second of lorry by uav { destination = yard, within = 25 m, order = any, replan = jammed }"
    two = MISSION.replace("  agent coordinator", f"  {lorry}\n  {end}\n  {check}\n  agent coordinator")
    two = two.replace(
        "  message jammed", "  agent hauler as driver controls lorry { observes lorry.*, events }\n  message jammed"
    )
    two = two.replace("unlock arrive(d: goal_place) when inspected(check) and clear(check)", "")
    two = two.replace("  success when ", "  success when emitted(arrive, yard) and ")
    goals = {}
    for agent in ("driver", "hauler"):
        command = Mind(tmp_path, agent, two).act(TOO_LONG, 1, FREE).command
        goals[agent] = command and (command.arguments["x"], command.arguments["y"])
    assert goals == {"driver": (330.0, -2.0), "hauler": (-120.0, -402.0)}


@pytest.mark.slow
def test_a_vehicle_that_may_drive_waits_for_a_route_without_a_jam(tmp_path: Path) -> None:
    file = tmp_path / "convoy.ljs"
    file.write_text(MISSION)
    played = lingjing.run(file, policy="oracle", seed=1, out=tmp_path / "run", overview=False, world="inline")
    assert (played.reason, played.score) == ("success", 1.0)
