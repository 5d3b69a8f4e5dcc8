"""The page over HTTP, for this machine alone.

The server listens on the loopback address. `admission` decides which requests are answered, so that neither another
user nor a foreign page in the same browser, whatever its name resolves to, gets an answer. Each connection has a thread
of its own, so a slow reader delays no other.
"""

from __future__ import annotations

import contextlib
import secrets
import socket
import threading
import zlib
from collections.abc import Callable, Iterator
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Protocol

from lingjing.errors import LingjingError, UsageError
from lingjing.signals import blocked_signals
from lingjing.viewer.admission import HOST, ConnectionGate, RefusedRequest, RequestHead, asked_for, refusal
from lingjing.viewer.page import element, page, policy

MOST_CONNECTIONS = 32
"""Connections with the token at a time; a browser keeps about six."""

PATIENCE_S = 60.0
"""How long a reader may take nothing before its connection is closed."""

JSON = "application/json"
_SQUEEZED = 1400
"""Bytes from which on an answer is compressed."""


class Served(Protocol):
    """What is shown. Answers are JSON as bytes; `picture` is a JPEG. Methods are called from several threads; each
    raises `UsageError` for what is not there."""

    source: bytes

    def page_start(self) -> bytes:
        """Head, steps and ending."""
        ...

    def ground(self) -> bytes:
        """The city."""
        ...

    def details(self, chunk: int) -> bytes:
        """The details of one chunk of steps."""
        ...

    def picture(self, name: str) -> bytes:
        """The stored picture."""
        ...

    def follow(self, begin: int) -> Iterator[tuple[str, bytes]]:
        """What comes after `begin` steps, as (event, data), waiting in between; ends at the end. An event
        of "" says that nothing has happened for a while."""
        ...


class LocalServer:
    """Answers by a handler, which has the attributes `given` and the token, until `close`. `port` 0 takes a free one.
    Raises `UsageError` if it cannot be had."""

    def __init__(self, handler: type[LocalRequest], given: dict[str, object], port: int, token: str = "") -> None:
        self.token = token or secrets.token_urlsafe(24)
        with taking(port):
            self._http = _HttpServer((HOST, port), type("Handler", (handler,), {**given, "token": self.token}))
        self._thread = threading.Thread(target=self._http.serve_forever, args=(0.1,), name="lingjing-http", daemon=True)
        with blocked_signals():  # by its threads, which hand their mask on
            self._thread.start()

    def address(self, path: str) -> str:
        """The URL of a path, with the token."""
        return f"http://{HOST}:{self._http.server_port}{path}?token={self.token}"

    def close(self) -> None:
        """Stop listening. Connections that are open end by themselves or with the process."""
        self._http.shutdown()
        self._http.server_close()
        self._thread.join()


@contextlib.contextmanager
def taking(port: int) -> Iterator[None]:
    """Raise `UsageError` for a port that cannot be listened on."""
    try:
        yield
    except (OSError, OverflowError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise UsageError(f"cannot listen on port {port}: {why}", hint="choose another with --port") from error


class _HttpServer(ThreadingHTTPServer):
    """A thread for each connection, of which at most `MOST_CONNECTIONS` are admitted; a reader that goes away is no
    error."""

    daemon_threads = True
    block_on_close = False
    allow_reuse_address = True  # else a port that was just given up is not to be had for a minute
    request_queue_size = 64

    def __init__(self, address: tuple[str, int], handler: type[BaseHTTPRequestHandler]) -> None:
        self._gate = ConnectionGate()
        self._slots = threading.BoundedSemaphore(MOST_CONNECTIONS)
        self._admitted: set[socket.socket] = set()
        super().__init__(address, handler)

    def service_actions(self) -> None:
        """Between two connections, ten times a second at least: drop those that sent no request in time."""
        self._gate.drop_late()

    def process_request(self, request: object, client_address: object) -> None:
        """A thread for a new connection, which waits at the gate until it is admitted."""
        self._gate.arrive(request, client_address[0])  # type: ignore[arg-type, index]
        super().process_request(request, client_address)  # type: ignore[arg-type]

    def process_request_thread(self, request: object, client_address: object) -> None:
        """The thread of a connection."""
        try:
            super().process_request_thread(request, client_address)  # type: ignore[arg-type]
        finally:
            if request in self._admitted:
                self._admitted.discard(request)
                self._slots.release()

    def admit(self, connection: socket.socket) -> bool:
        """True for a connection that has sent a request which is answered; False if there are too many of them."""
        if connection in self._admitted:
            return True
        self._gate.admit(connection)
        if not self._slots.acquire(blocking=False):
            return False
        self._admitted.add(connection)
        return True

    def handle_error(self, request: object, client_address: object) -> None:
        """A reader that goes away is no error."""


class LocalRequest(BaseHTTPRequestHandler):
    """One connection to a `LocalServer`. Pages of `origins` may ask beside the server's own."""

    token: str
    origins: tuple[str, ...] = ()
    protocol_version = "HTTP/1.1"
    server_version = "lingjing"
    sys_version = ""
    timeout = PATIENCE_S

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the library's name
        """Nothing is logged: the addresses hold the token."""

    def refused(self) -> RefusedRequest | None:
        """The reason why the request gets no answer, None if it does. A connection that is refused is closed."""
        hosts, origins = self.headers.get_all("Host", []), self.headers.get_all("Origin", [])
        head, port = RequestHead(self.path, hosts, origins), self.connection.getsockname()[1]
        refused = refusal(head, port, self.token, self.origins)
        if refused is None and not self.server.admit(self.connection):  # type: ignore[attr-defined]
            refused = RefusedRequest(HTTPStatus.SERVICE_UNAVAILABLE, "too many connections")
        self.close_connection |= refused is not None
        return refused


class ViewServer(LocalServer):
    """Serves the page of one `Served`."""

    def __init__(self, served: Served, port: int = 0, token: str = "") -> None:
        super().__init__(_PageRequest, {"served": served}, port, token)

    @property
    def url(self) -> str:
        """Where the page is, with the token."""
        return self.address("/")


class _PageRequest(LocalRequest):
    served: Served

    def do_GET(self) -> None:
        """Answer, or say why not."""
        why = self.refused()
        if why is not None:
            self._refuse(*why)
        else:
            self._answer(*asked_for(self.path))

    # -- parts

    def _answer(self, path: str, asked: dict[str, str]) -> None:
        makers: dict[str, Callable[[], tuple[str, bytes]]] = {
            "/": lambda: ("text/html; charset=utf-8", self._page()),
            "/page-start": lambda: (JSON, self.served.page_start()),
            "/ground": lambda: (JSON, self.served.ground()),
            "/details": lambda: (JSON, self.served.details(_number(asked.get("chunk")))),
            "/picture": lambda: ("image/jpeg", self.served.picture(asked.get("id", ""))),
        }
        try:
            if path == "/follow":
                self._follow(_number(asked.get("from")))
            elif path in makers:
                self._send(HTTPStatus.OK, *makers[path]())
            else:
                self._refuse(HTTPStatus.NOT_FOUND, "there is no such page")
        except UsageError as error:
            self._refuse(HTTPStatus.NOT_FOUND, str(error))
        except LingjingError as error:
            self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, str(error))
        except OSError:
            raise  # the reader has gone
        except Exception as error:  # noqa: BLE001 - the page says what is wrong; the server goes on
            self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, f"a fault of lingjing: {type(error).__name__}: {error}")

    def _page(self) -> bytes:
        return page("Lingjing", element("source", self.served.source.decode()), meta_policy=False).encode()

    def _send(self, status: HTTPStatus, kind: str, body: bytes) -> None:
        squeezed = (
            kind != "image/jpeg" and len(body) > _SQUEEZED and "deflate" in self.headers.get("Accept-Encoding", "")
        )
        if squeezed:
            body = zlib.compress(body, 1)
        self._head(status, kind)
        if squeezed:
            self.send_header("Content-Encoding", "deflate")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def _refuse(self, status: HTTPStatus, why: str) -> None:
        with contextlib.suppress(OSError):
            self._send(status, "text/plain; charset=utf-8", why.encode(errors="replace"))

    def _head(self, status: HTTPStatus, kind: str) -> None:
        self.send_response(status)
        for name, value in (
            ("Content-Type", kind),
            ("Content-Security-Policy", policy(served=True)),
            ("X-Content-Type-Options", "nosniff"),
            ("Referrer-Policy", "no-referrer"),
            ("Cross-Origin-Resource-Policy", "same-origin"),
            ("Cross-Origin-Opener-Policy", "same-origin"),
            ("Cache-Control", "no-store"),
        ):
            self.send_header(name, value)
        if self.close_connection:
            self.send_header("Connection", "close")

    def _follow(self, begin: int) -> None:
        """Server-sent events. A page that connects again is sent what it asked for before, and passes over it."""
        self.close_connection = True
        self._head(HTTPStatus.OK, "text/event-stream; charset=utf-8")
        self.end_headers()
        with contextlib.suppress(OSError):
            for event, data in self.served.follow(begin):
                self.wfile.write(b": \n\n" if not event else b"event: %s\ndata: %s\n\n" % (event.encode(), data))
                self.wfile.flush()


def _number(text: str | None) -> int:
    return int(text) if text and text.isascii() and text.isdigit() and len(text) < 10 else 0
