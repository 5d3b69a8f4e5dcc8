"""The loss of messages at a boundary in a mission with events that change the radio."""

from __future__ import annotations

from lingjing.kernel.bus import RadioConditions
from lingjing.kernel.registry import Registry
from lingjing.mission.geometry2d import contains
from lingjing.mission.instance import Instance, RadioChange
from lingjing.mission.schedule import Schedule


class ChangingRadio:
    """The radio of one instance. Holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._instance = instance
        self._changes = any(event.radio for event in instance.events)
        self._outlines = {region.name: region.polygon for region in instance.regions}

    def at(self, registry: Registry) -> RadioConditions | None:
        """Return the conditions at a boundary; None for a mission without events that change the radio."""
        if not self._changes:
            return None
        radio = Schedule(self._instance, registry.occurrences).radio(registry.time_s)
        jammed = {agent.id: self._loss(radio.jams, agent.controls, registry) for agent in self._instance.agents}
        return RadioConditions(radio.loss, jammed)

    def _loss(self, jams: tuple[RadioChange, ...], bodies: tuple[str, ...], registry: Registry) -> float:
        """Return the greatest loss among the jammed regions with one of these bodies."""
        losses = (jam.loss for jam in jams if jam.loss is not None and self._is_in(jam, bodies, registry))
        return max(losses, default=0.0)

    def _is_in(self, jam: RadioChange, bodies: tuple[str, ...], registry: Registry) -> bool:
        outline = self._outlines[jam.region]
        places = (registry.states[body].position for body in bodies if body in registry.states)
        return any(contains(outline, place[0], place[1]) for place in places)
