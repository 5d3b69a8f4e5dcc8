"""The properties of a block that were read (entries). `lingjing.dsl.syntax.keys` has those that it may have."""

from __future__ import annotations

import msgspec

from lingjing.dsl.checking.values import TypedExpression
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.keys import PropertyKey
from lingjing.mission import expression as ex


class PropertyEntry(msgspec.Struct, frozen=True):
    """A property that was read."""

    node: s.PropertyLine
    """Its statement."""
    key: PropertyKey
    """Its key."""
    parts: tuple[TypedExpression, ...]
    """The checked values: two for a speed with a direction or a size, else one."""

    @property
    def value(self) -> TypedExpression:
        """The only or first part."""
        return self.parts[0]

    @property
    def relation(self) -> str:
        """The relation between key and value: `=`, `~` or `<=`."""
        return self.node.relation


def word_of(entries: dict[str, PropertyEntry], key: str) -> str:
    """The bare word of a key's value; "" without the property."""
    entry = entries.get(key)
    return entry.value.ir.name if entry is not None and isinstance(entry.value.ir, ex.Symbol) else ""
