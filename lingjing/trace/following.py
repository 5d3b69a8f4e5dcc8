"""Incremental reading of a trace that is still being written.

Each call reads only the bytes that were added. The file may change its name from `trace.mcap.part` to `trace.mcap`
between two calls.
"""

from __future__ import annotations

from pathlib import Path

from lingjing.errors import UsageError
from lingjing.trace.container import DeclaredChannels, is_being_written, scan_from
from lingjing.trace.reader import TOPICS_READ, Trace, TraceBuilder
from lingjing.trace.records import BoundaryRecord
from lingjing.trace.topics import CAMERAS
from lingjing.trace.writer import part_path


class TraceFollower:
    """Incremental reader of one trace. `path` is the final name of the file."""

    def __init__(self, path: Path) -> None:
        self._final = path
        self._at = 0
        self._returned = 0
        self._channels = DeclaredChannels(TOPICS_READ)
        self._records: TraceBuilder | None = None
        self.trace: Trace | None = None
        """The trace as far as it was read. None until there is a header."""

    @property
    def is_left(self) -> bool:
        """True if the trace has begun, has no outcome, and no process writes it any more: its run was killed."""
        part = part_path(self._final)
        return self.trace is not None and self.trace.outcome is None and part.is_file() and not is_being_written(part)

    def more(self) -> tuple[BoundaryRecord, ...]:
        """Return the boundaries added since the last call. Raises `UsageError` if this version cannot read the file."""
        path = next((name for name in (part_path(self._final), self._final) if name.is_file()), None)
        if path is None:
            return ()
        records = self._records = self._records or TraceBuilder(path)
        records.lies_at(path)
        before = self._at
        try:
            for stored, after in scan_from(path, self._at, self._channels, passed_over=CAMERAS):
                records.take(stored)
                self._at = after
        except UsageError:
            if path.is_file() and path.stat().st_size > 0 and before == 0 and records.header is None:
                raise
            return ()  # the file is just being created or renamed
        if records.header is not None and (self.trace is None or self._at != before or self.trace.path != path):
            self.trace = records.trace()
        fresh = tuple(records.boundaries[self._returned :])  # includes those read in a call that a renaming ended
        self._returned = len(records.boundaries)
        return fresh
