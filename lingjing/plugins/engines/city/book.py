"""The book of goods: who has how much of what, and every transfer between a target and an actor.

The city engine alone moves goods, so its book is the truth at once, whatever the mirrors still say. What an actor was
given by a target so far stands in the target's account `"<stock>@<actor>"` (negative: taken), from which the actor's
own engine works out what is on board.
"""

from __future__ import annotations

import math

from lingjing.errors import UsageError
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.units import without_unit
from lingjing.plugins.engines.city.interaction import Interaction

DUST = 1e-9
"""Less than this of anything is nothing: what is left of a sum of floating-point transfers."""


class Book:
    """All stocks of an instance: declared states by entity and by the name without its unit."""

    def __init__(self, instance: Instance) -> None:
        self._limits = {entity.id: _numbers(entity, tuple(entity.properties)) for entity in instance.entities}
        self._stocks = {entity.id: _numbers(entity, entity.state) for entity in instance.entities}
        self._units = {
            (entity.id, without_unit(name)): name.removeprefix(without_unit(name))
            for entity in instance.entities
            for name in entity.state
        }
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

    def transfer(self, target: str, actor: str, interaction: Interaction) -> dict[str, float]:
        """Move what both ends allow; the amount and what the target has left, by names with units, {} for nothing.

        Inexhaustible is what a target gives without naming where from.
        """
        if interaction.takes:
            carried, own, sign = interaction.source, interaction.takes, -1.0
            amount = min(self.amount(target, own), self.amount(actor, carried))
        else:
            carried, own, sign = interaction.gives, interaction.source, 1.0
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
        left = {f"left{unit}": self.amount(target, own)} if own else {}
        return {f"amount{unit}": amount, **left}

    def _room(self, actor: str, interaction: Interaction) -> float:
        if not interaction.up_to:
            return math.inf
        limit = self._limits.get(actor, {}).get(interaction.up_to)
        return math.inf if limit is None else limit - self.amount(actor, interaction.gives)

    def _add(self, entity: str, stock: str, amount: float) -> None:
        stocks = self._stocks.setdefault(entity, {})
        after = stocks.get(stock, 0.0) + amount
        stocks[stock] = 0.0 if abs(after) <= DUST else after


def check_bounded(entity: Entity, interaction: Interaction, actors: tuple[Entity, ...]) -> None:
    """`UsageError` if an interaction would give without end: it names neither a source nor a limit that holds."""
    if not interaction.gives or interaction.source:
        return
    for actor in actors:
        if actor.engine == interaction.by_engine and interaction.up_to not in _numbers(actor, tuple(actor.properties)):
            raise UsageError(
                f"`{interaction.name}` of `{entity.id}` gives `{actor.id}` `{interaction.gives}` without end",
                hint="bound it: `up_to = payload` for an actor with a `payload`, or `from` a stock of the target",
            )


def _numbers(entity: Entity, names: tuple[str, ...]) -> dict[str, float]:
    values = {name: entity.properties.get(name) for name in names}
    return {
        without_unit(name): float(value)
        for name, value in values.items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    }
