"""The page over HTTP, for this machine alone.

The server listens on the loopback address. Every request must carry the token of its URL and name this machine in its
`Host` header, so that neither another user nor a foreign page in the same browser, whatever its name resolves to, gets
an answer. Each connection has a thread of its own; a slow reader keeps nobody waiting.
"""

from __future__ import annotations

import contextlib
import hmac
import secrets
import threading
import zlib
from collections.abc import Callable, Iterator
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Protocol
from urllib.parse import parse_qs, urlsplit

from lingjing.errors import LingjingError, UsageError
from lingjing.signals import unheard
from lingjing.viewer.page import element, page, policy

HOST = "127.0.0.1"
MOST_CONNECTIONS = 32
"""At a time; a browser keeps about six."""

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
        with unheard():  # by its threads, which hand their mask on
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


def refused(target: str, hosts: list[str], port: int, token: str) -> HTTPStatus | None:
    """Why a request gets no answer: it does not name this machine and the port, or its target lacks the token."""
    if [host.lower() for host in hosts] not in ([f"{HOST}:{port}"], [f"localhost:{port}"]):
        return HTTPStatus.MISDIRECTED_REQUEST
    given = asked_for(target)[1].get("token", "")
    return None if hmac.compare_digest(given.encode(), token.encode()) else HTTPStatus.FORBIDDEN


def asked_for(target: str) -> tuple[str, dict[str, str]]:
    """The path and the query of a request's target, of a name that is there twice the last value; nothing of a target
    that cannot be read."""
    try:
        url = urlsplit(target)
        return url.path, {name: values[-1] for name, values in parse_qs(url.query, max_num_fields=16).items()}
    except ValueError:
        return "", {}


class _HttpServer(ThreadingHTTPServer):
    """A thread for each of at most `MOST_CONNECTIONS` connections; readers that go away are no news."""

    daemon_threads = True
    block_on_close = False
    allow_reuse_address = True  # else a port that was just given up is not to be had for a minute
    request_queue_size = 64

    def __init__(self, address: tuple[str, int], handler: type[BaseHTTPRequestHandler]) -> None:
        self._slots = threading.BoundedSemaphore(MOST_CONNECTIONS)
        super().__init__(address, handler)

    def process_request(self, request: object, client_address: object) -> None:
        """One thread a connection; beyond the most there may be, it is closed at once."""
        if self._slots.acquire(blocking=False):
            super().process_request(request, client_address)  # type: ignore[arg-type]
        else:
            self.shutdown_request(request)  # type: ignore[arg-type]

    def process_request_thread(self, request: object, client_address: object) -> None:
        """The thread of a connection."""
        try:
            super().process_request_thread(request, client_address)  # type: ignore[arg-type]
        finally:
            self._slots.release()

    def handle_error(self, request: object, client_address: object) -> None:
        """A reader that goes away is no news."""


class LocalRequest(BaseHTTPRequestHandler):
    """One connection to a `LocalServer`."""

    token: str
    protocol_version = "HTTP/1.1"
    server_version = "lingjing"
    sys_version = ""
    timeout = PATIENCE_S

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the library's name
        """Nothing is logged: the addresses hold the token."""

    def refused(self) -> HTTPStatus | None:
        """Why the request gets no answer, None if it does."""
        return refused(self.path, [self.headers.get("Host", "")], self.connection.getsockname()[1], self.token)


class ViewServer(LocalServer):
    """Serves the page of one `Served`."""

    def __init__(self, served: Served, port: int = 0, token: str = "") -> None:
        super().__init__(_PageRequest, {"served": served}, port, token)

    @property
    def url(self) -> str:
        """Where the page is, with the token."""
        return self.address("/")


_REFUSED = {
    HTTPStatus.MISDIRECTED_REQUEST: "this server answers for 127.0.0.1 and localhost only",
    HTTPStatus.FORBIDDEN: "the address lacks its token: open the one that the command printed",
}


class _PageRequest(LocalRequest):
    served: Served

    def do_GET(self) -> None:
        """Answer, or say why not."""
        why = self.refused()
        if why is not None:
            self._refuse(why, _REFUSED[why])
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

    def _follow(self, begin: int) -> None:
        """Server-sent events. A page that connects again is sent what it asked for before, and passes over it."""
        self._head(HTTPStatus.OK, "text/event-stream; charset=utf-8")
        self.send_header("Connection", "close")
        self.end_headers()
        self.close_connection = True
        with contextlib.suppress(OSError):
            for event, data in self.served.follow(begin):
                self.wfile.write(b": \n\n" if not event else b"event: %s\ndata: %s\n\n" % (event.encode(), data))
                self.wfile.flush()


def _number(text: str | None) -> int:
    return int(text) if text and text.isascii() and text.isdigit() and len(text) < 10 else 0
