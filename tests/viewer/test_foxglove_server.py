"""The live server: Foxglove's protocol, the token, and hidden targets only on request."""

from __future__ import annotations

import base64
import contextlib
import json
import socket
import struct
import subprocess
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate

from lingjing import Trace
from lingjing.errors import UsageError
from lingjing.testing import TraceWriter, sea_rescue
from lingjing.viewer import foxglove_server
from lingjing.viewer.foxglove_server import FoxgloveServer, LiveClient
from tests import readers

connect = pytest.importorskip("websockets.sync.client", reason="websockets is not installed").connect
PATIENCE_S = 300


def hidden(trace: Trace) -> set[str]:
    return {entity.id for entity in trace.header.instance.entities if "position" in entity.hidden}


class Follower:
    """A client that subscribes to all channels and stores the messages by topic."""

    def __init__(self, server: FoxgloveServer) -> None:
        self.open = contextlib.ExitStack()
        client = connect(server.address, subprotocols=["foxglove.websocket.v1"], open_timeout=PATIENCE_S, max_size=None)
        self.socket = self.open.enter_context(client)
        self.info = json.loads(self.socket.recv(timeout=PATIENCE_S))
        self.channels: dict[int, dict[str, Any]] = {}
        self.messages: list[tuple[str, int, bytes]] = []

    def until(self, topic: str, times: int) -> Counter[str]:
        """Read until a topic has this number of messages."""
        while Counter(name for name, *_ in self.messages)[topic] < times:
            received = self.socket.recv(timeout=PATIENCE_S)
            if isinstance(received, str):
                new = json.loads(received)["channels"]
                self.channels |= {channel["id"]: channel for channel in new}
                wanted = [{"id": 1000 + channel["id"], "channelId": channel["id"]} for channel in new]
                self.socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
            elif received[0] == 1:
                _, subscription, time_ns = struct.unpack_from("<BIQ", received)
                self.messages.append((self.channels[subscription - 1000]["topic"], time_ns, received[13:]))
        return Counter(name for name, *_ in self.messages)

    def of(self, topic: str) -> list[bytes]:
        return [data for name, _, data in self.messages if name == topic]


@pytest.fixture
def play(trace: Trace, tmp_path: Path) -> Iterator[Callable[..., FoxgloveServer]]:
    """Serve a trace with a number of boundaries. Yield the server and the writer."""
    made: list[Any] = []

    def begin(boundaries: int, *, truth: bool = False) -> FoxgloveServer:
        writer = TraceWriter(tmp_path / "trace.mcap", trace.header)
        for record in trace.boundaries[:boundaries]:
            writer.boundary(record, [(frame, trace.jpeg(frame.id), None, None) for frame in record.frames])
        server = FoxgloveServer(tmp_path / "trace.mcap", truth=truth)
        made.extend((server.close, writer.__exit__))
        server.writer = writer  # type: ignore[attr-defined]
        return server

    yield begin
    made[0]()
    made[1](None, None, None)


def test_a_client_receives_channels_and_new_boundaries(trace: Trace, play: Callable[..., FoxgloveServer]) -> None:
    server = play(3)
    client = Follower(server)
    assert client.info["op"] == "serverInfo" and client.socket.subprotocol == "foxglove.websocket.v1"
    client.until("/score", 1)  # of the last stored boundary
    for record in trace.boundaries[3:8]:
        server.writer.boundary(  # type: ignore[attr-defined]
            record, [(frame, trace.jpeg(frame.id), None, None) for frame in record.frames]
        )
    client.until("/score", 6)
    assert [json.loads(item)["tick"] for item in client.of("/score")] == [2, 3, 4, 5, 6, 7]
    schema = next(item for item in client.channels.values() if item["topic"] == "/tf")
    assert schema["encoding"] == schema["schemaEncoding"] == "protobuf" and base64.b64decode(schema["schema"])
    score = next(item for item in client.channels.values() if item["topic"] == "/score")
    assert json.loads(score["schema"])["title"] == "lingjing.Score" and score["encoding"] == "json"
    client.until("/camera/uav_1/nadir", 1)
    pictures = [frame for record in trace.boundaries[3:8] for frame in record.frames if frame.entity == "uav[1]"]
    assert any(trace.jpeg(frame.id) in client.of("/camera/uav_1/nadir")[0] for frame in pictures)
    client.socket.send(json.dumps({"op": "unsubscribe", "subscriptionIds": [1000 + score["id"]]}))
    client.open.close()


@pytest.mark.parametrize("truth", [False, True])
def test_undiscovered_hidden_targets_are_not_sent(
    trace: Trace, play: Callable[..., FoxgloveServer], truth: bool
) -> None:
    first = min(record.tick for record in trace.boundaries if record.events)
    server = play(first, truth=truth)
    client = Follower(server)
    client.until("/score", 1)
    for record in trace.boundaries[first : first + 2]:
        server.writer.boundary(record)  # type: ignore[attr-defined]
    client.until("/score", 3)
    topics = {topic for topic, *_ in client.messages}
    assert any(topic.endswith("/truth") for topic in topics) is truth and "/lingjing/boundary" not in topics
    events = [event for record in trace.boundaries[first : first + 2] for event in record.events]
    revealed = {name for event in events for name in event.bindings} & hidden(trace)
    moved = {
        transform.child_frame_id
        for data in client.of("/tf")
        for transform in FrameTransforms.FromString(data).transforms
    }
    marked = {
        entity.id
        for topic in ("/scene", "/scene/hidden")
        for data in client.of(topic)
        for entity in SceneUpdate.FromString(data).entities
    }
    client.open.close()
    shown = hidden(trace) if truth else revealed
    assert revealed and revealed < hidden(trace)
    assert moved & hidden(trace) == shown
    assert {name for name in hidden(trace) if f"entity/{name}" in marked} == shown


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        ("/", {}, 403),
        ("/?token=x", {}, 403),
        ("/?token={token}x", {}, 403),
        (f"/?{'a=1&' * 20}token={{token}}", {}, 403),
        ("/?token={token}", {"Host": "a"}, 421),
        ("/?token={token}", {"Origin": "https://evil.example"}, 403),
        ("/?token={token}", {"Origin": "null"}, 403),
    ],
)
def test_requests_without_the_token_or_for_another_host_are_rejected(
    play: Callable[..., FoxgloveServer], path: str, headers: dict[str, str], status: int
) -> None:
    from websockets.exceptions import InvalidStatus

    server = play(1)
    port = server.address.split(":")[2].split("/")[0]
    address = f"ws://127.0.0.1:{port}{path.format(token=server.token)}"
    with (
        pytest.raises(InvalidStatus) as caught,
        connect(address, additional_headers=headers, open_timeout=PATIENCE_S),
    ):
        pass
    assert caught.value.response.status_code == status
    assert server.address.startswith("ws://127.0.0.1:") and server.token in server.url


@pytest.mark.parametrize("origin", ["https://app.foxglove.dev", "file://"])
def test_connections_from_foxgloves_own_pages_are_accepted(play: Callable[..., FoxgloveServer], origin: str) -> None:
    protocols = [*foxglove_server.PROTOCOLS]
    with connect(play(1).address, origin=origin, subprotocols=protocols, open_timeout=PATIENCE_S) as connection:
        assert json.loads(connection.recv(timeout=PATIENCE_S))["op"] == "serverInfo"


def test_connections_without_a_request_are_dropped_and_block_no_client(
    play: Callable[..., FoxgloveServer],
) -> None:
    server = play(1)
    port = int(server.address.split(":")[2].split("/")[0])
    with contextlib.ExitStack() as held:
        silent = [
            held.enter_context(socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S)) for _ in range(100)
        ]
        client = Follower(server)
        client.until("/score", 1)
        client.open.close()
        assert all(connection.recv(1) == b"" for connection in silent)


def test_invalid_requests_do_not_end_the_connection(play: Callable[..., FoxgloveServer]) -> None:
    server = play(1)
    client = Follower(server)
    for message in (
        "[]", "{", "null", b"\x01abc", '{"op": "subscribe"}', '{"op": "unsubscribe", "subscriptionIds": [{}]}',
        '{"op": "subscribe", "subscriptions": [1, {"id": -1, "channelId": 1}, {"id": 1, "channelId": 10000}]}',
    ):  # fmt: skip
        client.socket.send(message)
    client.until("/score", 1)
    client.open.close()


def test_a_client_that_reads_nothing_loses_messages_and_delays_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(foxglove_server, "WAITING_BYTES", 100)
    client = LiveClient()
    client.put('{"op": "advertise"}')
    for number in range(50):
        client.put(bytes([number]) * 10)
    assert client.size <= 100 and client.take() == '{"op": "advertise"}' and client.take() == bytes([42]) * 10
    client.leave()
    assert client.take() is None


def test_a_server_closes_while_a_client_reads_nothing(
    trace: Trace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(foxglove_server, "GOODBYE_S", 0.1)
    with TraceWriter(tmp_path / "trace.mcap", trace.header) as writer:
        writer.boundary(trace.boundaries[0])
        server = FoxgloveServer(tmp_path / "trace.mcap", truth=False)
        host, path = server.address.removeprefix("ws://").split("/", 1)
        name, port = host.split(":")
        request = (
            f"GET /{path} HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
            "Sec-WebSocket-Protocol: foxglove.websocket.v1\r\n\r\n"
        )
        with socket.create_connection((name, int(port)), timeout=PATIENCE_S) as idle:
            idle.sendall(request.encode())
            assert idle.recv(12) == b"HTTP/1.1 101"
            while not server._clients:
                time.sleep(0.01)
            (client,) = server._clients
            client.put(bytes(2**25))  # more than the sockets hold
            while client.waiting:  # until it is being sent
                time.sleep(0.01)
            server.close()
    assert not server._clients


def test_an_occupied_port_a_missing_package_and_an_invalid_file_are_errors(
    play: Callable[..., FoxgloveServer], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server = play(1)
    port = int(server.address.split(":")[2].split("/")[0])
    before = threading.active_count()
    with pytest.raises(UsageError, match=f"cannot listen on port {port}"):
        FoxgloveServer(tmp_path / "trace.mcap", truth=False, port=port)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "trace.mcap").write_text("no trace")
    with pytest.raises(UsageError, match="not a trace"):
        FoxgloveServer(tmp_path / "other" / "trace.mcap", truth=False)
    monkeypatch.setitem(__import__("sys").modules, "websockets.sync.server", None)
    with pytest.raises(UsageError, match="needs websockets"):
        FoxgloveServer(tmp_path / "trace.mcap", truth=False)
    assert threading.active_count() == before


def test_foxgloves_own_client_decodes_all_of_an_episode(trace: Trace, tmp_path: Path) -> None:
    readers.skip_without_node()
    server = FoxgloveServer(tmp_path / "trace.mcap", truth=False)
    listener = subprocess.Popen(
        ["node", str(readers.HERE / "listen.mjs"), server.address], stdout=subprocess.PIPE, text=True
    )
    with TraceWriter(tmp_path / "trace.mcap", trace.header) as writer:
        for record in trace.boundaries:
            writer.boundary(record, [(frame, trace.jpeg(frame.id), None, None) for frame in record.frames])
        writer.finish(sea_rescue.outcome_of(list(trace.boundaries)))
    result = json.loads(listener.communicate(timeout=600)[0])
    server.close()
    assert result["server"] == "Lingjing" and result["counts"]["/score"] >= 1
    assert {"uav[1]", "boat"} <= set(result["last"]["/tf"]["named"])
