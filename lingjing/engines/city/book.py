"""The book of goods: who has how much of what, and every transfer between a target and an actor.

The city engine alone moves goods, so its book is the truth at once, whatever the mirrors still say. What an actor was
given by a target so far stands in the target's account `"<stock>@<actor>"` (negative: taken), from which the actor's
own engine works out what is on board.
"""

from __future__ import annotations

import math

from lingjing.errors import UsageError
from lingjing.mission.instance import Entity, Instance, InteractionSpec
from lingjing.mission.units import without_unit

DUST = 1e-9
"""Less than this of anything is nothing: what is left of a sum of floating-point transfers."""


class Book:
    """All stocks of an instance: declared states by entity and by the name without its unit."""

    def __init__(self, instance: Instance) -> None:
        self._limits = {entity.id: numbers(entity, tuple(entity.properties)) for entity in instance.entities}
        self._stocks = {entity.id: numbers(entity, entity.state) for entity in instance.entities}
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

    def put(self, entity: str, stock: str, amount: float) -> None:
        """Let an entity have so much of a stock from now on."""
        self._stocks.setdefault(entity, {})[stock] = amount

    def takes_part(self, actor: str, interaction: InteractionSpec) -> bool:
        """Whether an actor has declared the state, and the limit, that goods are moved by."""
        declared = interaction.carried in self._stocks.get(actor, {})
        return declared and (not interaction.up_to or interaction.up_to in self._limits[actor])

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
        left = {f"left{unit}": self.amount(target, own)} if own else {}
        return {f"amount{unit}": amount, **left}

    def _room(self, actor: str, interaction: InteractionSpec) -> float:
        if not interaction.up_to:
            return math.inf
        return self._limits[actor][interaction.up_to] - self.amount(actor, interaction.gives)

    def _add(self, entity: str, stock: str, amount: float) -> None:
        stocks = self._stocks.setdefault(entity, {})
        after = stocks.get(stock, 0.0) + amount
        stocks[stock] = 0.0 if abs(after) <= DUST else after


def check_exchange(entity: Entity, interaction: InteractionSpec, actors: tuple[Entity, ...]) -> None:
    """`UsageError` if an interaction would give without end (it names neither a source nor a limit), or if what changes
    hands is not measured in one unit at both ends."""
    what = f"`{interaction.name}` of `{entity.id}`"
    for actor in actors:
        units = _units(actor)
        if actor.engine != interaction.by or not interaction.moves_goods or interaction.carried not in units:
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


def numbers(entity: Entity, names: tuple[str, ...]) -> dict[str, float]:
    """Those of an entity's properties that are numbers, by their names without units."""
    values = {name: entity.properties.get(name) for name in names}
    return {
        without_unit(name): float(value)
        for name, value in values.items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    }


def _units(entity: Entity) -> dict[str, str]:
    """The unit that ends the name of each property that is a number: `_kg`, or "" for a bare one."""
    return {
        without_unit(name): name.removeprefix(without_unit(name))
        for name, value in entity.properties.items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    }
