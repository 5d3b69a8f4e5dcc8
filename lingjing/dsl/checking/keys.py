"""What a block may say: its keys, and the entries that were read."""

from __future__ import annotations

import msgspec

from lingjing.dsl.checking.values import TypedExpression
from lingjing.dsl.syntax import tree as s
from lingjing.mission import expression as ex
from lingjing.mission.functions import Type


class PropertyKey(msgspec.Struct, frozen=True):
    """One property of a block. `choices` are the words allowed for a name or a list of names, None for any.

    `public` names where the value becomes visible to agents or engines, so that a hidden one is a leak. One that is not
    `proposed` is read, so that what refuses it can say why, and is in no hint and no completion.
    """

    name: str
    type: Type
    relations: tuple[str, ...] = ("=",)
    choices: tuple[str, ...] | None = None
    required: bool = False
    guarded: bool = False
    hideable: bool = False
    public: bool = True
    low: float | None = None
    high: float | None = None
    above: float | None = None
    whole: bool = False
    proposed: bool = True


def keyed(*keys: PropertyKey) -> dict[str, PropertyKey]:
    """The properties of a block by their names."""
    return {key.name: key for key in keys}


class PropertyEntry(msgspec.Struct, frozen=True):
    """A property that was read: its statement and its parts (two for a speed with a direction, a size, a range)."""

    node: s.PropertyLine
    key: PropertyKey
    parts: tuple[TypedExpression, ...]

    @property
    def value(self) -> TypedExpression:
        """The only or first part."""
        return self.parts[0]

    @property
    def relation(self) -> str:
        """`=`, `~` or `<=`."""
        return self.node.relation


def word_of(entries: dict[str, PropertyEntry], key: str) -> str:
    """The bare word that was given for a key; "" if none was."""
    entry = entries.get(key)
    return entry.value.ir.name if entry is not None and isinstance(entry.value.ir, ex.Symbol) else ""
