"""Hostile clients of the backend: they are rejected with a message, and the episode continues."""

from __future__ import annotations

import contextlib
import http.client
import json
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from lingjing.testing import run_command
from tests.serve.lj_engine.conftest import WAIT_S, Backend, ReferenceClient, Serve
from tests.serve.lj_engine.test_backend import NORTH, post, red_picture


class Paused(ReferenceClient):
    """A client that stops in the middle of an episode until the test lets it continue."""

    go_on = False
    reached = False

    def move(self, action: dict[str, Any]) -> None:
        self.reached = True
        while not self.go_on:
            time.sleep(0.02)
        super().move(action)


@pytest.fixture
def midway(serve: Serve) -> Iterator[tuple[Backend, Paused]]:
    """A backend in the middle of an episode; at the end the episode must be won."""
    served = serve("--deadline", "60", "--session", "multirotor=airsim", verbs=NORTH)
    client = Paused(served.url())
    client.start()
    wait(lambda: client.reached)
    yield served, client
    client.go_on = True
    trace = served.finish()
    assert trace.outcome is not None and trace.outcome.success


def wait(condition: Callable[[], bool]) -> None:
    latest = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < latest
        time.sleep(0.02)


def raw(url: str, **options: Any) -> Any:
    return connect(url, open_timeout=30, max_size=2**26, **options).__enter__()


def closed_with(connection: Any) -> tuple[int, str, list[str]]:
    """The close code and reason of a connection, with the frames before."""
    frames: list[str] = []
    try:
        while True:
            frames.append(connection.recv(timeout=30))
    except ConnectionClosed as error:
        assert error.rcvd is not None
        return error.rcvd.code, error.rcvd.reason, frames


def test_further_connections_to_one_address_do_not_replace_a_session_in_an_episode(midway: Any) -> None:
    served, client = midway
    for _ in range(10):
        code, reason, frames = closed_with(raw(served.url()))
        assert code == 1008 and "connected and plays an episode" in reason
        assert json.loads(frames[0])["type"] == "SYSTEM"
        assert "its session stays" in json.loads(frames[0])["data"]
    assert not client.ended


def test_a_second_connection_replaces_the_first_before_an_episode(serve: Serve) -> None:
    served = serve(
        "--pictures", "engine", "--deadline", "5", verbs=NORTH
    )  # the backend also waits for the session `image`
    first = ReferenceClient(served.url())
    second = ReferenceClient(served.url())
    code, _, frames = closed_with(first.socket)
    farewell = json.loads(frames[0])
    assert farewell["type"] == "SYSTEM" and "taken the place" in farewell["data"]
    assert code == 1000 or code == 1008
    second.start()
    ReferenceClient(served.url("image"), "open_vocab")
    trace = served.finish()
    assert trace.outcome is not None and trace.outcome.success


def test_unexpected_and_invalid_frames_are_answered_and_dropped(midway: Any) -> None:
    served, client = midway
    stranger = ReferenceClient(served.url("stranger")).socket
    answers = {}
    for name, frame in {
        "text": "hello", "list": "[1]", "deep": "[" * 5000, "number": "7",
        "unknown": json.dumps({"commandType": "actionAck", "request_id": "no-such", "data": {}}),
    }.items():  # fmt: skip
        stranger.send(frame)
        answers[name] = json.loads(stranger.recv(timeout=30))
    assert all(answer["type"] == "SYSTEM" for answer in answers.values())
    assert "no request has the id no-such" in answers["unknown"]["data"]
    assert "one JSON object" in answers["text"]["data"] and "one JSON object" in answers["deep"]["data"]
    stranger.send(b"\x00\x01")
    assert "not bytes" in json.loads(stranger.recv(timeout=30))["data"]
    stranger.send(json.dumps({"commandType": "executionCompleted", "droneID": "uav[1]", "judgment": {"success": True}}))
    stranger.send(
        json.dumps({"commandType": "pushEngineTelemetry", "taskId": client.task, "data": {"pose": {"x": 0, "y": 0}}})
    )
    for _ in range(30):
        stranger.send("nonsense")
    code, reason, _ = closed_with(stranger)
    assert code == 1008 and "frames were refused" in reason


def test_a_reply_of_another_session_to_a_request_is_rejected(midway: Any) -> None:
    served, client = midway
    act = next(f["data"] for f in client.received if f.get("data", {}).get("commandType") == "executeAction")
    stranger = ReferenceClient(served.url("stranger")).socket
    stranger.send(
        json.dumps({"commandType": "actionAck", "request_id": act["request_id"], "data": {"status": "failed"}})
    )
    assert "no request has the id" in json.loads(stranger.recv(timeout=30))["data"]


def test_an_oversized_frame_ends_only_its_own_connection(midway: Any) -> None:
    served, _ = midway
    stranger = ReferenceClient(served.url("stranger")).socket
    with contextlib.suppress(ConnectionClosed):
        stranger.send("x" * (32 * 2**20 + 1000))
    code, _, _ = closed_with(stranger)
    assert code == 1009


def test_a_flood_of_telemetry_does_not_block_the_server(midway: Any) -> None:
    served, client = midway
    for number in range(3000):
        client.send({"commandType": "pushEngineTelemetry", "taskId": client.task, "data": {"n": number}})
    for number in range(300):
        client.send({"commandType": "carlaSendLoc", "taskId": client.task, "n": number})
    stranger = ReferenceClient(served.url("stranger")).socket  # the server still answers
    stranger.close()


def test_invalid_paths_user_types_and_addresses_are_rejected(midway: Any) -> None:
    served, _ = midway
    for path in (
        "/ws/LJ-SPY/airsim",
        "/ws/LJ-ENGINE",
        "/",
        "/ws/LJ-ENGINE/../etc",
        "/ws/LJ-ENGINE/a%2fb",
        "/ws/LJ-ENGINE/" + "a" * 80,
    ):
        code, reason, frames = closed_with(raw(f"ws://127.0.0.1:{served.port}{path}"))
        assert code == 1008 and "/ws/" in reason and not frames, path
    for kind in ("LJ-UE", "LJ-CREW"):
        raw(served.url("viewer", kind)).close()


@pytest.mark.parametrize(
    ("headers", "status"),
    [({"Origin": "https://evil.example"}, 403), ({"Origin": "null"}, 403), ({"Host": "evil.example:9909"}, 421)],
)
def test_a_request_from_a_page_of_another_site_is_rejected(midway: Any, headers: dict[str, str], status: int) -> None:
    served, _ = midway
    assert f" {status} " in handshake(served.port, headers)
    request = http.client.HTTPConnection("127.0.0.1", served.port, timeout=30)
    request.request("POST", "/sim/vision/upload", b"", {"Content-Type": "text/plain", **headers})
    answer = request.getresponse()
    assert answer.status == status and answer.read()


def handshake(port: int, headers: dict[str, str]) -> str:
    """The first line of the answer to a handshake with these headers."""
    lines = {
        "Host": f"127.0.0.1:{port}", "Upgrade": "websocket", "Connection": "Upgrade",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Version": "13", **headers,
    }  # fmt: skip
    text = "GET /ws/LJ-ENGINE/page HTTP/1.1\r\n" + "".join(f"{name}: {value}\r\n" for name, value in lines.items())
    with socket.create_connection(("127.0.0.1", port), timeout=30) as wire:
        wire.sendall(f"{text}\r\n".encode())
        return wire.recv(4096).split(b"\r\n")[0].decode()


def test_a_request_from_the_servers_own_origin_is_accepted(midway: Any) -> None:
    served, _ = midway
    assert " 101 " in handshake(served.port, {"Origin": f"http://127.0.0.1:{served.port}"})


def test_invalid_uploads_are_rejected(midway: Any) -> None:
    served, _ = midway
    url = f"http://127.0.0.1:{served.port}/sim/vision/upload"
    picture = red_picture()
    assert post(url, {"photoid": "x"}, "../../../etc/passwd", picture) == 400
    assert post(url, {"photoid": "x"}, "C:\\windows\\a.png", picture) == 400
    assert post(url, {"photoid": "../../etc"}, "a.png", picture) == 404
    assert post(url, {"photoid": "x"}, "a.png", b"no picture") == 400
    assert post(url.replace("upload", "../upload"), {"photoid": "x"}, "a.png", picture) == 404
    assert post(url, {f"f{k}": "v" for k in range(80)}, "a.png", picture) == 400
    for headers, body, status in (
        ({"Content-Type": "application/json"}, b"{}", 415),
        ({"Content-Type": "multipart/form-data"}, b"x", 400),
        ({"Content-Type": "multipart/form-data; boundary=b", "Content-Length": "999999999"}, b"", 413),
        ({"Content-Type": "multipart/form-data; boundary=b", "Content-Length": "99999999999"}, b"", 413),
        ({"Content-Type": "multipart/form-data; boundary=b", "Content-Length": "-5"}, b"", 411),
    ):
        request = http.client.HTTPConnection("127.0.0.1", served.port, timeout=30)
        request.putrequest("POST", "/sim/vision/upload")
        for name, value in ({"Content-Length": str(len(body))} | headers).items():
            request.putheader(name, value)
        request.endheaders(body)
        answer = request.getresponse()
        assert (answer.status, "message" in json.loads(answer.read())) == (status, True), headers
    assert not list(Path(served.folder).parent.glob("**/passwd"))


def test_the_server_survives_bytes_that_are_no_http_and_silent_connections(midway: Any) -> None:
    served, _ = midway
    silent = [socket.create_connection(("127.0.0.1", served.port), timeout=30) for _ in range(20)]
    for data in (b"\x16\x03\x01\x02\x00\x01", b"POST", b"POST / HTTP/1.1\r\n" + b"A: " + b"b" * 200_000, b"\x00" * 100):
        with socket.create_connection(("127.0.0.1", served.port), timeout=30) as wire:
            wire.sendall(data)
    ReferenceClient(served.url("stranger")).socket.close()
    for connection in silent:
        connection.close()


def test_a_server_with_a_token_accepts_only_clients_with_the_token(serve: Serve, tmp_path: Path) -> None:
    (tmp_path / "token").write_text("correct-horse\n")
    served = serve("--token-file", str(tmp_path / "token"), verbs=NORTH)
    for url, headers in (
        (served.url(), {}), (f"{served.url()}?token=wrong", {}), (served.url(), {"Authorization": "Bearer wrong"}),
    ):  # fmt: skip
        with pytest.raises(InvalidStatus) as refused:
            raw(url, additional_headers=headers)
        assert refused.value.response.status_code == 403
    request = http.client.HTTPConnection("127.0.0.1", served.port, timeout=30)
    request.request("POST", "/sim/vision/upload", b"", {"Content-Type": "text/plain"})
    assert request.getresponse().status == 403
    engine = subprocess.Popen(
        [sys.executable, "-m", "lingjing.cli.main", "engine", "--connect", served.url(), "--once",
         "--token-file", str(tmp_path / "token")], stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    trace = served.finish()
    assert engine.wait(WAIT_S) == 0
    assert trace.outcome is not None and trace.outcome.success


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--lj-engine"], "needs a MISSION"),
        (["--lj-engine", "--scene", "bay"], "needs a MISSION"),
        (["--lj-engine", "--airsim", "ssr"], "are two servers"),
        (["--lj-engine", "ssr", "--profile", "carla"], "there is no profile `carla`"),
        (["--lj-engine", "ssr", "--session", "multirotor=a/b"], "is no ENGINE=ADDRESS"),
        (["--lj-engine", "ssr", "--session", "quadruped"], "owns no asset of mission"),
        (["--lj-engine", "ssr", "--session", "vessel", "--session", "vessel=b"], "twice"),
        (["--lj-engine", "ssr", "--host", "0.0.0.0"], "can be reached from a network"),
        (["--lj-engine", "ssr", "--pace", "wait"], "--pace wait needs a client"),
        (["--lj-engine", "ssr", "--deadline", "soon"], "--deadline"),
        (["--lj-engine", "ssr", "--policy", "nobody"], "nobody"),
        (["--lj-engine", "no_such_mission"], "no_such_mission"),
    ],
)
def test_a_wrong_command_line_of_the_backend_is_a_usage_error(
    options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["serve", *options]) == 2
    error = capsys.readouterr().err
    assert message in error and "Traceback" not in error


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (["--connect", "http://127.0.0.1:9909/ws/LJ-ENGINE/airsim"], 2, "is no address of a session"),
        (["--connect", "ws://127.0.0.1:9909/airsim"], 2, "is no address of a session"),
        (["--connect", "ws://127.0.0.1:1/ws/LJ-ENGINE/airsim"], 3, "no backend answers"),
        (["--connect", "ws://127.0.0.1:1/ws/LJ-ENGINE/airsim", "--engine", "city"], 2, "no engine that moves bodies"),
        (["--connect", "ws://127.0.0.1:1/ws/LJ-ENGINE/airsim", "--profile", "x"], 2, "there is no profile"),
        (["--connect", "ws://127.0.0.1:1/ws/LJ-ENGINE/airsim", "--telemetry", "0"], 2, "must be a period of"),
    ],
)
def test_a_wrong_command_line_of_the_engine_is_reported(
    options: list[str], code: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["engine", *options]) == code
    error = capsys.readouterr().err
    assert message in error and "Traceback" not in error


def test_the_backend_ends_if_no_session_connects_in_time(serve: Serve) -> None:
    served = serve("--patience", "1", "--session", "multirotor=airsim")
    _, text = served.process.communicate(timeout=WAIT_S)
    assert served.process.returncode == 3
    assert "no session has come within 1 s: LJ-ENGINE_airsim is awaited, none is connected" in text


def test_a_flood_of_relays_does_not_end_the_session_of_the_episode(midway: Any) -> None:
    served, client = midway
    stranger = ReferenceClient(served.url("stranger")).socket
    relay = json.dumps({"commandType": "sendToEngine", "data": {"text": "x" * 100_000}})
    for _ in range(1000):  # 100 MB for a client that does not read
        stranger.send(relay)
    stranger.ping().wait(60)  # the server has read all relays
    assert not client.ended
    stranger.close()
