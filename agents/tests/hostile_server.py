"""A real HTTP server on loopback with raw bytes as answers, as a hostile or broken service may send them."""

from __future__ import annotations

import json
import socket
import threading
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

Answer = Callable[[bytes], Iterator[bytes]]
"""A function of the whole request (head and body) that yields the pieces of the answer; it may be endless."""

BLOCK = 64 * 1024


def answered(status: str, body: bytes, *headers: str) -> bytes:
    """Return a complete HTTP/1.1 answer."""
    head = [f"HTTP/1.1 {status}", f"content-length: {len(body)}", *headers]
    return "\r\n".join(head).encode() + b"\r\n\r\n" + body


def completion(text: str) -> bytes:
    """Return a valid completion with this text."""
    choice = {"index": 0, "message": {"role": "assistant", "content": text}, "finish_reason": "stop"}
    return answered("200 OK", json.dumps({"choices": [choice]}).encode(), "content-type: application/json")


def header_of(request: bytes, name: str) -> str:
    """Return a header's value, or ""."""
    for line in request.split(b"\r\n\r\n")[0].split(b"\r\n")[1:]:
        key, _, value = line.partition(b":")
        if key.decode().lower() == name:
            return value.strip().decode()
    return ""


def gzip_bomb(status: str = "200 OK") -> bytes:
    """Return an answer of 4 GiB of spaces, 4 MB on the wire: a block after a full flush may be repeated."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    block = packer.compress(b" " * (1024 * 1024)) + packer.flush(zlib.Z_FULL_FLUSH)
    return answered(status, b"\x1f\x8b\x08" + bytes(7) + block * 4096, "content-encoding: gzip")


@contextmanager
def serve_raw(answer: Answer) -> Iterator[str]:
    """Yield the service's `base_url`. Each connection serves one request."""
    listener = socket.create_server(("127.0.0.1", 0))
    ended = threading.Event()

    def serve_one(connection: socket.socket) -> None:
        with connection, suppress(OSError):
            connection.settimeout(600)
            for piece in answer(_request(connection)):
                connection.sendall(piece)
                if ended.is_set():
                    return

    def accept() -> None:
        with suppress(OSError):
            while True:
                connection, _ = listener.accept()
                threading.Thread(target=serve_one, args=(connection,), daemon=True).start()

    threading.Thread(target=accept, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}/v1"
    finally:
        ended.set()
        with suppress(OSError):
            listener.shutdown(socket.SHUT_RDWR)
        listener.close()


def _request(connection: socket.socket) -> bytes:
    data = b""
    while b"\r\n\r\n" not in data:
        data += connection.recv(BLOCK) or b"\r\n\r\n"
    size = int(header_of(data, "content-length") or 0)
    while len(data) < data.index(b"\r\n\r\n") + 4 + size:
        piece = connection.recv(BLOCK)
        if not piece:
            raise ConnectionError("the client went away in the middle of its request")
        data += piece
    return data
