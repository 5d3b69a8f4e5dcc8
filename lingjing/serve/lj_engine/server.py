"""The server: WebSocket sessions of engines, and the HTTP route of their pictures, on one port.

`websockets` reads and writes all frames of the WebSocket protocol. A connection that begins with `POST` is an upload.
"""

from __future__ import annotations

import contextlib
import hmac
import http.server
import logging
import os
import socket
import threading
import time
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit

from lingjing.errors import UsageError
from lingjing.installation import install_line
from lingjing.processes.signals import blocked_signals
from lingjing.serve.lj_engine.hub import Hub
from lingjing.serve.lj_engine.sessions import POLICY_VIOLATION, Session, key_of
from lingjing.serve.lj_engine.uploads import MOST_BYTES, UPLOAD_PATH, UploadError, read_upload
from lingjing.viewer.admission import path_and_query

LOOPBACK = ("127.0.0.1", "::1", "localhost")
MOST_FRAME = 32 * 2**20
"""Longest frame of a session, bytes (chosen: a boundary of a thousand bodies has half a megabyte)."""
MOST_SESSIONS = 64
"""Most sessions at a time (chosen)."""
MOST_OPEN = 2 * MOST_SESSIONS
"""Most connections at a time, with uploads and those that have sent no request yet; more are closed (chosen)."""
_UPLOAD_S = 60.0
"""Longest time of one upload, seconds (chosen)."""
_HANDSHAKE_S = 10.0
"""Time for the first request of a connection, seconds (chosen)."""
_PEEK_S = 0.02
"""Time between two looks at a connection that has sent less than a word, seconds (chosen)."""
_FAREWELL_S = 1.0
"""Longest silence of a client after its answer, seconds (chosen)."""
_PING_S = 10.0
"""Period and patience of the WebSocket pings that find a dead peer, seconds (chosen)."""


class EngineServer:
    """Listens for engines of a hub until `close`."""

    def __init__(self, hub: Hub, host: str, port: int, token: str = "") -> None:
        """Raises `UsageError` if `websockets` is not installed or the address cannot be used."""
        try:
            from websockets.sync.server import ServerConnection, serve
        except ImportError as error:
            raise UsageError(
                "LJ-ENGINE needs websockets, which is not installed", hint=install_line("lj-engine")
            ) from error
        self.hub, self.host, self._token = hub, host, token
        self._connections = self._sessions = 0
        self._lock = threading.Lock()
        try:
            family = socket.AF_INET6 if ":" in host else socket.AF_INET
            listening = socket.create_server((host, port), family=family)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            hint = "another program uses it: choose another with --port (0: a free one)"
            raise UsageError(f"cannot listen at {host} port {port}: {reason}", hint=hint) from error
        self.port: int = listening.getsockname()[1]
        logging.getLogger("websockets.server").addHandler(logging.NullHandler())
        logging.getLogger("websockets.server").propagate = False  # the client reports broken handshakes
        self._server = serve(
            self._talk, sock=listening, create_connection=_quiet(ServerConnection), open_timeout=_HANDSHAKE_S,
            process_request=self._admit, compression=None, max_size=MOST_FRAME, server_header=None,
            ping_interval=_PING_S, ping_timeout=_PING_S, close_timeout=1.0,
        )  # fmt: skip
        websocket = self._server.handler

        def route(connection: socket.socket, address: object) -> None:
            with self._lock:
                self._connections += 1
                crowded = self._connections > MOST_OPEN
            try:
                if crowded:
                    connection.close()
                elif _begins_with_post(connection):
                    try:
                        _UploadRequest(connection, address, self)
                    finally:
                        _close(connection)
                else:
                    websocket(connection, address)
            finally:
                with self._lock:
                    self._connections -= 1
                with self._server.lock:
                    self._server.handler_threads.discard(threading.current_thread())

        self._server.handler = route
        with blocked_signals():
            threading.Thread(target=self._server.serve_forever, name="lj-engine-accept", daemon=True).start()

    def upload_url(self, session: Session) -> str:
        """Return the address to which a session uploads pictures: that at which it has reached this server."""
        query = f"?token={self._token}" if self._token else ""
        return f"http://{session.server_address}{UPLOAD_PATH}{query}"

    def close(self) -> None:
        """Send the frames that wait, close all sessions and stop listening."""
        for session in tuple(self.hub.sessions.values()):
            session.finish()
        for thread in threading.enumerate():
            if thread.name == "lj-engine-write":
                thread.join(2.0)
        self._server.shutdown()

    def refusal(
        self, target: str, hosts: list[str], origins: list[str], bearer: str = ""
    ) -> tuple[HTTPStatus, str] | None:
        """Return the refusal of a request; None if it is admitted.

        On a loopback address the `Host` must name it, so that no name of another site leads here. A page of another
        site is refused by its `Origin`. With a token, the address or the header `Authorization` must hold it.
        """
        names = [f"{name}:{self.port}" for name in ("127.0.0.1", "localhost", "[::1]")]
        if self.host in LOOPBACK and (len(hosts) != 1 or hosts[0].lower() not in names):
            return HTTPStatus.MISDIRECTED_REQUEST, "this server answers for 127.0.0.1 and localhost only"
        own = {
            f"{scheme}://{name}" for scheme in ("http", "ws") for name in (*names, *(host.lower() for host in hosts))
        }
        if any(origin.lower() not in own for origin in origins) or len(origins) > 1:
            return HTTPStatus.FORBIDDEN, "pages of other sites have no access to this server"
        sent = path_and_query(target)[1].get("token", "") or bearer.removeprefix("Bearer ").strip()
        if self._token and not hmac.compare_digest(sent.encode(), self._token.encode()):
            return HTTPStatus.FORBIDDEN, "the address lacks its token: add ?token=TOKEN"
        return None

    def _admit(self, connection: Any, request: Any) -> Any:
        """Return the response that refuses a handshake; None if it is admitted."""
        headers = request.headers
        bearer = headers.get("Authorization", "") if len(headers.get_all("Authorization")) == 1 else ""
        refused = self.refusal(request.path, headers.get_all("Host"), headers.get_all("Origin"), bearer)
        if refused is not None:
            return connection.respond(refused[0], f"{refused[1]}\n")
        if self._sessions >= MOST_SESSIONS:
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "too many connections\n")
        return None

    def _talk(self, connection: Any) -> None:
        """Serve one session, in its own thread."""
        from websockets.exceptions import ConnectionClosed

        key = key_of(urlsplit(connection.request.path).path)
        if key is None:
            connection.close(POLICY_VIOLATION, "the path is /ws/{LJ-ENGINE|LJ-UE|LJ-CREW}/{address}")
            return
        session = Session(connection, *key)
        with self._lock:
            self._sessions += 1
        writer = threading.Thread(target=session.write, name="lj-engine-write", daemon=True)
        writer.start()
        reason = "its connection was closed"
        try:
            refusal = self.hub.join(session)
            if refusal:
                session.tell(refusal)
                session.lost = refusal
                session.finish()
            for text in connection:
                if not session.lost:
                    self.hub.receive(session, text)
        except ConnectionClosed as error:
            reason = str(error)[:200]
        finally:
            self.hub.leave(session, reason)
            session.finish()
            writer.join(5.0)
            with self._lock:
                self._sessions -= 1


class _UploadRequest(http.server.BaseHTTPRequestHandler):
    """One HTTP request with a picture."""

    timeout = 30.0
    protocol_version = "HTTP/1.1"

    def __init__(self, connection: socket.socket, address: Any, server: EngineServer) -> None:
        self._engine_server = server
        with contextlib.suppress(OSError):  # the client has closed it
            super().__init__(connection, address, None)  # type: ignore[arg-type]  # the server is not used

    def do_POST(self) -> None:
        """Answer an upload."""
        self.close_connection = True
        try:
            self._take()
        except UploadError as error:
            self._answer(error.status, {"code": int(error.status), "message": error.message})
        else:
            self._answer(HTTPStatus.OK, {"code": 0, "message": "success"})

    def _take(self) -> None:
        server, headers = self._engine_server, self.headers
        hosts, origins = headers.get_all("Host") or [], headers.get_all("Origin") or []
        refused = server.refusal(self.path, hosts, origins, headers.get("Authorization", ""))
        if refused is not None:
            raise UploadError(*refused)
        if urlsplit(self.path).path != UPLOAD_PATH:
            raise UploadError(HTTPStatus.NOT_FOUND, f"pictures are posted to {UPLOAD_PATH}")
        length = headers.get("Content-Length", "")
        if not length.isascii() or not length.isdigit():
            raise UploadError(HTTPStatus.LENGTH_REQUIRED, "an upload must have a Content-Length")
        if len(length) > 9 or int(length) > MOST_BYTES:
            raise UploadError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"an upload may have at most {MOST_BYTES} bytes")
        if headers.get("Expect", "").lower() == "100-continue":
            self.send_response_only(HTTPStatus.CONTINUE)
            self.end_headers()
        body = self._read(int(length))
        server.hub.upload(read_upload(headers.get("Content-Type", ""), body))

    def _read(self, length: int) -> bytes:
        """Return the body. Raises `UploadError` if it is shorter, or slower than `_UPLOAD_S`."""
        until, body = time.monotonic() + _UPLOAD_S, bytearray()
        while len(body) < length:
            part = self.rfile.read1(length - len(body))
            if not part:
                raise UploadError(HTTPStatus.BAD_REQUEST, "the body is shorter than its Content-Length")
            body += part
            if time.monotonic() > until:
                raise UploadError(HTTPStatus.REQUEST_TIMEOUT, f"an upload may take at most {_UPLOAD_S:g} s")
        return bytes(body)

    def _answer(self, status: HTTPStatus, content: object) -> None:
        import msgspec

        body = msgspec.json.encode(content)
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the name of the standard library
        """Log nothing: refusals are answers to the client."""


def _quiet(kind: Any) -> Any:
    """Return a class of connections with pings that draw nothing from `random`. Such draws would be reported as draws
    of a policy."""

    def ping(self: Any, data: Any = None, ack_on_close: bool = False) -> Any:
        return kind.ping(self, os.urandom(4) if data is None else data, ack_on_close)

    return type("QuietConnection", (kind,), {"ping": ping})


def _begins_with_post(connection: socket.socket) -> bool:
    """Return whether a connection sends an HTTP request with a body. Reads nothing from it."""
    until = time.monotonic() + _HANDSHAKE_S
    begin = b""
    connection.settimeout(_HANDSHAKE_S)
    with contextlib.suppress(OSError):
        while (begin := connection.recv(4, socket.MSG_PEEK)) and begin != b"POST" and b"POST".startswith(begin):
            if time.monotonic() > until:
                break
            time.sleep(_PEEK_S)  # the rest of the word is in another packet
    connection.settimeout(None)
    return begin == b"POST"


def _close(connection: socket.socket) -> None:
    """Close a connection after its answer. What the client still sends is read and dropped for a moment: closed at
    once, the connection would be reset, and the answer lost."""
    with contextlib.suppress(OSError):
        connection.shutdown(socket.SHUT_WR)
        connection.settimeout(_FAREWELL_S)
        left = 2 * MOST_BYTES
        while left > 0 and (data := connection.recv(2**16)):
            left -= len(data)
    connection.close()
