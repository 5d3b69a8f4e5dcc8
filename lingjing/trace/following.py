"""`TraceFollower`: a trace that is still written, read as far as it goes, again and again.

Only what has been added is read. The file may change its name from `trace.mcap.part` to `trace.mcap` in between.
"""

from __future__ import annotations

from pathlib import Path

from lingjing.errors import UsageError
from lingjing.trace.container import DeclaredChannels, is_being_written, scan_from
from lingjing.trace.reader import TOPICS_READ, FoundRecords, Trace
from lingjing.trace.records import BoundaryRecord
from lingjing.trace.topics import CAMERAS
from lingjing.trace.writer import part_path


class TraceFollower:
    """Follows the trace of one episode; `path` is the name that it gets at its end.

    `trace` is what has been read so far, None as long as there is no header.
    """

    def __init__(self, path: Path) -> None:
        self._final = path
        self._at = 0
        self._returned = 0
        self._channels = DeclaredChannels(TOPICS_READ)
        self._found: FoundRecords | None = None
        self.trace: Trace | None = None

    @property
    def is_left(self) -> bool:
        """Whether a trace has begun, has no end, and nobody writes it any more: its run was killed."""
        part = part_path(self._final)
        return self.trace is not None and self.trace.outcome is None and part.is_file() and not is_being_written(part)

    def more(self) -> tuple[BoundaryRecord, ...]:
        """The boundaries that have been added. Raises `UsageError` if the file cannot be read by this version."""
        path = next((one for one in (part_path(self._final), self._final) if one.is_file()), None)
        if path is None:
            return ()
        found = self._found = self._found or FoundRecords(path)
        found.lies_at(path)
        before = self._at
        try:
            for stored, after in scan_from(path, self._at, self._channels, passed_over=CAMERAS):
                found.take(stored)
                self._at = after
        except UsageError:
            if path.is_file() and path.stat().st_size > 0 and before == 0 and found.header is None:
                raise
            return ()  # it is just being renamed or begun
        if found.header is not None and (self.trace is None or self._at != before or self.trace.path != path):
            self.trace = found.trace()
        fresh = tuple(found.boundaries[self._returned :])  # those that a renaming kept back the last time, too
        self._returned = len(found.boundaries)
        return fresh
