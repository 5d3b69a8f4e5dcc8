"""Interactions: what is wrong with one, in a mission's text and in a `mission.json` alike, and who may act from the
start.

What is moved must be declared as a state at both ends, and measured in one dimension.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from lingjing.mission.expression import Flag, Number, Point, Ref, Symbol, Text, parts
from lingjing.mission.expression import Sequence as Listed
from lingjing.mission.instance import Entity
from lingjing.mission.kinds import builtin_engines
from lingjing.mission.model import Group, Interaction, Mission, Property, RuleParameter, Unlock
from lingjing.mission.units import NONE, dimension_name, unit_of
from lingjing.mission.vocabulary import ENGINE_EVENTS

UNSAID = Number(value=0.0)
"""The radius of an interaction that says none; a declared one is more than nothing."""


class InteractionFault(NamedTuple):
    """What is wrong with an interaction: the code of the diagnostic, the words of the interaction that say it (the
    likeliest first; none: its name), the message and the way out. `wrong` is a name that nothing has, `known` are those
    that it may have meant."""

    code: str
    words: tuple[str, ...]
    message: str
    hint: str
    wrong: str = ""
    known: Collection[str] = ()


class Holder(NamedTuple):
    """Who has what: the kind of value of each of its properties (`a mass`; "" if that is not known), and which of them
    are states, by the author's names."""

    name: str
    kinds: Mapping[str, str]
    states: Collection[str]


def own_faults(one: Interaction, states: Collection[str]) -> Iterator[InteractionFault]:
    """What is wrong with an interaction by itself, at a target with these states."""
    what = f"the interaction `{one.name}`"
    if one.name in ENGINE_EVENTS:
        said = f"`{one.name}` is what engines tell of a body by themselves"
        yield InteractionFault("LJ0104", (), said, "choose another name")
    for key, given, due in (("by", bool(one.by), "an engine or a role"), ("within", one.within != UNSAID, "a length")):
        if not given:
            yield InteractionFault("LJ0106", (key,), f"{what} lacks `{key}`", f"add `{key}`: {due}")
    if one.takes and one.gives:
        said = f"{what} both takes and gives"
        yield InteractionFault("LJ0110", ("gives", "takes"), said, "declare two interactions")
    elif one.source and not (one.takes or one.gives):
        said = f"{what} takes and gives nothing `from` there"
        yield InteractionFault("LJ0110", ("from",), said, "say what: `takes` or `gives`")
    elif one.up_to and not one.gives:
        said = f"{what} gives nothing `up_to` there"
        yield InteractionFault("LJ0110", ("up_to",), said, "`up_to` bounds what is given")
    elif one.gives and not (one.source or one.up_to):
        said = f"{what} gives `{one.gives}` without end"
        yield InteractionFault("LJ0106", (), said, "add `up_to`, a limit of the actor, or `from`")
    elif one.own and one.own not in states:
        said = f"{what} moves `{one.own}`, which is no state of it"
        words = ("takes" if one.takes else "from",)
        yield InteractionFault("LJ0126", words, said, f"declare it: `state {one.own} = …`", one.own, states)


def actor_fault(by: str, engines: Iterable[str], roles: Collection[str]) -> InteractionFault | None:
    """What is wrong with who acts, where assets have these engines and agents these roles beside those built in."""
    known = {kind.name for kind in builtin_engines().values() if kind.acts} | set(engines) | set(roles)
    if by in known:
        return None
    said = f"no asset that is known here has the engine `{by}`"
    said += f", and no agent the role `{by}`" if roles else ""
    hint = f"`by` names the engine or role of who acts: {', '.join(sorted(known))}"
    return InteractionFault("LJ0125", ("by",), said, hint, by, known)


def shared_faults(one: Interaction, target: Holder, actors: Sequence[Holder]) -> Iterator[InteractionFault]:
    """What is wrong with what an interaction moves between a target and those who may act on it."""
    if not one.carried or not actors:
        return
    what = f"`{one.name}` of `{target.name}`"
    able = [actor for actor in actors if one.carried in actor.states]
    if not able:
        names = ", ".join(f"`{actor.name}`" for actor in actors)
        verb = "takes from" if one.takes else "gives"
        said = f"{what} {verb} the `{one.carried}` of a `{one.by}` asset, which is no state of {names}"
        hint = f"declare it with their type: `state {one.carried} = …`"
        states = [state for actor in actors for state in actor.states]
        yield InteractionFault("LJ0126", (), said, hint, one.carried, states)
    for actor in able:
        if one.up_to and one.up_to not in actor.kinds:
            said = f"{what} fills `{actor.name}` up to its `{one.up_to}`, which it has not"
            hint = f"declare it with its type: `{one.up_to} = …`"
            yield InteractionFault("LJ0126", (), said, hint, one.up_to, list(actor.kinds))
        carried = actor.kinds[one.carried]
        for holder, name in ((target, one.own), (actor, one.up_to)):
            kind = holder.kinds.get(name, "") if name else ""
            if carried and kind and carried != kind:
                pair = f"`{actor.name}.{one.carried}` is {carried}, `{holder.name}.{name}` {kind}"
                said = f"{what} moves one thing between two: {pair}"
                yield InteractionFault("LJ0210", (), said, "what is moved has one dimension at both ends")


def faults_of(mission: Mission) -> Iterator[tuple[str, InteractionFault]]:
    """What a mission's text would be refused for, with the path of the group: its interactions and its states."""
    assets = [group for group in mission.groups if group.role == "asset"]
    roles = {agent.role for agent in mission.agents}
    for group in mission.groups:
        path = f"{mission.name}/{group.name}"
        for prop in group.properties:
            if prop.state and (said := _no_state(prop)):
                yield path, InteractionFault("LJ0201", (), f"`{prop.name}` of `{group.name}` {said}", "")
        target = _holder(group)
        for one in group.interactions:
            named = actor_fault(one.by, (asset.engine for asset in assets), roles) if one.by else None
            actors = [_holder(asset) for asset in assets if _acts(asset, one.by, mission)]
            found = (*own_faults(one, target.states), *((named,) if named else ()))
            yield from ((path, fault) for fault in (*found, *shared_faults(one, target, actors)))


def _no_state(prop: Property) -> str:
    if prop.plain in ("position", "heading"):
        return "changes by itself: it is no state"
    return "is a state and no number" if isinstance(prop.value, Text | Symbol | Flag | Point | Listed) else ""


def _acts(asset: Group, by: str, mission: Mission) -> bool:
    controls = (expr for agent in mission.agents if agent.role == by for expr in agent.controls)
    return asset.engine == by or any(
        isinstance(part, Ref) and part.name == asset.name for expr in controls for part in parts(expr)
    )


def _holder(group: Group) -> Holder:
    kinds = {prop.plain: _kind(prop) for prop in group.properties}
    return Holder(group.name, kinds, [prop.plain for prop in group.properties if prop.state])


def _kind(prop: Property) -> str:
    unit = unit_of(prop.unit) if prop.unit else None
    noun = "bare number" if unit is None or unit.dimension == NONE else dimension_name(unit.dimension)
    return f"an {noun}" if noun[:1] in "aeiou" else f"a {noun}"


def allowed_from_the_start(entities: Iterable[Entity], unlocks: Iterable[Unlock]) -> tuple[Unlock, ...]:
    """The unlocks, without a condition, of the interactions that a mission leaves to anybody at any time: those that
    none of its own `unlock` lines names for the target's group."""
    bound = {(unlock.interaction, given.domain) for unlock in unlocks for given in unlock.parameters}
    free = dict.fromkeys((one.name, entity.group) for entity in entities for one in entity.interactions)
    return tuple(
        Unlock(interaction=name, parameters=(RuleParameter(name="target", domain=group),), condition=Flag(value=True))
        for name, group in free
        if (name, group) not in bound
    )
