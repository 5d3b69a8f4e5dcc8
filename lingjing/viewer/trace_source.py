"""The content for a server from a finished trace. Each part is computed once, at its first request."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import closing
from functools import cached_property

from lingjing.errors import UsageError
from lingjing.trace.call_store import CallReader, calls_of
from lingjing.trace.reader import Trace
from lingjing.viewer.calls_page import calls_page
from lingjing.viewer.page_content import CHUNK, PageContent, page_json


class TraceSource:
    """The content of a trace for `lingjing.viewer.server`. With `truth`, it contains hidden targets and true boxes."""

    def __init__(self, trace: Trace, *, truth: bool) -> None:
        self.source = page_json({"kind": "server", "chunk": CHUNK, "calls": calls_of(trace.path) is not None})
        self._trace = trace
        self._truth = truth
        self._lock = threading.Lock()

    def page_start(self) -> bytes:
        """Return head, steps and ending."""
        with self._lock:
            return self._page_start

    def ground(self) -> bytes:
        """Return the ground."""
        with self._lock:
            return self._ground

    def details(self, chunk: int) -> bytes:
        """Return the details of one chunk of steps. Raises `UsageError` if there is no such chunk."""
        with self._lock:
            details = self._content.details[chunk * CHUNK : (chunk + 1) * CHUNK]
        if not details:
            raise UsageError(f"there is no chunk {chunk}")
        return page_json(details)

    def picture(self, name: str) -> bytes:
        """Return a stored picture as JPEG. Raises `UsageError` if there is no such picture."""
        return self._trace.jpeg(name)

    def calls(self) -> bytes:
        """Return the page of model calls. Raises `UsageError` if the trace has no record of them."""
        with self._lock:
            return self._calls

    def follow(self, begin: int) -> Iterator[tuple[str, bytes]]:
        """Yield nothing, because a finished trace gets no further steps."""
        yield from ()

    # -- parts

    @cached_property
    def _content(self) -> PageContent:
        return PageContent(self._trace, self._truth)

    @cached_property
    def _page_start(self) -> bytes:
        return page_json(self._content.page_start())

    @cached_property
    def _calls(self) -> bytes:
        record = calls_of(self._trace.path)
        if record is None:
            raise UsageError("the trace has no record of model calls beside it")
        with closing(CallReader(record)) as reader:
            return calls_page(reader, self._trace, served=True).encode()

    @cached_property
    def _ground(self) -> bytes:
        return page_json(self._content.ground())
