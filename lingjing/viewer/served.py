"""What a server shows of a finished trace. Everything is made once, when it is first asked for."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from functools import cached_property

from lingjing.errors import UsageError
from lingjing.trace.reader import Trace
from lingjing.viewer.narrated import CHUNK, Narration, packed


class ServedTrace:
    """A trace for `lingjing.viewer.server`; with `truth` hidden things are shown."""

    source = packed({"kind": "server", "chunk": CHUNK})

    def __init__(self, trace: Trace, *, truth: bool) -> None:
        self._trace = trace
        self._truth = truth
        self._lock = threading.Lock()

    def page_start(self) -> bytes:
        """Head, steps and ending."""
        with self._lock:
            return self._telling

    def ground(self) -> bytes:
        """The city."""
        with self._lock:
            return self._ground

    def details(self, chunk: int) -> bytes:
        """The details of one chunk of steps."""
        with self._lock:
            details = self._narration.details[chunk * CHUNK : (chunk + 1) * CHUNK]
        if not details:
            raise UsageError(f"there is no chunk {chunk}")
        return packed(details)

    def picture(self, name: str) -> bytes:
        """The stored picture."""
        return self._trace.jpeg(name)

    def follow(self, begin: int) -> Iterator[tuple[str, bytes]]:
        """Nothing comes after the end."""
        yield from ()

    # -- parts

    @cached_property
    def _narration(self) -> Narration:
        return Narration(self._trace, self._truth)

    @cached_property
    def _telling(self) -> bytes:
        return packed(self._narration.page_start())

    @cached_property
    def _ground(self) -> bytes:
        return packed(self._narration.ground())
