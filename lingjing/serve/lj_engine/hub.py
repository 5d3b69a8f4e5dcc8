"""The sessions of one server, the links of engines to them, and the record of all frames."""

from __future__ import annotations

import threading
import time
import uuid
from collections import deque
from collections.abc import Sequence
from typing import Literal

import msgspec

from lingjing.engines.remote.link import Exchange, Request
from lingjing.engines.remote.messages import (
    READY,
    SUBSCRIBE,
    TELEMETRY,
    UNSUBSCRIBE,
    Document,
    command_data,
    command_type,
    request_id_of,
    result_of,
    task_of,
)
from lingjing.errors import InfrastructureError
from lingjing.serve.lj_engine.sessions import Session, read_message
from lingjing.serve.lj_engine.uploads import AwaitedPictures, Upload
from lingjing.trace.records import EngineFrame

MOST_EVENTS = 100
"""Most unread events of a link, as in the paper's system; older ones are dropped."""
MOST_BROKEN = 20
"""Frames that are no messages, or answer nothing, after which a session is closed (chosen)."""
MOST_DROPPED = 2000
"""Most dropped frames of an episode that are recorded (chosen)."""
_CUT = 1000
"""Letters of a dropped frame that are recorded."""
_LONGEST_KIND = 40
"""Letters of the kind of an event that are kept."""
_EXPIRED = 4096
"""Expired requests that are remembered, so that a late answer is known as one."""
_RELAYS = {"sendToUE": "LJ-UE", "sendToEngine": "LJ-ENGINE", "sendCommandToUE": "LJ-UE"}

Use = Literal["request", "reply", "event", "late", "unknown", "broken", "notice", "upload"]


class _Arrived(msgspec.Struct, frozen=True):
    """A frame that has arrived and was not read by an engine."""

    text: str
    message: Document
    wall_s: float


class Hub:
    """The state that the threads of connections share with the episode's thread. Its methods are thread-safe."""

    def __init__(self, task_id: str) -> None:
        self.task_id = task_id
        self.pictures = AwaitedPictures()
        self.news = threading.Condition()
        self.sessions: dict[str, Session] = {}
        self.held: frozenset[str] = frozenset()
        """Keys of sessions that own bodies of the running episode: no other connection takes their place."""
        self._links: list[LiveLink] = []
        self._began = time.monotonic()
        self._frames: list[EngineFrame] = []
        self._count = self._dropped = 0

    # -- sessions

    def join(self, session: Session) -> str:
        """Add a session. An earlier session with its key is closed. Returns the reason of a refusal, or ""."""
        with self.news:
            earlier = self.sessions.get(session.key)
            if earlier is not None and session.key in self.held and not earlier.lost:
                return f"{session.key} is connected and plays an episode; its session stays"
            self.sessions[session.key] = session
            session.hello()
            if earlier is not None:
                earlier.tell(f"another connection as {session.key} has taken the place of this one")
                earlier.lost = earlier.lost or "another connection took its place"
                earlier.finish()
            self.news.notify_all()
        return ""

    def leave(self, session: Session, reason: str) -> None:
        """Mark a session as lost."""
        with self.news:
            session.lost = session.lost or reason
            if self.sessions.get(session.key) is session and session.key not in self.held:
                del self.sessions[session.key]
            self.news.notify_all()

    def hold(self, keys: frozenset[str]) -> None:
        """Reserve the sessions of an episode."""
        with self.news:
            self.held = keys

    def open_keys(self) -> tuple[str, ...]:
        """Return the keys of open sessions, in the order of their connection."""
        with self.news:
            return tuple(key for key, session in self.sessions.items() if not session.lost)

    def link(self, engine: str, key: str, *, paced: bool) -> LiveLink:
        """Return a link of an engine to the session `key`. `paced`: mission time passes as fast as wall-clock time."""
        with self.news:
            session = self.sessions.get(key)
            if session is None:
                raise InfrastructureError(f"the session {key} was lost before the episode began")
            link = LiveLink(self, engine, session, paced=paced)
            self._links.append(link)
            return link

    # -- frames

    def receive(self, session: Session, text: object) -> None:
        """Take over a frame of a session: a reply, an event, a relay, or nothing that is known."""
        message = read_message(text)
        with self.news:
            if isinstance(message, str):
                self._refuse(session, "broken", str(text), message)
                return
            assert isinstance(text, str)
            arrived = _Arrived(text, message, time.monotonic() - self._began)
            if request := request_id_of(message):
                self._reply(session, request, arrived)
            elif (kind := command_type(message)) in (SUBSCRIBE, UNSUBSCRIBE):
                session.scene = task_of(message) if kind == SUBSCRIBE else ""
                self._drop("event", session, text, arrived.wall_s)
            elif kind in _RELAYS or isinstance(message.get("receiver"), str):
                self._relay(session, kind, message)
                self._drop("event", session, text, arrived.wall_s)
            else:
                self._event(session, arrived)
            self.news.notify_all()

    def upload(self, upload: Upload) -> None:
        """Take over a picture. Raises `UploadError`."""
        self.pictures.arrive(upload)
        text = msgspec.json.encode({"fields": upload.fields, "sha256": upload.sha256}).decode()
        with self.news:
            self.note("upload", "", "http", text, time.monotonic() - self._began)

    def send(
        self, session: Session, frame: bytes, use: Use = "notice", engine: str = "", exchange: int = -1, slot: int = -1
    ) -> None:
        """Send a frame and record it. With a slot it belongs to an exchange."""
        with self.news:
            self.note(use, engine, session.key, frame.decode(), self.now(), exchange, slot)
            session.send(frame)

    def note(
        self, use: Use, engine: str, session: str, text: str, wall_s: float, exchange: int = -1, slot: int = -1
    ) -> None:
        """Record a frame."""
        frame = EngineFrame(
            number=self._count, tick=0, engine=engine, session=session, exchange=exchange, use=use, slot=slot,
            text=text, wall_s=round(wall_s, 6),
        )  # fmt: skip
        self._count += 1
        self._frames.append(frame)

    def take_frames(self, tick: int) -> tuple[EngineFrame, ...]:
        """Return the frames since the last call, as those before boundary `tick`."""
        with self.news:
            frames, self._frames = self._frames, []
        return tuple(msgspec.structs.replace(frame, tick=tick) for frame in frames)

    def now(self) -> float:
        """Return the wall-clock seconds since the server began."""
        return time.monotonic() - self._began

    def _reply(self, session: Session, request: str, arrived: _Arrived) -> None:
        for link in self._links:
            if link.session is session and (verdict := link.reply(request, arrived)):
                if verdict == "late":
                    self._drop("late", session, arrived.text, arrived.wall_s)
                return
        self._refuse(session, "unknown", arrived.text, f"no request has the id {request[:60]}")

    def _event(self, session: Session, arrived: _Arrived) -> None:
        links = [link for link in self._links if link.session is session]
        for link in links:
            for dropped in link.add_event(arrived):
                self._drop("late", session, dropped.text, dropped.wall_s)
        if not links:
            self._drop("event", session, arrived.text, arrived.wall_s)

    def _relay(self, session: Session, kind: str, message: Document) -> None:
        receiver = _RELAYS.get(kind) or str(message.get("receiver"))
        content = message.get("data", message)
        frame = msgspec.json.encode({"type": "DATA", "data": content})
        for other in self.sessions.values():
            if other is not session and other.user_type == receiver:
                other.relay(frame)

    def _refuse(self, session: Session, use: Use, text: str, reason: str) -> None:
        self._drop(use, session, text, self.now())
        session.broken += 1
        session.tell(reason)
        if session.broken >= MOST_BROKEN:
            session.lost = session.lost or f"{MOST_BROKEN} of its frames were refused"
            session.finish()

    def _drop(self, use: Use, session: Session, text: str, wall_s: float) -> None:
        """Record a frame that no engine reads. Past a limit it is only counted."""
        self._dropped += 1
        if self._dropped <= MOST_DROPPED:
            self.note(use, "", session.key, text[:_CUT], wall_s)


class LiveLink:
    """The link of one engine to an open session; see `lingjing.engines.remote.link.Link`."""

    def __init__(self, hub: Hub, engine: str, session: Session, *, paced: bool) -> None:
        self.session = session
        self._hub, self._engine, self._paced = hub, engine, paced
        self._next = 0
        self._pending: dict[str, int] = {}
        """The slot of each open request."""
        self._expired: deque[str] = deque(maxlen=_EXPIRED)
        self._replies: dict[int, _Arrived] = {}
        self._events: deque[_Arrived] = deque()
        self._paced_from: float | None = None
        self._kinds: set[str] = set()
        """The kinds of events that have arrived."""

    @property
    def task_id(self) -> str:
        """The id of the episode on the wire."""
        return self._hub.task_id

    def exchange(self, requests: Sequence[Request], deadline_s: float) -> Exchange:
        """Send requests and wait for their replies. Raises `InfrastructureError` if the session is lost."""
        number, self._next = self._next, self._next + 1
        hub = self._hub
        with hub.news:
            self._check_open()
            self._replies = {}
            for slot, request in enumerate(requests):
                identity = str(uuid.uuid4()) if request.wants_reply else ""
                if identity:
                    self._pending[identity] = slot
                frame = msgspec.json.encode(command_data(request.command, hub.task_id, request.fields, identity))
                hub.send(self.session, frame, "request" if identity else "notice", self._engine, number, slot)
            if self._pending:
                hub.news.wait_for(lambda: not self._pending or bool(self.session.lost), deadline_s)
            self._expired.extend(self._pending)
            self._pending.clear()
            replies: list[Document | None] = [None] * len(requests)
            for slot, arrived in sorted(self._replies.items()):
                hub.note("reply", self._engine, self.session.key, arrived.text, arrived.wall_s, number, slot)
                replies[slot] = result_of(arrived.message)
            events = tuple(self._events)
            self._events.clear()
            for event in events:
                hub.note("event", self._engine, self.session.key, event.text, event.wall_s, number)
            if None in replies:
                self._check_open()
        return Exchange(tuple(replies), tuple(event.message for event in events))

    def wait(self, event: str, deadline_s: float) -> None:
        """Wait until an event of this kind has arrived. `isReady` may have no `commandType`."""

        def has_come() -> bool:
            return event in self._kinds

        with self._hub.news:
            self._hub.news.wait_for(lambda: has_come() or bool(self.session.lost), deadline_s)
            self._check_open()

    def pause(self, until_s: float) -> None:
        """Wait until this mission time has passed on the wall clock, if the episode is paced."""
        if not self._paced:
            return
        now = time.monotonic()
        if self._paced_from is None:
            self._paced_from = now
        left = self._paced_from + until_s - now
        if left > 0.0:
            with self._hub.news:
                self._hub.news.wait_for(lambda: bool(self.session.lost), left)

    def reply(self, request: str, arrived: _Arrived) -> Literal["taken", "late", ""]:
        """Take a reply over. Returns "" if this link has sent no such request."""
        if request in self._pending:
            self._replies[self._pending.pop(request)] = arrived
            return "taken"
        return "late" if request in self._expired else ""

    def add_event(self, arrived: _Arrived) -> list[_Arrived]:
        """Queue an event. Returns the events that it drops: older telemetry, or the oldest beyond the limit."""
        dropped: list[_Arrived] = []
        if len(self._kinds) < MOST_EVENTS:
            self._kinds.add(READY if READY in arrived.message else command_type(arrived.message)[:_LONGEST_KIND])
        if command_type(arrived.message) == TELEMETRY:
            dropped = [event for event in self._events if command_type(event.message) == TELEMETRY]
            for event in dropped:
                self._events.remove(event)
        self._events.append(arrived)
        while len(self._events) > MOST_EVENTS:
            dropped.append(self._events.popleft())
        return dropped

    def _check_open(self) -> None:
        if self.session.lost:
            raise InfrastructureError(
                f"the session {self.session.key} was lost: {self.session.lost}",
                hint="connect the engine again and start a new episode",
            )
