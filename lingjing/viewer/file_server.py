"""One file over HTTP for Foxglove on this machine: by ranges, with the token of its address.

Foxglove's page comes from another place than this server, so its origin is named in the answers (CORS), and a browser
is told that a public page may ask this machine (Private Network Access). Nobody without the token gets a byte.
"""

from __future__ import annotations

import contextlib
import re
from http import HTTPStatus
from pathlib import Path
from urllib.parse import quote

from lingjing.viewer.admission import asked_for
from lingjing.viewer.server import LocalRequest, LocalServer

ORIGIN = "https://app.foxglove.dev"
"""The site of Foxglove's page, which may read the answers."""

DESKTOP = "file://"
"""The origin that an application of Electron sends from a page of its own; no page of a site can send it."""

PIECE = 2**18
_RANGE = re.compile(r"bytes=(\d{1,18})-(\d{0,18})")


class TraceFileServer(LocalServer):
    """Serves the file `path`."""

    def __init__(self, path: Path, port: int = 0) -> None:
        super().__init__(_FileRequest, {"path_served": path}, port)

    @property
    def file_url(self) -> str:
        """Where the file is, with the token. Foxglove goes by the name's ending."""
        return self.address("/trace.mcap")

    @property
    def url(self) -> str:
        """What opens it in Foxglove."""
        return f"{ORIGIN}/~/view?ds=remote-file&ds.url={quote(self.file_url, safe='')}"


class _FileRequest(LocalRequest):
    path_served: Path
    origins = (ORIGIN, DESKTOP)

    def do_OPTIONS(self) -> None:  # noqa: N802 - the library's name
        """Answer the request that a browser sends before a page of another site may ask."""
        refused = self.refused()
        self._answer(HTTPStatus.NO_CONTENT if refused is None else refused.status, 0)

    def do_HEAD(self) -> None:  # noqa: N802 - the library's name
        """How long the file is."""
        if self._is_allowed():
            self._answer(HTTPStatus.OK, self.path_served.stat().st_size)

    def do_GET(self) -> None:  # noqa: N802 - the library's name
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

    # -- parts

    def _is_allowed(self) -> bool:
        why = self.refused()
        if why is not None:
            self._answer(why.status, 0)
        elif asked_for(self.path)[0] != "/trace.mcap":
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
