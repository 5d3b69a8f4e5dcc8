"""Goods on board of an asset: the amount that a mission declares as `state`, and the transfers since then.

The city engine carries out transfers. It keeps one account for each stock, asset and counterpart: the counterpart's
mirror has `"<stock>@<asset>"` in its resources, the net amount given to that asset so far (negative if it was taken).
The asset's own engine adds the accounts up. Accounts are running totals, so no transfer is counted twice or lost.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from lingjing.mission.instance import Entity
from lingjing.trace.records import BodyState

Accounts = Mapping[str, Sequence[float]]
"""The amounts of each account, one from each counterpart."""


def booked(mirrors: Iterable[BodyState]) -> Accounts:
    """Return the accounts in the mirrors. An engine reads them once for all its assets."""
    accounts: dict[str, list[float]] = {}
    for state in mirrors:
        if not state.resources:
            continue  # the usual case: every one of many background movers
        for account, amount in state.resources.items():
            if "@" in account:
                accounts.setdefault(account, []).append(amount)
    return accounts


class Stock:
    """The changing stocks of one asset, by the name of their property (`load_kg`)."""

    def __init__(self, entity: Entity) -> None:
        self._first = {
            state.field: value for state in entity.state if (value := entity.number(state.field)) is not None
        }
        self.declared = tuple(state for state in entity.state if state.field in self._first)
        """The states that are amounts, in the order of their declaration."""
        self._accounts = [
            (state.field, f"{word}@{entity.id}")
            for state in self.declared
            for word in dict.fromkeys((state.field, state.name))
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
        """The mass on board, the stock `load`, kilograms; 0 without one."""
        return max(0.0, self.amounts.get("load_kg", 0.0))


__all__ = ["Accounts", "Stock", "booked"]
