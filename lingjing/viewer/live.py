"""The content for a server from a running episode: its trace, read as it grows.

The run is not affected. It writes its trace and never waits for a reader.
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
from lingjing.viewer.page_content import CHUNK, PageContent, ground_of_trace, page_json
from lingjing.viewer.steps import StepDetail, ViewStep

POLL_S = 0.3
"""Interval of reading the file, seconds. Chosen."""

LEFT_S = 2.0
"""Time, seconds, after which a trace that no process writes and that does not grow counts as that of a killed run.
Chosen."""

QUIET_S = 15.0
"""Longest time without an event, seconds. Then an empty event is sent, which fails if the connection is closed.
Chosen."""


class _WaitingNote(msgspec.Struct, frozen=True):
    """The answer while there is no header yet. The page then repeats its request."""

    waiting: bool = True


class _LiveNews(msgspec.Struct, frozen=True):
    """Further steps and their details."""

    steps: list[ViewStep]
    details: list[StepDetail]


class LiveSource:
    """The content of a growing trace for `lingjing.viewer.server`.

    `path` is the final name of the trace, or this name with `.part`. Raises `UsageError` if an existing file is no
    trace.
    """

    source = page_json({"kind": "server", "chunk": CHUNK})

    def __init__(self, path: Path, *, truth: bool) -> None:
        final = path.with_name(path.name.removesuffix(PART))
        self._follower = TraceFollower(final)
        self._truth = truth
        self._content: PageContent | None = None
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
        """Stop reading the file, and end all calls of `follow`."""
        self._closed.set()
        self._thread.join()
        with self._news:
            self._news.notify_all()

    def page_start(self) -> bytes:
        """Return head, steps and, after the end of the episode, the ending."""
        with self._news:
            if self._content is None:
                return page_json(_WaitingNote())
            return page_json(self._content.page_start(live=not self._has_ended()))

    def ground(self) -> bytes:
        """Return the ground. It is computed once."""
        with self._building:
            if self._ground is None:
                with self._news:
                    if self._content is None:
                        raise UsageError("the episode has not begun")
                    trace, frame = self._content.trace, self._content.head.frame
                self._ground = page_json(ground_of_trace(trace, frame))
            return self._ground

    def details(self, chunk: int) -> bytes:
        """Return the details of one chunk of steps, as far as they exist."""
        with self._news:
            details = self._content.details[chunk * CHUNK : (chunk + 1) * CHUNK] if self._content else []
            if not details:
                raise UsageError(f"there is no chunk {chunk}")
            return page_json(details)

    def picture(self, name: str) -> bytes:
        """Return a stored picture as JPEG."""
        with self._news:
            if self._follower.trace is None:
                raise UsageError("the episode has not begun")
            trace: Trace = self._follower.trace
        return trace.jpeg(name)

    def calls(self) -> bytes:
        """Raise `UsageError`: the record of an episode is shown when it has ended."""
        raise UsageError("the model calls of a running episode are shown when it has ended")

    def follow(self, begin: int) -> Iterator[tuple[str, bytes]]:
        """Yield the steps from `begin` on when they exist, then the ending."""
        while not self._closed.is_set():
            with self._news:
                ended, content = self._has_ended(), self._content
                if not ended and (content is None or len(content.steps) <= begin):
                    self._news.wait(QUIET_S)
                    ended, content = self._has_ended(), self._content
                news = _LiveNews(content.steps[begin:], content.details[begin:]) if content else _LiveNews([], [])
                begin += len(news.steps)
                data = page_json(news)
                ending = page_json(content.ending()) if ended and content is not None else b""
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
                continue  # the file is just being renamed; a file that stays invalid adds no steps

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
            if self._content is None:
                self._content = PageContent(trace, self._truth)
            else:
                self._content.trace = trace
                self._content.take(records)
            if records or self._has_ended():
                self._news.notify_all()
