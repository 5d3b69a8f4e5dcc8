"""The interventions A0 to A3 of last-mile delivery: the route data, the agents that receive it, the commands of A3."""

import json
import re
from dataclasses import replace

import msgspec
import pytest
from lingjing_agents.react.route_guidance import RouteGuidance

from agents.tests.agent_kit import picture, react
from agents.tests.chat_server import NOOP, Reply, serve
from agents.tests.test_react_request import SentRequest, agents_of, brief_of, placed, registry_of
from lingjing.kernel.visibility import Projector
from lingjing.plugins.policy import Action, Inbox
from lingjing.plugins.roads import read_road_map

COLUMN = "ld-star"
FORWARD = {
    **NOOP,
    "command": {"verb": "setDestination", "arguments": {"x": 7, "y": 8, "z": 55}, "resource": "uav"},
}


DRIVE = {**NOOP, "command": {"verb": "forward", "arguments": {"distance": 80}, "resource": "van"}}


async def request_and_command(
    agent_id: str, intervention: str, answer: dict = NOOP
) -> tuple[SentRequest, Action | None]:
    instance, city = placed(COLUMN)
    agent = next(spec for spec in agents_of(COLUMN) if spec.id == agent_id)
    options = {"intervention": intervention} if intervention else {}
    with serve([Reply(answer)]) as server:
        policy = react(model="m", base_url=server.url, **options)
        await policy.reset(brief_of(COLUMN, agent))
        seen = Projector(instance, 0, city).observe(agent, registry_of(instance, 3))
        decision = await policy.act(replace(seen, pictures=()), Inbox())
    return SentRequest(server.requests[0]), decision.command


def ends() -> tuple[tuple[float, ...], tuple[float, ...]]:
    instance, _ = placed(COLUMN)
    (route,) = instance.inspections
    by_id = {entity.id: entity.position for entity in instance.entities}
    return by_id[route.asset], by_id[route.destination]


async def test_without_an_intervention_the_mission_shows_the_route():
    request, _ = await request_and_command("driver", "")
    assert "GIVEN OF THE ROUTE" not in request.system
    assert "(260, 178" in request.system
    assert next(entity for entity in request.state["entities"] if entity["id"] == "van")["route"]


@pytest.mark.parametrize("agent", ["coordinator", "inspector", "driver", "courier"])
async def test_a0_holds_no_geometry_of_the_route(agent: str):
    request, _ = await request_and_command(agent, "A0")
    start, end = ends()
    numbers = set(re.findall(r"-?\d+(?:\.\d+)?", request.whole.split("JSON SCHEMA")[0]))
    assert "GIVEN OF THE ROUTE" not in request.system
    assert "route" not in json.dumps(request.state.get("entities", []))
    for place in (start, end):
        assert not {f"{place[0]:g}", f"{place[1]:g}"} <= numbers
    shown = {entity["id"]: entity for entity in request.state["entities"]}
    assert all("position" not in shown.get(name, {}) for name in ("van", "uav", "dog")), "each begins at an end"


async def test_a0_shows_a_body_again_once_it_has_left_the_end_of_the_route():
    instance, city = placed(COLUMN)
    agent = next(spec for spec in agents_of(COLUMN) if spec.id == "inspector")
    guidance = RouteGuidance(brief_of(COLUMN, agent), "A0")
    seen = Projector(instance, 0, city).observe(agent, registry_of(instance, 3))
    pictures = (picture((-120.0, -195.0, 0.3)),)
    pictures = (replace(pictures[0], entity="uav"),)

    def uav_at(x: float, y: float) -> tuple[object, int]:
        moved = tuple(
            msgspec.structs.replace(view, position=(x, y, 50.0)) if view.id == "uav" else view for view in seen.entities
        )
        shown = guidance.observation(replace(seen, entities=moved, pictures=pictures))
        return next(view.position for view in shown.entities if view.id == "uav"), len(shown.pictures)

    assert uav_at(-120.0, -195.0) == (None, 0)
    assert uav_at(-110.0, -180.0) == (None, 0)
    assert uav_at(0.0, -182.0) == ((0.0, -182.0, 50.0), 1)


async def test_a1_gives_the_ends_and_no_roads():
    request, _ = await request_and_command("inspector", "A1")
    route_data = json.loads(request.system.split("GIVEN OF THE ROUTE\n", 1)[1].split("\n", 1)[0])
    start, end = ends()
    assert route_data == {
        "endpoints": {
            "vehicle": "van",
            "start": [round(start[0], 1), round(start[1], 1)],
            "target": [round(end[0], 1), round(end[1], 1)],
        }
    }
    assert "route" not in json.dumps((await request_and_command("driver", "A1"))[0].state["entities"])


async def test_a2_gives_the_roads_and_a_way_along_them():
    request, command = await request_and_command("inspector", "A2", FORWARD)
    route_data = json.loads(request.system.split("GIVEN OF THE ROUTE\n", 1)[1].split("\n", 1)[0])
    start, end = ends()
    way = read_road_map(placed(COLUMN)[1].network).way(start[:2], end[:2])
    assert way is not None
    assert route_data["route_hint"] == [[round(x, 1), round(y, 1)] for x, y in way.points]
    graph = route_data["road_graph"]
    assert {at for link in graph["roads_from_to"] for at in link} == set(range(len(graph["nodes_east_north"])))
    assert len(graph["roads_from_to"]) > 20
    assert command is not None
    assert command.arguments == {"x": 7.0, "y": 8.0, "z": 55.0}  # the model still chooses
    assert "next_node" not in request.state


async def test_a3_sends_the_vehicle_but_no_aircraft_along_the_shortest_path():
    request, command = await request_and_command("driver", "A3", DRIVE)
    _, end = ends()
    assert command is not None and len(request.state["next_node"]) == 2
    assert (command.verb, command.arguments) == ("setDestination", {"x": round(end[0], 1), "y": round(end[1], 1)})
    _, command = await request_and_command("inspector", "A3", FORWARD)
    assert command is not None
    assert command.arguments == {"x": 7.0, "y": 8.0, "z": 55.0}
    looking = {**NOOP, "command": {"verb": "takePhoto", "arguments": {"camera": "nadir"}, "resource": "uav"}}
    _, command = await request_and_command("inspector", "A3", looking)
    assert command is not None
    assert command.verb == "takePhoto"  # pictures and messages stay those of the model


async def test_missions_without_an_inspected_route_are_not_changed():
    (agent,) = agents_of("bi-single")
    with serve([Reply()]) as server:
        for options in ({}, {"intervention": "A0"}):
            policy = react(model="m", base_url=server.url, **options)
            await policy.reset(brief_of("bi-single", agent))
            instance, city = placed("bi-single")
            await policy.act(Projector(instance, 0, city).observe(agent, registry_of(instance, 3)), Inbox())
    assert server.requests[0] == server.requests[1]
