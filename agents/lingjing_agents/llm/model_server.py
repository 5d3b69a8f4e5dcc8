"""`LoopbackModel`: a server on loopback that speaks the OpenAI chat protocol and passes requests on to a `ModelAsker`.

It serves one agent, in the process of its policy. A client needs its random key, so that no other process of the
machine spends the agent's calls. Each request has a thread and an event loop of its own.
"""

from __future__ import annotations

import asyncio
import hmac
import secrets
import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import msgspec

from lingjing.decoding import from_json
from lingjing.plugins.model_access import ForwardedAnswer, ModelAsker

HOST = "127.0.0.1"
"""The server listens on this machine alone."""

MOST_BYTES = 64 * 1024 * 1024
"""The longest request. Chosen: dozens of pictures."""

_WAIT_S = 60.0
"""Seconds without progress after which a connection is closed. Chosen."""


class LoopbackModel:
    """`lingjing.plugins.asking.ModelServer` over an access to a model."""

    def __init__(self, asker: ModelAsker, tick: Callable[[], int], within_s: float) -> None:
        self.key = secrets.token_urlsafe(24)

        def answer(body: bytes) -> ForwardedAnswer:
            return asyncio.run(asker.forward(tick(), body, within_s))

        self._http = ThreadingHTTPServer((HOST, 0), _handler(self.key, answer))
        self._http.daemon_threads = True
        self._thread = threading.Thread(target=self._http.serve_forever, args=(0.1,), daemon=True, name="model-server")
        self._thread.start()

    @property
    def url(self) -> str:
        """The address, to which clients append `/chat/completions`."""
        return f"http://{HOST}:{self._http.server_address[1]}/v1"

    def close(self) -> None:
        """Stop serving."""
        self._http.shutdown()
        self._http.server_close()
        self._thread.join()


def _handler(key: str, answer: Callable[[bytes], ForwardedAnswer]) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        timeout = _WAIT_S

        def do_GET(self) -> None:
            """Answer the list of models, which some clients ask for."""
            if self._is_admitted():
                self._send(ForwardedAnswer(status=200, body=b'{"object":"list","data":[]}'))

        def do_POST(self) -> None:
            """Pass a chat request on."""
            size = self.headers.get("content-length", "")
            if not size.isascii() or not size.isdigit() or int(size) > MOST_BYTES:
                self.close_connection = True
                self._send(_error(413, "a request needs its length, and is at most 64 MiB"))
                return
            body = self.rfile.read(int(size))
            if not self._is_admitted():
                return
            if not self.path.rstrip("/").endswith("/chat/completions"):
                self._send(_error(404, f"`{self.path[:80]}` is not served: /v1/chat/completions alone is"))
                return
            answered = answer(body)
            self._send(answered, streamed=answered.status == 200 and _wants_stream(body))

        def _is_admitted(self) -> bool:
            token = self.headers.get("authorization", "").encode("latin-1", "replace")
            if hmac.compare_digest(token, f"Bearer {key}".encode()):
                return True
            self._send(_error(401, "the key of this server is missing: give its `key` to the client"))
            return False

        def _send(self, answered: ForwardedAnswer, *, streamed: bool = False) -> None:
            data = _events(answered.body) if streamed else answered.body
            try:
                self.send_response(answered.status)
                self.send_header("content-type", "text/event-stream" if streamed else "application/json")
                self.send_header("content-length", str(len(data)))
                self.end_headers()
                self.wfile.write(data)
            except OSError:  # the client has gone
                self.close_connection = True

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the name of the base class
            """Print nothing."""

    return Handler


def _error(status: int, reason: str) -> ForwardedAnswer:
    return ForwardedAnswer(status=status, body=msgspec.json.encode({"error": {"message": reason, "type": "lingjing"}}))


def _wants_stream(body: bytes) -> bool:
    class Streamed(msgspec.Struct):
        stream: bool | None = None

    try:
        return bool(from_json(body, Streamed).stream)
    except (msgspec.DecodeError, RecursionError):
        return False


def _events(body: bytes) -> bytes:
    """Return a completion as the events of a stream: one chunk with all of it, and the end."""
    completion = from_json(body)
    chunk = {**completion, "object": "chat.completion.chunk"}
    chunk["choices"] = [
        {"index": choice.get("index", 0), "delta": _delta(choice), "finish_reason": choice.get("finish_reason")}
        for choice in completion.get("choices", [])
    ]
    return b"data: " + msgspec.json.encode(chunk) + b"\n\ndata: [DONE]\n\n"


def _delta(choice: dict[str, dict[str, object]]) -> dict[str, object]:
    message = dict(choice.get("message", {}))
    calls = message.get("tool_calls")
    if isinstance(calls, list):
        message["tool_calls"] = [{"index": number, **call} for number, call in enumerate(calls)]
    return message
