"""The stocks of all entities, and every transfer between a target and an actor.

Only the city engine moves goods. Its stocks are the current ones even if mirrors of actors are older. The account
`"<stock>@<actor>"` of a target sums what the target gave to that actor; negative amounts were taken. An actor's own
engine derives its load from these accounts.
"""

from __future__ import annotations

import math

from lingjing.errors import UsageError
from lingjing.mission.instance import Entity, Instance, InteractionSpec, StateSpec
from lingjing.mission.units import field_named
from lingjing.mission.vocabulary import AMOUNT, LEFT

DUST = 1e-9
"""Amounts below this count as zero: the rounding error of repeated transfers."""


class Goods:
    """The stocks of an instance: the declared states of each entity, by name without unit."""

    def __init__(self, instance: Instance) -> None:
        self._entities = {entity.id: entity for entity in instance.entities}
        self._stocks = {entity.id: first_amounts(entity) for entity in instance.entities}
        self._units = {(entity.id, state.name): state.unit for entity in instance.entities for state in entity.state}
        self._accounts: dict[str, dict[str, float]] = {}

    def amount(self, entity: str, stock: str) -> float:
        """Return the amount of a stock of an entity; 0 if the entity does not declare it."""
        return self._stocks.get(entity, {}).get(stock, 0.0)

    def stocks(self, entity: str) -> dict[str, float]:
        """Return all stocks of an entity, by name."""
        return self._stocks.get(entity, {})

    def accounts(self, target: str) -> dict[str, float]:
        """Return the accounts of a target with each actor, by `"<stock>@<actor>"`."""
        return self._accounts.get(target, {})

    def put(self, entity: str, stock: str, amount: float) -> None:
        """Set the amount of a stock of an entity."""
        self._stocks.setdefault(entity, {})[stock] = amount

    def takes_part(self, actor: str, interaction: InteractionSpec) -> bool:
        """Return whether an actor declares the state, and the limit if there is one, that the interaction moves goods
        by."""
        declared = interaction.carried in self._stocks.get(actor, {})
        return declared and (not interaction.up_to or self._limit(actor, interaction) is not None)

    def transfer(self, target: str, actor: str, interaction: InteractionSpec) -> dict[str, float]:
        """Move the largest amount that both ends allow.

        Return the amount moved and the amount left at the target, by names with units; empty if nothing moves. A target
        that gives without naming a source has an unlimited supply.
        """
        if not self.takes_part(actor, interaction):
            return {}
        carried, own = interaction.carried, interaction.own
        if interaction.takes:
            sign = -1.0
            amount = min(self.amount(target, own), self.amount(actor, carried))
        else:
            sign = 1.0
            supply = self.amount(target, own) if own else math.inf
            amount = min(supply, self._room(actor, interaction))
        if not amount > DUST:
            return {}
        self._add(actor, carried, sign * amount)
        if own:
            self._add(target, own, -amount)
        account = self._accounts.setdefault(target, {})
        key = f"{carried}@{actor}"
        account[key] = account.get(key, 0.0) + sign * amount
        unit = self._units.get((actor, carried), "")
        left = {StateSpec(name=LEFT, unit=unit).field: self.amount(target, own)} if own else {}
        return {StateSpec(name=AMOUNT, unit=unit).field: amount, **left}

    def _room(self, actor: str, interaction: InteractionSpec) -> float:
        limit = self._limit(actor, interaction)
        return math.inf if limit is None else limit - self.amount(actor, interaction.gives)

    def _limit(self, actor: str, interaction: InteractionSpec) -> float | None:
        """Return the capacity of an actor for the goods that it receives; None without a declared limit."""
        entity = self._entities[actor]
        field = field_named(interaction.up_to, entity.properties) if interaction.up_to else None
        return None if field is None else entity.number(field)

    def _add(self, entity: str, stock: str, amount: float) -> None:
        stocks = self._stocks.setdefault(entity, {})
        after = stocks.get(stock, 0.0) + amount
        stocks[stock] = 0.0 if abs(after) <= DUST else after


def check_exchange(entity: Entity, interaction: InteractionSpec, actors: tuple[Entity, ...]) -> None:
    """Check that the actors of an interaction can exchange goods with the target.

    Raises `UsageError` if the interaction gives its `actors` an unlimited amount (without source and limit), or if the
    two ends use different units.
    """
    what = f"`{interaction.name}` of `{entity.id}`"
    for actor in actors:
        units = _units(actor, interaction.up_to)
        if not interaction.moves_goods or interaction.carried not in units:
            continue
        if interaction.gives and not interaction.source and interaction.up_to not in units:
            raise UsageError(
                f"{what} gives `{actor.id}` `{interaction.gives}` without end",
                hint="bound it: `up_to = payload` for an actor with a `payload`, or `from` a stock of the target",
            )
        known = {units[interaction.carried], _units(entity).get(interaction.own), units.get(interaction.up_to)} - {None}
        if len(known) > 1:
            raise UsageError(
                f"{what} moves `{interaction.carried}` of `{actor.id}` in different units",
                hint="give the states of both ends and the limit one dimension",
            )


def first_amounts(entity: Entity) -> dict[str, float]:
    """Return the initial amounts of an entity's states, by name."""
    return {state.name: value for state in entity.state if (value := entity.number(state.field)) is not None}


def _units(entity: Entity, *limits: str) -> dict[str, str]:
    """Return the unit of each state of an entity and of each limit in `limits`."""
    units = {state.name: state.unit for state in entity.state}
    for name in limits:
        field = field_named(name, entity.properties) if name else None
        if field is not None:
            units[name] = field.removeprefix(name).removeprefix("_")
    return units
