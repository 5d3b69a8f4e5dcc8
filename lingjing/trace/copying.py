"""Copies of traces under another header: `copy_trace`, and `picture_parts`, a stored picture to be stored again."""

from __future__ import annotations

from pathlib import Path

from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import Header
from lingjing.trace.surroundings import NO_SURROUNDINGS, Surroundings
from lingjing.trace.writer import PictureParts, TraceWriter


def copy_trace(
    trace: Trace, header: Header, path: Path, surroundings: Surroundings = NO_SURROUNDINGS
) -> Trace:  # fmt: skip
    """The trace with all its boundaries, pictures and its outcome in a new file that begins with `header`, sealed anew.
    Viewers are shown the city in it only if its `surroundings` are given.

    Raises `UsageError` if `path` is there already or cannot be written.
    """
    with TraceWriter(path, header, surroundings=surroundings) as writer:
        for record in trace.boundaries:
            writer.boundary(record, [picture_parts(trace, frame.id) for frame in record.frames])
        if trace.complete and trace.outcome is not None:
            return read_trace(writer.finish(trace.outcome))
        return read_trace(writer.abandon(trace.outcome))


def picture_parts(trace: Trace, frame_id: str) -> PictureParts:
    """A picture as `TraceWriter.boundary` takes it, its JPEG byte for byte. Raises what `Trace.picture` raises."""
    picture = trace.picture(frame_id)
    return picture.info, trace.jpeg(frame_id), picture.depth, picture.semantic
