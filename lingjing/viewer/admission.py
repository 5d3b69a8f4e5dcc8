"""Requests that a local server answers, and connections that have not shown yet that theirs is one.

A request is answered if it names this machine once in `Host`, comes from a page of an allowed `Origin` or from no page,
and carries the token of the address. A connection that has shown no such request within `ADMISSION_S` is dropped,
however slowly it sends. Of one address at most `MOST_WAITING` connections wait at a time: a newcomer displaces the
oldest, because a browser sends its request at once.
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

ADMISSION_S = 1.0
"""Seconds in which a connection must send its first request."""

MOST_WAITING = 8
"""Connections of one address without a request; a browser opens about six at a time."""

MOST_WAITING_IN_ALL = 64
"""Connections without a request, of all addresses: every address of 127.0.0.0/8 is this machine."""


class RefusedRequest(NamedTuple):
    """Why a request gets no answer."""

    status: HTTPStatus
    message: str


class RequestHead(NamedTuple):
    """The parts of a request that decide whether it is answered: its target, and all `Host` and `Origin` headers."""

    target: str
    hosts: Sequence[str]
    origins: Sequence[str]


def refusal(head: RequestHead, port: int, token: str, origins: Sequence[str] = ()) -> RefusedRequest | None:
    """The reason why a request gets no answer, None if it does. Pages of this server and of `origins` may ask."""
    names = [f"{name}:{port}" for name in (HOST, "localhost")]
    if len(head.hosts) != 1 or head.hosts[0].lower() not in names:
        return RefusedRequest(HTTPStatus.MISDIRECTED_REQUEST, "this server answers for 127.0.0.1 and localhost only")
    allowed = {*origins, *(f"http://{name}" for name in names)}
    if len(head.origins) > 1 or not allowed.issuperset(head.origins):
        return RefusedRequest(HTTPStatus.FORBIDDEN, "a page of another site may not ask this server")
    given = asked_for(head.target)[1].get("token", "")
    if not hmac.compare_digest(given.encode(), token.encode()):
        words = "the address lacks its token: open the one that the command printed"
        return RefusedRequest(HTTPStatus.FORBIDDEN, words)
    return None


def asked_for(target: str) -> tuple[str, dict[str, str]]:
    """The path and the query of a request's target, of a name that is there twice the last value; nothing of a target
    that cannot be read."""
    try:
        url = urlsplit(target)
        return url.path, {name: values[-1] for name, values in parse_qs(url.query, max_num_fields=16).items()}
    except ValueError:
        return "", {}


class _Waiting(NamedTuple):
    address: str
    since: float


class ConnectionGate:
    """The connections of one server that have not been admitted yet, the oldest first."""

    def __init__(self) -> None:
        self._waiting: dict[socket.socket, _Waiting] = {}
        self._lock = threading.Lock()

    def arrive(self, connection: socket.socket, address: str) -> None:
        """Note a new connection; where too many wait, the oldest is dropped."""
        with self._lock:
            for closed in [other for other in self._waiting if other.fileno() < 0]:
                del self._waiting[closed]
            self._waiting[connection] = _Waiting(address, time.monotonic())
            of_address = [other for other, waiting in self._waiting.items() if waiting.address == address]
            for other in (*of_address[:-MOST_WAITING], *list(self._waiting)[:-MOST_WAITING_IN_ALL]):
                self._drop(other)

    def admit(self, connection: socket.socket) -> None:
        """Wait for this connection no more: it has sent a request that is answered."""
        with self._lock:
            self._waiting.pop(connection, None)

    def drop_late(self) -> None:
        """Drop the connections that have waited for longer than `ADMISSION_S`."""
        with self._lock:
            limit = time.monotonic() - ADMISSION_S
            late = [other for other, waiting in self._waiting.items() if waiting.since < limit]
            for connection in late:
                if not _has_unread(connection):  # else its thread has not had the processor yet
                    self._drop(connection)

    def _drop(self, connection: socket.socket) -> None:
        if self._waiting.pop(connection, None) is not None:
            with contextlib.suppress(OSError):  # the other side has closed it
                connection.shutdown(socket.SHUT_RDWR)


def _has_unread(connection: socket.socket) -> bool:
    if connection.fileno() < 0:
        return False
    poller = select.poll()
    poller.register(connection, select.POLLIN)
    return any(events & select.POLLIN and not events & select.POLLHUP for _, events in poller.poll(0))


class GatedSocket(socket.socket):
    """A listening socket, each of whose connections arrives at a gate before the server has it."""

    gate: ConnectionGate

    def accept(self) -> tuple[socket.socket, tuple[str, int]]:
        """The next connection and its address."""
        connection, address = super().accept()
        self.gate.arrive(connection, address[0])
        return connection, address


@contextlib.contextmanager
def gated(port: int, gate: ConnectionGate) -> Iterator[GatedSocket]:
    """A socket that listens on this machine's port, 0 for a free one; closed if what follows fails."""
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
    "asked_for",
    "gated",
    "refusal",
]
