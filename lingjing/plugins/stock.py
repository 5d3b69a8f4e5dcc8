"""Goods on board: what a mission declares as `state`, and what the city's book says was given and taken since.

The city engine performs the handing over and keeps one account a stock, asset and counterpart: the counterpart's
mirror carries `"<stock>@<asset>"` in its resources, the net amount given to that asset so far (negative: taken). The
asset's own engine adds them up. Accounts are running totals, so nothing is counted twice and nothing is lost.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from lingjing.mission.instance import Entity
from lingjing.trace.records import BodyState

Accounts = Mapping[str, Sequence[float]]
"""What was given so far, by account: an amount from each counterpart."""


def booked(mirrors: Iterable[BodyState]) -> Accounts:
    """The accounts that the mirrors carry; read once for all assets of an engine."""
    found: dict[str, list[float]] = {}
    for state in mirrors:
        if not state.resources:
            continue  # as of every background mover, and these are many
        for account, amount in state.resources.items():
            if "@" in account:
                found.setdefault(account, []).append(amount)
    return found


class Stock:
    """The changing stocks of one asset, by the name of their property (`load_kg`)."""

    def __init__(self, entity: Entity) -> None:
        self._first = {one.field: value for one in entity.state if (value := entity.number(one.field)) is not None}
        self.declared = tuple(one for one in entity.state if one.field in self._first)
        """The states that are amounts, in the order of their declaration."""
        self._accounts = [
            (one.field, f"{word}@{entity.id}") for one in self.declared for word in dict.fromkeys((one.field, one.name))
        ]
        self.amounts: Mapping[str, float] = dict(self._first)

    def read(self, book: Accounts) -> None:
        """Bring the amounts up to date."""
        amounts = dict(self._first)
        for name, account in self._accounts:
            for amount in book.get(account, ()):
                amounts[name] += amount
        self.amounts = amounts

    @property
    def load_kg(self) -> float:
        """What is on board of a stock `load`, kilograms; 0 without one."""
        return max(0.0, self.amounts.get("load_kg", 0.0))


__all__ = ["Accounts", "Stock", "booked"]
