"""The occurrences of a mission's events, read back from the records of a trace."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from lingjing.mission.schedule import OCCURRED, UNDONE, Occurrence
from lingjing.trace.records import BoundaryRecord


def recorded_occurrences(records: Iterable[BoundaryRecord], before: int) -> tuple[Occurrence, ...]:
    """Return the occurrences of events with a condition before boundary `before`, without the values that they set.

    The values are in the recorded states. Timed events leave no mark, because every schedule knows them.
    """
    occurrences: dict[tuple[str, int], Occurrence] = {}
    latest: dict[str, int] = {}
    for record in records:
        if record.tick >= before:
            break
        for event in record.task_events:
            if event.name and event.kind == OCCURRED:
                occurrences[event.name, record.tick] = Occurrence(event.name, record.tick)
                latest[event.name] = record.tick
            elif event.name and event.kind == UNDONE:
                key = event.name, latest[event.name]
                occurrences[key] = msgspec.structs.replace(occurrences[key], undone=record.tick)
    return tuple(occurrences.values())
