"""One connection of a foreign engine: its key, the frames that wait to be sent, and its end."""

from __future__ import annotations

import re
import threading
from collections import deque
from typing import Any

import msgspec

from lingjing.decoding import from_json
from lingjing.engines.remote.messages import Document

USER_TYPES = ("LJ-ENGINE", "LJ-UE", "LJ-CREW")
"""The user types of the protocol."""
_PATH = re.compile(r"/ws/([A-Za-z-]{1,20})/([A-Za-z0-9_.-]{1,64})/?")
_MOST_RELAYED = 2**20
"""Most unread bytes of a session beside which relays of other sessions are still added. Chosen."""
_MOST_UNSENT = 64 * 2**20
"""Most bytes that wait for a session that does not read; beyond them it is closed. Chosen."""
POLICY_VIOLATION = 1008
"""The close code of the protocol for sessions that are not admitted (RFC 6455)."""


def key_of(path: str) -> tuple[str, str] | None:
    """Return (user type, address) of the path of a session; None if it is none."""
    match = _PATH.fullmatch(path)
    return (match[1], match[2]) if match is not None and match[1] in USER_TYPES else None


def system(content: object) -> bytes:
    """Return a SYSTEM frame."""
    return msgspec.json.encode({"type": "SYSTEM", "data": content})


class Session:
    """An open connection. `send` never waits for the client: a thread of the session writes."""

    def __init__(self, connection: Any, user_type: str, address: str) -> None:
        self.connection = connection
        self.user_type, self.address = user_type, address
        self.lost = ""
        """The reason of the end; "" while the session is open."""
        self.scene = ""
        """The task of the scene that the session has subscribed to; "" without one."""
        self.broken = 0
        """Number of frames that were no messages."""
        self._unsent: deque[str] = deque()
        self._unsent_bytes = 0
        self._news = threading.Condition()
        self._ends = False

    @property
    def key(self) -> str:
        """The session key: `LJ-ENGINE_airsim`."""
        return f"{self.user_type}_{self.address}"

    @property
    def server_address(self) -> str:
        """The address and port at which the client has reached this server: the header `Host` of its handshake."""
        return str(self.connection.request.headers["Host"])

    def hello(self) -> None:
        """Send the first frame of the protocol."""
        self.send(system({"code": 0, "message": f"Hello,{self.address}"}))

    def tell(self, text: str) -> None:
        """Send a sentence as a SYSTEM frame."""
        self.send(system(text))

    def send(self, frame: bytes) -> None:
        """Queue a frame."""
        with self._news:
            if self._ends:
                return
            if self._unsent_bytes > _MOST_UNSENT:
                self.lost = self.lost or "it does not read its frames"
                self._ends = True
                self._unsent.clear()
            else:
                self._unsent.append(frame.decode())
                self._unsent_bytes += len(frame)
            self._news.notify()

    def relay(self, frame: bytes) -> None:
        """Queue a frame of another session, unless this one has much to read already: a flood must not end it."""
        if self._unsent_bytes <= _MOST_RELAYED:
            self.send(frame)

    def finish(self) -> None:
        """Close the connection after the frames that wait."""
        with self._news:
            self._ends = True
            self._news.notify()

    def write(self) -> None:
        """Write frames until the session ends: the work of its second thread."""
        from websockets.exceptions import ConnectionClosed

        try:
            while (text := self._next()) is not None:
                self.connection.send(text)
            self.connection.close(POLICY_VIOLATION if self.lost else 1000, self.lost[:100])
        except (ConnectionClosed, OSError):
            pass  # the client has closed it; the reading thread reports this

    def _next(self) -> str | None:
        with self._news:
            self._news.wait_for(lambda: self._unsent or self._ends)
            if not self._unsent:
                return None
            text = self._unsent.popleft()
            self._unsent_bytes -= len(text)
            return text


def read_message(text: object) -> Document | str:
    """Return the message of a frame, or the fault as text."""
    if not isinstance(text, str):
        return "a frame is text, not bytes"
    try:
        message = from_json(text)
    except (msgspec.DecodeError, RecursionError, UnicodeError) as error:
        return f"a frame is one JSON object: {error}"[:200]
    return message if isinstance(message, dict) else "a frame is one JSON object"
