"""One short play for each of the twelve columns. Every relation that the mission declares for the mode is an edge of
its graph and gives typed records. Each record has source, target, means and tick, and no record is repeated.
"""

from __future__ import annotations

import pytest

from lingjing.mission.graph import graph
from lingjing.testing import CENTRE_BOX, Stage, does, reports, says, together
from tests.missions import staging as kit

BY_MESSAGE = ("information_handoff", "guidance")


# -- a script for each team in which all of its relations occur


def walk(play):
    play.stage.places["dog"] = (5.0, 0.0, 0.0)
    play.do()
    play.put("dog", "home", east=-20.0)
    play.wait(3)


def inspect_bridge(play):
    play.stage.boxes = {"fracture": CENTRE_BOX}
    play.do()
    place = play.entity("fracture").position[:2]
    play.put("uav", "fracture")
    play.do({"inspector": reports("finding", "f1-uav-nadir", "bridge_fracture", place)})
    play.wait(2)


def deliver_parcel(play):
    stop = play.entity("stop_node").position
    play.stage.routes = [(stop,)]
    play.stage.boxes = {"jam[1]": CENTRE_BOX}
    play.do({"inspector": does("takePhoto")})
    jam = play.entity("jam[1]").position[:2]
    play.do({"inspector": reports("sighting", "f1-uav-nadir", "congestion", jam)})
    play.put("uav", "stop_node", east=10.0)
    play.do({"coordinator": says("order", to=("driver",), assignee="driver", task="wait", position=jam)})
    play.put("van", "stop_node")
    play.do()
    play.put("uav", "house")
    step = {"assignee": "courier", "step": "forward", "position": (255.0, 240.0)}
    play.do({"inspector": says("guide", **step)})
    play.do({"coordinator": says("guide", to=("courier",), **step)})
    play.put("dog", "house")
    play.wait(3)
    assert play.success


def fight_fires(play):
    play.do({"searcher[1]": does("takePhoto")})
    report = reports("sighting", "f1-dog[1]-front", "fire_source", (0.0, 0.0))
    play.stage.boxes = {"fire[1]": CENTRE_BOX}
    play.do({"searcher[1]": together(report, says("progress", task="search", state="west is clear"))})
    play.put("dog[1]", "fire[1]", east=6.0)
    play.do({"searcher[1]": does("takePhoto")})
    seen = f"f{play.published.record.tick}-dog[1]-front"
    play.put("dog[2]", "fire[1]", east=-1.5)
    play.put("dog[1]", "fire[1]", east=1.0)
    play.do({"searcher[1]": reports("sighting", seen, "fire_source", play.entity("fire[1]").position[:2])})
    play.wait(3)


def repair(play):
    play.stage.places["uav"] = (0.0, 0.0, 30.0)
    play.stage.boxes = {"leak[1]": CENTRE_BOX}
    play.do({"pilot": does("takePhoto", camera="nadir")})
    place = play.entity("leak[1]").position[:2]
    play.do({"pilot": reports("finding", "f1-uav-nadir", "pipeline_leak", place)})
    play.do({"pilot": says("guide", assignee="dog", step="forward", amount=5.0)})
    play.put("dog", "leak[1]")
    play.wait(3)


def reroute(play):
    goal = play.entity("goal_place").position
    play.stage.routes = [(goal,)]
    play.stage.boxes = {"jam[1]": CENTRE_BOX}
    play.do({"inspector": does("takePhoto")})
    jam = play.entity("jam[1]").position[:2]
    look = says("order", to=("inspector",), assignee="inspector", task="look", position=goal[:2])
    play.do({"inspector": reports("sighting", "f1-uav-nadir", "congestion", jam), "coordinator": look})
    play.do({"coordinator": says("order", to=("driver",), assignee="driver", task="wait", position=jam)})
    play.put("uav", "goal_place")
    play.do()
    play.put("van", "goal_place")
    play.wait(3)


def search(play):
    """UFR and SSR: one sighting, one order, several requests for the vehicle, and its arrival."""
    target, cls, vehicle, verb = {
        "ufr": ("fire[1]", "building_fire", "truck", "setDestination"),
        "ssr": ("victim[1]", "person_in_water", "boat", "moveTo"),
    }[play.instance.mission]
    hub = play.instance.comms.hub
    driver = next(agent.id for agent in play.instance.agents if vehicle in agent.controls)
    x, y, _ = play.entity(target).position
    east, north = play.instance.cells[0].centre
    play.stage.places["uav[1]"] = (east, north, 100.0)
    play.stage.boxes = {target: CENTRE_BOX}
    play.do({"scout[1]": does("takePhoto", camera="nadir")})
    report = reports("detection", "f1-uav[1]-nadir", cls, (x, y))
    order = {"assignee": driver, "task": "go", "position": (x, y)}
    if hub:
        play.do({"scout[1]": report})
        play.do({hub: says("assignment", to=(driver,), **order)})
        play.do({hub: says("assignment", to=("scout[2]",), assignee="scout[2]", task="search")})
    else:
        play.do({"scout[1]": together(report, says("assignment", **order))})
    play.do({agent: does(verb, vehicle, x=x, y=y) for agent in ("scout[1]", "scout[2]") if not hub})
    play.put(vehicle, target)
    play.wait(3)


def haul(play):
    for number in range(1, 6):
        play.stage.places[f"van[{number}]"] = (2000.0 + 100.0 * number, 2000.0, 0.0)
    play.do()
    hub = play.instance.comms.hub
    if hub:
        orders = [{"assignee": f"driver[{k}]", "stops": ("point[1]",), "load": 200.0} for k in (1, 2)]
        play.do({hub: says("plan", to=("driver[1]",), **orders[0])})
        play.do({hub: says("plan", to=("driver[2]",), **orders[1])})
    x, y, _ = play.entity("point[1]").position
    going = does("setDestination", x=x, y=y)
    play.do({"driver[1]": going, "driver[2]": going})
    play.put("van[1]", "point[1]")
    play.put("van[2]", "point[1]")
    play.wait(2)
    play.do({"driver[1]": says("handover", stop="point[1]", delivered=200.0, left=50.0)})
    play.put("van[1]", "depot", east=20.0)
    play.put("van[2]", "depot", east=-30.0)
    play.wait(2)


PLAYS = {
    "vdn": (walk, {}),
    "bi": (inspect_bridge, {}),
    "ld": (deliver_parcel, {}),
    "idf": (fight_fires, {"fires": 1.0}),
    "upr": (repair, {}),
    "ufr": (search, {"fires": 1.0}),
    "cr": (reroute, {}),
    "ssr": (search, {"victims": 1.0}),
    "cd": (haul, {"points": 5.0}),
}


# -- the checks


def occurs(relation, record, roles):
    """True if a record is an occurrence of a declared relation."""
    if record.kind != relation.kind:
        return False
    if relation.kind == "dependency":
        return (record.source, record.target) == (relation.source, relation.target)
    if relation.kind == "competition":
        return roles.get(record.source) in (relation.source, relation.target)
    pair = roles.get(record.source), roles.get(record.target)
    declared = relation.source, relation.target
    return pair == declared or (relation.mutual and pair == declared[::-1])


def means(play):
    """The values that a record may have in `by`, for each kind: messages with sender and recipient, places, requests,
    subjects."""
    records = [boundary.record for boundary in play.all]
    edges = {edge.id for record in records for edge in record.messages}
    places = {cell.name for cell in play.instance.cells} | {region.name for region in play.instance.regions}
    requests = {receipt.request for receipt in play.receipts if receipt.reason in ("conflict", "busy")}
    subjects = {change.subject for record in records for change in record.stages}
    agents = {agent.id for agent in play.instance.agents}
    edges_of = dict.fromkeys(BY_MESSAGE, edges)
    return {**edges_of, "cooperation": places, "competition": requests | agents, "dependency": subjects}


@pytest.mark.parametrize(("name", "mode"), [pytest.param(*column, id="-".join(column)) for column in kit.COLUMNS])
def test_all_relations_of_a_column_happen_and_are_recorded(name, mode):
    script, settings = PLAYS[name]
    instance = kit.still(kit.staged(name, mode, settings=tuple(settings.items()))[0])
    goal = next((e.position for e in instance.entities if e.id in ("stop_node", "goal_place")), (0.0, 0.0, 0.0))
    places = {"uav": (-20.0, -50.0, 30.0)} if name == "upr" else {}
    with kit.playing(name, mode, instance=instance, stage=Stage(routes=[(goal,)], places=places)) as play:
        script(play)
        roles = {agent.id: agent.role for agent in play.instance.agents}
        edges = {(edge.kind, edge.source, edge.target) for edge in graph(kit.mission(name), mode).edges}
        records = play.relations
        assert play.instance.relations
        for relation in play.instance.relations:
            ends = "stage" if relation.kind == "dependency" else "role"
            assert (relation.kind, f"{ends}:{relation.source}", f"{ends}:{relation.target}") in edges
            assert any(occurs(relation, record, roles) for record in records), relation
        named = means(play)
        ticks = {published.record.tick for published in play.all}
        for record in records:
            assert record.tick in ticks
            assert record.by in named[record.kind], record
            assert any(occurs(relation, record, roles) for relation in play.instance.relations), record
        facts = [(record.kind, record.source, record.target, record.by) for record in records]
        assert len(facts) == len(set(facts))
