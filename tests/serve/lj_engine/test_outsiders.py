"""Faults that appeared with an engine and a backend written only from the description of the protocol."""

from __future__ import annotations

import json
import random
import socket
import time
from collections.abc import Sequence
from typing import Any

import pytest
from websockets.sync.client import connect
from websockets.sync.server import ServerConnection

from lingjing.engines.remote import link, poses, script
from lingjing.errors import InfrastructureError
from lingjing.serve.lj_engine import answers, client, hosted_engines, hub, server
from lingjing.testing import PluginHost, instantiate
from lingjing.trace.records import Command
from tests.serve.lj_engine.conftest import ReferenceClient, Serve
from tests.serve.lj_engine.test_backend import NORTH, red_picture
from tests.serve.lj_engine.test_engine import scenario


def test_an_upload_that_arrives_in_small_pieces_is_accepted() -> None:
    sessions = hub.Hub("task")
    serving = server.EngineServer(sessions, "127.0.0.1", 0)
    try:
        photo = sessions.pictures.expect("f1")
        part = f'--b\r\nContent-Disposition: form-data; name="photoid"\r\n\r\n{photo}\r\n'.encode()
        file = b'--b\r\nContent-Disposition: form-data; name="file"; filename="a.png"\r\n\r\n'
        body = part + file + red_picture() + b"\r\n--b--\r\n"
        head = f"POST /sim/vision/upload HTTP/1.1\r\nHost: 127.0.0.1:{serving.port}\r\nContent-Length: {len(body)}\r\n"
        text = head.encode() + b"Content-Type: multipart/form-data; boundary=b\r\n\r\n"
        with socket.create_connection(("127.0.0.1", serving.port), timeout=30) as wire:
            wire.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            for piece in (text[:2], text[2:6], text[6:], body[:100], body[100:]):
                wire.sendall(piece)
                time.sleep(0.05)
            assert b" 200 " in wire.recv(200)
        assert sessions.pictures.take(photo, 5.0) is not None
    finally:
        serving.close()


def test_an_upload_that_never_ends_is_closed_with_status_408(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "_UPLOAD_S", 0.3)
    serving = server.EngineServer(hub.Hub("task"), "127.0.0.1", 0)
    head = f"POST /sim/vision/upload HTTP/1.1\r\nHost: 127.0.0.1:{serving.port}\r\nContent-Length: 1000\r\n\r\n"
    try:
        with socket.create_connection(("127.0.0.1", serving.port), timeout=30) as wire:
            wire.sendall(head.encode())
            for _ in range(8):
                wire.sendall(b"x")
                time.sleep(0.1)
            assert b" 408 " in wire.recv(200)
    finally:
        serving.close()


def test_silent_connections_beyond_the_limit_are_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "MOST_OPEN", 3)
    serving = server.EngineServer(hub.Hub("task"), "127.0.0.1", 0)
    try:
        silent = [socket.create_connection(("127.0.0.1", serving.port), timeout=30) for _ in range(3)]
        time.sleep(0.3)
        with socket.create_connection(("127.0.0.1", serving.port), timeout=30) as wire:
            assert wire.recv(10) == b"", "closed at once"
        for each in silent:
            each.close()
        time.sleep(0.3)
        with connect(f"ws://127.0.0.1:{serving.port}/ws/LJ-ENGINE/airsim", open_timeout=30) as session:
            assert json.loads(session.recv(timeout=30))["data"]["code"] == 0, "there is room again"
    finally:
        serving.close()


def test_a_session_uploads_to_the_address_that_it_connected_to() -> None:
    """An engine on another machine cannot reach 127.0.0.1 of this one."""
    sessions = hub.Hub("task")
    serving = server.EngineServer(sessions, "0.0.0.0", 0, token="t")
    try:
        url = f"ws://localhost:{serving.port}/ws/LJ-ENGINE/image?token=t"
        with connect(url, open_timeout=30) as session:
            session.recv(timeout=30)
            known = sessions.sessions["LJ-ENGINE_image"]
            assert serving.upload_url(known) == f"http://localhost:{serving.port}/sim/vision/upload?token=t"
    finally:
        serving.close()


def test_pings_do_not_use_the_global_random_generator() -> None:
    """Their draws were reported as draws of a policy."""
    sent: list[Any] = []

    class Recorded(ServerConnection):
        def __init__(self) -> None:
            pass

        def ping(self, data: Any = None, ack_on_close: bool = False) -> Any:
            sent.append(data)

    before = random.getstate()
    server._quiet(Recorded)().ping()
    assert random.getstate() == before and len(sent[0]) == 4


def test_a_session_lost_before_the_episode_is_an_infrastructure_error() -> None:
    with pytest.raises(InfrastructureError, match="LJ-ENGINE_airsim was lost before the episode began"):
        hub.Hub("task").link("multirotor", "LJ-ENGINE_airsim", paced=False)


class Scripted:
    """A link that answers with prepared events."""

    task_id = "T"

    def __init__(self) -> None:
        self.events: list[Any] = []

    def exchange(self, requests: Sequence[link.Request], deadline_s: float) -> link.Exchange:
        events, self.events = tuple(self.events), []
        return link.Exchange(tuple(None for _ in requests), events)

    def wait(self, event: str, deadline_s: float) -> None: ...

    def pause(self, until_s: float) -> None: ...


def test_a_route_without_a_car_belongs_to_the_car_with_the_last_command() -> None:
    instance = instantiate("cd")
    cars = [entity for entity in instance.entities if entity.engine == "road" and entity.role == "asset"]
    session = Scripted()
    bodies, names = poses.Bodies(instance, tuple(cars)), poses.Names(tuple(cars))
    driver = script.ScriptDriver(session, "road", bodies, names, reply_s=1.0, asks=False)
    driver.reset([])
    verb = Command(
        id="c1", tick=0, sender="a", resource=cars[0].id, verb="setDestination", arguments={"x": 50.0, "y": 0.0}
    )
    session.events = [
        {"commandType": "carlaSendLoc", "locationArray": [{"x": 1000.0, "y": 0.0}, {"x": 5000.0, "y": 0.0}]}
    ]
    driver.submit([verb])
    (route,) = driver.advance(1.0, (), observes=True).routes
    assert (route.entity, route.request) == (cars[0].id, "c1") and route.waypoints[-1][0] == pytest.approx(50.0)


def test_a_profile_of_one_body_is_rejected_for_a_mission_of_several_bodies(serve: Serve) -> None:
    served = serve(verbs=NORTH, uavs=2)
    ReferenceClient(served.url(), "open_vocab").start()
    served.finish(code=3)
    assert any("its profile reports one body" in line for line in served.errors), served.errors


def test_a_backend_that_closes_while_the_scenario_is_acknowledged_is_reported() -> None:
    """The connection ends between the acknowledgement and the next frame."""
    from websockets.exceptions import ConnectionClosedError

    class Closing:
        def recv(self, timeout: float) -> str:
            data = {"commandType": "resetScenario", "request_id": "u", "taskId": "T-1", "scenario": scenario()}
            return json.dumps({"type": "COMMAND", "data": data})

    def send(message: object) -> None:
        raise ConnectionClosedError(None, None)

    host = PluginHost()
    settings = answers.EngineSettings("airsim", "127.0.0.1")
    playing = answers.Answers(settings, host, hosted_engines.HostedEngines(host, ()), send, print)
    try:
        with pytest.raises(InfrastructureError, match="the backend has closed the connection"):
            client._answer_all(Closing(), playing, once=False)
    finally:
        playing.close()
