"""Every declared relation is in the graph and becomes a record when it happens. Star mode delivers through its hub in
two ticks, broadcast reaches every agent, and one truck or boat serves one agent at a time.
"""

from __future__ import annotations

import pytest

from lingjing.mission.graph import graph
from lingjing.testing import CENTRE_BOX, Stage, does, reports, says, together
from tests.missions import staging as kit

FIVE = ("information_handoff", "cooperation", "competition", "guidance", "dependency")

DECLARED = {
    ("vdn", "single"): {"dependency"},
    ("bi", "single"): {"dependency"},
    ("ld", "star"): {"information_handoff", "cooperation", "guidance", "dependency"},
    ("idf", "broadcast"): set(FIVE),
    ("upr", "star"): {"information_handoff", "cooperation", "guidance", "dependency"},
    ("ufr", "star"): {"information_handoff", "cooperation", "guidance", "dependency"},
    ("ufr", "broadcast"): set(FIVE),
    ("cr", "star"): {"information_handoff", "cooperation", "guidance", "dependency"},
    ("ssr", "star"): {"information_handoff", "cooperation", "guidance", "dependency"},
    ("ssr", "broadcast"): set(FIVE),
    ("cd", "star"): set(FIVE),
    ("cd", "broadcast"): {"information_handoff", "cooperation", "competition", "dependency"},
}
"""A mission with one agent has dependent stages and no cooperation. Competition requires a shared resource, and
guidance requires authority: a hub, or a message kind that orders."""

columns = pytest.mark.parametrize(
    ("name", "mode"), [pytest.param(*column, id="-".join(column)) for column in kit.COLUMNS]
)


@columns
def test_the_declared_relations_are_edges_of_the_graph(name, mode):
    edges = {edge.kind for edge in graph(kit.mission(name), mode).edges}
    assert edges & set(FIVE) == DECLARED[name, mode]
    instance, _ = kit.staged(name, mode)
    assert {relation.kind for relation in instance.relations} == DECLARED[name, mode]


def relations_of(play, kind):
    """(source, target, by, tick) of the records of one kind."""
    return [
        (relation.source, relation.target, relation.by, relation.tick)
        for relation in play.relations
        if relation.kind == kind
    ]


def message_ids(play, kind, tick):
    """The ids of the messages of a kind that were sent for a boundary."""
    sent = [
        edge for boundary in play.all for edge in boundary.record.messages if (edge.kind, edge.tick) == (kind, tick)
    ]
    return list(dict.fromkeys(edge.id for edge in sent))


# -- the search teams: UFR and SSR

TEAMS = {
    "ufr": ("fire", "building_fire", "truck", "setDestination", "driver", "dispatcher", "located", "extinguished"),
    "ssr": ("victim", "person_in_water", "boat", "moveTo", "skipper", "commander", "reported", "rescued"),
}
teams = pytest.mark.parametrize("name", TEAMS)


def team(name, mode, count=1.0):
    return kit.playing(name, mode, **{f"{TEAMS[name][0]}s": count})


def sighted(play, name, scout=1):
    """A picture of the first target, taken above the first cell, and a true report of this target."""
    target, cls = f"{TEAMS[name][0]}[1]", TEAMS[name][1]
    x, y = play.instance.cells[0].centre
    play.stage.places[f"uav[{scout}]"] = (x, y, 100.0)
    play.stage.boxes = {target: CENTRE_BOX}
    play.do({f"scout[{scout}]": does("takePhoto", camera="nadir")})
    frame = f"f{play.published.record.tick}-uav[{scout}]-nadir"
    place = play.entity(target).position[:2]
    return target, place, reports("detection", frame, cls, place)


@teams
def test_broadcast_reaches_all_peers_in_one_tick(name):
    with team(name, "broadcast") as play:
        _, _, report = sighted(play, name)
        play.do({"scout[1]": report})
        peers = {agent.id for agent in play.instance.agents} - {"scout[1]"}
        assert {agent for agent, box in play.published.inboxes.items() if box.messages} == peers
        assert not play.published.inboxes["scout[1]"].messages


@teams
def test_messages_in_star_mode_pass_through_the_hub_in_two_ticks(name):
    """Only the hub receives a scout's report; the addressee receives the hub's message a tick later."""
    responder, hub = TEAMS[name][4:6]
    with team(name, "star") as play:
        _, place, report = sighted(play, name)
        first = play.do({"scout[1]": report})
        assert [agent for agent, box in first.inboxes.items() if box.messages] == [hub]
        order = says("assignment", to=(responder,), assignee=responder, task="go", position=place)
        second = play.do({hub: order})
        assert [agent for agent, box in second.inboxes.items() if box.messages] == [responder]
        assert second.record.tick - first.record.tick == 1  # sent at boundary 1, received at boundary 3
        assert first.record.tick == 2 and second.record.tick == 3


@teams
def test_a_search_team_hands_its_evidence_to_the_responder(name):
    with team(name, "broadcast") as play:
        _, _, report = sighted(play, name)
        play.do({"scout[1]": report})
        (message,) = message_ids(play, "detection", 2)
        assert relations_of(play, "information_handoff") == [("scout[1]", TEAMS[name][4], message, 2)]


@teams
def test_in_star_mode_evidence_is_handed_over_when_the_hub_orders_the_responder(name):
    responder, hub = TEAMS[name][4:6]
    with team(name, "star") as play:
        _, place, report = sighted(play, name)
        play.do({"scout[1]": report})
        assert relations_of(play, "information_handoff") == []
        play.do({hub: says("assignment", to=(responder,), assignee=responder, task="go", position=place)})
        (order,) = message_ids(play, "assignment", 3)
        assert relations_of(play, "information_handoff") == [("scout[1]", responder, order, 3)]


@teams
def test_an_order_to_another_place_hands_no_evidence_over(name):
    responder, hub = TEAMS[name][4:6]
    with team(name, "star") as play:
        _, (x, y), report = sighted(play, name)
        play.do({"scout[1]": report})
        play.do({hub: says("assignment", to=(responder,), assignee=responder, task="go", position=(x + 90.0, y))})
        assert relations_of(play, "information_handoff") == []


@teams
@pytest.mark.parametrize("mode", ["star", "broadcast"])
def test_scouts_cooperate_by_the_cells_that_they_photograph(name, mode):
    with team(name, mode) as play:
        sighted(play, name, scout=2)
        visited = [cell.name for cell in play.published.observations["scout[1]"].cells if cell.visited_tick == 1]
        partners = [agent.id for agent in play.instance.agents if agent.role == "searcher" and agent.id != "scout[2]"]
        assert visited
        expected = {("scout[2]", partner, cell, 1) for partner in partners for cell in visited}
        assert set(relations_of(play, "cooperation")) == expected


@teams
def test_the_coordinator_guides_scouts(name):
    hub = TEAMS[name][5]
    with team(name, "star") as play:
        play.do({hub: says("assignment", to=("scout[2]",), assignee="scout[2]", task="search")})
        (order,) = message_ids(play, "assignment", 1)
        assert relations_of(play, "guidance") == [(hub, "scout[2]", order, 1)]


@teams
def test_only_one_agent_commands_a_vehicle_in_a_tick(name):
    """Of several commands in a tick, the first in declaration order is accepted. The others get `conflict`."""
    resource, verb, responder = TEAMS[name][2:5]
    with team(name, "broadcast") as play:
        scouts = [agent.id for agent in play.instance.agents if agent.role == "searcher"]
        x, y, _ = play.entity(f"{TEAMS[name][0]}[1]").position
        senders = (*reversed(scouts), responder)
        play.do({agent: does(verb, resource, x=x, y=y) for agent in senders})
        assert play.reasons(scouts[0])[0] == ("accepted", "")
        for agent in (*scouts[1:], responder):
            assert play.reasons(agent) == [("rejected", "conflict")]
        losers = [(source, target, tick) for source, target, _, tick in relations_of(play, "competition")]
        assert losers == [(scout, resource, 1) for scout in scouts[1:]]


@teams
def test_in_star_mode_scouts_have_no_authority_over_the_vehicle(name):
    resource, verb = TEAMS[name][2:4]
    with team(name, "star") as play:
        play.do({"scout[1]": does(verb, resource, x=0.0, y=0.0)})
        assert play.reasons("scout[1]") == [("rejected", "no_authority")]
        assert relations_of(play, "competition") == []


@teams
@pytest.mark.parametrize("mode", ["star", "broadcast"])
def test_rescue_and_extinguishing_depend_on_the_located_place(name, mode):
    """The four stages are separate events: detected, located, handed off, executed."""
    resource, verb, responder = TEAMS[name][2:5]
    with team(name, mode) as play:
        target, (x, y), report = sighted(play, name)
        play.do({"scout[1]": report})
        assert play.stages() == [f"detect {target}", f"locate {target}"]
        play.do({responder: does(verb, x=x, y=y)})
        assert play.stages()[2:] == [f"handoff {target}"]
        play.put(resource, target)
        play.wait(5)
        assert play.stages()[3:] == [f"execute {target}"] and play.success
        ((source, after, by, tick),) = relations_of(play, "dependency")
        assert (source, after, by) == ("locate", "execute", target)
        assert tick == play.published.record.tick


# -- the dogs: IDF


def gathered(play):
    """Stand the dogs beside each other."""
    x, y, z = play.entity("dog[1]").position
    for number in (1, 2, 3):
        play.stage.places[f"dog[{number}]"] = (x, y + 3.0 * number, z)


def test_dogs_hand_over_sightings_and_guide_by_their_progress():
    with kit.playing("idf", fires=1.0) as play:
        gathered(play)
        play.do({"searcher[1]": does("takePhoto")})
        report = reports("sighting", "f1-dog[1]-front", "fire_source", (0.0, 0.0))
        progress = says("progress", task="search", state="west is clear")
        play.do({"searcher[1]": together(report, progress)})
        (seen,), (done,) = message_ids(play, "sighting", 2), message_ids(play, "progress", 2)
        others = ("searcher[2]", "searcher[3]")
        assert relations_of(play, "information_handoff") == [("searcher[1]", other, seen, 2) for other in others]
        assert relations_of(play, "guidance") == [("searcher[1]", other, done, 2) for other in others]


def test_dogs_cooperate_in_the_factory_and_compete_for_a_fire():
    with kit.playing("idf", fires=1.0) as play:
        play.put("dog[1]", "fire[1]", east=1.0)
        play.do()
        assert relations_of(play, "cooperation") == []  # the first one is alone there
        play.put("dog[2]", "fire[1]", east=-1.5)
        play.wait(3)
        assert ("searcher[2]", "searcher[1]", "factory", 2) in relations_of(play, "cooperation")
        assert play.success
        winner = next(event for boundary in play.all for event in boundary.record.task_events).entities[1]
        ((rival, target, by, _),) = relations_of(play, "competition")
        assert (winner, target, by, rival) == ("dog[1]", "fire[1]", "searcher[1]", "searcher[2]")


def test_dogs_out_of_radio_range_do_not_receive_messages():
    """The radio of the factory reaches 12 km in the open."""
    with kit.playing("idf", fires=1.0) as play:
        gathered(play)
        play.stage.places["dog[3]"] = (-13000.0, 0.0, 0.0)
        play.do()
        play.do({"searcher[1]": says("progress", task="search", state="nothing")})
        assert [agent for agent, box in play.published.inboxes.items() if box.messages] == ["searcher[2]"]


# -- guided work: UPR


def test_a_pilot_guides_a_dog_step_by_step():
    places = {"uav": (-20.0, -70.0, 30.0)}
    with kit.playing("upr", stage=Stage(places=places)) as play:
        play.stage.places["uav"] = (0.0, 0.0, 30.0)
        play.do({"pilot": says("guide", assignee="dog", step="forward", amount=5.0)})
        (step,) = message_ids(play, "guide", 1)
        assert relations_of(play, "guidance") == [("pilot", "walker", step, 1)]
        assert relations_of(play, "information_handoff") == [("pilot", "walker", step, 1)]
        assert ("pilot", "walker", "area", 1) in relations_of(play, "cooperation")
        assert [edge.id for edge in play.published.inboxes["walker"].messages] == [step]


def test_guidance_messages_are_limited():
    for most in (10.0, 30.0):
        stage = Stage(places={"uav": (0.0, 0.0, 30.0)})
        with kit.playing("upr", guidance_steps=most, stage=stage) as play:
            for _ in range(int(most) + 1):
                play.do({"pilot": says("guide", assignee="dog", step="left", amount=5.0)})
            outcomes = [status for status, _ in play.reasons("pilot")]
            assert outcomes == ["accepted"] * int(most) + ["rejected"]


# -- routes: LD and CR


@pytest.mark.parametrize("name", ["ld", "cr"])
def test_route_evidence_reaches_the_driver_through_the_coordinator(name):
    goal = {"ld": "stop_node", "cr": "goal_place"}[name]
    instance = kit.still(kit.staged(name)[0])
    jam, end = (next(e.position for e in instance.entities if e.id == each) for each in ("jam[1]", goal))
    with kit.playing(name, instance=instance, stage=Stage(routes=[(end,)])) as play:
        play.stage.boxes = {"jam[1]": CENTRE_BOX}
        play.do({"inspector": does("takePhoto")})
        play.do({"inspector": reports("sighting", "f1-uav-nadir", "congestion", jam[:2])})
        assert [agent for agent, box in play.published.inboxes.items() if box.messages] == ["coordinator"]
        play.do({"coordinator": says("order", to=("driver",), assignee="driver", task="wait", position=jam[:2])})
        (order,) = message_ids(play, "order", 3)
        assert relations_of(play, "information_handoff") == [("inspector", "driver", order, 3)]


def test_the_coordinator_guides_the_inspector_along_the_route():
    goal = next(e.position for e in kit.staged("cr")[0].entities if e.id == "goal_place")
    with kit.playing("cr", stage=Stage(routes=[(goal,)])) as play:
        play.do({"coordinator": says("order", to=("inspector",), assignee="inspector", task="look")})
        (order,) = message_ids(play, "order", 1)
        assert relations_of(play, "guidance") == [("coordinator", "inspector", order, 1)]


def test_inspector_and_driver_cooperate_in_the_district_from_the_beginning():
    with kit.playing("cr") as play:
        together = [relation for relation in play.relations if relation.kind == "cooperation"]
        pairs = {(relation.source, relation.target, relation.by, relation.tick) for relation in together}
        assert pairs == {("inspector", "driver", "district", 0), ("driver", "inspector", "district", 0)}


def test_the_uav_comes_to_the_dog_and_guides_it_through_the_coordinator():
    goal = next(e.position for e in kit.staged("ld")[0].entities if e.id == "stop_node")
    with kit.playing("ld", stage=Stage(routes=[(goal,)])) as play:
        play.do()
        play.stage.places["uav"] = (260.0, 250.0, 60.0)
        step = {"assignee": "courier", "step": "forward", "position": (255.0, 240.0)}
        play.do({"inspector": says("guide", **step)})
        assert ("inspector", "courier", "yard", 2) in relations_of(play, "cooperation")
        play.do({"coordinator": says("guide", to=("courier",), **step)})
        (passed,) = message_ids(play, "guide", 3)
        assert ("inspector", "courier", passed, 3) in relations_of(play, "guidance")


def test_the_stages_of_a_delivery_depend_on_each_other():
    goal = next(e.position for e in kit.still(kit.staged("ld")[0]).entities if e.id == "stop_node")
    with kit.playing("ld", stage=Stage(routes=[(goal,)])) as play:
        play.do()
        play.put("uav", "stop_node")
        play.do()
        play.put("van", "stop_node")
        play.wait(2)
        play.put("dog", "house")
        play.wait(3)
        assert play.success
        pairs = [(source, target) for source, target, *_ in relations_of(play, "dependency")]
        assert pairs == [("inspect", "drive"), ("drive", "guide_in"), ("guide_in", "deliver")]


# -- the fleet: CD


def away(play):
    for number in range(1, 6):
        play.stage.places[f"van[{number}]"] = (2000.0 + 100.0 * number, 2000.0, 0.0)


def test_the_planner_guides_drivers_and_receives_their_delivery_reports():
    with kit.playing("cd", "star", points=5.0) as play:
        away(play)
        play.do({"planner": says("plan", to=("driver[2]",), assignee="driver[2]", stops=("point[1]",), load=200.0)})
        (plan,) = message_ids(play, "plan", 1)
        assert relations_of(play, "guidance") == [("planner", "driver[2]", plan, 1)]
        play.do({"driver[2]": says("handover", stop="point[1]", delivered=200.0, left=50.0)})
        (message,) = message_ids(play, "handover", 2)
        assert relations_of(play, "information_handoff") == [("driver[2]", "planner", message, 2)]


@pytest.mark.parametrize("mode", ["star", "broadcast"])
def test_vans_cooperate_in_quarters_and_compete_for_the_warehouse(mode):
    with kit.playing("cd", mode, points=5.0) as play:
        away(play)
        play.do()
        play.put("van[1]", "point[2]")
        play.put("van[2]", "point[3]")
        play.do()
        cells = {cell.name for cell in play.instance.cells}
        together = [relation for relation in relations_of(play, "cooperation") if relation[3] == 2]
        assert {relation[:2] for relation in together} == {("driver[1]", "driver[2]"), ("driver[2]", "driver[1]")}
        assert {relation[2] for relation in together} <= cells
        play.put("van[1]", "depot", east=20.0)
        play.put("van[2]", "depot", east=-30.0)
        play.wait(2)
        rivals = {(source, target) for source, target, *_ in relations_of(play, "competition")}
        assert rivals == {("driver[1]", "depot"), ("driver[2]", "depot")}


@pytest.mark.parametrize("mode", ["star", "broadcast"])
def test_a_delivery_depends_on_its_assignment(mode):
    with kit.playing("cd", mode, points=5.0) as play:
        away(play)
        x, y, _ = play.entity("point[4]").position
        play.do({"driver[3]": does("setDestination", x=x, y=y)})
        play.put("van[3]", "point[4]")
        play.wait(2)
        assert [relation[:3] for relation in relations_of(play, "dependency")] == [("assign", "execute", "point[4]")]


def test_the_large_order_is_split_by_two_plans():
    """The planner assigns the order to two drivers, each with a load. The engine confirms both parts."""
    with kit.playing("cd", "star", points=5.0) as play:
        away(play)
        for driver in ("driver[1]", "driver[2]"):
            play.do({"planner": says("plan", to=(driver,), assignee=driver, stops=("point[1]",), load=200.0)})
        play.put("van[1]", "point[1]")
        play.put("van[2]", "point[1]")
        play.wait(2)
        parts = [event for boundary in play.all for event in boundary.record.task_events if event.kind == "deliver"]
        assert sorted(event.values["amount_kg"] for event in parts) == [50.0, 200.0]
        assert play.kinds() == [("served", "point[1]")]
        assert len(relations_of(play, "guidance")) == 2


# -- single agents


def test_the_stages_of_a_walk_depend_on_each_other():
    with kit.playing("vdn") as play:
        play.stage.places["dog"] = (5.0, 0.0, 0.0)
        play.do()
        play.put("dog", "home", east=-20.0)
        play.wait(3)
        assert play.success
        assert [relation[:2] for relation in relations_of(play, "dependency")] == [
            ("enter", "search"),
            ("search", "approach"),
            ("approach", "arrive"),
        ]


def test_the_stages_of_an_inspection_depend_on_each_other():
    with kit.playing("bi") as play:
        play.stage.boxes = {"fracture": CENTRE_BOX}
        play.do()
        place = play.entity("fracture").position[:2]
        play.put("uav", "fracture")
        play.do({"inspector": reports("finding", "f1-uav-nadir", "bridge_fracture", place)})
        play.wait(2)
        assert play.success
        pairs = [relation[:2] for relation in relations_of(play, "dependency")]
        assert pairs == [("detect", "locate"), ("locate", "handoff"), ("handoff", "execute")]
