"""Declared states that no engine keeps: they live by what was declared and what interactions moved since.

The city engine moves goods between targets and assets and publishes, with a target, what it gave each asset so far:
`"<stock>@<asset>"` (negative: taken). An engine that weighs its loads adds that up itself and reports the state; for
any other, a plug-in's among them, this does. An account is a running total, so nothing is counted twice or lost.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import msgspec

from lingjing.mission.instance import Entity, Instance, StateSpec
from lingjing.trace.records import BodyState

_OF = "@"


class Stocks:
    """The declared states of the entities of one instance: what each begins with."""

    def __init__(self, instance: Instance) -> None:
        self._first = {entity.id: first for entity in instance.entities if (first := _declared(entity))}

    def kept(self, states: Mapping[str, BodyState]) -> dict[str, BodyState]:
        """The states of those entities whose engines leave a declared state out, with it."""
        lacking = {
            name: {spec: amount for spec, amount in first.items() if not _reports(states[name], spec)}
            for name, first in self._first.items()
        }
        lacking = {name: stocks for name, stocks in lacking.items() if stocks}
        if not lacking:
            return {}
        got = _accounts(states.values())
        return {name: _with(states[name], stocks, got) for name, stocks in lacking.items()}


def _declared(entity: Entity) -> dict[StateSpec, float]:
    return {spec: value for spec in entity.state if (value := entity.number(spec.field)) is not None}


def _reports(state: BodyState, spec: StateSpec) -> bool:
    return spec.name in state.resources or spec.field in state.resources


def _accounts(states: Iterable[BodyState]) -> dict[str, float]:
    got: dict[str, float] = {}
    for state in states:
        for account, amount in state.resources.items():
            if _OF in account:
                got[account] = got.get(account, 0.0) + amount
    return got


def _with(state: BodyState, stocks: Mapping[StateSpec, float], got: Mapping[str, float]) -> BodyState:
    amounts = {spec.name: first + got.get(f"{spec.name}{_OF}{state.id}", 0.0) for spec, first in stocks.items()}
    return msgspec.structs.replace(state, resources={**state.resources, **amounts})
