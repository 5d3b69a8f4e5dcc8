"""One file over HTTP for Foxglove on this machine: by ranges, with the token of its address.

Foxglove's page comes from another place than this server, so its origin is named in the answers (CORS), and a browser
is told that a public page may ask this machine (Private Network Access). Nobody without the token gets a byte.
"""

from __future__ import annotations

import contextlib
import hmac
import re
import secrets
import threading
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from urllib.parse import quote

from lingjing.errors import UsageError
from lingjing.signals import unheard
from lingjing.viewer.server import HOST, PATIENCE_S, LocalHttpServer, asked_for

ORIGIN = "https://app.foxglove.dev"
"""Whose page may read the answers; the desktop app has no origin that is checked."""

PIECE = 2**18
_RANGE = re.compile(r"bytes=(\d{1,18})-(\d{0,18})")


class TraceFileServer:
    """Serves the file `path` until `close`; `port` 0 takes a free one. Raises `UsageError` if it cannot be had."""

    def __init__(self, path: Path, port: int = 0) -> None:
        self.token = secrets.token_urlsafe(24)
        handler = type("Handler", (_Handler,), {"path_served": path, "token": self.token})
        try:
            self._http = LocalHttpServer((HOST, port), handler)
        except (OSError, OverflowError) as error:
            why = getattr(error, "strerror", None) or str(error)
            raise UsageError(f"cannot listen on port {port}: {why}", hint="choose another with --port") from error
        self._thread = threading.Thread(target=self._http.serve_forever, args=(0.1,), name="lingjing-file", daemon=True)
        with unheard():
            self._thread.start()

    @property
    def file_url(self) -> str:
        """Where the file is, with the token. Foxglove goes by the name's ending."""
        return f"http://{HOST}:{self._http.server_port}/trace.mcap?token={self.token}"

    @property
    def url(self) -> str:
        """What opens it in Foxglove."""
        return f"{ORIGIN}/~/view?ds=remote-file&ds.url={quote(self.file_url, safe='')}"

    def close(self) -> None:
        """Stop listening."""
        self._http.shutdown()
        self._http.server_close()
        self._thread.join()


class _Handler(BaseHTTPRequestHandler):
    path_served: Path
    token: str
    protocol_version = "HTTP/1.1"
    server_version = "lingjing"
    sys_version = ""
    timeout = PATIENCE_S

    def do_OPTIONS(self) -> None:
        """What a browser asks before a page of another place may ask."""
        self._answer(HTTPStatus.NO_CONTENT, 0)

    def do_HEAD(self) -> None:
        """How long the file is."""
        if self._is_allowed():
            self._answer(HTTPStatus.OK, self.path_served.stat().st_size)

    def do_GET(self) -> None:
        """The file, or the range that is asked for."""
        if not self._is_allowed():
            return
        with self.path_served.open("rb") as file, contextlib.suppress(ConnectionError, TimeoutError):
            size = self.path_served.stat().st_size
            asked = _RANGE.fullmatch(self.headers.get("Range", ""))
            first, last = (int(asked[1]), int(asked[2] or size - 1)) if asked else (0, size - 1)
            last = min(last, size - 1)
            if first > last:
                self._answer(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE, 0, f"bytes */{size}")
                return
            part = f"bytes {first}-{last}/{size}" if asked else ""
            self._answer(HTTPStatus.PARTIAL_CONTENT if asked else HTTPStatus.OK, last - first + 1, part)
            file.seek(first)
            left = last - first + 1
            while left > 0 and (data := file.read(min(PIECE, left))):
                self.wfile.write(data)
                left -= len(data)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the library's name
        """Nothing is logged: the addresses hold the token."""

    # -- parts

    def _is_allowed(self) -> bool:
        path, asked = asked_for(self.path)
        given, port = asked.get("token", ""), self.connection.getsockname()[1]
        if self.headers.get("Host", "").lower() not in (f"{HOST}:{port}", f"localhost:{port}"):
            self._answer(HTTPStatus.MISDIRECTED_REQUEST, 0)
        elif not hmac.compare_digest(given.encode(), self.token.encode()):
            self._answer(HTTPStatus.FORBIDDEN, 0)
        elif path != "/trace.mcap":
            self._answer(HTTPStatus.NOT_FOUND, 0)
        elif not self.path_served.is_file():
            self._answer(HTTPStatus.GONE, 0)
        else:
            return True
        return False

    def _answer(self, status: HTTPStatus, length: int, part: str = "") -> None:
        self.send_response(status)
        for name, value in (
            ("Content-Type", "application/octet-stream"),
            ("Content-Length", str(length)),
            ("Accept-Ranges", "bytes"),
            ("Access-Control-Allow-Origin", ORIGIN),
            ("Access-Control-Allow-Headers", "Range"),
            ("Access-Control-Expose-Headers", "Accept-Ranges, Content-Length, Content-Range"),
            ("Access-Control-Allow-Private-Network", "true"),
            ("X-Content-Type-Options", "nosniff"),
            ("Cache-Control", "no-store"),
        ):
            self.send_header(name, value)
        if part:
            self.send_header("Content-Range", part)
        self.end_headers()
