"""An episode that is still played, over Foxglove's WebSocket protocol, for this machine alone.

The trace is read as it grows; what it shows is made of its records anew, so that what nobody has found yet is not told
unless the truth is asked for. The server listens on the loopback address and wants the token of its address with every
connection. Each client has a queue of its own: one that reads slowly loses messages, and keeps nobody waiting.

The protocol is `foxglove.websocket.v1` (also spoken under its later name `foxglove.sdk.v1`): the server tells channels
as JSON, a client subscribes to some, and gets their messages as binary frames: 0x01, subscription, time, data.
"""

from __future__ import annotations

import base64
import contextlib
import json
import secrets
import socket
import struct
import threading
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from pathlib import Path
from typing import Any
from urllib.parse import quote

from lingjing.analysis.played_city import surroundings_of
from lingjing.errors import UsageError
from lingjing.installation import install_line
from lingjing.signals import blocked_signals
from lingjing.trace import foxglove
from lingjing.trace.container import ContainerSchema
from lingjing.trace.following import TraceFollower
from lingjing.trace.reader import Trace
from lingjing.trace.records import BoundaryRecord, FrameInfo
from lingjing.trace.topics import SCENE, TRANSFORMS, camera_topic
from lingjing.trace.viewer_messages import Timed, ViewerMessages
from lingjing.trace.writer import PART, nanoseconds
from lingjing.viewer.admission import ADMISSION_S, HOST, ConnectionGate, RequestHead, gated, refusal
from lingjing.viewer.file_server import DESKTOP, ORIGIN
from lingjing.viewer.live import POLL_S
from lingjing.viewer.server import taking
from lingjing.viewer.told import ToldEpisode

PROTOCOLS = ("foxglove.websocket.v1", "foxglove.sdk.v1")
WAITING_BYTES = 2**26
"""What a client may have waiting; beyond that its oldest messages are left out."""

GOODBYE_S = 1.0
"""So long clients have to take their leave when the server ends."""

MOST_CLIENTS = 16
MOST_ASKED = 2**16
"""Bytes of one request of a client."""

CHANNELS = ("", "depth", "semantic")
SPARE = ("depth", "semantic")
"""Of a picture, and those of it that are large and not read from the file unless somebody wants them."""
_MESSAGE = struct.Struct("<BIQ")


@dataclass(frozen=True, slots=True)
class LiveChannel:
    """A topic as clients are told of it."""

    number: int
    topic: str
    schema: ContainerSchema

    def advertised(self) -> Mapping[str, str | int]:
        """The protocol's `Channel`."""
        binary = self.schema.encoding != "jsonschema"
        return {
            "id": self.number,
            "topic": self.topic,
            "encoding": self.schema.message_encoding,
            "schemaName": self.schema.name,
            "schema": base64.b64encode(self.schema.data).decode() if binary else self.schema.data.decode(),
            "schemaEncoding": self.schema.encoding,
        }


@dataclass(slots=True)
class LiveClient:
    """One connection: what it has subscribed to, and what waits to be sent."""

    connection: Any = None
    wanted: dict[int, set[int]] = field(default_factory=dict)
    """Channel → subscriptions."""
    waiting: deque[str | bytes] = field(default_factory=deque)
    size: int = 0
    gone: bool = False
    news: threading.Condition = field(default_factory=threading.Condition)

    def put(self, data: str | bytes) -> None:
        """Send this; what was told of channels is never left out."""
        with self.news:
            self.waiting.append(data)
            self.size += len(data)
            while self.size > WAITING_BYTES and len(self.waiting) > 1:
                place = next((n for n, one in enumerate(self.waiting) if isinstance(one, bytes)), None)
                if place is None:
                    break
                self.size -= len(self.waiting[place])
                del self.waiting[place]
            self.news.notify()

    def take(self) -> str | bytes | None:
        """The next that is to be sent; None when the connection has ended."""
        with self.news:
            self.news.wait_for(lambda: self.waiting or self.gone)
            if self.gone:
                return None
            data = self.waiting.popleft()
            self.size -= len(data)
            return data

    def leave(self) -> None:
        """The connection has ended."""
        with self.news:
            self.gone = True
            self.news.notify()


class FoxgloveServer:
    """Serves the trace that gets the name `path` at its end, while it is written and afterwards, until `close`.

    Raises `UsageError` if `websockets` is not installed, the port cannot be had, or the file is no trace.
    """

    def __init__(self, path: Path, *, truth: bool, port: int = 0, token: str = "") -> None:
        self.token = token or secrets.token_urlsafe(24)
        self._follower = TraceFollower(path.with_name(path.name.removesuffix(PART)))
        self._truth = truth
        self._lock = threading.Lock()
        self._gone = threading.Condition(self._lock)
        self._clients: list[LiveClient] = []
        self._channels: dict[str, LiveChannel] = {}
        self._kept: dict[int, list[tuple[int, bytes]]] = {}
        self._told: ToldEpisode | None = None
        self._shown: ViewerMessages | None = None
        self._now = 0
        self._closed = threading.Event()
        self._read()
        self._gate = ConnectionGate()
        self._server = self._listen(port)
        self._threads = [
            threading.Thread(target=self._server.serve_forever, name="lingjing-foxglove", daemon=True),
            threading.Thread(target=self._follow_file, name="lingjing-follow", daemon=True),
        ]
        with blocked_signals():
            for thread in self._threads:
                thread.start()

    @property
    def address(self) -> str:
        """The WebSocket's address, with the token."""
        return f"ws://{HOST}:{self._server.socket.getsockname()[1]}/?token={self.token}"

    @property
    def url(self) -> str:
        """What opens it in Foxglove."""
        return f"{ORIGIN}/~/view?ds=foxglove-websocket&ds.url={quote(self.address, safe='')}"

    def close(self) -> None:
        """Let clients go, those that read nothing without a word, and stop listening."""
        self._closed.set()
        with self._lock:
            for client in self._clients:
                client.leave()
            self._gone.wait_for(lambda: not self._clients, GOODBYE_S)
            for client in self._clients:
                with contextlib.suppress(OSError):  # it goes by itself
                    client.connection.socket.shutdown(socket.SHUT_RDWR)
        self._server.shutdown()
        for thread in self._threads:
            thread.join()

    # -- connections

    def _listen(self, port: int) -> Any:
        try:
            from websockets.sync.server import serve
        except ImportError as error:
            message = "Foxglove's live view needs websockets, which is not installed"
            raise UsageError(message, hint=install_line("foxglove")) from error
        with taking(port), gated(port, self._gate) as listening:
            return serve(
                self._talk,
                sock=listening,
                open_timeout=ADMISSION_S,
                subprotocols=list(PROTOCOLS),
                process_request=self._checked,
                compression=None,
                max_size=MOST_ASKED,
                server_header=None,
            )

    def _checked(self, connection: Any, request: Any) -> Any:
        """An answer that refuses, or None for a request with the token, this machine's own name, an origin that may
        ask, and room for one more."""
        port = self._server.socket.getsockname()[1]
        head = RequestHead(request.path, request.headers.get_all("Host"), request.headers.get_all("Origin"))
        refused = refusal(head, port, self.token, (ORIGIN, DESKTOP))
        if refused is not None:
            return connection.respond(refused.status, f"{refused.message}\n")
        self._gate.admit(connection.socket)
        if len(self._clients) >= MOST_CLIENTS:
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "too many connections\n")
        return None

    def _talk(self, connection: Any) -> None:
        """One connection, in a thread of its own."""
        from websockets.exceptions import ConnectionClosed

        client = LiveClient(connection)
        with self._lock:
            if self._closed.is_set():
                return
            self._clients.append(client)
            client.put(json.dumps(self._hello()))
            if self._channels:
                client.put(_advertisement(self._channels.values()))
        sender = threading.Thread(target=_send, args=(connection, client), daemon=True)
        sender.start()
        try:
            for asked in connection:
                if isinstance(asked, str):
                    self._answer(client, asked)
        except ConnectionClosed:
            pass
        finally:
            with self._lock:
                self._clients.remove(client)
                self._gone.notify()
            client.leave()
            sender.join()

    def _hello(self) -> Mapping[str, Any]:
        return {
            "op": "serverInfo",
            "name": "Lingjing",
            "capabilities": ["time"],
            "metadata": {},
            "sessionId": self.token[:8],
        }

    def _answer(self, client: LiveClient, asked: str) -> None:
        """Subscriptions; all else that a client may say is of no concern here."""
        try:
            said = json.loads(asked)
        except (ValueError, RecursionError):
            return
        if not isinstance(said, dict):
            return
        if said.get("op") == "subscribe":
            for one in _dicts(said.get("subscriptions")):
                channel, subscription = one.get("channelId"), one.get("id")
                if isinstance(channel, int) and isinstance(subscription, int) and 0 <= subscription < 2**32:
                    self._subscribe(client, channel, subscription)
        elif said.get("op") == "unsubscribe" and isinstance(said.get("subscriptionIds"), list):
            with self._lock:
                for subscriptions in client.wanted.values():
                    subscriptions.difference_update(one for one in said["subscriptionIds"] if isinstance(one, int))

    def _subscribe(self, client: LiveClient, channel: int, subscription: int) -> None:
        with self._lock:
            if channel not in {one.number for one in self._channels.values()}:
                return
            client.wanted.setdefault(channel, set()).add(subscription)
            for time_ns, data in self._kept.get(channel, ()):
                client.put(_MESSAGE.pack(1, subscription, time_ns) + data)

    # -- the trace

    def _follow_file(self) -> None:
        while not self._closed.wait(POLL_S):
            try:
                self._read()
            except UsageError:
                continue  # it is just being replaced; a file that stays wrong shows nothing more

    def _read(self) -> None:
        records = self._follower.more()
        trace = self._follower.trace
        if trace is None:
            return
        if self._told is None or self._shown is None:
            self._told = ToldEpisode(trace.header.instance, truth=self._truth)
            self._shown = ViewerMessages(trace.header.instance, surroundings_of(trace))
            self._publish(self._shown.beginning(hidden=self._truth))
        for record in records:
            self._boundary(trace, self._told, self._shown, record)
        if records and trace.outcome is not None:
            self._publish(self._shown.ending())

    def _boundary(self, trace: Trace, told: ToldEpisode, shown: ViewerMessages, record: BoundaryRecord) -> None:
        seen, found = told.take(record)
        if found:
            self._publish([(record.time_s, foxglove.markers(found))])
        for frame in record.frames:
            self._publish(self._picture(trace, frame))
        self._publish(shown.boundary(seen))
        with self._lock:
            self._now = nanoseconds(record.time_s)
            for client in self._clients:
                client.put(struct.pack("<BQ", 2, self._now))

    def _picture(self, trace: Trace, frame: FrameInfo) -> Iterable[Timed]:
        """The messages of a picture, whose bytes are those that are stored."""
        yield frame.time_s, foxglove.calibration(frame)
        if self._truth:
            yield frame.time_s, foxglove.true_boxes(frame)
        for channel in CHANNELS:
            topic = camera_topic(frame, channel)
            if channel in SPARE and topic in self._channels and not self._is_wanted(topic):
                continue
            try:
                data = trace.stored(frame.id, channel)
            except UsageError:
                continue  # the file has just got another name; the next picture comes
            if data is not None:
                yield frame.time_s, foxglove.stored_channel(frame, channel, data)

    def _is_wanted(self, topic: str) -> bool:
        with self._lock:
            return any(client.wanted.get(self._channels[topic].number) for client in self._clients)

    def _publish(self, messages: Iterable[Timed]) -> None:
        for time_s, (topic, schema, data) in messages:
            time_ns = nanoseconds(time_s)
            with self._lock:
                channel = self._channels.get(topic)
                if channel is None:
                    channel = self._channels[topic] = LiveChannel(len(self._channels) + 1, topic, schema)
                    for client in self._clients:
                        client.put(_advertisement([channel]))
                kept = self._kept.setdefault(channel.number, [])
                if not topic.startswith(SCENE):  # maps add up; of the rest a latecomer needs the last
                    del kept[: -1 if topic == TRANSFORMS else None]  # bodies, then their cameras
                kept.append((time_ns, data))
                for client in self._clients:
                    for subscription in client.wanted.get(channel.number, ()):
                        client.put(_MESSAGE.pack(1, subscription, time_ns) + data)


def _advertisement(channels: Iterable[LiveChannel]) -> str:
    return json.dumps({"op": "advertise", "channels": [dict(one.advertised()) for one in channels]})


def _send(connection: Any, client: LiveClient) -> None:
    from websockets.exceptions import ConnectionClosed

    try:
        while (data := client.take()) is not None:
            connection.send(data)
    except (ConnectionClosed, OSError):
        pass  # who reads has gone
    finally:
        connection.close()


def _dicts(value: object) -> list[dict[str, Any]]:
    return [one for one in value if isinstance(one, dict)] if isinstance(value, list) else []
