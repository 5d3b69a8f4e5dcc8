"""The page over HTTP, for clients on this machine.

The server listens on the loopback address. `admission` refuses requests from other users and from foreign pages in the
same browser, whatever address their names resolve to. Each connection has its own thread, so a slow client does not
delay the others.
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
from lingjing.processes.signals import blocked_signals
from lingjing.viewer.admission import HOST, ConnectionGate, RefusedRequest, RequestHead, path_and_query, refusal
from lingjing.viewer.page import CALLS, PLAYER, PageAssets, element, page, policy

MOST_CONNECTIONS = 32
"""Most admitted connections at a time. Chosen: a browser keeps about six."""

PATIENCE_S = 60.0
"""Time without progress, seconds, after which a connection is closed. Chosen."""

JSON, HTML = "application/json", "text/html; charset=utf-8"
_SQUEEZED = 1400
"""Shortest response, bytes, that is compressed. Chosen: a shorter one fits into one network packet anyway."""


class PageSource(Protocol):
    """The content that a server serves.

    Answers are JSON as bytes, except for pictures. Methods are called from several threads. Each raises `UsageError`
    for content that does not exist.
    """

    source: bytes
    """JSON that describes the source of the data to the page."""

    def page_start(self) -> bytes:
        """Return head, steps and ending."""
        ...

    def ground(self) -> bytes:
        """Return the ground."""
        ...

    def details(self, chunk: int) -> bytes:
        """Return the details of one chunk of steps."""
        ...

    def picture(self, name: str) -> bytes:
        """Return a stored picture as JPEG."""
        ...

    def calls(self) -> bytes:
        """Return the page of model calls, HTML."""
        ...

    def follow(self, begin: int) -> Iterator[tuple[str, bytes]]:
        """Yield (event, data) for the content after `begin` steps, when it exists, until the end of the episode.

        An empty event means that nothing has happened for a while.
        """
        ...


class LocalServer:
    """An HTTP server on the loopback address that runs until `close`.

    `handler` gets `attributes` and the token as class attributes. `port` 0 selects a free port. Raises `UsageError` if
    the server cannot listen on the port.
    """

    def __init__(self, handler: type[LocalRequest], attributes: dict[str, object], port: int, token: str = "") -> None:
        self.token = token or secrets.token_urlsafe(24)
        with port_errors(port):
            self._http = _HttpServer((HOST, port), type("Handler", (handler,), {**attributes, "token": self.token}))
        self._thread = threading.Thread(target=self._http.serve_forever, args=(0.1,), name="lingjing-http", daemon=True)
        with blocked_signals():  # the thread and the threads that it starts inherit the mask
            self._thread.start()

    def address(self, path: str) -> str:
        """Return the URL of a path, with the token."""
        return f"http://{HOST}:{self._http.server_port}{path}?token={self.token}"

    def close(self) -> None:
        """Stop listening. Open connections end by themselves or with the process."""
        self._http.shutdown()
        self._http.server_close()
        self._thread.join()


@contextlib.contextmanager
def port_errors(port: int) -> Iterator[None]:
    """Turn errors of listening on a port into `UsageError`."""
    try:
        yield
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise UsageError(f"cannot listen on port {port}: {reason}", hint="choose another with --port") from error


class _HttpServer(ThreadingHTTPServer):
    """An HTTP server with a thread for each connection. At most `MOST_CONNECTIONS` are admitted at a time."""

    daemon_threads = True
    block_on_close = False
    allow_reuse_address = True  # otherwise a port that was just closed is blocked for a minute
    request_queue_size = 64

    def __init__(self, address: tuple[str, int], handler: type[BaseHTTPRequestHandler]) -> None:
        self._gate = ConnectionGate()
        self._slots = threading.BoundedSemaphore(MOST_CONNECTIONS)
        self._admitted: set[socket.socket] = set()
        super().__init__(address, handler)

    def service_actions(self) -> None:
        """Drop connections that sent no request in time. The library calls this at least ten times a second."""
        self._gate.drop_late()

    def process_request(self, request: object, client_address: object) -> None:
        """Start a thread for a new connection, which waits at the gate until it is admitted."""
        self._gate.arrive(request, client_address[0])  # type: ignore[arg-type, index]
        super().process_request(request, client_address)  # type: ignore[arg-type]

    def process_request_thread(self, request: object, client_address: object) -> None:
        """Serve a connection in its thread, and free its slot at the end."""
        try:
            super().process_request_thread(request, client_address)  # type: ignore[arg-type]
        finally:
            if request in self._admitted:
                self._admitted.discard(request)
                self._slots.release()

    def admit(self, connection: socket.socket) -> bool:
        """Admit a connection that has sent an admissible request. Return False if there are too many connections."""
        if connection in self._admitted:
            return True
        self._gate.admit(connection)
        if not self._slots.acquire(blocking=False):
            return False
        self._admitted.add(connection)
        return True

    def handle_error(self, request: object, client_address: object) -> None:
        """Ignore errors of a connection: a client that closes it is no error."""


class LocalRequest(BaseHTTPRequestHandler):
    """One connection to a `LocalServer`."""

    token: str
    origins: tuple[str, ...] = ()
    """Origins of pages that are allowed in addition to the server's own."""
    protocol_version = "HTTP/1.1"
    server_version = "lingjing"
    sys_version = ""
    timeout = PATIENCE_S

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the library's name
        """Log nothing, because the addresses contain the token."""

    def refused(self) -> RefusedRequest | None:
        """Return the refusal of the request, or None if it is admitted. A refused connection is closed."""
        hosts, origins = self.headers.get_all("Host", []), self.headers.get_all("Origin", [])
        head, port = RequestHead(self.path, hosts, origins), self.connection.getsockname()[1]
        refused = refusal(head, port, self.token, self.origins)
        if refused is None and not self.server.admit(self.connection):  # type: ignore[attr-defined]
            refused = RefusedRequest(HTTPStatus.SERVICE_UNAVAILABLE, "too many connections")
        self.close_connection |= refused is not None
        return refused


class ViewServer(LocalServer):
    """A server of the page with the content of one `PageSource`."""

    def __init__(self, served: PageSource, port: int = 0, token: str = "") -> None:
        super().__init__(_PageRequest, {"served": served}, port, token)

    @property
    def url(self) -> str:
        """The URL of the page, with the token."""
        return self.address("/")


class _PageRequest(LocalRequest):
    served: PageSource

    def do_GET(self) -> None:
        """Answer or refuse a request."""
        refused = self.refused()
        if refused is not None:
            self._refuse(*refused)
        else:
            self._answer(*path_and_query(self.path))

    # -- parts

    def _answer(self, path: str, query: dict[str, str]) -> None:
        makers: dict[str, Callable[[], tuple[str, bytes]]] = {
            "/": lambda: (HTML, self._page()),
            "/page-start": lambda: (JSON, self.served.page_start()),
            "/ground": lambda: (JSON, self.served.ground()),
            "/details": lambda: (JSON, self.served.details(_number(query.get("chunk")))),
            "/picture": lambda: ("image/jpeg", self.served.picture(query.get("id", ""))),
        }
        try:
            if path == "/follow":
                self._follow(_number(query.get("from")))
            elif path == "/calls":
                self._send(HTTPStatus.OK, HTML, self.served.calls(), CALLS)
            elif path in makers:
                self._send(HTTPStatus.OK, *makers[path]())
            else:
                self._refuse(HTTPStatus.NOT_FOUND, "there is no such page")
        except UsageError as error:
            self._refuse(HTTPStatus.NOT_FOUND, str(error))
        except LingjingError as error:
            self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, str(error))
        except OSError:
            raise  # the client has closed the connection
        except Exception as error:  # noqa: BLE001 - the page shows the error, and the server goes on
            self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, f"an error of lingjing: {type(error).__name__}: {error}")

    def _page(self) -> bytes:
        return page("Lingjing", element("source", self.served.source.decode()), meta_policy=False).encode()

    def _send(self, status: HTTPStatus, kind: str, body: bytes, assets: PageAssets = PLAYER) -> None:
        squeezed = (
            kind != "image/jpeg" and len(body) > _SQUEEZED and "deflate" in self.headers.get("Accept-Encoding", "")
        )
        if squeezed:
            body = zlib.compress(body, 1)
        self._head(status, kind, assets)
        if squeezed:
            self.send_header("Content-Encoding", "deflate")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def _refuse(self, status: HTTPStatus, message: str) -> None:
        with contextlib.suppress(OSError):
            self._send(status, "text/plain; charset=utf-8", message.encode(errors="replace"))

    def _head(self, status: HTTPStatus, kind: str, assets: PageAssets = PLAYER) -> None:
        self.send_response(status)
        for name, value in (
            ("Content-Type", kind),
            ("Content-Security-Policy", policy(served=True, assets=assets)),
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
        """Send server-sent events. A page that reconnects receives steps again and ignores those that it has."""
        self.close_connection = True
        self._head(HTTPStatus.OK, "text/event-stream; charset=utf-8")
        self.end_headers()
        with contextlib.suppress(OSError):
            for event, data in self.served.follow(begin):
                self.wfile.write(b": \n\n" if not event else b"event: %s\ndata: %s\n\n" % (event.encode(), data))
                self.wfile.flush()


def _number(text: str | None) -> int:
    return int(text) if text and text.isascii() and text.isdigit() and len(text) < 10 else 0
