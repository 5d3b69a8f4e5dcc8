"""One file over HTTP for Foxglove on this machine, with range requests.

Foxglove's page has another origin than this server. The responses therefore allow its origin (CORS), and allow requests
from a public page to this machine (Private Network Access). A request without the token of the address is refused.
"""

from __future__ import annotations

import contextlib
import re
from http import HTTPStatus
from pathlib import Path
from urllib.parse import quote

from lingjing.viewer.admission import path_and_query
from lingjing.viewer.server import LocalRequest, LocalServer

ORIGIN = "https://app.foxglove.dev"
"""The origin of Foxglove's page, which may read the responses."""

DESKTOP = "file://"
"""The origin of Foxglove's desktop application (Electron). A page of a web site cannot send it."""

PIECE = 2**18
"""Bytes that are read and sent at a time. Chosen."""
_RANGE = re.compile(r"bytes=(\d{1,18})-(\d{0,18})")


class TraceFileServer(LocalServer):
    """A server of the file `path`."""

    def __init__(self, path: Path, port: int = 0) -> None:
        super().__init__(_FileRequest, {"path_served": path}, port)

    @property
    def file_url(self) -> str:
        """The URL of the file, with the token. Foxglove detects the format from the suffix."""
        return self.address("/trace.mcap")

    @property
    def url(self) -> str:
        """The URL that opens the file in Foxglove."""
        return f"{ORIGIN}/~/view?ds=remote-file&ds.url={quote(self.file_url, safe='')}"


class _FileRequest(LocalRequest):
    path_served: Path
    origins = (ORIGIN, DESKTOP)

    def do_OPTIONS(self) -> None:  # noqa: N802 - the library's name
        """Answer the preflight request of a browser for a page of another origin."""
        refused = self.refused()
        self._answer(HTTPStatus.NO_CONTENT if refused is None else refused.status, 0)

    def do_HEAD(self) -> None:  # noqa: N802 - the library's name
        """Answer with the length of the file."""
        if self._is_allowed():
            self._answer(HTTPStatus.OK, self.path_served.stat().st_size)

    def do_GET(self) -> None:  # noqa: N802 - the library's name
        """Answer with the file or the requested range."""
        if not self._is_allowed():
            return
        with self.path_served.open("rb") as file, contextlib.suppress(ConnectionError, TimeoutError):
            size = self.path_served.stat().st_size
            request = _RANGE.fullmatch(self.headers.get("Range", ""))
            first, last = (int(request[1]), int(request[2] or size - 1)) if request else (0, size - 1)
            last = min(last, size - 1)
            if first > last:
                self._answer(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE, 0, f"bytes */{size}")
                return
            part = f"bytes {first}-{last}/{size}" if request else ""
            self._answer(HTTPStatus.PARTIAL_CONTENT if request else HTTPStatus.OK, last - first + 1, part)
            file.seek(first)
            left = last - first + 1
            while left > 0 and (data := file.read(min(PIECE, left))):
                self.wfile.write(data)
                left -= len(data)

    # -- parts

    def _is_allowed(self) -> bool:
        refused = self.refused()
        if refused is not None:
            self._answer(refused.status, 0)
        elif path_and_query(self.path)[0] != "/trace.mcap":
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
