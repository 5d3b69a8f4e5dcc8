"""Quantities that conditions read, and what changes each of them."""

from __future__ import annotations

from typing import Literal

import msgspec

QuantityKind = Literal[
    "time",
    "position",
    "velocity",
    "heading",
    "status",
    "state",
    "property",
    "presence",
    "event",
    "assignment",
    "picture",
    "true box",
    "message",
    "rule",
    "route",
    "counter",
    "region",
    "setting",
]
"""The kinds of quantities.

A `state` is a number that interactions or the engine change, a `property` one that nothing changes. `presence` is
whether an entity is there and not dead. An `event` is a performed interaction or an engine's own event. A `rule` is an
adjudicated event that another condition reads. A `counter` is what a limit or a route's replans count.
"""

CauseKind = Literal["time", "verb", "message", "interaction", "event", "engine"]
"""The kinds of causes of a change.

A `verb` is a command of an agent, an `event` one that the mission declares. An `engine` changes a quantity by itself
or as the result of commands: motion, collisions, batteries, pictures.
"""


class Record(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """Base of the records of this package: frozen, keyword-only, defaults are left out of JSON."""


class Cause(Record, frozen=True, kw_only=True):
    """One way in which a quantity changes."""

    kind: CauseKind
    name: str
    """The verb, interaction, message kind, event or engine; `now` for time."""
    by: tuple[str, ...] = ()
    """The roles that can bring it about, or the asset groups of an interaction's actors. Empty if no agent can."""


class Quantity(Record, frozen=True, kw_only=True):
    """One quantity that a condition reads."""

    kind: QuantityKind
    owner: str = ""
    """The group, message kind, inspection, limit or rule that has it; "" for time and settings."""
    name: str = ""
    """The field, property, interaction, region or setting."""
    causes: tuple[Cause, ...] = ()
    """Everything that changes it; empty for a constant."""
    least: float | None = None
    """Lower bound of a number over the whole episode, in the unit of its name; None if there is none."""
    most: float | None = None
    """Upper bound of a number over the whole episode; None if there is none."""
    hidden: bool = False
    """True if agents must not learn it: it is hidden, or belongs to an entity with a hidden property."""
    indirect: bool = False
    """True if the part does not name the owner: it reads a bound member, or binds members that it hands to rules."""

    @property
    def key(self) -> str:
        """Its name in listings: `victim.position`, `event victim.rescue`, `now`."""
        if self.kind == "time":
            return "now"
        dotted = ".".join(part for part in (self.owner, self.name) if part)
        return dotted if self.kind in _DOTTED else f"{self.kind} {dotted}"


_DOTTED = frozenset(("position", "velocity", "heading", "status", "state", "property"))
"""Kinds with a field of their own, which names them without the kind's word."""
