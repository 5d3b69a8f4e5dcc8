"""The requests of `react` to a model, compared in every column of the benchmark with the instance that is played.

The kernel's own projector, validator and router make the expected values, so that no number of the mission or the
kernel is repeated here.
"""

import base64
import json
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import cv2
import msgspec
import numpy as np
import pytest
from lingjing_agents.react.facts import interface

import lingjing
from agents.tests.agent_kit import react
from agents.tests.chat_server import NOOP, Reply, serve
from lingjing import testing
from lingjing.kernel.commands import CommandValidator
from lingjing.kernel.registry import Registry, initial
from lingjing.kernel.visibility import Projector
from lingjing.mission.instance import AgentSpec, Entity, Instance
from lingjing.plugins.decisions import sendable
from lingjing.plugins.geometry import mounted_camera_pose, pixel_to_plane
from lingjing.plugins.policy import REFERENCE, Action, Brief, Inbox, Observation, Picture
from lingjing.plugins.roads import read_road_map
from lingjing.scene.city import City
from lingjing.testing import mission_file
from lingjing.trace.records import BodyState, CameraPose, Envelope, Receipt, Route

COLUMNS = (
    "bi-single", "vdn-single", "ld-star", "idf-broadcast", "upr-star", "ufr-star", "ufr-broadcast", "cr-star",
    "ssr-star", "ssr-broadcast", "cd-star", "cd-broadcast",
)  # fmt: skip
ROOF_M = 42.0
_PAIR = re.compile(r"(?=(?<![\d.])(-?\d+(?:\.\d+)?), ?(-?\d+(?:\.\d+)?)(?![\d.]))")
"""Two numbers beside each other, as places are written; each number may begin one pair and end another."""
_NAMED = re.compile(r"\b[a-z]+[A-Z]\w*|(?<=`)\w+(?=`)")
"""The names in a prompt: verbs and kinds of messages."""


@cache
def placed(column: str) -> tuple[Instance, City]:
    name, _, mode = column.partition("-")
    mission = lingjing.compile(mission_file(name))
    return testing.placed(mission, seed=1, mode=mode)


def briefs_of(instance: Instance) -> Iterator[Brief]:
    """Yield the brief of each agent of an instance without a city."""
    classes = tuple(dict.fromkeys(entity.type for entity in instance.entities))
    for agent in instance.agents:
        yield Projector(instance, 0, None).brief(agent, classes)


def brief_of(column: str, agent: AgentSpec) -> Brief:
    instance, city = placed(column)
    classes = tuple(dict.fromkeys(entity.type for entity in instance.entities))
    return Projector(instance, 0, city).brief(agent, classes)


def registry_of(instance: Instance, tick: int) -> Registry:
    """The shared state with every body where it starts, and a route for every inspected one."""
    states = {
        entity.id: BodyState(
            id=entity.id, position=entity.position, heading_deg=entity.heading_deg, status="idle",
            resources={spec.name: entity.number_or(spec.field, 0.0) for spec in entity.state},
        )
        for entity in instance.entities
    }  # fmt: skip
    routes = {
        route.asset: Route(
            entity=route.asset, number=1, waypoints=((1.5, 2.5, 0.0), (120.0, -40.0, 0.0)), length_m=1.0,
            duration_s=1.0, time_s=0.0,
        )
        for route in instance.inspections
    }  # fmt: skip
    return msgspec.structs.replace(initial(instance), tick=tick, states=states, routes=routes)


def observation(column: str, agent: AgentSpec, tick: int) -> Observation:
    """Return an agent's observation at a boundary, with pictures of all cameras that it receives."""
    instance, city = placed(column)
    pictures = pictures_of(instance, agent, tick)
    return Projector(instance, 0, city).observe(agent, registry_of(instance, tick), pictures=pictures)


def pictures_of(instance: Instance, agent: AgentSpec, tick: int) -> tuple[Picture, ...]:
    """One picture from each of the agent's cameras, about 60 m up for aircraft, over a roof in the north-east; and the
    reference pictures of its role at boundary 0."""
    own = [entity for entity in instance.entities if entity.id in agent.controls]
    made = [_picture(entity, camera.name, tick) for entity in own for camera in entity.cameras]
    if tick == 0:
        shown = [name for reveal in instance.reveals if reveal.role == agent.role for name in reveal.entities]
        pose = CameraPose(position=(0.0, 0.0, 0.0), heading_deg=0.0, tilt_deg=0.0, width=64, height=36)
        made += [
            Picture(frame=f"r0-{name}", entity=name, camera=REFERENCE, tick=0, time_s=0.0, pose=pose,
                    rgb=np.zeros((36, 64, 3), np.uint8), jpeg=b"\xff\xd8reference\xff\xd9")
            for name in shown
        ]  # fmt: skip
    return tuple(made)


def _picture(entity: Entity, camera: str, tick: int) -> Picture:
    mount = next(spec for spec in entity.cameras if spec.name == camera)
    east, north, up = entity.position
    state = BodyState(
        id=entity.id, position=(east, north, up + 60.0 * (entity.number("band_high_m") is not None)),
        heading_deg=entity.heading_deg,
    )  # fmt: skip
    pose = mounted_camera_pose(state, mount, entity.mounts)
    depth = None
    if "depth" in mount.channels and mount.view == "nadir":
        depth = np.full((pose.height, pose.width), pose.position[2], np.float32)
        depth[: pose.height // 4, -pose.width // 4 :] = pose.position[2] - ROOF_M
    rgb = np.zeros((pose.height, pose.width, 3), np.uint8)
    return Picture(
        frame=f"f{tick}-{entity.id}-{camera}", entity=entity.id, camera=camera, tick=tick, time_s=0.0, pose=pose,
        rgb=rgb, depth=depth, jpeg=b"\xff\xd8stored\xff\xd9",
    )  # fmt: skip


class SentRequest:
    """A request as a model reads it: the system text, and the last turn's state and images."""

    def __init__(self, request: dict) -> None:
        self.turns = request["messages"]
        self.system = self.turns[0]["content"]
        last = self.turns[-1]["content"]
        parts = [{"type": "text", "text": last}] if isinstance(last, str) else last
        self.state = json.loads(parts[0]["text"])
        self.images = [part["image_url"]["url"] for part in parts[1:]]
        self.whole = json.dumps(self.turns, ensure_ascii=False)
        self.known = json.loads(self.system.split("KNOWN FROM THE START\n", 1)[1].split("\n", 1)[0])


_REQUESTS: dict[tuple[str, str], list[SentRequest]] = {}


async def sent_requests(column: str, agent: AgentSpec) -> list[SentRequest]:
    """Return the requests to the agent's model at boundaries 0 and 3, which are made once for all tests."""
    if (column, agent.id) not in _REQUESTS:
        _REQUESTS[column, agent.id] = await _send_requests(column, agent)
    return _REQUESTS[column, agent.id]


async def _send_requests(column: str, agent: AgentSpec) -> list[SentRequest]:
    instance, city = placed(column)
    brief = brief_of(column, agent)
    projector = Projector(instance, 0, city)
    with serve([Reply(_first_answer(brief)), Reply(NOOP)]) as server:
        policy = react(model="test-model", base_url=server.url, images="16")
        await policy.reset(brief)
        for tick in (0, 3):
            seen = projector.observe(agent, registry_of(instance, tick))
            await policy.act(replace(seen, pictures=pictures_of(instance, agent, tick)), _inbox(brief, tick))
    return [SentRequest(request) for request in server.requests]


def _first_answer(brief: Brief) -> dict:
    """A command, with a later receipt, or no command if the agent has no resource."""
    if not brief.resources:
        return NOOP
    verb = next(verb for verb in brief.resources[0].verbs if verb.name == "stop" or len(verb.arguments) == 2)
    arguments = {spec.name: 1.0 for spec in verb.arguments}
    return {**NOOP, "command": {"verb": verb.name, "arguments": arguments, "resource": brief.resources[0].id}}


def _inbox(brief: Brief, tick: int) -> Inbox:
    if tick == 0:
        return Inbox()
    sender = brief.peers[0].id if brief.peers else "somebody"
    note = Envelope(
        id="m2-1", tick=2, sender=sender, recipient=brief.agent, kind="news", category="other", body={"text": "hello"},
        bytes=9, deliver_at=3,
    )  # fmt: skip
    held = brief.resources[0].id if brief.resources else "nothing"
    command_receipt = Receipt(
        request="c1-4", tick=1, sender=brief.agent, resource=held, status="rejected", reason="busy", detail="it"
    )
    message_receipt = Receipt(
        request="m3-2", tick=3, sender=brief.agent, resource="progress", status="rejected", reason="payload", by="bus"
    )
    return Inbox(messages=(note,), receipts=(command_receipt, message_receipt))


def agents_of(column: str) -> list[AgentSpec]:
    return list(placed(column)[0].agents)


@pytest.mark.parametrize("column", COLUMNS)
async def test_goal_role_task_and_rules_are_those_of_the_mission(column: str):
    instance, _ = placed(column)
    for agent in agents_of(column):
        for request in await sent_requests(column, agent):
            assert f"You are `{agent.id}`, {agent.role} in a mission of {instance.budget.ticks} ticks" in request.system
            assert f"of {instance.clock.tick_s:g} s" in request.system
            assert instance.goal in request.system
            assert agent.prompt in request.system
            named = {verb.name for entity in instance.entities for verb in entity.verbs}
            named |= {message.kind for message in instance.messages}
            assert set(_NAMED.findall(agent.prompt)) <= named  # every name in a prompt can be commanded or sent
            assert not re.search(r"-0\.0\b", request.whole)
            for entity in instance.entities:
                for interaction in entity.interactions:
                    assert f"within {interaction.within_m:g} m" in request.system
            if any(rule.matching for rule in instance.rules):
                assert "IoU ≥ 0.5" in request.system
            for limit in instance.limits:
                assert f"at most {limit.most} of" in request.system
            for route in instance.inspections:
                assert f"within {route.within_m:g} m (horizontally)" in request.system
            assert "[east, north, elevation] in metres" in request.system


@pytest.mark.parametrize("column", COLUMNS)
def test_the_bounds_of_every_argument_are_the_clipping_bounds_of_the_kernel(column: str):
    """The kernel admits both bounds that the prompt names, and clips a value outside of them. Regression: the prompt
    said 0 m for a car's `forward`, and its engine takes at least 0.1 m."""
    instance, city = placed(column)
    registry = registry_of(instance, 1)
    validator = CommandValidator(msgspec.structs.replace(instance, permits=(), limits=()), city)
    checked = 0
    for agent in agents_of(column):
        interface_text = interface(brief_of(column, agent))
        for resource in brief_of(column, agent).resources:
            section = interface_text.split(f"- `{resource.id}`:", 1)[1].split("\n- `", 1)[0].split("\n\n", 1)[0]
            for verb in resource.verbs:
                lines = [line for line in section.splitlines() if line.strip().startswith(f"{verb.name}(")]
                if verb.name == "takePhoto" and not resource.cameras:
                    assert not lines
                    continue
                (line,) = lines
                for spec in verb.arguments:
                    bounds = re.search(rf"\b{spec.name}: (-?[\d.]+) to (-?[\d.]+)", line)
                    if spec.unit == "name" or bounds is None:
                        assert spec.minimum is None or spec.maximum is None or spec.unit == "name", (verb.name, spec)
                        continue
                    for bound, beyond in ((float(bounds[1]), -7.0), (float(bounds[2]), 7.0)):
                        if verb.name in ("up", "down", "takeoff"):  # the band ends these, from where it stands
                            continue
                        argument = ArgumentId(agent.id, resource.id, verb.name, spec.name)
                        assert _clipped(validator, registry, argument, bound) == (bound, False), argument
                        assert _clipped(validator, registry, argument, bound + beyond) == (bound, True), argument
                        checked += 1
    commands = any(agent.commands for agent in agents_of(column))
    assert checked or not commands


class ArgumentId(NamedTuple):
    agent: str
    resource: str
    verb: str
    argument: str


def _clipped(validator: CommandValidator, registry: Registry, target: ArgumentId, value: float) -> tuple[float, bool]:
    """Return the value that the kernel admits for an argument, and True if the receipt reports a clipped value."""
    entity = next(entity for entity in validator._instance.entities if entity.id == target.resource)
    verb = next(verb for verb in entity.verbs if verb.name == target.verb)
    arguments = {
        spec.name: value if spec.name == target.argument else 50.0 for spec in verb.arguments if spec.unit != "name"
    }
    action = Action(verb=target.verb, arguments=arguments, resource=target.resource)
    resolution = validator.resolve([(target.agent, action)], registry, 1)
    assert resolution.commands, resolution.receipts
    (command,) = resolution.commands
    return float(command.arguments[target.argument]), f"`{target.argument}`" in resolution.clipped.get(command.id, "")


def test_the_text_of_takeoff_states_the_altitude_band():
    instance, _ = placed("ld-star")
    (agent,) = (each for each in instance.agents if each.role == "inspector")
    (line,) = (line for line in interface(brief_of("ld-star", agent)).splitlines() if "takeoff(" in line)
    assert line.endswith("ends inside of the band, elevation 30 to 120 m")


@pytest.mark.parametrize("column", COLUMNS)
async def test_places_classes_weather_and_message_limits_are_those_of_the_instance(column: str):
    instance, city = placed(column)
    for agent in agents_of(column):
        request = (await sent_requests(column, agent))[-1]
        public = {region.name: region for region in instance.regions if not region.hidden}
        assert set(request.known["regions_east_north_m"]) == set(public)
        for name, corners in request.known["regions_east_north_m"].items():
            assert np.allclose(corners, public[name].polygon, atol=0.051)
        watched = {channel.name for channel in agent.observes if channel.source == "grid"}
        cells = {cell.name: cell for cell in instance.cells if cell.grid in watched}
        assert {cell["name"] for cell in request.known.get("cells", [])} == set(cells)
        for cell in request.known.get("cells", []):
            assert np.allclose(cell["centre_m"], cells[cell["name"]].centre, atol=0.051)
        assert request.known["weather"]["wind_mps"] == pytest.approx(instance.weather.wind_mps, abs=0.001)
        assert request.known["weather"]["wind_from_deg"] == pytest.approx(instance.weather.wind_from_deg, abs=0.001)
        west, south, east, north = city.bounds
        limits = request.known["commanded_places_must_lie_within_m"]
        assert (limits["east"], limits["north"]) == ([west - 1000, east + 1000], [south - 1000, north + 1000])
        if sendable(brief_of(column, agent)):
            assert f"at most {instance.comms.payload_bytes} bytes" in request.system
            assert not brief_of(column, agent).peers or f"{instance.comms.delay_ticks} tick" in request.system


@pytest.mark.parametrize("column", COLUMNS)
async def test_every_message_field_states_its_range_unit_and_names(column: str):
    instance, _ = placed(column)
    for agent in agents_of(column):
        brief = brief_of(column, agent)
        request = (await sent_requests(column, agent))[-1]
        section = request.system.split("YOU MAY SEND\n", 1)[1].split("\n\n", 1)[0]
        for message in sendable(brief):
            (line,) = [row for row in section.splitlines() if row.startswith(f"- {message.kind} (")]
            for field in message.fields:
                entry = re.search(rf"[{{;] ?{field.name}( \(may be left out\))?: ([^;}}]+)", line)
                assert entry is not None, (message.kind, field.name)
                assert bool(entry[1]) == field.optional
                if field.minimum is not None:
                    assert f"at least {field.minimum:g}" in entry[2]
                if field.maximum is not None:
                    assert f"at most {field.maximum:g}" in entry[2]
                if field.unit:
                    assert field.unit in entry[2]
                if field.name == "class":
                    assert all(entity.type in entry[2] for entity in instance.entities)
                if field.name == "assignee":
                    assert all(spec.id in entry[2] for spec in instance.agents)
                if field.name == "cell" and brief.cells:
                    assert all(cell.name in entry[2] for cell in brief.cells)


@pytest.mark.parametrize("column", COLUMNS)
async def test_an_observation_is_whole(column: str):
    """Entities, routes with their numbered waypoints, cells, messages, and receipts with verb and request."""
    instance, city = placed(column)
    for agent in agents_of(column):
        seen = Projector(instance, 0, city).observe(agent, registry_of(instance, 3))
        brief = brief_of(column, agent)
        state = (await sent_requests(column, agent))[-1].state
        shown = {entity["id"]: entity for entity in state.get("entities", [])}
        assert set(shown) == {view.id for view in seen.entities}
        for view in seen.entities:
            entity = shown[view.id]
            if view.position is not None:
                assert np.allclose(entity["position"], view.position, atol=0.051)
            if view.route is not None:
                assert [point["waypoint"] for point in entity["route"]] == [1, 2]
                assert np.allclose([point["position"] for point in entity["route"]], view.route, atol=0.051)
            for name, amount in (view.resources or {}).items():
                assert entity["resources"][name] == pytest.approx(amount, abs=0.001)
        named = {*state.get("cells_searched", {}), *state.get("cells_unsearched", [])}
        assert named == {cell.name for cell in seen.cells}
        assert state["received"][0]["body"] == {"text": "hello"}
        command_receipt, message_receipt = state["receipts"]
        assert (command_receipt["request"], command_receipt["status"], command_receipt["reason"]) == (
            "c1-4",
            "rejected",
            "busy",
        )
        assert (message_receipt["message"], message_receipt["reason"]) == ("progress", "payload")
        if brief.resources:
            assert command_receipt["verb"] in {verb.name for verb in brief.resources[0].verbs}


@pytest.mark.parametrize("column", COLUMNS)
async def test_each_picture_states_its_camera_and_its_ground_points_at_known_heights(column: str):
    instance, _ = placed(column)
    for agent in agents_of(column):
        first, later = await sent_requests(column, agent)
        for tick, request in ((0, first), (3, later)):
            pictures = pictures_of(instance, agent, tick)
            listed = {shown["frame"]: shown for shown in request.state.get("pictures", [])}
            for picture in (shot for shot in pictures if shot.camera != REFERENCE):
                _check_picture(listed[picture.frame], picture, instance.scene.datum_m)
            references = [shown for shown in listed.values() if shown.get("reference")]
            due = [name for reveal in instance.reveals if reveal.role == agent.role for name in reveal.entities]
            assert [shown["frame"] for shown in references] == [f"r0-{name}" for name in due]  # at both boundaries
            assert all(set(shown) <= {"frame", "reference", "size_px", "images"} for shown in references)
            assert len(request.images) == len(listed)


def _check_picture(listed: dict, picture: Picture, level_m: float) -> None:
    pose = picture.pose
    assert listed["camera"] == f"{picture.entity}/{picture.camera}"
    assert listed["size_px"] == [pose.width, pose.height]
    assert listed["field_of_view_deg"] == pytest.approx(pose.hfov_deg, abs=0.05)
    assert listed["tilt_deg"] == pytest.approx(pose.tilt_deg, abs=0.05)
    assert np.allclose(listed["camera_position"], pose.position, atol=0.051)
    ground = listed["ground"]
    for y, row in zip(ground["y"], ground["east_north_elevation_m"], strict=True):
        for x, place in zip(ground["x"], row, strict=True):
            u, v = x * pose.width, y * pose.height
            if picture.depth is None:
                expected = pixel_to_plane(pose, u, v, level_m)
                far = expected is None or math.dist(expected[:2], pose.position[:2]) > 5000.0
                assert place is None or (not far and np.allclose(place, expected, atol=0.6))
                continue
            roof = y < 0.25 and x > 0.75
            expected = pixel_to_plane(pose, u, v, ROOF_M if roof else 0.0)
            assert expected is not None
            assert np.allclose(place, expected, atol=0.6), (x, y)


@pytest.mark.parametrize("column", COLUMNS)
async def test_no_request_contains_hidden_values(column: str):
    """No coordinate of a hidden place, and the same words for two instances that differ in hidden values alone."""
    instance, _ = placed(column)
    secret = [entity for entity in instance.entities if "position" in entity.hidden]
    for agent in agents_of(column):
        for request in await sent_requests(column, agent):
            pairs = [(float(x), float(y)) for x, y in _PAIR.findall(request.whole)]
            assert pairs
            for entity in secret:
                near = [pair for pair in pairs if math.dist(pair, entity.position[:2]) < 1.0]
                assert near == [], entity.id
    moved = _with_hidden_places_moved(instance)
    city = placed(column)[1]
    for agent in moved.agents:
        classes = tuple(dict.fromkeys(entity.type for entity in moved.entities))
        other = Projector(moved, 0, city).brief(agent, classes)
        assert msgspec.json.encode(other) == msgspec.json.encode(brief_of(column, agent))


def _with_hidden_places_moved(instance: Instance) -> Instance:
    entities = [
        msgspec.structs.replace(
            entity, position=(entity.position[0] + 13.7, entity.position[1] - 9.3, entity.position[2])
        )
        if "position" in entity.hidden
        else entity
        for entity in instance.entities
    ]
    return msgspec.structs.replace(instance, entities=tuple(entities))


@pytest.mark.parametrize("column", ["cd-star", "cd-broadcast"])
async def test_road_distances_are_in_the_request_of_missions_that_promise_them(column: str):
    instance, city = placed(column)
    agent = agents_of(column)[-1]
    request = (await sent_requests(column, agent))[-1]
    table = json.loads(request.system.split("ROADS (shortest ways when they are empty)\n", 1)[1].split("\n", 1)[0])
    places = {entity.id: entity.position for entity in instance.entities if entity.role == "target"}
    assert set(table["places"]) == set(places)
    roads = read_road_map(city.network)
    for i, start in enumerate(table["places"][:4]):
        for j, end in enumerate(table["places"][:4]):
            way = roads.way(places[start][:2], places[end][:2])
            expected = 0.0 if i == j else way.length_m if way else None
            assert table["metres_from_row_to_column"][i][j] == pytest.approx(expected, abs=5.01)


async def test_a_whole_picture_is_the_stored_file_and_a_tile_has_every_pixel():
    column = "bi-single"
    (agent,) = agents_of(column)
    brief, pictures = brief_of(column, agent), pictures_of(placed(column)[0], agents_of(column)[0], 3)
    noise = np.random.default_rng(0).integers(0, 255, pictures[0].rgb.shape, np.uint8)
    seen = Observation(agent=agent.id, tick=3, time_s=0.0, pictures=(replace(pictures[0], rgb=noise),))
    with serve([Reply(NOOP)]) as server:
        policy = react(model="test-model", base_url=server.url, tiles="2")
        await policy.reset(brief)
        await policy.act(seen, Inbox())
    request = SentRequest(server.requests[0])
    files = [base64.b64decode(url.split(",", 1)[1]) for url in request.images]
    assert files[0] == pictures[0].jpeg
    sizes = [cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR).shape for data in files[1:]]
    assert sizes == [(540, 960, 3)] * 4
    shows = [image["shows"] for image in request.state["pictures"][0]["images"]]
    assert shows[0] == [0.0, 0.0, 1.0, 1.0]
    assert shows[1:] == [[0.0, 0.0, 0.5, 0.5], [0.5, 0.0, 1.0, 0.5], [0.0, 0.5, 0.5, 1.0], [0.5, 0.5, 1.0, 1.0]]
