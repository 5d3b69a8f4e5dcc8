"""Connections of clients, and the queue of their calls.

Each connection has a thread that reads frames and one that writes answers. So a client that does not read its answers
does not delay other clients: when too many bytes wait for it, its connection is closed.
"""

from __future__ import annotations

import hmac
import queue
import select
import socket
import threading
import time
from contextlib import suppress
from typing import Any

from lingjing.errors import UsageError
from lingjing.serve.airsim.protocol import FrameReader, ProtocolError, Request, response

TOKEN_METHOD = "lingjing.token"  # noqa: S105 - the name of a method
"""The method with which a client gives the token, as its first call."""

_MOST_CLIENTS = 32
"""Most connections at a time (chosen)."""
_MOST_WAITING = 256
"""Most calls of one client that wait for an answer (chosen)."""
_MOST_UNSENT = 64_000_000
"""Most bytes of answers that wait for one client to read them (chosen: eight pictures of a million floats)."""
_TOKEN_S = 10.0
"""Time in which a client must give the token, seconds (chosen)."""
_CHUNK = 65_536
"""Bytes of one read."""
_FAREWELL_S = 5.0
"""Time in which a closed connection must take its last answers, seconds (chosen)."""


class Client:
    """The connection of one client."""

    def __init__(self, connection: socket.socket, name: str) -> None:
        self.name = name
        """`client 1`, by order of arrival."""
        self.open = True
        """False after the connection was lost or closed."""
        self.admitted = False
        """True if the client may call: it has offered the token, or none is needed."""
        self.waiting = 0
        """Calls without an answer."""
        self._connection = connection
        self._unsent: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._unsent_bytes = 0
        self._lock = threading.Lock()

    def send(self, frame: bytes) -> None:
        """Send an answer, without waiting. A client that does not read is disconnected."""
        with self._lock:
            self._unsent_bytes += len(frame)
            blocked = self._unsent_bytes > _MOST_UNSENT and self._unsent_bytes > len(frame)
        if blocked:
            self.close()
        else:
            self._unsent.put(frame)

    def begin_call(self) -> bool:
        """Count a call that waits; return whether the client has no more than `_MOST_WAITING`."""
        with self._lock:
            self.waiting += 1
            return self.waiting <= _MOST_WAITING

    def end_call(self) -> None:
        """Count a call that was answered."""
        with self._lock:
            self.waiting -= 1

    def write(self) -> None:
        """Write answers until the connection is closed: the work of its second thread."""
        with suppress(OSError):
            while (frame := self._unsent.get()) is not None:
                self._connection.sendall(frame)
                with self._lock:
                    self._unsent_bytes -= len(frame)
        self.close()

    def finish(self) -> None:
        """Close the connection after the answers that wait."""
        self._unsent.put(None)

    def close(self) -> None:
        """Close the connection now."""
        self.open = False
        self._unsent.put(None)
        with suppress(OSError):
            self._connection.shutdown(socket.SHUT_RDWR)
        self._connection.close()


class Call:
    """A call of a client, answered once."""

    def __init__(self, client: Client, request: Request) -> None:
        self.client = client
        self.method = request.method
        self.arguments: list[Any] = request.arguments
        self.answered = False
        self._number = request.id

    def succeed(self, result: object = None) -> None:
        """Answer with a result of plain values."""
        self._answer(None, result)

    def fail(self, message: str) -> None:
        """Answer with an error."""
        self._answer(message, None)

    def _answer(self, error: str | None, result: object) -> None:
        if self.answered:
            return
        self.answered = True
        self.client.end_call()
        if self._number is not None and self.client.open:
            self.client.send(response(self._number, error, result))


class CallServer:
    """Listens, and queues the calls of all clients in the order of their arrival."""

    def __init__(self, host: str, port: int, token: str = "") -> None:
        """Listen at an address. Raises `UsageError` if that is not possible."""
        self.calls: queue.SimpleQueue[Call | None] = queue.SimpleQueue()
        """The calls; None says that a client has come or gone."""
        self.clients: list[Client] = []
        """The open connections."""
        self.served = 0
        """Number of clients so far."""
        self._token = token
        self._lock = threading.Lock()
        try:
            family = socket.AF_INET6 if ":" in host else socket.AF_INET
            self._socket = socket.create_server((host, port), family=family)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            hint = "another program uses it: choose another with --port (0: a free one)"
            raise UsageError(f"cannot listen at {host} port {port}: {reason}", hint=hint) from error
        self.port: int = self._socket.getsockname()[1]
        threading.Thread(target=self._accept, name="airsim-accept", daemon=True).start()

    def close(self) -> None:
        """Stop listening and close every connection after the answers that wait."""
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        for client in tuple(self.clients):
            client.finish()
        for thread in threading.enumerate():
            if thread.name == "airsim-write":
                thread.join(_FAREWELL_S)
        for client in tuple(self.clients):
            client.close()

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._socket.accept()
            except OSError:
                return
            with self._lock:
                crowded = len(self.clients) >= _MOST_CLIENTS
                if not crowded:
                    self.served += 1
                    client = Client(connection, f"client {self.served}")
                    client.admitted = not self._token
                    self.clients.append(client)
            if crowded:
                with suppress(OSError):
                    connection.settimeout(_FAREWELL_S)
                    connection.sendall(response(0, f"{_MOST_CLIENTS} clients are connected already", None))
                connection.close()
                continue
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            threading.Thread(target=client.write, name="airsim-write", daemon=True).start()
            threading.Thread(target=self._read, args=(client, connection), name="airsim-read", daemon=True).start()
            self.calls.put(None)

    def _read(self, client: Client, connection: socket.socket) -> None:
        reader = FrameReader()
        try:
            until = time.monotonic() + _TOKEN_S
            while data := _received(connection, None if client.admitted else until):
                for request in reader.feed(data):
                    self._take(client, request)
        except (ProtocolError, TimeoutError) as error:
            reason = str(error) if isinstance(error, ProtocolError) else f"no token came within {_TOKEN_S:g} s"
            client.send(response(0, f"the connection is closed: {reason}", None))
            client.finish()
        except OSError:
            client.close()
        else:
            client.close()
        with self._lock:
            client.open = False
            self.clients.remove(client)
        self.calls.put(None)

    def _take(self, client: Client, request: Request) -> None:
        if not client.admitted:
            offered = request.arguments[0] if request.arguments else None
            if request.method != TOKEN_METHOD or not _is_token(offered, self._token):
                raise ProtocolError(f"this server needs its token: call `{TOKEN_METHOD}` with it first")
            client.admitted = True
            if request.id is not None:
                client.send(response(request.id, None, True))
            return
        call = Call(client, request)
        if client.begin_call():
            self.calls.put(call)
        else:
            call.fail(f"{_MOST_WAITING} calls of this client wait already")


def _received(connection: socket.socket, until: float | None) -> bytes:
    """Return the next bytes of a client; empty at the end. Raises `TimeoutError` after `until`, on the clock
    `time.monotonic`."""
    if until is not None:
        if (left := until - time.monotonic()) <= 0.0:
            raise TimeoutError
        ready, _, _ = select.select([connection], [], [], left)
        if not ready:
            raise TimeoutError
    return connection.recv(_CHUNK)


def _is_token(offered: object, token: str) -> bool:
    return isinstance(offered, str) and hmac.compare_digest(offered.encode("utf-8", "replace"), token.encode())
