"""The book of goods: who has how much of what, and every transfer between a target and an actor.

The city engine alone moves goods, so its book is the truth at once, whatever the mirrors still say. What an actor was
given by a target so far stands in the target's account `"<stock>@<actor>"` (negative: taken), from which the actor's
own engine works out what is on board.
"""

from __future__ import annotations

import math

from lingjing.errors import UsageError
from lingjing.mission.instance import Entity, Instance, InteractionSpec, StateSpec
from lingjing.mission.units import field_named
from lingjing.mission.vocabulary import AMOUNT, LEFT

DUST = 1e-9
"""Less than this of anything is nothing: what is left of a sum of floating-point transfers."""


class Goods:
    """All stocks of an instance: declared states by entity and by the name without its unit."""

    def __init__(self, instance: Instance) -> None:
        self._entities = {entity.id: entity for entity in instance.entities}
        self._stocks = {entity.id: first_amounts(entity) for entity in instance.entities}
        self._units = {(entity.id, one.name): one.unit for entity in instance.entities for one in entity.state}
        self._accounts: dict[str, dict[str, float]] = {}

    def amount(self, entity: str, stock: str) -> float:
        """How much of a stock an entity has; 0 of what it has not declared."""
        return self._stocks.get(entity, {}).get(stock, 0.0)

    def stocks(self, entity: str) -> dict[str, float]:
        """All that an entity has, by stock."""
        return self._stocks.get(entity, {})

    def accounts(self, target: str) -> dict[str, float]:
        """What each actor was given by a target, by `"<stock>@<actor>"`."""
        return self._accounts.get(target, {})

    def put(self, entity: str, stock: str, amount: float) -> None:
        """Let an entity have so much of a stock from now on."""
        self._stocks.setdefault(entity, {})[stock] = amount

    def takes_part(self, actor: str, interaction: InteractionSpec) -> bool:
        """Whether an actor has declared the state, and the limit, that goods are moved by."""
        declared = interaction.carried in self._stocks.get(actor, {})
        return declared and (not interaction.up_to or self._limit(actor, interaction) is not None)

    def transfer(self, target: str, actor: str, interaction: InteractionSpec) -> dict[str, float]:
        """Move what both ends allow; the amount and what the target has left, by names with units, {} for nothing.

        Inexhaustible is what a target gives without naming where from.
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
        """How much of what it is given an actor holds; None where nothing is said."""
        entity = self._entities[actor]
        field = field_named(interaction.up_to, entity.properties) if interaction.up_to else None
        return None if field is None else entity.number(field)

    def _add(self, entity: str, stock: str, amount: float) -> None:
        stocks = self._stocks.setdefault(entity, {})
        after = stocks.get(stock, 0.0) + amount
        stocks[stock] = 0.0 if abs(after) <= DUST else after


def check_exchange(entity: Entity, interaction: InteractionSpec, actors: tuple[Entity, ...]) -> None:
    """`UsageError` if an interaction gives its `actors` without end (it names neither a source nor a limit), or if what
    changes hands is not measured in one unit at both ends."""
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
    """What an entity's states begin with, by their names."""
    return {one.name: value for one in entity.state if (value := entity.number(one.field)) is not None}


def _units(entity: Entity, *limits: str) -> dict[str, str]:
    """The unit in which an entity has each of its states, and each of these limits."""
    units = {one.name: one.unit for one in entity.state}
    for name in limits:
        field = field_named(name, entity.properties) if name else None
        if field is not None:
            units[name] = field.removeprefix(name).removeprefix("_")
    return units
