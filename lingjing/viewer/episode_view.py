"""The records of an episode without the truth: without undiscovered hidden targets and without true boxes."""

from __future__ import annotations

import msgspec

from lingjing.mission.instance import Entity, Instance
from lingjing.trace.records import BoundaryRecord, FrameInfo, Snapshot
from lingjing.viewer.state import EpisodeState


class EpisodeView:
    """The visible part of one episode's records. Boundaries must be passed in order. With `truth`, all is visible."""

    def __init__(self, instance: Instance, *, truth: bool) -> None:
        self._state = EpisodeState(instance, truth=truth)
        self.truth = truth
        hidden = (entity for entity in instance.entities if not self._is_visible(entity))
        self.hidden = {} if truth else {entity.id: entity for entity in hidden}
        """The entities that are not visible yet, by id."""

    def take(self, record: BoundaryRecord) -> tuple[BoundaryRecord, tuple[Entity, ...]]:
        """Return the visible part of the next boundary, and the hidden targets that are visible from it on."""
        self._state.take(record)
        if self.truth:
            return record, ()
        revealed = tuple(entity for entity in self.hidden.values() if self._is_visible(entity))
        for entity in revealed:
            del self.hidden[entity.id]
        visible = msgspec.structs.replace(
            record,
            snapshots=tuple(self._snapshot(snapshot) for snapshot in record.snapshots),
            frames=tuple(_without_truth(frame) for frame in record.frames),
            task_events=tuple(self._state.visible_event(event) for event in record.task_events),
        )
        return visible, revealed

    def _is_visible(self, entity: Entity) -> bool:
        return entity.role != "target" or self._state.sight(entity) is not None

    def _snapshot(self, snapshot: Snapshot) -> Snapshot:
        states = tuple(state for state in snapshot.states if state.id not in self.hidden)
        return msgspec.structs.replace(snapshot, states=states)


def _without_truth(frame: FrameInfo) -> FrameInfo:
    """Return a picture without its true boxes."""
    return msgspec.structs.replace(frame, boxes=(), faint=())
