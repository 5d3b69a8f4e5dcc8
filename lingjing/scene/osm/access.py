"""Access of cars and buses to streets, by OpenStreetMap's hierarchy of keys.

A key applies to every kind of traffic below it, unless a more specific key overrides it: `access` < `vehicle` <
`motor_vehicle` < `motorcar`, and < `psv` < `bus`. Each may be limited to one direction (`motor_vehicle:backward`).
Restrictions by time (`…:conditional`) are not read. A value that OpenStreetMap does not define is ignored. Source: the
wiki of OpenStreetMap, page `Key:access`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

Access = Literal["open", "destination", "closed"]
"""`destination`: open to traffic that begins or ends there, closed to through traffic."""

CAR_KEYS = ("motorcar", "motor_vehicle", "vehicle", "access")
"""Keys for cars, the most specific first."""
BUS_KEYS = ("bus", "psv", "motor_vehicle", "vehicle", "access")
"""Keys for buses, the most specific first."""

_VALUES: dict[str, Access] = {
    **dict.fromkeys(("yes", "permissive", "designated", "official", "public", "discouraged", "true", "1"), "open"),
    **dict.fromkeys(("destination", "customers", "residents"), "destination"),
    **dict.fromkeys(
        (
            "no", "private", "permit", "delivery", "agricultural", "forestry", "emergency", "military", "employees",
            "staff", "students", "restricted", "use_sidepath", "dismount", "false", "0",
        ),
        "closed",
    ),
}  # fmt: skip
"""Value of an access key → access of public traffic."""

_RANK: tuple[Access, ...] = ("open", "destination", "closed")
"""Accesses from the most to the least permissive. The most permissive value of a list
(`agricultural;destination`) counts."""


def access(tags: Mapping[str, str], keys: Sequence[str], direction: str = "") -> Access | None:
    """The access along a way by the first of some keys that states it; None if none does.

    `direction`: `forward` or `backward`; keys of that direction then precede those of both.
    """
    for key in keys:
        for name in (f"{key}:{direction}", key) if direction else (key,):
            permitted = _value(tags.get(name, ""))
            if permitted is not None:
                return permitted
    return None


# -- private


def _value(text: str) -> Access | None:
    permitted = {_VALUES.get(part.strip()) for part in text.casefold().split(";")}
    return next((rank for rank in _RANK if rank in permitted), None)
