"""Public events, each counted once, and the small questions the rules ask of an observation."""

from __future__ import annotations

from lingjing.plugins.policy import EntityView, EventView, Observation


class EventLog:
    """Remembers which events have been seen. One happening may come as a task event and as an adjudicated event
    (`serve`, then `served`): the first of the two kinds that is met is the one that counts."""

    def __init__(self, stem: str = "rescue") -> None:
        self._stem = stem
        self._signal: str | None = None
        self._seen: set[str] = set()
        self.rescues = 0

    def fresh_rescues(self, events: tuple[EventView, ...]) -> int:
        """How many rescues these events tell of that were not known before."""
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
    """What the agent sees of one entity."""
    return next((view for view in observation.entities if view.id == entity), None)
