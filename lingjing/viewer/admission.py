"""Admission of requests and connections to a server on this machine.

A request is admitted if it has one `Host` header that names this machine, a target without another host, no `Origin`
or an allowed one, and the token of the address. A connection that has sent no such request within `ADMISSION_S` is
dropped, however slowly it sends. At most `MOST_WAITING` connections of one address wait at a time. A new connection
displaces the oldest one, because a browser sends its request at once.
"""

from __future__ import annotations

import contextlib
import hmac
import select
import socket
import threading
import time
from collections.abc import Iterator, Sequence
from http import HTTPStatus
from typing import NamedTuple
from urllib.parse import parse_qs, urlsplit

HOST = "127.0.0.1"
"""The address on which servers listen."""

ADMISSION_S = 1.0
"""Time for the first request of a connection. Chosen: a browser sends its request at once."""

MOST_WAITING = 8
"""Most waiting connections of one address. Chosen: a browser opens about six at a time."""

MOST_WAITING_IN_ALL = 64
"""Most waiting connections of all addresses. Chosen. A client can use every address of 127.0.0.0/8."""


class RefusedRequest(NamedTuple):
    """The response to a request that is not admitted."""

    status: HTTPStatus
    message: str


class RequestHead(NamedTuple):
    """The parts of a request that decide on its admission."""

    target: str
    """Path and query."""
    hosts: Sequence[str]
    """All `Host` headers."""
    origins: Sequence[str]
    """All `Origin` headers."""


def refusal(head: RequestHead, port: int, token: str, origins: Sequence[str] = ()) -> RefusedRequest | None:
    """Return the refusal of a request, or None if it is admitted. Pages of this server and of `origins` are allowed."""
    names = [f"{name}:{port}" for name in (HOST, "localhost")]
    if len(head.hosts) != 1 or head.hosts[0].lower() not in names or not _is_path(head.target):
        return RefusedRequest(HTTPStatus.MISDIRECTED_REQUEST, "this server answers for 127.0.0.1 and localhost only")
    allowed = {*origins, *(f"http://{name}" for name in names)}
    if len(head.origins) > 1 or not allowed.issuperset(head.origins):
        return RefusedRequest(HTTPStatus.FORBIDDEN, "pages of other sites have no access to this server")
    sent = path_and_query(head.target)[1].get("token", "")
    if not hmac.compare_digest(sent.encode(), token.encode()):
        message = "the address lacks its token: open the address that the command printed"
        return RefusedRequest(HTTPStatus.FORBIDDEN, message)
    return None


def path_and_query(target: str) -> tuple[str, dict[str, str]]:
    """Return path and query of a request's target. Of a repeated name, the last value counts.

    Both are empty for a target that cannot be parsed.
    """
    try:
        url = urlsplit(target)
        return url.path, {name: values[-1] for name, values in parse_qs(url.query, max_num_fields=16).items()}
    except ValueError:
        return "", {}


def _is_path(target: str) -> bool:
    """Return True for the target `/path`, False for one with a host of its own, which HTTP prefers to `Host`."""
    return target.startswith("/") and not target.startswith("//")


class _Waiting(NamedTuple):
    """A waiting connection. `since`: its arrival on the monotonic clock, seconds."""

    address: str
    since: float


class ConnectionGate:
    """The connections of one server that have not been admitted yet, the oldest first. Its methods are thread-safe."""

    def __init__(self) -> None:
        self._waiting: dict[socket.socket, _Waiting] = {}
        self._lock = threading.Lock()

    def arrive(self, connection: socket.socket, address: str) -> None:
        """Add a new connection. If too many wait, the oldest is dropped."""
        with self._lock:
            for closed in [other for other in self._waiting if other.fileno() < 0]:
                del self._waiting[closed]
            self._waiting[connection] = _Waiting(address, time.monotonic())
            of_address = [other for other, waiting in self._waiting.items() if waiting.address == address]
            for other in (*of_address[:-MOST_WAITING], *list(self._waiting)[:-MOST_WAITING_IN_ALL]):
                self._drop(other)

    def admit(self, connection: socket.socket) -> None:
        """Remove a connection that has sent an admitted request."""
        with self._lock:
            self._waiting.pop(connection, None)

    def drop_late(self) -> None:
        """Drop the connections that have waited for longer than `ADMISSION_S`."""
        with self._lock:
            limit = time.monotonic() - ADMISSION_S
            late = [other for other, waiting in self._waiting.items() if waiting.since < limit]
            for connection in late:
                if not _has_unread(connection):  # unread data: the thread of the connection has not run yet
                    self._drop(connection)

    def _drop(self, connection: socket.socket) -> None:
        if self._waiting.pop(connection, None) is not None:
            with contextlib.suppress(OSError):  # the client has closed it
                connection.shutdown(socket.SHUT_RDWR)


def _has_unread(connection: socket.socket) -> bool:
    if connection.fileno() < 0:
        return False
    poller = select.poll()
    poller.register(connection, select.POLLIN)
    return any(events & select.POLLIN and not events & select.POLLHUP for _, events in poller.poll(0))


class GatedSocket(socket.socket):
    """A listening socket that adds each new connection to a gate."""

    gate: ConnectionGate

    def accept(self) -> tuple[socket.socket, tuple[str, int]]:
        """Return the next connection and its address."""
        connection, address = super().accept()
        self.gate.arrive(connection, address[0])
        return connection, address


@contextlib.contextmanager
def gated_socket(port: int, gate: ConnectionGate) -> Iterator[GatedSocket]:
    """Return a socket that listens on `port` of this machine, 0 for a free one. It is closed if the block raises."""
    listening = GatedSocket(socket.AF_INET, socket.SOCK_STREAM)
    listening.gate = gate
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((HOST, port))
        listening.listen()
        yield listening
    except BaseException:
        listening.close()
        raise


__all__ = [
    "ADMISSION_S",
    "HOST",
    "MOST_WAITING",
    "ConnectionGate",
    "RefusedRequest",
    "RequestHead",
    "gated_socket",
    "path_and_query",
    "refusal",
]
