"""Which streets cars and buses may use, by OpenStreetMap's own hierarchy of keys.

A key holds for every kind of traffic below it, unless a more special key says otherwise:
`access` < `vehicle` < `motor_vehicle` < `motorcar`, and < `psv` < `bus`. Each may hold for one direction alone
(`motor_vehicle:backward`). What holds only at times (`…:conditional`) is not read; a value that OpenStreetMap does not
define says nothing. Source: the wiki of OpenStreetMap, page `Key:access`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

Access = Literal["open", "destination", "closed"]
"""`destination`: open to what begins or ends there, closed to through traffic."""

CAR_KEYS = ("motorcar", "motor_vehicle", "vehicle", "access")
BUS_KEYS = ("bus", "psv", "motor_vehicle", "vehicle", "access")

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
"""The values of access keys: what each means for traffic of the public."""

_RANK: tuple[Access, ...] = ("open", "destination", "closed")
"""From the most to the least that is permitted: of a list (`agricultural;destination`) each value permits its own."""


def access(tags: Mapping[str, str], keys: Sequence[str], direction: str = "") -> Access | None:
    """The access along a way by the first of some keys that says it; None if none does.

    `direction` is `forward` or `backward`: keys of that direction then precede those of both.
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
