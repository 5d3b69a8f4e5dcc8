"""The properties that a block may have: `name = value` lines with their types and limits."""

from __future__ import annotations

import msgspec

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
    file_ending: str = ""
    """Ending of the files that the value may name as a text instead of a word; empty if it may name none."""
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
    default: str = ""
    """The value without the line, as it would be written; empty for none. It is documentation: a test compares it with
    what a mission without the line gives."""
    proposed: bool = True
    """False for a key that is read only to report why it is not permitted; it is not proposed in hints and
    completions."""


PropertyKeys = dict[str, PropertyKey]
"""The properties of a block by name."""


def keyed(*keys: PropertyKey) -> PropertyKeys:
    """The properties of a block by name."""
    return {key.name: key for key in keys}
