"""The server: the token, and admission of requests to the names of this machine only."""

from __future__ import annotations

import contextlib
import http.client
import json
import socket
import threading
import time
import zlib
from collections.abc import Iterator
from urllib.parse import quote

import pytest

from lingjing import Trace
from lingjing.errors import UsageError
from lingjing.viewer import admission
from lingjing.viewer.page import policy
from lingjing.viewer.page_content import CHUNK
from lingjing.viewer.server import MOST_CONNECTIONS, ViewServer
from lingjing.viewer.trace_source import TraceSource


@pytest.fixture(scope="module")
def server(trace: Trace) -> Iterator[ViewServer]:
    made = ViewServer(TraceSource(trace, truth=False))
    yield made
    made.close()


def port_of(server: ViewServer) -> int:
    return int(server.url.split(":")[2].split("/")[0])


def ask(
    server: ViewServer, path: str, *, token: str | None = None, **headers: str
) -> tuple[int, dict[str, str], bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", port_of(server), timeout=300)
    mark = "&" if "?" in path else "?"
    connection.request("GET", f"{path}{mark}token={server.token if token is None else token}", headers=headers)
    answer = connection.getresponse()
    response = answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read()
    connection.close()
    return response


def test_the_page_and_its_data_are_served(server: ViewServer, trace: Trace) -> None:
    status, headers, body = ask(server, "/")
    assert status == 200 and body.startswith(b"<!doctype html>")
    assert headers["content-security-policy"] == policy(served=True)
    assert headers["x-content-type-options"] == "nosniff" and headers["referrer-policy"] == "no-referrer"
    assert (
        "access-control-allow-origin" not in headers and "frame-ancestors 'none'" in headers["content-security-policy"]
    )
    status, headers, body = ask(server, "/page-start", **{"Accept-Encoding": "gzip, deflate"})
    assert headers["content-encoding"] == "deflate"
    start = json.loads(zlib.decompress(body))
    assert len(start["steps"]) == len(trace.boundaries) and start["live"] is False
    assert json.loads(ask(server, "/ground")[2])["known"] in (True, False)
    assert len(json.loads(ask(server, "/details?chunk=0")[2])) == min(CHUNK, len(trace.boundaries))
    name = next(iter(trace.frames))
    status, headers, body = ask(server, f"/picture?id={quote(name)}")
    assert (status, headers["content-type"], body) == (200, "image/jpeg", trace.jpeg(name))


@pytest.mark.parametrize("path", ["/", "/page-start", "/ground", "/details?chunk=0", "/picture?id=x", "/follow", "/no"])
def test_without_the_token_nothing_is_served(server: ViewServer, path: str) -> None:
    for token in ("", "x", server.token[:-1], server.token + "x", "é"):
        status, _, body = ask(server, path, token=quote(token))
        assert status == 403 and len(body) < 200 and server.token.encode() not in body


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1", "evil.example:80", "127.0.0.1.evil.example", ""])
def test_a_request_for_another_host_name_is_rejected(server: ViewServer, host: str) -> None:
    assert ask(server, "/page-start", Host=host)[0] == 421
    assert ask(server, "/page-start", Host=f"localhost:{port_of(server)}")[0] == 200


@pytest.mark.parametrize(
    "path", ["/picture?id=none", "/picture", "/details?chunk=99", "/details?chunk=-1x9", "/../etc/passwd"]
)
def test_a_request_for_a_missing_part_is_answered_with_404(server: ViewServer, path: str) -> None:
    status, headers, body = ask(server, path)
    if path == "/details?chunk=-1x9":
        assert status == 200  # the first chunk is the default
    else:
        assert status == 404 and body and headers["content-type"].startswith("text/plain")


def test_only_get_requests_succeed_and_invalid_requests_do_not_end_the_server(server: ViewServer) -> None:
    for data in (b"POST / HTTP/1.1\r\nHost: x\r\n\r\n", b"\x00\xff\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n", b""):
        with socket.create_connection(("127.0.0.1", port_of(server)), timeout=300) as connection:
            connection.sendall(data)
            connection.shutdown(socket.SHUT_WR)
            answer = connection.makefile("rb").read()
        assert b" 200 " not in answer.split(b"\r\n")[0]
    assert ask(server, "/")[0] == 200


def test_a_query_with_too_many_fields_is_rejected(server: ViewServer) -> None:
    fields = "&".join(f"field{number}=1" for number in range(20))
    assert ask(server, f"/page-start?{fields}")[0] == 403


def test_a_closed_port_can_be_used_again(trace: Trace) -> None:
    reused = []
    for _ in range(4):  # another process may get the port meanwhile, but not each time
        first = ViewServer(TraceSource(trace, truth=False))
        port = port_of(first)
        assert ask(first, "/follow")[0] == 200  # the server closes first: its end of the connection lingers
        first.close()
        with contextlib.suppress(UsageError):
            ViewServer(TraceSource(trace, truth=False), port).close()
            reused.append(port)
    assert reused


def test_a_client_that_reads_nothing_delays_no_other(server: ViewServer) -> None:
    idle = [socket.create_connection(("127.0.0.1", port_of(server)), timeout=300) for _ in range(8)]
    for connection in idle:
        connection.sendall(
            f"GET /page-start?token={server.token} HTTP/1.1\r\nHost: 127.0.0.1:{port_of(server)}\r\n\r\n".encode()
        )
    assert ask(server, "/details?chunk=0")[0] == 200
    for connection in idle:
        connection.close()


def test_the_server_listens_on_the_loopback_address_and_an_occupied_port_is_an_error(
    server: ViewServer, trace: Trace
) -> None:
    assert server.url.startswith("http://127.0.0.1:") and len(server.token) >= 32
    with pytest.raises(UsageError, match=f"cannot listen on port {port_of(server)}"):
        ViewServer(TraceSource(trace, truth=False), port_of(server))


def raw(server: ViewServer, text: str) -> bytes:
    """Return the response to a request that is sent literally."""
    with socket.create_connection(("127.0.0.1", port_of(server)), timeout=300) as connection:
        connection.sendall(text.encode())
        return b"".join(iter(lambda: connection.recv(65536), b""))


def test_a_request_without_exactly_one_host_header_is_rejected(server: ViewServer) -> None:
    host, target = f"Host: 127.0.0.1:{port_of(server)}\r\n", f"/page-start?token={server.token}"
    for hosts in (host * 2, f"Host: evil.example\r\n{host}", f"{host}Host: evil.example\r\n"):
        answer = raw(server, f"GET {target} HTTP/1.1\r\n{hosts}\r\n")
        assert answer.startswith(b"HTTP/1.1 421 "), answer[:200]
    assert raw(server, f"GET {target} HTTP/1.1\r\n\r\n").startswith(b"HTTP/1.1 421 ")
    assert raw(server, f"GET {target} HTTP/1.1\r\n{host}Connection: close\r\n\r\n").startswith(b"HTTP/1.1 200 ")


@pytest.mark.parametrize("before", ["http://evil.example", "//evil.example", "http://127.0.0.1:1", "page"])
def test_a_request_target_with_another_host_is_rejected(server: ViewServer, before: str) -> None:
    head = (
        f"/page-start?token={server.token} HTTP/1.1\r\nHost: 127.0.0.1:{port_of(server)}\r\nConnection: close\r\n\r\n"
    )
    assert raw(server, f"GET {before}{head}")[:13] in (b"HTTP/1.1 421 ", b"HTTP/1.1 404 ")
    assert raw(server, f"GET {head}").startswith(b"HTTP/1.1 200 ")


@pytest.mark.parametrize(
    "origin", ["https://evil.example", "null", "http://127.0.0.1", "http://localhost:1", "file://"]
)
def test_a_request_from_a_page_of_another_site_is_rejected(server: ViewServer, origin: str) -> None:
    assert ask(server, "/page-start", Origin=origin)[0] == 403
    assert ask(server, "/page-start", Origin=f"http://127.0.0.1:{port_of(server)}")[0] == 200


def test_a_connection_without_a_request_is_dropped(server: ViewServer) -> None:
    silent = socket.create_connection(("127.0.0.1", port_of(server)), timeout=300)
    slow = socket.create_connection(("127.0.0.1", port_of(server)), timeout=300)
    begun = time.monotonic()
    with silent, slow:
        slow.sendall(b"GET /page-start HTTP/1.1\r\nX: ")
        with pytest.raises(OSError):
            while True:  # single bytes at intervals are no request either
                slow.sendall(b"x")
                time.sleep(0.05)
        assert silent.recv(1) == b""
    assert time.monotonic() - begun >= admission.ADMISSION_S


def test_a_connection_with_the_token_is_not_dropped(server: ViewServer) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", port_of(server), timeout=300)
    for wait in (0.0, 1.5 * admission.ADMISSION_S):
        time.sleep(wait)
        connection.request("GET", f"/page-start?token={server.token}")
        answer = connection.getresponse()
        assert (answer.status, bool(answer.read())) == (200, True)
    connection.request("GET", "/page-start?token=x")
    answer = connection.getresponse()
    assert (answer.status, answer.headers["Connection"]) == (403, "close"), (
        "a request without the token ends the connection"
    )


def test_many_silent_connections_of_one_address_block_no_client(
    server: ViewServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(admission, "ADMISSION_S", 3600.0)  # newer connections displace them, not the time limit
    with contextlib.ExitStack() as held:
        silent = [
            held.enter_context(socket.create_connection(("127.0.0.1", port_of(server)), timeout=300))
            for _ in range(4 * MOST_CONNECTIONS)
        ]
        assert ask(server, "/page-start")[0] == 200
        assert all(connection.recv(1) == b"" for connection in silent[: -admission.MOST_WAITING]), (
            "the oldest are dropped"
        )
        while threading.active_count() >= MOST_CONNECTIONS:  # the threads of dropped connections end
            time.sleep(0.01)
    monkeypatch.undo()
    assert ask(server, "/page-start")[0] == 200


def test_silent_connections_of_several_addresses_block_no_client(
    server: ViewServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(admission, "ADMISSION_S", 3600.0)
    with contextlib.ExitStack() as held:
        for number in range(2 * admission.MOST_WAITING_IN_ALL):
            source = (f"127.0.{number // admission.MOST_WAITING}.1", 0)
            held.enter_context(
                socket.create_connection(("127.0.0.1", port_of(server)), timeout=300, source_address=source)
            )
        assert ask(server, "/page-start")[0] == 200
        while threading.active_count() >= 2 * admission.MOST_WAITING_IN_ALL:  # the threads of dropped connections end
            time.sleep(0.01)


def test_the_number_of_admitted_connections_is_limited(server: ViewServer) -> None:
    with contextlib.ExitStack() as held:
        for _ in range(MOST_CONNECTIONS):
            connection = http.client.HTTPConnection("127.0.0.1", port_of(server), timeout=300)
            held.callback(connection.close)
            connection.request("GET", f"/page-start?token={server.token}")
            assert connection.getresponse().read()
        assert ask(server, "/page-start")[0] == 503
