"""The smallest message of a kind: a lower bound of its body as JSON, which the payload of the bus must hold."""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.mission.instance import Instance, MessageSpec
from lingjing.mission.model import Field

_LEAST_BYTES = {
    "name": len('""'),
    "text": len('""'),
    "number": len("0"),
    "flag": len("true"),
    "position": len("[0,0]"),
    "box": len("[0,0,1,1]"),
    "names": len("[]"),
}
"""The shortest valid value of a field as JSON, by the field's type."""


def least_bytes(spec: MessageSpec, instance: Instance, words: Mapping[str, int] | None = None) -> int:
    """A lower bound of the size of a message body: its required fields with their shortest values.

    `words` are lower bounds of the lengths of texts, by field.
    """
    lengths = words or {}
    fields = [
        _least(field, instance) + lengths.get(field.name, 0)
        for field in spec.fields
        if not field.optional or field.name in lengths
    ]
    return len("{}") + sum(fields) + max(0, len(fields) - 1)


def _least(field: Field, instance: Instance) -> int:
    return len(f'"{field.name}":') + (_LEAST_BYTES.get(field.type) or _least_frame(instance))


def _least_frame(instance: Instance) -> int:
    """The size of the shortest id of a picture, `"f1-uav-nadir"`."""
    names = [f'"f1-{entity.id}-{camera.name}"' for entity in instance.entities for camera in entity.cameras]
    return min(map(len, names), default=0)
