"""A running episode over Foxglove's WebSocket protocol, for clients on this machine (ADR 0020).

The trace is read as it grows. The messages for viewers are derived from its records anew, so that they contain no
undiscovered hidden targets, unless the truth is requested. The server listens on the loopback address and requires the
token of its address. Each client has its own queue. A slow client loses messages and does not delay the others.

The protocol is `foxglove.websocket.v1` (later renamed `foxglove.sdk.v1`). The server advertises channels as JSON. A
client subscribes to channels and receives their messages as binary frames: 0x01, subscription, time, data.
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
from lingjing.processes.signals import blocked_signals
from lingjing.trace import foxglove
from lingjing.trace.container import ContainerSchema
from lingjing.trace.following import TraceFollower
from lingjing.trace.reader import Trace
from lingjing.trace.records import BoundaryRecord, FrameInfo
from lingjing.trace.topics import CHANNELS, SCENE, TRANSFORMS, camera_topic
from lingjing.trace.viewer_messages import TimedMessage, ViewerMessages
from lingjing.trace.writer import PART, nanoseconds
from lingjing.viewer.admission import ADMISSION_S, HOST, ConnectionGate, RequestHead, gated_socket, refusal
from lingjing.viewer.episode_view import EpisodeView
from lingjing.viewer.file_server import DESKTOP, ORIGIN
from lingjing.viewer.live import POLL_S
from lingjing.viewer.server import port_errors

PROTOCOLS = ("foxglove.websocket.v1", "foxglove.sdk.v1")
WAITING_BYTES = 2**26
"""Longest queue of a client, bytes. Beyond it, the oldest data is dropped. Chosen."""

GOODBYE_S = 1.0
"""Time for clients to close their connections when the server ends. Chosen."""

MOST_CLIENTS = 16
"""Most connections at a time. Chosen."""
MOST_ASKED = 2**16
"""Longest request of a client, bytes. Chosen."""

_MESSAGE = struct.Struct("<BIQ")
"""Head of a binary frame: 0x01, subscription, time in nanoseconds."""


@dataclass(frozen=True, slots=True)
class _LiveChannel:
    """A topic with its number in the protocol."""

    number: int
    topic: str
    schema: ContainerSchema

    def advertised(self) -> Mapping[str, str | int]:
        """Return the `Channel` object of the protocol."""
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
    """One connection: its subscriptions and its queue of messages."""

    connection: Any = None
    wanted: dict[int, set[int]] = field(default_factory=dict)
    """The numbers of the client's subscriptions by channel."""
    waiting: deque[str | bytes] = field(default_factory=deque)
    """Messages to send: text for the protocol's JSON, bytes for data."""
    size: int = 0
    """Length of all of `waiting`, bytes or characters."""
    closed: bool = False
    news: threading.Condition = field(default_factory=threading.Condition)
    """Signals a change of `waiting` or `closed`."""

    def put(self, data: str | bytes) -> None:
        """Queue a message. If the queue is too long, its oldest data is dropped, but never an advertisement."""
        with self.news:
            self.waiting.append(data)
            self.size += len(data)
            while self.size > WAITING_BYTES and len(self.waiting) > 1:
                place = next((n for n, message in enumerate(self.waiting) if isinstance(message, bytes)), None)
                if place is None:
                    break
                self.size -= len(self.waiting[place])
                del self.waiting[place]
            self.news.notify()

    def take(self) -> str | bytes | None:
        """Wait for the next message and return it, or None if the connection is closed."""
        with self.news:
            self.news.wait_for(lambda: self.waiting or self.closed)
            if self.closed:
                return None
            data = self.waiting.popleft()
            self.size -= len(data)
            return data

    def leave(self) -> None:
        """Mark the connection as closed."""
        with self.news:
            self.closed = True
            self.news.notify()


class FoxgloveServer:
    """A server of the trace `path` while it is being written and afterwards, until `close`.

    `path` is the final name of the trace, or this name with `.part`. Raises `UsageError` if `websockets` is not
    installed, if the server cannot listen on the port, or if the file is no trace.
    """

    def __init__(self, path: Path, *, truth: bool, port: int = 0, token: str = "") -> None:
        self.token = token or secrets.token_urlsafe(24)
        self._follower = TraceFollower(path.with_name(path.name.removesuffix(PART)))
        self._truth = truth
        self._lock = threading.Lock()
        self._gone = threading.Condition(self._lock)
        self._clients: list[LiveClient] = []
        self._channels: dict[str, _LiveChannel] = {}
        self._kept: dict[int, list[tuple[int, bytes]]] = {}
        """Time and data, by channel, of the messages for clients that subscribe later."""
        self._view: EpisodeView | None = None
        self._messages: ViewerMessages | None = None
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
        """The URL of the WebSocket, with the token."""
        return f"ws://{HOST}:{self._server.socket.getsockname()[1]}/?token={self.token}"

    @property
    def url(self) -> str:
        """The URL that opens the episode in Foxglove."""
        return f"{ORIGIN}/~/view?ds=foxglove-websocket&ds.url={quote(self.address, safe='')}"

    def close(self) -> None:
        """Close all connections and stop listening. A client that reads nothing is cut off after `GOODBYE_S`."""
        self._closed.set()
        with self._lock:
            for client in self._clients:
                client.leave()
            self._gone.wait_for(lambda: not self._clients, GOODBYE_S)
            for client in self._clients:
                with contextlib.suppress(OSError):  # the client has closed it
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
        with port_errors(port), gated_socket(port, self._gate) as listening:
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
        """Return the response that refuses a request, or None if it is admitted and there is room for a client."""
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
        """Serve one connection, in its own thread."""
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
            for request in connection:
                if isinstance(request, str):
                    self._answer(client, request)
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

    def _answer(self, client: LiveClient, text: str) -> None:
        """Carry out a request to subscribe or unsubscribe. Other requests are ignored."""
        try:
            request = json.loads(text)
        except (ValueError, RecursionError):
            return
        if not isinstance(request, dict):
            return
        if request.get("op") == "subscribe":
            for item in _dicts(request.get("subscriptions")):
                channel, subscription = item.get("channelId"), item.get("id")
                if isinstance(channel, int) and isinstance(subscription, int) and 0 <= subscription < 2**32:
                    self._subscribe(client, channel, subscription)
        elif request.get("op") == "unsubscribe" and isinstance(request.get("subscriptionIds"), list):
            with self._lock:
                for subscriptions in client.wanted.values():
                    subscriptions.difference_update(n for n in request["subscriptionIds"] if isinstance(n, int))

    def _subscribe(self, client: LiveClient, number: int, subscription: int) -> None:
        with self._lock:
            if number not in {channel.number for channel in self._channels.values()}:
                return
            client.wanted.setdefault(number, set()).add(subscription)
            for time_ns, data in self._kept.get(number, ()):
                client.put(_MESSAGE.pack(1, subscription, time_ns) + data)

    # -- the trace

    def _follow_file(self) -> None:
        while not self._closed.wait(POLL_S):
            try:
                self._read()
            except UsageError:
                continue  # the file is just being renamed; a file that stays invalid adds no messages

    def _read(self) -> None:
        records = self._follower.more()
        trace = self._follower.trace
        if trace is None:
            return
        if self._view is None or self._messages is None:
            self._view = EpisodeView(trace.header.instance, truth=self._truth)
            self._messages = ViewerMessages(trace.header.instance, surroundings_of(trace))
            self._publish(self._messages.beginning(hidden=self._truth))
        for record in records:
            self._boundary(trace, self._view, self._messages, record)
        if records and trace.outcome is not None:
            self._publish(self._messages.ending())

    def _boundary(self, trace: Trace, view: EpisodeView, messages: ViewerMessages, record: BoundaryRecord) -> None:
        visible, revealed = view.take(record)
        if revealed:
            self._publish([(record.time_s, foxglove.markers(revealed))])
        for frame in record.frames:
            self._publish(self._picture(trace, frame))
        self._publish(messages.boundary(visible))
        with self._lock:
            self._now = nanoseconds(record.time_s)
            for client in self._clients:
                client.put(struct.pack("<BQ", 2, self._now))

    def _picture(self, trace: Trace, frame: FrameInfo) -> Iterable[TimedMessage]:
        """Yield the messages of a picture, with the stored bytes. Channels beside the colours need a subscription: they
        are large."""
        yield frame.time_s, foxglove.calibration(frame)
        if self._truth:
            yield frame.time_s, foxglove.true_boxes(frame)
        for channel in ("", *CHANNELS):
            topic = camera_topic(frame, channel)
            if channel and topic in self._channels and not self._is_wanted(topic):
                continue
            try:
                data = trace.stored(frame.id, channel)
            except UsageError:
                continue  # the file has just been renamed; later pictures can be read
            if data is not None:
                yield frame.time_s, foxglove.stored_channel(frame, channel, data)

    def _is_wanted(self, topic: str) -> bool:
        with self._lock:
            return any(client.wanted.get(self._channels[topic].number) for client in self._clients)

    def _publish(self, messages: Iterable[TimedMessage]) -> None:
        for time_s, (topic, schema, data) in messages:
            time_ns = nanoseconds(time_s)
            with self._lock:
                channel = self._channels.get(topic)
                if channel is None:
                    channel = self._channels[topic] = _LiveChannel(len(self._channels) + 1, topic, schema)
                    for client in self._clients:
                        client.put(_advertisement([channel]))
                kept = self._kept.setdefault(channel.number, [])
                if not topic.startswith(SCENE):  # updates of the map add up; of other topics the last message suffices
                    del kept[: -1 if topic == TRANSFORMS else None]  # two messages: bodies, then their cameras
                kept.append((time_ns, data))
                for client in self._clients:
                    for subscription in client.wanted.get(channel.number, ()):
                        client.put(_MESSAGE.pack(1, subscription, time_ns) + data)


def _advertisement(channels: Iterable[_LiveChannel]) -> str:
    return json.dumps({"op": "advertise", "channels": [dict(channel.advertised()) for channel in channels]})


def _send(connection: Any, client: LiveClient) -> None:
    from websockets.exceptions import ConnectionClosed

    try:
        while (data := client.take()) is not None:
            connection.send(data)
    except (ConnectionClosed, OSError):
        pass  # the client has closed the connection
    finally:
        connection.close()


def _dicts(value: object) -> list[dict[str, Any]]:
    return [item for item in value if isinstance(item, dict)] if isinstance(value, list) else []
