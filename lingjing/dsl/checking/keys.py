"""The properties that a block may have (keys), and those that were read (entries)."""

from __future__ import annotations

import msgspec

from lingjing.dsl.checking.values import TypedExpression
from lingjing.dsl.syntax import tree as s
from lingjing.mission import expression as ex
from lingjing.mission.functions import Type


class PropertyKey(msgspec.Struct, frozen=True):
    """A property that a block may have."""

    name: str
    """Its word in the language."""
    type: Type
    """Type of its value."""
    relations: tuple[str, ...] = ("=",)
    """Permitted relations: `=`, `~`, `<=`."""
    choices: tuple[str, ...] | None = None
    """Permitted words for a name or a list of names; None permits any."""
    required: bool = False
    """True if the block must have it."""
    guarded: bool = False
    """True if it may have a condition."""
    hideable: bool = False
    """True if it may be hidden."""
    public: bool = True
    """True if its value becomes visible to agents or engines, so that a hidden value is a leak."""
    low: float | None = None
    """Least value, SI; None without one."""
    high: float | None = None
    """Greatest value, SI; None without one."""
    above: float | None = None
    """The value must exceed this, SI; None without one."""
    whole: bool = False
    """True if the value must be an integer."""
    proposed: bool = True
    """False for a key that is read only to report why it is not permitted; it is not proposed in hints and
    completions."""


def keyed(*keys: PropertyKey) -> dict[str, PropertyKey]:
    """The properties of a block by name."""
    return {key.name: key for key in keys}


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
        """`=`, `~` or `<=`."""
        return self.node.relation


def word_of(entries: dict[str, PropertyEntry], key: str) -> str:
    """The bare word of a key's value; "" without the property."""
    entry = entries.get(key)
    return entry.value.ir.name if entry is not None and isinstance(entry.value.ir, ex.Symbol) else ""
