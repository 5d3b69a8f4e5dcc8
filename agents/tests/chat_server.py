"""A real HTTP server on loopback with the OpenAI chat protocol.

The next script entry answers each request; the last one repeats. The server stores the requests.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from lingjing_agents.reader.player import RequestPlayer

NOOP = {"thought": "nothing to do", "command": None, "messages": []}


@dataclass
class Reply:
    """A scripted answer; `step` becomes the completion's text (as JSON unless it is a text already)."""

    step: Any = field(default_factory=lambda: NOOP)
    status: int = 200
    finish_reason: str = "stop"
    headers: dict[str, str] = field(default_factory=dict)
    delay_s: float = 0.0
    drop: bool = False
    body: str | None = None


class ChatServer:
    """The script, the stored requests and the address of a server."""

    def __init__(self, script: list[Reply] | Callable[[dict[str, Any]], Reply]) -> None:
        self.script = script
        self.requests: list[dict[str, Any]] = []
        self.keys: list[str] = []
        self.lock = threading.Lock()
        self.released = threading.Event()
        self.url = ""

    def next_reply(self, request: dict[str, Any], key: str) -> Reply:
        with self.lock:
            number = len(self.requests)
            self.requests.append(request)
            self.keys.append(key)
        if callable(self.script):
            return self.script(request)
        return self.script[min(number, len(self.script) - 1)]


def reading_model() -> Callable[[dict[str, Any]], Reply]:
    """Return a script that answers from the texts and pictures of its requests (`RequestPlayer`)."""
    player = RequestPlayer()
    return lambda request: Reply(json.loads(player.answer(request)))


def completion(reply: Reply) -> dict[str, Any]:
    text = reply.step if isinstance(reply.step, str) else json.dumps(reply.step)
    return {
        "id": "chatcmpl-1",
        "object": "chat.completion",
        "created": 0,
        "model": "test-model",
        "choices": [
            {"index": 0, "message": {"role": "assistant", "content": text}, "finish_reason": reply.finish_reason}
        ],
        "usage": {"prompt_tokens": 100, "completion_tokens": 20, "total_tokens": 120},
    }


def _handler(server: ChatServer) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_POST(self) -> None:
            size = int(self.headers.get("content-length", 0))
            request = json.loads(self.rfile.read(size))
            if self.path != "/v1/chat/completions":
                self._send(404, {}, b'{"error": {"message": "no such path"}}')
                return
            reply = server.next_reply(request, self.headers.get("authorization", ""))
            if reply.delay_s:
                server.released.wait(reply.delay_s)
            if reply.drop:
                self.close_connection = True
                self.connection.close()
                return
            if reply.body is not None:
                data = reply.body.encode()
            elif reply.status == 200:
                data = json.dumps(completion(reply)).encode()
            else:
                data = json.dumps({"error": {"message": f"scripted {reply.status}", "type": "test"}}).encode()
            self._send(reply.status, reply.headers, data)

        def _send(self, status: int, headers: dict[str, str], data: bytes) -> None:
            try:
                self.send_response(status)
                for name, value in {"content-type": "application/json", **headers}.items():
                    self.send_header(name, value)
                self.send_header("content-length", str(len(data)))
                self.end_headers()
                self.wfile.write(data)
            except (BrokenPipeError, ConnectionResetError):
                self.close_connection = True

        def log_message(self, *args: object) -> None:
            return

    return Handler


@contextmanager
def serve(script: list[Reply] | Callable[[dict[str, Any]], Reply]) -> Iterator[ChatServer]:
    """Run the server on a free port of the loopback interface inside the context."""
    state = ChatServer(script)
    http = ThreadingHTTPServer(("127.0.0.1", 0), _handler(state))
    http.daemon_threads = True
    thread = threading.Thread(target=http.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
    thread.start()
    state.url = f"http://127.0.0.1:{http.server_address[1]}/v1"
    try:
        yield state
    finally:
        state.released.set()
        http.shutdown()
        http.server_close()
        thread.join(timeout=5)


def stopwatch() -> Callable[[], float]:
    start = time.monotonic()
    return lambda: time.monotonic() - start
