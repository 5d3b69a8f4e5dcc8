"""Declared states that no engine keeps, derived from the declaration and the interactions since.

An engine that weighs its loads derives them itself (`lingjing.plugins.stock`) and reports the state. This module does
so for any other engine, including those of plug-ins.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec

from lingjing.mission.instance import Instance, StateSpec
from lingjing.plugins.stock import Accounts, Stock, booked
from lingjing.trace.records import BodyState


class Stocks:
    """The declared states of the entities of one instance."""

    def __init__(self, instance: Instance) -> None:
        self._stocks = {entity.id: Stock(entity) for entity in instance.entities if entity.state}

    def kept(self, states: Mapping[str, BodyState]) -> dict[str, BodyState]:
        """Return the states of entities with a declared state that their engine does not report, completed with it."""
        lacking = {
            name: left_out
            for name, stock in self._stocks.items()
            if (left_out := [spec for spec in stock.declared if not _reports(states[name], spec)])
        }
        if not lacking:
            return {}
        book = booked(states.values())
        return {name: self._with(states[name], left_out, book) for name, left_out in lacking.items()}

    def _with(self, state: BodyState, left_out: Sequence[StateSpec], book: Accounts) -> BodyState:
        stock = self._stocks[state.id]
        stock.read(book)
        amounts = {spec.name: stock.amounts[spec.field] for spec in left_out}
        return msgspec.structs.replace(state, resources={**state.resources, **amounts})


def _reports(state: BodyState, spec: StateSpec) -> bool:
    return spec.name in state.resources or spec.field in state.resources
