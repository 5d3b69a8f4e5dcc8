"""`random`: valid verbs with random arguments, and sometimes a message that is valid by its schema."""

from __future__ import annotations

import numpy as np

from lingjing.plugins.decisions import sendable
from lingjing.plugins.policy import (
    Action,
    ArgumentSpec,
    Brief,
    Datum,
    Decision,
    Field,
    Inbox,
    MessageSpec,
    Observation,
    Outgoing,
    Resource,
)

ACT_PROBABILITY = 0.7
"""Probability of a command at a boundary. Chosen."""
SPEAK_PROBABILITY = 0.15
"""Probability of a message at a boundary. Chosen."""


class RandomPolicy:
    """A policy that draws all choices from one stream, seeded by `brief.seed`. It reads only the names of valid
    choices.
    """

    async def reset(self, brief: Brief) -> None:
        """Seed the stream and store the action space."""
        self._brief = brief
        self._random = np.random.Generator(np.random.PCG64(brief.seed))
        self._speech = sendable(brief)
        points = [corner for region in brief.regions for corner in region.polygon] or [(-500.0, -500.0), (500.0, 500.0)]
        self._low, self._high = np.min(points, axis=0), np.max(points, axis=0)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return one random command or none, and sometimes a message."""
        command = self._command() if self._chance(ACT_PROBABILITY) else None
        messages = (self._message(observation),) if self._speech and self._chance(SPEAK_PROBABILITY) else ()
        return Decision(command=command, messages=messages)

    def _command(self) -> Action | None:
        able = tuple(resource for resource in self._brief.resources if resource.verbs)
        if not able:
            return None
        resource = able[self._random.integers(len(able))]
        verb = resource.verbs[self._random.integers(len(resource.verbs))]
        arguments = {
            spec.name: self._argument(spec, resource)
            for spec in verb.arguments
            if not (spec.optional and self._chance(0.5))
        }
        return Action(verb=verb.name, arguments=arguments, resource=resource.id)

    def _argument(self, spec: ArgumentSpec, resource: Resource) -> Datum:
        if spec.name == "camera":
            return resource.cameras[self._random.integers(len(resource.cameras))].name if resource.cameras else ""
        low, high = self._bounds(spec)
        return round(float(self._random.uniform(low, high)), 2)

    def _bounds(self, spec: ArgumentSpec) -> tuple[float, float]:
        if spec.minimum is not None and spec.maximum is not None:
            return spec.minimum, spec.maximum
        spans = {
            "x": (float(self._low[0]), float(self._high[0])),
            "y": (float(self._low[1]), float(self._high[1])),
            "z": (0.0, 120.0),
        }
        low, high = spans.get(spec.name, (0.0, 50.0))
        return spec.minimum if spec.minimum is not None else low, spec.maximum if spec.maximum is not None else high

    def _message(self, observation: Observation) -> Outgoing:
        message: MessageSpec = self._speech[self._random.integers(len(self._speech))]
        frames = tuple(picture.frame for picture in observation.pictures) or ("none",)
        body = {
            field.name: self._field(field, frames)
            for field in message.fields
            if not (field.optional and self._chance(0.5))
        }
        peers = tuple(peer.id for peer in self._brief.peers)
        return Outgoing(kind=message.kind, body=body, to=peers)

    def _field(self, field: Field, frames: tuple[str, ...]) -> Datum:
        if field.type == "box":
            x, y = self._random.uniform(0.0, 0.9, 2)
            return (round(float(x), 4), round(float(y), 4), round(float(x) + 0.05, 4), round(float(y) + 0.05, 4))
        if field.type == "position":
            return (
                *(round(float(v), 1) for v in self._random.uniform(self._low, self._high)),
                self._brief.water_level_m,
            )
        if field.type == "number":
            low = field.minimum if field.minimum is not None else 0.0
            high = field.maximum if field.maximum is not None else low + 1.0
            return round(float(self._random.uniform(low, high)), 3)
        if field.type == "flag":
            return bool(self._chance(0.5))
        if field.type == "frame":
            return frames[self._random.integers(len(frames))]
        return self._name(field)

    def _name(self, field: Field) -> Datum:
        names = {
            "class": self._brief.classes,
            "cell": tuple(cell.name for cell in self._brief.cells),
            "assignee": tuple(peer.id for peer in self._brief.peers),
        }.get(field.name, ()) or ("anything",)
        name = names[self._random.integers(len(names))]
        return (name,) if field.type == "names" else name

    def _chance(self, probability: float) -> bool:
        return bool(self._random.random() < probability)
