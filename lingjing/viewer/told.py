"""The records of an episode as a watcher may know them: without hidden targets that nobody has found and true boxes."""

from __future__ import annotations

import msgspec

from lingjing.mission.instance import Entity, Instance
from lingjing.trace.records import BoundaryRecord, FrameInfo, Snapshot
from lingjing.viewer.state import Watched


class ToldEpisode:
    """Takes the boundaries of one episode in order. With `truth` everything is told."""

    def __init__(self, instance: Instance, *, truth: bool) -> None:
        self.watched = Watched(instance, truth=truth)
        self.truth = truth
        self.hidden = {} if truth else {one.id: one for one in instance.entities if not self._seen(one)}
        """What may not be told yet, by id."""

    def take(self, record: BoundaryRecord) -> tuple[BoundaryRecord, tuple[Entity, ...]]:
        """The boundary as it may be told, and the hidden targets that may be shown from it on."""
        self.watched.take(record)
        if self.truth:
            return record, ()
        found = tuple(one for one in self.hidden.values() if self._seen(one))
        for one in found:
            del self.hidden[one.id]
        replace = msgspec.structs.replace
        return replace(
            record,
            snapshots=tuple(self._snapshot(one) for one in record.snapshots),
            frames=tuple(seen_frame(one) for one in record.frames),
            task_events=tuple(self.watched.told(one) for one in record.task_events),
        ), found

    def _seen(self, entity: Entity) -> bool:
        return entity.role != "target" or self.watched.sight(entity) is not None

    def _snapshot(self, snapshot: Snapshot) -> Snapshot:
        states = tuple(state for state in snapshot.states if state.id not in self.hidden)
        return msgspec.structs.replace(snapshot, states=states)


def seen_frame(frame: FrameInfo) -> FrameInfo:
    """A picture without what was truly in it."""
    return msgspec.structs.replace(frame, boxes=(), faint=())
