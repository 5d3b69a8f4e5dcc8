"""A chat service with an n-th answer that fails as its address requests: `http://127.0.0.1:PORT/<case>/<n>/<way>/v1`.

Run as a program it prints its port and serves until its standard input ends.
"""

from __future__ import annotations

import json
import socket
import struct
import sys
import threading
from collections import Counter
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

STEP = {"observation": "sea", "thought": "wait", "action": None, "messages": [], "detections": []}
GOOD = json.dumps({"choices": [{"message": {"role": "assistant", "content": json.dumps(STEP)}}]}).encode()

WAYS = ("reset", "cut", "gzip", "status500", "status401", "nonsense", "empty")
"""The connection is reset, or closed in the middle; the body is not packed as it says; a refusal; no JSON; nothing."""


class Answers(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    requests: Counter[str] = Counter()
    """Requests so far, by case."""

    def log_message(self, *_: object) -> None: ...

    def do_POST(self) -> None:
        self.rfile.read(int(self.headers["Content-Length"]))
        _, case, number, way, *_ = self.path.split("/")
        self.requests[case] += 1
        self._answer(way if self.requests[case] == int(number) else "good")

    def _answer(self, way: str) -> None:
        self.close_connection = True
        if way == "reset":
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            return
        status = int(way.removeprefix("status")) if way.startswith("status") else 200
        body = {"nonsense": b"<html>", "empty": b""}.get(way, GOOD)
        self.send_response(status)
        self.send_header("Content-Length", str(len(body)))
        if way == "gzip":
            self.send_header("Content-Encoding", "gzip")
        self.end_headers()
        self.wfile.write(body[: len(body) // 2] if way == "cut" else body)


def main() -> None:
    server = ThreadingHTTPServer(("127.0.0.1", 0), Answers)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    print(server.server_port, flush=True)
    sys.stdin.read()


if __name__ == "__main__":
    main()
