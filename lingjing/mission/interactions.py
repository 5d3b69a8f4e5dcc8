"""Checks of interactions, in a mission's text and in a `mission.json`, and the unlocks of unrestricted ones.

An amount that an interaction moves must be declared as a state at both ends, and have the same dimension there.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from lingjing.articles import with_article
from lingjing.mission.expression import Flag, Number, Point, Ref, Symbol, Text, parts
from lingjing.mission.expression import Sequence as Listed
from lingjing.mission.instance import Entity
from lingjing.mission.kinds import builtin_engines
from lingjing.mission.model import Group, Interaction, Mission, Property, RuleParameter, Unlock
from lingjing.mission.units import NONE, dimension_name, unit_of
from lingjing.mission.vocabulary import ENGINE_EVENTS

UNSAID = Number(value=0.0)
"""The radius of an interaction that declares no radius, metres; a declared radius is greater than zero."""


class InteractionFault(NamedTuple):
    """An error of an interaction."""

    code: str
    """The diagnostic code."""
    words: tuple[str, ...]
    """Words of the interaction that may be at fault, the likeliest first; empty for its name."""
    message: str
    hint: str
    """The way out."""
    wrong: str = ""
    """A name that no element has; "" if the error is another one."""
    known: Collection[str] = ()
    """Names that `wrong` may have been meant to be."""


class Holder(NamedTuple):
    """An asset or target with its properties."""

    name: str
    kinds: Mapping[str, str]
    """Property → kind of its value (`a mass`); "" if unknown."""
    states: Collection[str]
    """The properties that are states, by the author's names."""


def own_faults(interaction: Interaction, states: Collection[str]) -> Iterator[InteractionFault]:
    """Errors of an interaction by itself, at a target with these states."""
    what = f"the interaction `{interaction.name}`"
    if interaction.name in ENGINE_EVENTS:
        message = f"`{interaction.name}` is an event that engines report by themselves"
        yield InteractionFault("LJ0104", (), message, "choose another name")
    for key, is_declared, kind in (
        ("by", bool(interaction.by), "an engine or a role"),
        ("within", interaction.within != UNSAID, "a length"),
    ):
        if not is_declared:
            yield InteractionFault("LJ0106", (key,), f"{what} lacks `{key}`", f"add `{key}`: {kind}")
    if interaction.takes and interaction.gives:
        message = f"{what} both takes and gives"
        yield InteractionFault("LJ0110", ("gives", "takes"), message, "declare two interactions")
    elif interaction.source and not (interaction.takes or interaction.gives):
        message = f"{what} has `from`, but neither takes nor gives"
        yield InteractionFault("LJ0110", ("from",), message, "add `takes` or `gives`")
    elif interaction.up_to and not interaction.gives:
        message = f"{what} has `up_to`, but gives nothing"
        yield InteractionFault("LJ0110", ("up_to",), message, "`up_to` is the limit of `gives`")
    elif interaction.gives and not (interaction.source or interaction.up_to):
        message = f"{what} gives `{interaction.gives}` without a limit"
        yield InteractionFault("LJ0106", (), message, "add `up_to`, a limit of the actor, or `from`")
    elif interaction.own and interaction.own not in states:
        message = f"{what} changes `{interaction.own}`, which is no state of it"
        words = ("takes" if interaction.takes else "from",)
        yield InteractionFault(
            "LJ0126", words, message, f"declare it: `state {interaction.own} = …`", interaction.own, states
        )


def actor_fault(by: str, engines: Iterable[str], roles: Collection[str]) -> InteractionFault | None:
    """The error of `by`, or None. `engines` are those of the mission's assets, `roles` those of its agents; built-in
    engines are known too."""
    known = {kind.name for kind in builtin_engines().values() if kind.acts} | set(engines) | set(roles)
    if by in known:
        return None
    message = f"no known asset has the engine `{by}`"
    message += f", and no agent has the role `{by}`" if roles else ""
    hint = f"`by` names the engine or role of the actor: {', '.join(sorted(known))}"
    return InteractionFault("LJ0125", ("by",), message, hint, by, known)


def shared_faults(interaction: Interaction, target: Holder, actors: Sequence[Holder]) -> Iterator[InteractionFault]:
    """Errors of the amount that an interaction moves between a target and its possible actors."""
    if not interaction.carried or not actors:
        return
    what = f"`{interaction.name}` of `{target.name}`"
    able = [actor for actor in actors if interaction.carried in actor.states]
    if not able:
        names = ", ".join(f"`{actor.name}`" for actor in actors)
        verb = "takes from" if interaction.takes else "gives"
        message = (
            f"{what} {verb} the `{interaction.carried}` of a `{interaction.by}` asset, which is no state of {names}"
        )
        hint = f"declare it with their type: `state {interaction.carried} = …`"
        states = [state for actor in actors for state in actor.states]
        yield InteractionFault("LJ0126", (), message, hint, interaction.carried, states)
    for actor in able:
        if interaction.up_to and interaction.up_to not in actor.kinds:
            message = f"{what} fills `{actor.name}` up to its `{interaction.up_to}`, which it does not have"
            hint = f"declare it with its type: `{interaction.up_to} = …`"
            yield InteractionFault("LJ0126", (), message, hint, interaction.up_to, list(actor.kinds))
        carried = actor.kinds[interaction.carried]
        for holder, name in ((target, interaction.own), (actor, interaction.up_to)):
            kind = holder.kinds.get(name, "") if name else ""
            if carried and kind and carried != kind:
                pair = f"`{actor.name}.{interaction.carried}` is {carried}, `{holder.name}.{name}` {kind}"
                message = f"{what} moves an amount between two dimensions: {pair}"
                yield InteractionFault("LJ0210", (), message, "declare both states with the same dimension")


def faults_of(mission: Mission) -> Iterator[tuple[str, InteractionFault]]:
    """Errors of a mission's interactions and states that the compiler of a text reports too, with the path of the
    group."""
    assets = [group for group in mission.groups if group.role == "asset"]
    roles = {agent.role for agent in mission.agents}
    for group in mission.groups:
        path = f"{mission.name}/{group.name}"
        for prop in group.properties:
            if prop.state and (reason := _no_state(prop)):
                yield path, InteractionFault("LJ0201", (), f"`{prop.name}` of `{group.name}` {reason}", "")
        target = _holder(group)
        for spec in group.interactions:
            by_fault = actor_fault(spec.by, (asset.engine for asset in assets), roles) if spec.by else None
            actors = [_holder(asset) for asset in assets if _acts(asset, spec.by, mission)]
            faults = (*own_faults(spec, target.states), *((by_fault,) if by_fault else ()))
            yield from ((path, fault) for fault in (*faults, *shared_faults(spec, target, actors)))


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
    return with_article("bare number" if unit is None or unit.dimension == NONE else dimension_name(unit.dimension))


def unrestricted_unlocks(entities: Iterable[Entity], unlocks: Iterable[Unlock]) -> tuple[Unlock, ...]:
    """Unlocks without a condition, for the interactions that no `unlock` line of the mission names for the target's
    group."""
    bound = {(unlock.interaction, parameter.domain) for unlock in unlocks for parameter in unlock.parameters}
    free = dict.fromkeys((spec.name, entity.group) for entity in entities for spec in entity.interactions)
    return tuple(
        Unlock(interaction=name, parameters=(RuleParameter(name="target", domain=group),), condition=Flag(value=True))
        for name, group in free
        if (name, group) not in bound
    )
