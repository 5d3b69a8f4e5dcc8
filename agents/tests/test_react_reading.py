"""The request-only player: it reads the facts from the requests of `react` alone, and these suffice to win."""

import json
from pathlib import Path
from typing import Any

import cv2
import httpx
import pytest
from lingjing_agents.capability import claims_limit
from lingjing_agents.heuristic.target_types import ANY_VEHICLE
from lingjing_agents.reader.player import RequestPlayer
from lingjing_agents.reader.policy import ReaderOptions, SightedOptions
from lingjing_agents.reader.request_text import brief_from, inbox_from, observation_from
from lingjing_agents.reader.service import PlayerService
from lingjing_agents.reader.true_boxes import TrueBoxes

import lingjing
from agents.tests.agent_kit import brief, picture
from agents.tests.test_react_encoding import roles, sent
from agents.tests.test_react_request import COLUMNS, brief_of, briefs_of, observation
from lingjing import metrics
from lingjing import read as read_trace
from lingjing.plugins.decisions import sendable
from lingjing.plugins.policy import FrameInfo
from lingjing.testing import instantiate, mission_file
from lingjing.trace.records import Box


async def _first_request(column: str, agent: Any) -> tuple[str, dict[str, Any]]:
    """Return the system text and the newest state of an agent's first request."""
    (system, *_, state), *_ = [call.messages for call in await sent(column, agent, model="m", base_url="http://h/v1")]
    content = json.loads(state)["content"]
    return json.loads(system)["content"], json.loads(content if isinstance(content, str) else content[0]["text"])


@pytest.mark.parametrize("column", COLUMNS)
async def test_the_brief_read_from_a_request_is_the_brief_of_the_agent(column: str) -> None:
    """Ids, verbs with their arguments and bounds, messages with their fields, cells, regions and agents."""
    for agent in roles(column):
        true = brief_of(column, agent)
        system, _ = await _first_request(column, agent)
        read = brief_from(system)
        assert (read.agent, read.role, read.ticks, read.tick_s) == (true.agent, true.role, true.ticks, true.tick_s)
        assert {peer.id: peer.role for peer in read.peers} == {peer.id: peer.role for peer in true.peers}
        assert [cell.name for cell in read.cells] == [cell.name for cell in true.cells]
        assert {region.name for region in read.regions} == {region.name for region in true.regions}
        assert read.classes == true.classes
        assert [_commands(resource) for resource in read.resources] == [
            _commands(resource) for resource in true.resources
        ]
        own = {message.kind: {field.name for field in message.fields} for message in sendable(read)}
        assert own == {message.kind: {field.name for field in message.fields} for message in sendable(true)}


async def test_the_limit_of_claims_is_read_from_the_rules() -> None:
    (agent,) = roles("bi-single")
    system, _ = await _first_request("bi-single", agent)
    assert claims_limit(brief_from(system)) is None, "tier 0 has none"
    (hardened,) = briefs_of(instantiate(lingjing.compile(mission_file("bi")), seed=1, mode="single", tier=1))
    (rule,) = (sentence for sentence in hardened.rules if "claims" in sentence)
    head, others = system.split("RULES OF THIS MISSION", 1)
    first, rest = others.split("\n", 1)
    read = brief_from(f"{head}RULES OF THIS MISSION{first}\n- {rule}.\n{rest}")
    assert claims_limit(read) == claims_limit(hardened) == 2


def _commands(resource: Any) -> tuple[Any, ...]:
    """Return id, type, ownership, cameras and verbs of a resource, with what the rules need to know of a motion."""
    motions = {
        verb.name: (verb.motion, {spec.name: spec.optional for spec in verb.arguments}) for verb in resource.verbs
    }
    return resource.id, resource.type, resource.embodied, [camera.name for camera in resource.cameras], motions


async def test_the_state_read_from_a_request_is_the_observation() -> None:
    (agent,) = roles("bi-single")
    true = observation("bi-single", agent, 0)
    system, state = await _first_request("bi-single", agent)
    images = [cv2.imencode(".jpg", shot.rgb)[1].tobytes() for shot in true.pictures]
    read = observation_from(state, images, brief_from(system))
    assert [view.id for view in read.entities] == [view.id for view in true.entities]
    assert [shot.frame for shot in read.pictures] == [shot.frame for shot in true.pictures]
    assert read.pictures[0].pose.position == pytest.approx(true.pictures[0].pose.position, abs=0.051)
    assert not inbox_from(state, brief_from(system)).messages
    with pytest.raises(ValueError, match="not of its size_px"):
        observation_from(state, [b"no picture"] * len(images), brief_from(system))


async def test_events_of_two_boundaries_have_different_ids() -> None:
    """Rules count an event once, by its id. Regression: the first events of all boundaries had the same id."""
    (agent,) = roles("bi-single")
    system, _ = await _first_request("bi-single", agent)
    ids: list[str] = []
    for tick in (3, 4):
        rescues = [{"kind": "rescue", "entities": ["boat"], "tick": tick}] * 2
        read = observation_from({"tick": tick, "time_s": 0.0, "events": rescues}, [], brief_from(system))
        ids += [event.id for event in read.events]
    assert len(set(ids)) == 4


def test_the_service_rejects_unreadable_requests_over_http() -> None:
    service = PlayerService(RequestPlayer())
    try:
        address = f"{service.url}/chat/completions"
        text = {"role": "system", "content": "You are a poet."}
        wrong = httpx.post(address, json={"messages": [text, {"role": "user", "content": "{}"}]})
        assert (wrong.status_code, "no request of `react`" in wrong.json()["error"]["message"]) == (400, True)
        assert httpx.post(address, content=b"[").status_code == 400
        assert httpx.post(f"{service.url}/models", json={}).status_code == 404
    finally:
        service.close()
    with pytest.raises(httpx.ConnectError):
        httpx.post(address, json={})


def test_true_boxes_are_those_of_the_class_and_a_repeatable_share_is_withheld() -> None:
    searcher = brief("scout[1]", "broadcast")
    shots = [picture((0.0, 0.0, 100.0), tick=tick) for tick in range(40)]
    boxes = tuple(
        Box(entity=f"victim[{number}]", cls=cls, box=(0.1 * number, 0.1, 0.1 * number + 0.05, 0.2), pixels=9)
        for number, cls in enumerate((*["person_in_water"] * 5, "buoy"))
    )
    counts = {}
    for share in (0.0, 0.4, 1.0):
        truth = TrueBoxes(share)
        truth.keep(_frame(shot, boxes) for shot in shots)
        find = truth.detectors(searcher)["person_in_water"]
        detections = [find(shot, 0.0) for shot in shots]
        assert detections == [find(shot, 0.0) for shot in shots]
        counts[share] = sum(map(len, detections))
    assert (counts[0.0], counts[1.0]) == (200, 0)
    assert counts[0.4] == pytest.approx(120, abs=25)


def test_vehicles_in_a_row_are_a_queue_and_parked_or_scattered_vehicles_are_not() -> None:
    shot = picture((0.0, 0.0, 100.0))
    row = [(0.40 + 0.035 * number, 0.50, 0.42 + 0.035 * number, 0.51) for number in range(5)]
    for classes, wanted in ((["car", "truck", "car", "delivery_van", "car"], 1), (["parked_car"] * 5, 0)):
        truth = TrueBoxes()
        others = tuple(Box(entity="", cls=cls, box=box, pixels=9) for cls, box in zip(classes, row, strict=True))
        far = Box(entity="", cls="car", box=(0.05, 0.05, 0.06, 0.06), pixels=9)
        truth.keep([_frame(shot, (*others, far))])
        (find,) = [
            find for name, find in truth.detectors(brief("scout[1]", "broadcast")).items() if name == "congestion"
        ]
        queues = find(shot, 0.0)
        assert [queue.box for queue in queues] == [(0.40, 0.50, 0.56, 0.51)] * wanted
        vehicles = truth.detectors(brief("scout[1]", "broadcast"))[ANY_VEHICLE](shot, 0.0)
        assert len(vehicles) == (6 if wanted else 1)


def _frame(shot: Any, boxes: tuple[Box, ...]) -> FrameInfo:
    return FrameInfo(
        id=shot.frame, entity=shot.entity, camera=shot.camera, tick=shot.tick, time_s=0.0, pose=shot.pose,
        channels=("rgb",), boxes=tuple(box for box in boxes if box.entity),
        others=tuple(box for box in boxes if not box.entity),
    )  # fmt: skip


def test_the_player_uses_the_encoding_of_the_suites_and_ignores_another_model() -> None:
    options = ReaderOptions.model_validate({"model": "gpt-5.5"})
    assert (options.model, options.encoding, options.repairs, options.images) == ("request-player", "paper", 0, 2)
    with pytest.raises(ValueError, match="withheld"):
        SightedOptions.model_validate({"withheld": 1.5})


@pytest.mark.parametrize("name", [pytest.param("bi", marks=pytest.mark.thorough), "upr"])
def test_the_requests_suffice_to_win(name: str, tmp_path: Path) -> None:
    result = lingjing.run(
        mission_file(name), seed=1, policy="sighted-reader", overview=False, world="inline", out=tmp_path / "run"
    )
    values = metrics(read_trace(result.trace))
    assert result.success, (result.reason, result.scr)
    assert (values.json_compliance, values.substitutions, values.box_convention_errors) == (1.0, 0, 0)


@pytest.mark.study
@pytest.mark.parametrize("tier", [0, 1])
@pytest.mark.parametrize("column", COLUMNS)
def test_the_requests_of_every_column_suffice_to_win(column: str, tier: int, tmp_path: Path) -> None:
    name, mode = column.split("-")
    result = lingjing.run(
        mission_file(name), mode=mode, seed=1, tier=tier, policy="sighted-reader", out=tmp_path / "run"
    )
    assert result.success, (result.reason, result.scr)
