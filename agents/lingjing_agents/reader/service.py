"""`PlayerService`: an HTTP service on loopback that answers requests of the OpenAI chat protocol with a player."""

from __future__ import annotations

import json
import threading
import weakref
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import msgspec

from lingjing_agents.reader.player import RequestPlayer

_PATH = "/v1/chat/completions"
MODEL = "request-player"
"""The name of the "model" at its service."""


class PlayerService:
    """The service of one policy. It ends with the object."""

    def __init__(self, player: RequestPlayer) -> None:
        server = ThreadingHTTPServer(("127.0.0.1", 0), _handler_of(player))
        server.daemon_threads = True
        # `poll_interval` is how long the end of the service may take, seconds.
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True).start()
        self.url = f"http://127.0.0.1:{server.server_address[1]}/v1"
        """The address of the service."""
        self._end = weakref.finalize(self, _ended, server)

    def close(self) -> None:
        """End the service."""
        self._end()


def _ended(server: ThreadingHTTPServer) -> None:
    server.shutdown()
    server.server_close()


def _handler_of(player: RequestPlayer) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers.get("content-length", 0)))
            if self.path != _PATH:
                self._send(404, {"error": {"message": f"no such path: {self.path}"}})
                return
            try:
                self._send(200, _completion(player.answer(json.loads(body))))
            except (ValueError, KeyError, TypeError, IndexError, msgspec.MsgspecError) as error:
                self._send(400, {"error": {"message": f"{type(error).__name__}: {error}", "type": "invalid_request"}})

        def _send(self, status: int, content: dict[str, Any]) -> None:
            data = json.dumps(content).encode()
            self.send_response(status)
            self.send_header("content-type", "application/json")
            self.send_header("content-length", str(len(data)))
            self.end_headers()
            self.wfile.write(data)

        def log_message(self, *args: object) -> None:
            """Print nothing: the calls are in the trace."""

    return Handler


def _completion(text: str) -> dict[str, Any]:
    """Return the completion with an answer. It states no usage, because a program has no tokens."""
    message = {"role": "assistant", "content": text}
    return {
        "id": "request-player",
        "object": "chat.completion",
        "created": 0,
        "model": MODEL,
        "choices": [{"index": 0, "message": message, "finish_reason": "stop"}],
    }
