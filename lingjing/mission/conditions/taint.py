"""`propagate`: what the interactions change that hidden values decide, as a part of the declarations.

An interaction is *secret* if a hidden value decides whether, when or in which amount it is performed: a hidden value in
its `unlock`, a target or an actor with a hidden place, or an amount that another secret interaction has changed. Its
event, its count, and all that it changes are then hidden quantities. They hide further unlocks, so that both sets grow
until nothing is added.

An interaction with `told = all` is public where every agent observes `events`: a condition over it decides nothing that
an agent does not know from the event. Where an agent does not, the kernel still shows it to the others (`shown`). Its
event tells no amount: where a hidden value decides the amount (a hidden stock, demand or limit), the states that the
interaction changes are hidden although its event is not.
"""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from lingjing.mission import model
from lingjing.mission.conditions.declarations import Declarations, Group, Taint
from lingjing.mission.conditions.reads import Reader
from lingjing.mission.natures import FIRE, LEAK, TargetNature
from lingjing.mission.natures import worked_levels as levels_of

PLACE = "position"
"""The hidden property, or the changed field, that stands for the place of a body."""


def propagate(declarations: Declarations, *, shown: bool = False) -> Declarations:
    """The declarations with the taint of secret interactions. `shown`: those that are told to all are public."""
    shown = shown or declarations.events_observed
    while True:
        grown = _taint(declarations, shown=shown)
        if grown == declarations.taint:
            return declarations
        declarations = msgspec.structs.replace(declarations, taint=grown)


def roots(declarations: Declarations) -> frozenset[tuple[str, str]]:
    """(interaction, group of its targets) that are secret, or move a secret amount, by a hidden value of their own and
    not only through another interaction."""
    first = _taint(msgspec.structs.replace(declarations, taint=Taint()), shown=declarations.events_observed)
    return first.interactions | first.amounts


def changed_fields(group: Group, interaction: model.Exchange) -> Iterator[str]:
    """The fields of a target in rules that an interaction with it changes."""
    yield "status"
    for own in {interaction.own, _level(group).get(interaction.name, "")} - {""}:
        yield from (field for field, plain in group.states.items() if plain == own)
    if interaction.name in group.aboard or group.drifts:
        yield PLACE  # the actor takes it along, or it stops as soon as it is served


# -- private


def _taint(of: Declarations, *, shown: bool) -> Taint:
    """One round: everything that is tainted by what is known to be hidden."""
    interactions: set[tuple[str, str]] = set()
    amounts: set[tuple[str, str]] = set()
    fields: set[tuple[str, str]] = set()
    for target in of.groups.values():
        for spec in target.interactions:
            if _hides_amount(target, spec, of):
                amounts.add((spec.name, target.name))
                fields |= {(group.name, field) for group, field in moved_fields(of, target, spec)}
            if (shown and spec.told == "all") or not _is_secret(spec, target, of):
                continue
            interactions.add((spec.name, target.name))
            fields |= {(target.name, field) for field in changed_fields(target, spec)}
            fields |= {(actor.name, field) for actor, field in carried_fields(of, spec)}
    followers = {(group.name, PLACE) for group in of.groups.values() if _follows_hidden(group, of)}
    return Taint(frozenset(interactions), frozenset(fields | followers), frozenset(_sighted(of)), frozenset(amounts))


def carried_fields(of: Declarations, interaction: model.Exchange) -> Iterator[tuple[Group, str]]:
    """The state of each group of actors that an interaction changes, by its name in rules."""
    for name in of.actors(interaction) if interaction.carried else ():
        group = of.groups[name]
        yield from ((group, field) for field, plain in group.states.items() if plain == interaction.carried)


def moved_fields(of: Declarations, target: Group, interaction: model.Exchange) -> Iterator[tuple[Group, str]]:
    """The states of the target and of each group of actors that show the amount of an interaction."""
    if interaction.moves_goods:
        yield from ((target, field) for field, plain in target.states.items() if plain == interaction.own)
        yield from carried_fields(of, interaction)


def _hides_amount(target: Group, interaction: model.Exchange, of: Declarations) -> bool:
    """True if a hidden value decides the amount that an interaction moves."""
    moved = {(group.name, field) for group, field in moved_fields(of, target, interaction)}
    return bool(moved) and (
        any(field in of.groups[name].hidden for name, field in moved)
        or not moved.isdisjoint(of.taint.fields)
        or any(_hides_limit(of.groups[name], interaction) for name in of.actors(interaction))
    )


def _is_secret(interaction: model.Exchange, target: Group, of: Declarations) -> bool:
    moved = {(target.name, field) for field in changed_fields(target, interaction)} - {(target.name, "status")}
    moved |= {(group.name, field) for group, field in carried_fields(of, interaction)}
    return (
        bool(target.hidden)
        or not moved.isdisjoint(of.taint.fields)
        or (target.name, PLACE) in of.taint.fields
        or any(_hides_action(of.groups[name], interaction) for name in of.actors(interaction))
        or any(_reads_hidden(unlock, target, of) for unlock in of.unlocked.get(interaction.name, ()))
    )


def _hides_action(actor: Group, interaction: model.Exchange) -> bool:
    """True if a hidden property of an actor decides whether it reaches a target, or the amount that it moves."""
    return PLACE in actor.hidden or _hides_limit(actor, interaction)


def _hides_limit(actor: Group, interaction: model.Exchange) -> bool:
    """True if a hidden property of an actor bounds the amount that it moves."""
    bounds = {interaction.carried, interaction.up_to} - {""}
    return any(name == word or name.startswith(f"{word}_") for name in actor.hidden for word in bounds)


def _reads_hidden(unlock: model.Unlock, target: Group, of: Declarations) -> bool:
    """True if an unlock that concerns this target depends on a hidden quantity."""
    names = {parameter.name: parameter.domain for parameter in unlock.parameters}
    if names and target.name not in names.values():
        return False
    reader = Reader(of)
    leaves = (*reader.bound(names), *reader.leaves(unlock.condition, names))
    return any(leaf.hidden for leaf in leaves)


def _follows_hidden(group: Group, of: Declarations) -> bool:
    """True if a body moves by itself along a way that a hidden place directs."""
    if group.behaviour is None:
        return False
    return group.behaviour.region in of.hidden_regions or any(
        PLACE in other.hidden or (other.name, PLACE) in of.taint.fields
        for name in group.behaviour.of
        if (other := of.group(name)) is not None
    )


def _sighted(of: Declarations) -> Iterator[str]:
    """Groups with members that a rule over a hidden value matches with reports: the kernel then takes the reported
    place for the member's own in `assigned(…)`."""
    for rule in of.rules.values():
        domains = [parameter.domain for parameter in rule.parameters]
        groups = [domain for domain in domains if domain in of.groups]
        if len(groups) == len(domains):
            continue
        reader, names = Reader(of), {parameter.name: parameter.domain for parameter in rule.parameters}
        if any(leaf.hidden for leaf in (*reader.bound(names), *reader.leaves(rule.condition, names))):
            yield from groups


def _level(group: Group) -> dict[str, str]:
    """Interaction → the state that an actor works off by it."""
    nature = next((each for each in (FIRE, LEAK) if each.level in group.states), TargetNature())
    return levels_of(nature, group.interactions, group.states.values())
