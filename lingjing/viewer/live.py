"""What a server shows of an episode that is still played: its trace, read as it grows.

The run knows nothing of it: it writes its trace and never waits for anybody who looks on.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import msgspec

from lingjing.errors import UsageError
from lingjing.trace.following import TraceFollower
from lingjing.trace.reader import Trace
from lingjing.trace.writer import PART
from lingjing.viewer.narrated import CHUNK, Narration, packed, played_ground
from lingjing.viewer.steps import StepDetail, ViewStep

POLL_S = 0.3
"""How often the file is looked at."""

LEFT_S = 2.0
"""So long a trace must stand still and be written by nobody before its run counts as killed."""

QUIET_S = 15.0
"""So long without news, a sign of life is sent, by which a reader that has gone is noticed."""


class WaitingNote(msgspec.Struct, frozen=True):
    """There is no header yet: ask again."""

    waiting: bool = True


class LiveNews(msgspec.Struct, frozen=True):
    """Further steps and their details."""

    steps: list[ViewStep]
    details: list[StepDetail]


class ServedRun:
    """A growing trace for `lingjing.viewer.server`; `path` is the name that it gets at its end, or that with `.part`.

    Raises `UsageError` if a file is there already that is no trace.
    """

    source = packed({"kind": "server", "chunk": CHUNK})

    def __init__(self, path: Path, *, truth: bool) -> None:
        final = path.with_name(path.name.removesuffix(PART))
        self._follower = TraceFollower(final)
        self._truth = truth
        self._narration: Narration | None = None
        self._ground: bytes | None = None
        self._news = threading.Condition()
        self._building = threading.Lock()
        self._closed = threading.Event()
        self._still_since = time.monotonic()
        self._is_left = False
        self._read()
        self._thread = threading.Thread(target=self._follow_file, name="lingjing-follow", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Look at the file no more, and let go of those who wait for news."""
        self._closed.set()
        self._thread.join()
        with self._news:
            self._news.notify_all()

    def page_start(self) -> bytes:
        """Head, steps and, once the episode has ended, the ending."""
        with self._news:
            if self._narration is None:
                return packed(WaitingNote())
            return packed(self._narration.page_start(live=not self._has_ended()))

    def ground(self) -> bytes:
        """The city, built once."""
        with self._building:
            if self._ground is None:
                with self._news:
                    if self._narration is None:
                        raise UsageError("the episode has not begun")
                    trace, frame = self._narration.trace, self._narration.head.frame
                self._ground = packed(played_ground(trace, frame))
            return self._ground

    def details(self, chunk: int) -> bytes:
        """The details of one chunk of steps, as far as there are any."""
        with self._news:
            found = self._narration.details[chunk * CHUNK : (chunk + 1) * CHUNK] if self._narration else []
            if not found:
                raise UsageError(f"there is no chunk {chunk}")
            return packed(found)

    def picture(self, name: str) -> bytes:
        """The stored picture."""
        with self._news:
            if self._follower.trace is None:
                raise UsageError("the episode has not begun")
            trace: Trace = self._follower.trace
        return trace.jpeg(name)

    def follow(self, begin: int) -> Iterator[tuple[str, bytes]]:
        """Steps from `begin` on as they come, then the ending."""
        while not self._closed.is_set():
            with self._news:
                ended, told = self._has_ended(), self._narration
                if not ended and (told is None or len(told.steps) <= begin):
                    self._news.wait(QUIET_S)
                    ended, told = self._has_ended(), self._narration
                news = LiveNews(told.steps[begin:], told.details[begin:]) if told is not None else LiveNews([], [])
                begin += len(news.steps)
                data = packed(news)
                ending = packed(told.ending()) if ended and told is not None else b""
            yield ("steps", data) if news.steps else ("", b"")
            if ending:
                yield "ending", ending
                return

    # -- parts

    def _has_ended(self) -> bool:
        trace = self._follower.trace
        return self._is_left or (trace is not None and trace.outcome is not None)

    def _follow_file(self) -> None:
        while not self._closed.wait(POLL_S) and not self._has_ended():
            try:
                self._read()
            except UsageError:
                continue  # it is just being replaced; a file that stays wrong shows nothing more

    def _read(self) -> None:
        records = self._follower.more()
        now = time.monotonic()
        if records:
            self._still_since = now
        left = now - self._still_since >= LEFT_S and self._follower.is_left
        with self._news:
            self._is_left = left
            trace = self._follower.trace
            if trace is None:
                return
            if self._narration is None:
                self._narration = Narration(trace, self._truth)
            else:
                self._narration.trace = trace
                self._narration.take(records)
            if records or self._has_ended():
                self._news.notify_all()
