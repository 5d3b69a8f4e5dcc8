"""Public events, each counted once, and lookups in an observation."""

from __future__ import annotations

from lingjing.plugins.policy import EntityView, EventView, Observation


class EventLog:
    """The events that have been received.

    One occurrence may be reported as a task event and as an adjudicated event (`serve`, then `served`). Only the first
    of the two kinds counts.
    """

    def __init__(self, stem: str = "rescue") -> None:
        self._stem = stem
        self._signal: str | None = None
        self._seen: set[str] = set()
        self.rescues = 0

    def fresh_rescues(self, events: tuple[EventView, ...]) -> int:
        """Return the number of new rescues in these events."""
        before = self.rescues
        for event in events:
            if event.id in self._seen:
                continue
            self._seen.add(event.id)
            self._count(event.kind)
        return self.rescues - before

    def _count(self, kind: str) -> None:
        if not self._stem or not kind.startswith(self._stem):
            return
        self._signal = self._signal or kind
        if kind == self._signal:
            self.rescues += 1


def view_of(observation: Observation, entity: str) -> EntityView | None:
    """Return the agent's view of one entity, or None."""
    return next((view for view in observation.entities if view.id == entity), None)
