"""Traces of chosen records, for tests of what reads traces; `TraceWriter` writes one with pictures, step by step."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from lingjing.decoding import from_json
from lingjing.mission.instance import Instance
from lingjing.trace.container import scan
from lingjing.trace.digest import START, last_digest, next_digest, next_frames_digest, verify
from lingjing.trace.encoding import to_json
from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import AgentBinding, BoundaryRecord, Header, Outcome
from lingjing.trace.writer import TraceWriter, part_path

__all__ = [
    "START", "TraceWriter", "from_json", "header_of", "last_digest", "next_digest", "next_frames_digest",
    "outcome_of", "part_path", "scan", "to_json", "verify", "write_trace",
]  # fmt: skip


def header_of(instance: Instance, policy: str = "heuristic") -> Header:
    """Return the header of a trace of an instance; all agents have one policy."""
    bindings = tuple(AgentBinding(agent=agent.id, policy=policy) for agent in instance.agents)
    return Header(instance=instance, bindings=bindings, fingerprint={"cpu": "test"})


def outcome_of(records: Sequence[BoundaryRecord], *, success: bool | None = None, wall_s: float = 12.5) -> Outcome:
    """Return the outcome of an episode with these boundaries: score and digests of the last one.

    `success` is True for a won episode, None for one that is won if its last boundary ends it.
    """
    frames = START
    for record in records:
        frames = next_frames_digest(frames, record.frames)
    last = records[-1]
    won = last.done if success is None else success
    return Outcome(
        success=won,
        reason="success" if won else "budget",
        scr=last.scr,
        score=last.reward,
        ticks=last.tick,
        digest=last.digest,
        frames_digest=frames,
        wall_s=wall_s,
    )


def write_trace(path: Path, header: Header, records: Iterable[BoundaryRecord], *, finish: bool = True) -> Trace:
    """Write records as a trace without pictures, and read it. Its folder is created.

    With `finish=False`, or without a record, the trace is that of an episode that broke off.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    written = list(records)
    writer = TraceWriter(path, header)
    for record in written:
        writer.boundary(record)
    return read_trace(writer.finish(outcome_of(written)) if finish and written else writer.abandon())


__all__ = ["TraceWriter", "header_of", "outcome_of", "write_trace"]
