"""A trace for Foxglove over HTTP: ranges, the token, and the allowed origins."""

from __future__ import annotations

import http.client
import socket
import struct
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest

from lingjing.errors import UsageError
from lingjing.viewer.file_server import ORIGIN, TraceFileServer

DATA = bytes(range(256)) * 40


@pytest.fixture
def server(tmp_path: Path) -> Iterator[TraceFileServer]:
    (tmp_path / "trace.mcap").write_bytes(DATA)
    made = TraceFileServer(tmp_path / "trace.mcap")
    yield made
    made.close()


def ask(
    server: TraceFileServer, method: str = "GET", path: str = "", **headers: str
) -> tuple[int, dict[str, str], bytes]:
    url = urlsplit(server.file_url)
    connection = http.client.HTTPConnection("127.0.0.1", url.port or 0, timeout=300)
    connection.request(method, path or f"{url.path}?{url.query}", headers=headers)
    answer = connection.getresponse()
    response = answer.status, dict(answer.getheaders()), answer.read()
    connection.close()
    return response


def test_the_file_is_served_whole_and_by_ranges(server: TraceFileServer) -> None:
    status, headers, body = ask(server)
    assert (status, body) == (200, DATA) and headers["Access-Control-Allow-Origin"] == ORIGIN
    assert ask(server, "HEAD")[1]["Content-Length"] == str(len(DATA))
    for requested, first, last in (
        ("5-9", 5, 9),
        ("10200-", 10200, 10239),
        ("10200-99999", 10200, 10239),
        ("0-0", 0, 0),
    ):
        status, headers, body = ask(server, Range=f"bytes={requested}")
        assert (status, body) == (206, DATA[first : last + 1])
        assert headers["Content-Range"] == f"bytes {first}-{last}/{len(DATA)}"
    assert ask(server, Range=f"bytes={len(DATA)}-")[0] == 416
    assert ask(server, Range="bytes=a-b")[2] == DATA  # no range: all of it
    assert ask(server, "OPTIONS")[1]["Access-Control-Allow-Private-Network"] == "true"


def test_a_request_without_the_token_gets_no_content(server: TraceFileServer) -> None:
    for path in ("/trace.mcap", "/trace.mcap?token=x", "/", "/../etc/passwd", f"/other?token={server.token}"):
        status, _, body = ask(server, path=path)
        assert status in (403, 404) and body == b""
    assert ask(server, Host="evil.example")[0] == 421
    assert ask(server, Origin="https://evil.example")[0] == 403
    assert ask(server, Origin=ORIGIN)[2] == ask(server, Origin="file://")[2] == DATA
    assert ask(server, "OPTIONS", path="/trace.mcap", Origin=ORIGIN)[0] == 403
    assert parse_qs(urlsplit(server.url).query)["ds.url"] == [server.file_url] and server.url.startswith(ORIGIN)


def test_invalid_requests_and_closed_connections_print_nothing(
    server: TraceFileServer, capfd: pytest.CaptureFixture[str]
) -> None:
    url = urlsplit(server.file_url)
    fields = "&".join(f"field{number}=1" for number in range(20))
    assert ask(server, path=f"{url.path}?{url.query}&{fields}")[0] == 403
    with socket.create_connection(("127.0.0.1", url.port or 0), timeout=300) as client:
        client.sendall(b"GET ")
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # closing resets the connection
    assert ask(server)[0] == 200
    server.close()
    assert capfd.readouterr() == ("", "")


def test_a_removed_file_and_an_occupied_port_are_errors(server: TraceFileServer, tmp_path: Path) -> None:
    (tmp_path / "trace.mcap").unlink()
    assert ask(server)[0] == 410
    port = urlsplit(server.file_url).port or 0
    with pytest.raises(UsageError, match=f"cannot listen on port {port}"):
        TraceFileServer(tmp_path / "trace.mcap", port)
