"""The rules on the road, one situation at a time: routes inspected and driven, goods hauled, decks followed."""

import dataclasses
import math
from itertools import pairwise

import msgspec
import pytest
from lingjing_agents.heuristic import bridge_inspector as following
from lingjing_agents.heuristic import route_inspector as inspecting
from lingjing_agents.heuristic.bridge_inspector import BridgeInspector, centreline, longest
from lingjing_agents.heuristic.delivery_coordinator import DeliveryCoordinator
from lingjing_agents.heuristic.delivery_driver import DeliveryDriver
from lingjing_agents.heuristic.policy import rules_for
from lingjing_agents.heuristic.rescuer import Rescuer
from lingjing_agents.heuristic.route_coordinator import RouteCoordinator
from lingjing_agents.heuristic.route_driver import RouteDriver
from lingjing_agents.heuristic.route_inspector import RouteInspector
from lingjing_agents.heuristic.target_types import ANY_VEHICLE, FIRES, GAPS, PEOPLE, target_type_of
from lingjing_agents.paths.delivery_tours import shared_out, street_m, tours
from lingjing_agents.perception.people_at_sea import FoundBox
from lingjing_agents.perception.road_blocks import RoadBlock
from lingjing_agents.perception.road_queues import VehicleQueue

from agents.tests.agent_kit import (
    ASSIGNMENT,
    JAM,
    NADIR,
    REPORT,
    STATUS,
    EventView,
    Inbox,
    brief,
    envelope,
    length,
    observe,
    picture,
    sent_by,
    verb,
    view,
)  # fmt: skip
from lingjing.plugins.geometry import world_to_pixel
from lingjing.plugins.policy import EntityView, Field, MessageSpec, Peer, Receipt, Region, Resource


def spec(kind: str, record: str, category: str, fields: tuple[str, ...], senders: tuple[str, ...]) -> MessageSpec:
    made = tuple(Field(name=name, type="name") for name in fields)
    return MessageSpec(kind=kind, type=record, category=category, fields=made, senders=senders, recipients=("all",))


JAM_REPORT = sent_by(JAM, "boss", "eye")
ORDER = sent_by(ASSIGNMENT, "boss")
PROGRESS = sent_by(STATUS, "eye", "driver")
SIGHTING = sent_by(REPORT, "eye")
TOUR = spec("plan", "tour", "assignment", ("assignee", "stops", "load"), ("boss",))
HANDOVER = spec("handover", "delivery", "target_status", ("stop", "delivered", "left"), ("driver",))
CLAIM = sent_by(ASSIGNMENT, "driver")

UAV = Resource(
    id="uav", type="quadrotor", embodied=True, cameras=(NADIR,),
    verbs=(verb("takeoff"), verb("setDestination", length("x"), length("y"), length("z")), verb("takePhoto")),
    properties={"band_low_m": 40.0, "band_high_m": 120.0},
)  # fmt: skip


DRIVEN = (verb("setDestination", length("x"), length("y")), verb("stop"))


def van(name: str = "van", **properties: float) -> Resource:
    return Resource(
        id=name,
        type="delivery_van",
        embodied=True,
        verbs=DRIVEN,
        properties=properties,
    )


def brief_of(role: str, *resources: Resource, messages: tuple[MessageSpec, ...], **changes):
    others = (
        Peer(id="boss", role="boss", resources=()),
        Peer(id="eye", role="eye", resources=("uav",)),
        Peer(id="driver[1]", role="driver", resources=("van[1]",)),
        Peer(id="driver[2]", role="driver", resources=("van[2]",)),
    )
    name = changes.pop("agent", role)
    return msgspec.structs.replace(
        brief(), agent=name, role=role, resources=resources, messages=messages, cells=(),
        peers=tuple(peer for peer in others if peer.id != name), water_level_m=0.0, tick_s=20.0,
        **{"hub": "boss", "mode": "star", "settings": {}, "regions": (), "classes": ("congestion",), **changes},
    )  # fmt: skip


QUEUE = VehicleQueue((0.4, 0.2, 0.5, 0.8), 0.8, (40.0, 1.0), 5)
ROUTE = ((0.0, 0.0, 0.0), (200.0, 0.0, 0.0), (400.0, 0.0, 0.0))
INSPECTION = (JAM_REPORT, ORDER, PROGRESS, SIGHTING)


def routed(tick: int, route=ROUTE, events=()):
    shown = EntityView(id="van", type="car", position=(-150.0, 0.0, 0.0), route=route)
    return observe("boss", tick, shown, events=events)


def inspected(number: int, state: str, place, tick: int):
    return envelope("eye", PROGRESS, {"task": f"inspect-{number}", "state": state, "position": place}, tick=tick)


def orders(decision, task: str) -> list[tuple[str, tuple[float, ...]]]:
    bodies = [note.body for note in decision.messages]
    return [(body["assignee"], body["position"]) for body in bodies if body.get("task") == task]


def test_rules_follow_from_the_messages_and_the_body_of_an_agent():
    assert isinstance(rules_for(brief_of("boss", messages=INSPECTION)), RouteCoordinator)
    assert isinstance(rules_for(brief_of("eye", UAV, messages=INSPECTION)), RouteInspector)
    assert isinstance(rules_for(brief_of("driver", van(), messages=INSPECTION)), RouteDriver)
    assert isinstance(rules_for(brief_of("driver", van(), messages=(TOUR, HANDOVER, CLAIM))), DeliveryDriver)
    assert isinstance(rules_for(brief_of("boss", messages=(TOUR, HANDOVER, CLAIM))), DeliveryCoordinator)
    assert isinstance(
        rules_for(brief_of("eye", UAV, messages=(SIGHTING,), classes=("bridge_fracture",))), BridgeInspector
    )


def test_a_fire_truck_is_no_fire():
    assert target_type_of(brief_of("eye", messages=(), classes=("fire_truck", "building_fire"))) == (
        FIRES,
        "building_fire",
    )
    assert target_type_of(brief_of("eye", messages=(), classes=("fire_truck",))) is None
    assert target_type_of(brief_of("eye", messages=(), classes=("person_in_water",))) == (PEOPLE, "person_in_water")


def test_a_new_route_is_inspected_waypoint_by_waypoint_and_then_driven():
    boss = RouteCoordinator(brief_of("boss", messages=INSPECTION))
    first = boss.act(routed(1), Inbox())
    assert orders(first, "inspect") == [("eye", place) for place in ROUTE]
    assert boss.act(routed(2), Inbox()).messages == ()
    for number, place in enumerate(ROUTE, 1):
        clear_report = Inbox(messages=(inspected(number, "clear", place, number + 2),))
        decision = boss.act(routed(number + 3), clear_report)
    assert orders(decision, "drive") == [("driver[1]", ROUTE[-1])]
    over = (EventView(id="e1", kind="arrive", tick=9, entities=("goal", "van")),)
    assert boss.act(routed(9, events=over), Inbox()).messages == ()
    assert boss.act(routed(30), Inbox()).messages == ()


def test_another_route_is_requested_after_a_jam_while_the_limit_allows():
    boss = RouteCoordinator(brief_of("boss", messages=INSPECTION, settings={"replans_most": 1.0}))
    boss.act(routed(1), Inbox())
    jam = boss.act(routed(4), Inbox(messages=(inspected(1, "jammed", (30.0, 2.0, 0.0), 3),)))
    (note,) = jam.messages
    assert (note.kind, note.body["position"][:2], note.body["waypoint"]) == ("jammed", (30.0, 2.0), 1)
    other = ((0.0, 100.0, 0.0), (400.0, 100.0, 0.0))
    again = boss.act(routed(5, route=other), Inbox(messages=(inspected(2, "clear", ROUTE[1], 4),)))
    assert orders(again, "inspect") == [("eye", place) for place in other]
    spent = boss.act(routed(8, route=other), Inbox(messages=(inspected(1, "jammed", (200.0, 100.0, 0.0), 7),)))
    assert [note.kind for note in spent.messages] == []


def test_another_route_is_awaited_after_a_jam_at_the_last_waypoint():
    def after_the_jam() -> RouteCoordinator:
        boss = RouteCoordinator(brief_of("boss", messages=INSPECTION))
        boss.act(routed(1), Inbox())
        for number, place in enumerate(ROUTE[:-1], 1):
            boss.act(routed(2), Inbox(messages=(inspected(number, "clear", place, 2),)))
        jam = boss.act(routed(3), Inbox(messages=(inspected(len(ROUTE), "jammed", (370.0, 0.0, 0.0), 3),)))
        assert [note.kind for note in jam.messages] == ["jammed"]
        return boss

    other = ((0.0, 0.0, 0.0), (0.0, 100.0, 0.0), (400.0, 0.0, 0.0))
    again = after_the_jam().act(routed(4, route=other), Inbox())
    assert orders(again, "inspect") == [("eye", place) for place in other]
    boss = after_the_jam()
    driven = [orders(boss.act(routed(tick), Inbox()), "drive") for tick in range(4, 8)]
    assert driven == [[], [], [("driver[1]", ROUTE[-1])], []]  # if there is no other route, it drives the old one


@pytest.mark.parametrize("task", ["drive", "arrive"])
def test_a_driver_waits_for_its_order_and_repeats_a_rejected_command(task):
    driver = RouteDriver(brief_of("driver", van(), messages=INSPECTION), van())
    here = view("van", (0.0, 0.0, 0.0))
    assert driver.act(observe("driver", 1, here), Inbox()).command is None
    order = envelope("boss", ORDER, {"assignee": "driver", "task": task, "position": (300.0, 50.0, 0.0)})
    command = driver.act(observe("driver", 2, here), Inbox(messages=(order,))).command
    assert command is not None
    assert command.arguments == {"x": 300.0, "y": 50.0}
    refusal = Receipt(
        request="c2-1", tick=2, sender="driver", resource="van", status="rejected", reason="not_permitted"
    )
    assert driver.act(observe("driver", 3, here), Inbox(receipts=(refusal,))).command is None
    assert driver.act(observe("driver", 4, here), Inbox()).command is None
    assert driver.act(observe("driver", 5, here), Inbox()).command == command
    assert driver.act(observe("driver", 6, view("van", (290.0, 50.0, 0.0))), Inbox()).command is None


def inspecting_orders(*places, tick: int = 1) -> Inbox:
    bodies = [{"assignee": "eye", "task": "inspect", "position": place} for place in places]
    return Inbox(messages=tuple(envelope("boss", ORDER, body, tick=tick) for body in bodies))


def shot_by_uav(tick: int, place=(0.0, 0.0, 120.0)):
    return dataclasses.replace(picture(place, tick=tick), entity="uav")


def inspector(monkeypatch, queues=(), jams=0.0):
    """Return the rules after the picture of the first waypoint, with their decision on it."""
    monkeypatch.setattr(inspecting, "find_queues", lambda rgb, pose, level, line: queues)
    rules = RouteInspector(brief_of("eye", UAV, messages=INSPECTION, settings={"jams": jams}), UAV)
    start = view("uav", (0.0, 0.0, 120.0))
    photo = rules.act(observe("eye", 2, start), inspecting_orders(*ROUTE)).command
    assert photo is not None
    assert photo.verb == "takePhoto"
    return rules, rules.act(observe("eye", 3, start, pictures=(shot_by_uav(3),)), Inbox())


def test_an_inspector_reports_a_clear_waypoint_and_flies_to_the_next(monkeypatch):
    _, decision = inspector(monkeypatch)
    assert [note.body["state"] for note in decision.messages] == ["clear"]
    assert decision.command is not None
    assert decision.command.arguments == {"x": 203.0, "y": 0.0, "z": 120.0}  # past it as far as the leg after needs


def test_a_long_leg_is_photographed_in_its_middle_while_a_jam_is_possible(monkeypatch):
    rules, decision = inspector(monkeypatch, jams=1.0)
    assert decision.command is not None
    assert decision.command.arguments == {"x": 100.0, "y": 0.0, "z": 120.0}
    over = view("uav", (100.0, 0.0, 120.0))
    photo = rules.act(observe("eye", 4, over), Inbox()).command
    assert photo is not None
    assert photo.verb == "takePhoto"
    jam = VehicleQueue((0.4, 0.2, 0.5, 0.8), 0.8, (120.0, 1.0), 5)
    monkeypatch.setattr(inspecting, "find_queues", lambda rgb, pose, level, line: (jam,))
    seen = rules.act(observe("eye", 5, over, pictures=(shot_by_uav(5, (100.0, 0.0, 120.0)),)), Inbox())
    progress, report = seen.messages
    assert (progress.body["state"], progress.body["position"]) == ("jammed", (120.0, 1.0, 0.0))
    assert report.body["position"] == (120.0, 1.0, 0.0)
    last = 5 + inspecting.WAIT_TICKS
    on = rules.act(observe("eye", last, over), Inbox()).command  # without another route, to the end of this leg
    assert on is not None
    assert on.arguments["x"] == pytest.approx(200.0, abs=23.0)


def test_the_middle_of_a_leg_without_a_jam_is_not_reported(monkeypatch):
    rules, _ = inspector(monkeypatch, jams=1.0)
    over = view("uav", (100.0, 0.0, 120.0))
    rules.act(observe("eye", 4, over), Inbox())
    on = rules.act(observe("eye", 5, over, pictures=(shot_by_uav(5, (100.0, 0.0, 120.0)),)), Inbox())
    assert on.messages == ()
    assert on.command is not None
    assert on.command.arguments["x"] == pytest.approx(200.0, abs=23.0)


def test_an_inspector_reports_a_jam_with_its_box_and_place(monkeypatch):
    _, decision = inspector(monkeypatch, queues=(QUEUE,))
    progress, report = decision.messages
    assert (progress.body["state"], progress.body["position"]) == ("jammed", (40.0, 1.0, 0.0))
    assert (report.body["class"], report.body["box"]) == ("congestion", (0.4, 0.2, 0.5, 0.8))
    assert decision.command is None


NAMED = "*named* holds for jam `j`, jammed `r` when the horizontal distance from `r.position` to `j` is at most `12 m`"


def test_a_second_picture_gives_the_place_of_a_jam_if_places_must_be_exact(monkeypatch):
    """The first one is taken at a waypoint, or in the middle of a long leg; it shows the jam from aside."""
    seen = [RoadBlock((60.0, 0.0), (0.4, 0.2, 0.5, 0.8), 4, certain=False)]
    monkeypatch.setattr(inspecting, "find_blocks", lambda rgb, pose, level, line: tuple(seen))
    rules = RouteInspector(brief_of("eye", UAV, messages=INSPECTION, rules=(NAMED,), settings={"jams": 1.0}), UAV)
    start = view("uav", (0.0, 0.0, 120.0))
    rules.act(observe("eye", 2, start), inspecting_orders(*ROUTE))
    first = rules.act(observe("eye", 3, start, pictures=(shot_by_uav(3),)), Inbox())
    assert first.messages == () and first.command is not None
    assert (first.command.arguments["x"], first.command.arguments["y"]) == (60.0, 0.0)
    over = view("uav", (60.0, 0.0, 120.0))
    photo = rules.act(observe("eye", 4, over), Inbox()).command
    assert photo is not None and photo.verb == "takePhoto"
    seen[:] = [RoadBlock((66.0, 1.0), (0.4, 0.2, 0.5, 0.8), 8, certain=True)]
    second = rules.act(observe("eye", 5, over, pictures=(shot_by_uav(5, (60.0, 0.0, 120.0)),)), Inbox())
    progress, report = second.messages
    assert (progress.body["state"], progress.body["position"]) == ("jammed", (66.0, 1.0, 0.0))
    assert report.body["position"][:2] == (66.0, 1.0)
    assert rules._middles_of([place[:2] for place in ROUTE]) == {1: (100.0, 0.0), 2: (300.0, 0.0)}


def test_detected_vehicles_replace_the_pixels_if_places_must_be_exact():
    """The picture is grey. Its boxes show two lanes of cars, which meet 20 m beyond the waypoint."""
    shot = shot_by_uav(3)
    boxes = []
    for lane, ends in ((0.0, (-24.0, -11.0, 2.0, 15.0, 26.0)), (3.3, (15.0, 28.0, 41.0))):
        for x in ends:
            (u, v, *_) = world_to_pixel(shot.pose, (x, lane, 0.0))
            u, v = u / shot.pose.width, v / shot.pose.height
            boxes.append(FoundBox((u - 0.005, v - 0.005, u + 0.005, v + 0.005), 1.0))
    seen = {ANY_VEHICLE: lambda picture, level: tuple(boxes)}
    rules = RouteInspector(brief_of("eye", UAV, messages=INSPECTION, rules=(NAMED,), settings={"jams": 1.0}), UAV, seen)
    start = view("uav", (0.0, 0.0, 120.0))
    rules.act(observe("eye", 2, start), inspecting_orders(*ROUTE))
    over = rules.act(observe("eye", 3, start, pictures=(shot,)), Inbox()).command
    assert over is not None and (over.arguments["x"], over.arguments["y"]) == pytest.approx((20.5, 0.0), abs=1.0)


def test_an_inspector_on_the_ground_climbs_vertically_before_it_flies_on():
    rules = RouteInspector(brief_of("eye", UAV, messages=INSPECTION), UAV)
    below = view("uav", (-60.0, -10.0, 1.0), status="grounded")
    up = rules.act(observe("eye", 1, below), inspecting_orders(*ROUTE)).command
    assert up is not None
    assert (up.verb, up.arguments) == ("setDestination", {"x": -60.0, "y": -10.0, "z": 120.0})
    above = view("uav", (-60.0, -10.0, 120.0))
    on = rules.act(observe("eye", 2, above), Inbox()).command
    assert on is not None
    assert on.arguments == {"x": 3.0, "y": 0.0, "z": 120.0}


def test_an_inspector_without_orders_rises_and_hovers():
    rules = RouteInspector(brief_of("eye", UAV, messages=INSPECTION), UAV)
    up = rules.act(observe("eye", 1, view("uav", (5.0, 0.0, 1.0), status="grounded")), Inbox()).command
    assert up is not None
    assert up.arguments == {"x": 5.0, "y": 0.0, "z": 120.0}
    assert rules.act(observe("eye", 2, view("uav", (5.0, 0.0, 120.0))), Inbox()).command is None


def test_an_inspector_returns_to_the_start_after_a_jam_and_waits_for_the_next_route(monkeypatch):
    rules, decision = inspector(monkeypatch, queues=(QUEUE,))
    assert decision.command is None  # it stands over the first waypoint, where the next route begins too
    away = rules.act(observe("eye", 4, view("uav", (90.0, 0.0, 120.0))), Inbox()).command
    assert away is not None
    assert away.arguments == {"x": 0.0, "y": 0.0, "z": 120.0}
    assert rules.act(observe("eye", 5, view("uav", (2.0, 0.0, 120.0))), Inbox()).command is None
    other = ((0.0, 0.0, 0.0), (0.0, 150.0, 0.0))
    first = rules.act(observe("eye", 6, view("uav", (2.0, 0.0, 120.0))), inspecting_orders(*other, tick=5)).command
    assert first is not None
    assert first.verb == "takePhoto"


def test_an_inspector_that_receives_no_other_route_continues_the_old_route(monkeypatch):
    rules, _ = inspector(monkeypatch, queues=(QUEUE,))
    start = view("uav", (0.0, 0.0, 120.0))
    last = 3 + inspecting.WAIT_TICKS
    waited = [rules.act(observe("eye", tick, start), Inbox()).command for tick in range(4, last)]
    assert waited == [None] * len(waited)
    on = rules.act(observe("eye", last, start), Inbox()).command
    assert on is not None
    assert on.verb == "setDestination"


STOPS = {"p[1]": (300.0, 0.0), "p[2]": (320.0, 60.0), "p[3]": (-200.0, 0.0)}


def test_a_tour_fits_one_van_and_a_larger_order_is_split():
    plan = tours((0.0, 0.0), STOPS, {"p[1]": 100.0, "p[2]": 100.0, "p[3]": 250.0}, 200.0)
    assert sum(tour.load for tour in plan) == pytest.approx(450.0)
    assert max(tour.load for tour in plan) <= 200.0
    assert sorted(sorted(tour.stops) for tour in plan) == [["p[1]", "p[2]"], ["p[3]"], ["p[3]"]]
    assert plan[0].length_m == pytest.approx(street_m((0, 0), (320.0, 60.0)) * 2)
    shares = shared_out(plan, ("a", "b"))
    assert shares["a"][0] is plan[0]
    assert len(shares["b"]) == 2


def town(tick: int, at, load: float, demands, *, busy=False, status="parked"):
    me = EntityView(
        id="van[1]", type="delivery_van", position=(*at, 0.0), velocity=(0.0, 0.0, 0.0), heading_deg=0.0,
        status=status, busy=busy, resources={"load": load},
    )  # fmt: skip
    points = [
        EntityView(id=name, type="delivery_point", position=(*STOPS[name], 0.0), resources={"demand": left})
        for name, left in demands.items()
    ]
    depot = EntityView(id="depot", type="warehouse", position=(0.0, 0.0, 0.0))
    other = EntityView(id="van[2]", type="delivery_van", position=(0.0, 18.0, 0.0))
    return observe("driver[1]", tick, me, *points, depot, other)


def hauler(hub: str | None = None) -> DeliveryDriver:
    body = van("van[1]", payload_kg=200.0)
    mode = "star" if hub else "broadcast"
    return DeliveryDriver(
        brief_of("driver", body, messages=(TOUR, HANDOVER, CLAIM), agent="driver[1]", hub=hub, mode=mode), body
    )


def test_drivers_without_a_hub_divide_the_tours_and_claim_them():
    decision = hauler().act(town(1, (0.0, 10.0), 200.0, {"p[1]": 100.0, "p[2]": 100.0, "p[3]": 200.0}), Inbox())
    assert decision.command is not None
    assert decision.command.verb == "setDestination"
    assert math.dist(tuple(decision.command.arguments.values()), STOPS["p[1]"]) < 70.0
    assert {note.kind for note in decision.messages} == {CLAIM.kind}
    assert len(decision.messages) == 2


def test_a_driver_reports_the_remaining_demand_and_returns_to_load():
    rules = hauler()
    demands = {"p[1]": 200.0, "p[3]": 100.0}
    rules.act(town(1, (0.0, 10.0), 200.0, demands), Inbox())
    after = rules.act(town(5, (299.0, 2.0), 0.0, {"p[1]": 0.0, "p[3]": 100.0}), Inbox())
    (handover,) = [note for note in after.messages if note.kind == "handover"]
    assert (handover.body["stop"], handover.body["delivered"], handover.body["left"]) == ("p[1]", 200.0, 0.0)
    assert after.command is not None
    assert after.command.arguments == {"x": 0.0, "y": 0.0}


def test_a_driver_under_a_hub_follows_the_assigned_tour():
    rules = hauler("boss")
    demands = {"p[1]": 100.0, "p[3]": 100.0}
    assert rules.act(town(1, (0.0, 10.0), 200.0, demands), Inbox()).command is None
    order = envelope("boss", TOUR, {"assignee": "driver[1]", "stops": ("p[3]",), "load": 100.0})
    command = rules.act(town(2, (0.0, 10.0), 200.0, demands), Inbox(messages=(order,))).command
    assert command is not None
    assert command.arguments == {"x": -200.0, "y": 0.0}


def test_a_loaded_van_that_waits_before_the_depot_leaves_the_queue():
    rules = hauler()
    demands = {"p[1]": 200.0, "p[3]": 200.0}
    rules.act(town(1, (60.0, 0.0), 0.0, demands), Inbox())
    assert rules.act(town(2, (45.0, 0.0), 0.0, demands, busy=True, status="waiting"), Inbox()).command is None
    command = rules.act(town(3, (45.0, 0.0), 200.0, demands, busy=True, status="waiting"), Inbox()).command
    assert command is not None
    assert command.verb == "stop"


def test_a_coordinator_assigns_tours_that_fit_and_repeats_them_to_a_van_that_has_not_moved():
    rules = DeliveryCoordinator(brief_of("boss", messages=(TOUR, HANDOVER, CLAIM)))
    vans = [
        EntityView(id=f"van[{i}]", type="delivery_van", position=(0.0, 8.0 * i, 0.0), resources={"load": 200.0})
        for i in (1, 2)
    ]

    def seen(tick: int, third: float):
        points = [
            EntityView(id=name, type="delivery_point", position=(*place, 0.0), resources={"demand": demand})
            for (name, place), demand in zip(STOPS.items(), (100.0, 100.0, third), strict=True)
        ]
        depot = EntityView(id="depot", type="warehouse", position=(0.0, 0.0, 0.0))
        return observe("boss", tick, *vans, *points, depot)

    first = rules.act(seen(0, 250.0), Inbox())
    assert all(note.body["load"] <= 200.0 for note in first.messages)
    assert sum(note.body["load"] for note in first.messages) == pytest.approx(450.0)
    assert {note.body["assignee"] for note in first.messages} == {"driver[1]", "driver[2]"}
    assert rules.act(seen(1, 250.0), Inbox()).messages == ()
    assert rules.act(seen(6, 0.0), Inbox()).messages != ()  # the van that has not moved receives the order again


DECK = Region(name="deck", polygon=((0.0, -12.0), (600.0, -12.0), (600.0, 12.0), (0.0, 12.0)))
SQUARE = Region(name="town", polygon=((0.0, 0.0), (600.0, 0.0), (600.0, 600.0), (0.0, 600.0)))


def test_the_long_region_is_followed_from_the_near_end():
    assert longest((SQUARE, DECK)) is DECK
    line = centreline(DECK.polygon, (590.0, 30.0), 50.0)
    assert line[0][0] > line[-1][0]
    assert max(abs(y) for _, y in line) < 1.0
    assert max(math.dist(a, b) for a, b in pairwise(line)) <= 50.0


def test_a_gap_is_reported_with_its_place_on_the_deck(monkeypatch):
    finds = (FoundBox((0.45, 0.4, 0.55, 0.6), 0.9),)
    kind = type(GAPS)(words=GAPS.words, find=lambda rgb, pose, level: finds)
    monkeypatch.setattr(following, "target_type_of", lambda brief: (kind, "bridge_fracture"))
    rules = BridgeInspector(
        brief_of(
            "eye", UAV, messages=(SIGHTING,), classes=("bridge_fracture",), regions=(DECK,), settings={"altitude": 60.0}
        ),
        UAV,
    )
    shot = shot_by_uav(1, (100.0, 0.0, 60.0))
    decision = rules.act(observe("eye", 3, view("uav", (100.0, 0.0, 60.0)), pictures=(shot,)), Inbox())
    (note,) = decision.messages
    assert math.dist(note.body["position"][:2], (100.0, 0.0)) < 2.0
    assert note.body["class"] == "bridge_fracture"
    assert decision.command is not None
    assert decision.command.verb == "setDestination"


TRUCK = Resource(id="truck", type="fire_truck", embodied=True, verbs=DRIVEN)


def test_a_truck_drives_to_a_fire_once_and_reports_that_it_is_out():
    rules = Rescuer(
        brief_of("driver", TRUCK, messages=(SIGHTING, PROGRESS), classes=("building_fire",), hub=None), TRUCK
    )
    fire = envelope("eye", SIGHTING, {"position": (200.0, 40.0, 10.0), "confidence": 0.9, "class": "building_fire"})
    start = view("truck", (0.0, 0.0, 0.0))
    command = rules.act(observe("driver", 1, start), Inbox(messages=(fire,))).command
    assert command is not None
    assert command.arguments == {"x": 200.0, "y": 40.0}
    there = view("truck", (200.0, 15.0, 0.0))
    out = (EventView(id="e9", kind="extinguish", tick=4, entities=("truck",)),)
    decision = rules.act(observe("driver", 4, there, events=out), Inbox())
    assert decision.command is None
    assert [note.body["state"] for note in decision.messages] == ["rescued"]


def test_a_driver_commands_an_unreachable_place_only_once():
    own_brief = brief_of("driver", van(), messages=INSPECTION, classes=("building_fire",), regions=brief().regions)
    driver = Rescuer(own_brief, van())
    here = view("van", (0.0, -430.0, 0.0))
    refusal = Receipt(request="c0-1", tick=0, sender="driver", resource="van", status="rejected", reason="unreachable")
    assert driver.act(observe("driver", 0, here), Inbox()).command is not None
    assert driver.act(observe("driver", 1, here), Inbox(receipts=(refusal,))).command is None
    assert driver.act(observe("driver", 2, here), Inbox()).command is None
    seen = envelope("eye", SIGHTING, {"position": (500.0, -430.0, 0.0), "confidence": 1.0})
    command = driver.act(observe("driver", 3, here), Inbox(messages=(seen,))).command
    assert command is not None and command.arguments["x"] == 500.0
    assert driver.act(observe("driver", 4, here), Inbox(receipts=(refusal,))).command is None
    assert driver.act(observe("driver", 5, here), Inbox()).command is None
