"""Copies of traces under another header."""

from __future__ import annotations

from pathlib import Path

from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import Header
from lingjing.trace.surroundings import NO_SURROUNDINGS, Surroundings
from lingjing.trace.writer import PictureParts, TraceWriter


def copy_trace(
    trace: Trace, header: Header, path: Path, surroundings: Surroundings = NO_SURROUNDINGS
) -> Trace:  # fmt: skip
    """Copy a trace to a new file that begins with `header`, and return the copy.

    Boundaries, pictures and the outcome are copied; the file is sealed anew. The city is included for viewers only if
    `surroundings` holds it. Raises `UsageError` if `path` exists or cannot be written.
    """
    with TraceWriter(path, header, surroundings=surroundings) as writer:
        for record in trace.boundaries:
            writer.engine_frames([frame for frame in trace.engine_frames if frame.tick == record.tick])
            writer.boundary(record, [picture_parts(trace, frame.id) for frame in record.frames])
        if trace.complete and trace.outcome is not None:
            return read_trace(writer.finish(trace.outcome))
        return read_trace(writer.abandon(trace.outcome))


def picture_parts(trace: Trace, frame_id: str) -> PictureParts:
    """Return a stored picture as input for `TraceWriter.boundary`, with its JPEG unchanged.

    Raises the errors of `Trace.picture`.
    """
    picture = trace.picture(frame_id)
    return picture.info, trace.jpeg(frame_id), picture.depth, picture.semantic, picture.instance
