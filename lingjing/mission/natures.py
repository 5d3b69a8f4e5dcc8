"""The behaviour of a target without interaction, derived from its properties: burning, leaking, adrift, waiting.

A nature has a status word and the word that follows when the behaviour ends. Some natures have a `level`: a declared
state between 0 and 1 without unit, such as `heat`. An actor works it off in a given time, and it may grow back. A type
may declare its own first status word (`status = …`).

The city engine plays the natures, and the checker of the language reads from them which status words a target can
have.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Protocol

import msgspec

from lingjing.mission.instance import Entity
from lingjing.mission.vocabulary import CLEARED, DORMANT

PEOPLE = "people"
"""Name of the state that counts the people of a queue."""
CITY = "city"
"""Name of the engine that plays the natures."""
WAITING = "waiting"
"""Status of a target without another nature."""


class TargetNature(msgspec.Struct, frozen=True):
    """The behaviour of a target without interaction."""

    word: str = WAITING
    """Status word."""
    level: str = ""
    """Name of the state that actors work off; empty if there is none."""
    over: str = ""
    """Status when the level is 0; empty means the word of the interaction."""
    vanished: str = DORMANT
    """Status after the target has vanished."""
    lasts: bool = False
    """True if no interaction changes the status word."""
    work_s: float = 0.0
    """Time in which an actor reduces the level from 1 to 0, seconds, unless the interaction declares its own."""
    growth_hz: float = 0.0
    """Growth of the level per second while no actor works on it."""


FIRE = TargetNature("burning", level="heat", over="out", work_s=10.0, growth_hz=1.0 / 60.0)
"""A fire. It takes 10 s to put out and a minute to regain its full heat (both chosen)."""
LEAK = TargetNature("leaking", level="flow", over="sealed", work_s=5.0)
"""A leak. It takes 5 s to seal (chosen) and does not grow back."""
BLOCKAGE = TargetNature("blocking", vanished=CLEARED, lasts=True)
"""A target that blocks a road. Once vanished it is cleared."""

BREAK = TargetNature("fractured", lasts=True)
"""A broken bridge. It stays broken."""

ADRIFT = TargetNature("adrift")
QUEUE = TargetNature("queueing")
STORE = TargetNature("open", lasts=True)
"""A store with an unlimited supply. It stays open."""


class PlayedInteraction(Protocol):
    """The fields of an interaction that decide its target's status: those of a mission and of an instance alike."""

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def status(self) -> str: ...  # noqa: D102 - the declared word; "" for none
    @property
    def done_word(self) -> str: ...  # noqa: D102
    @property
    def takes(self) -> str: ...  # noqa: D102
    @property
    def source(self) -> str: ...  # noqa: D102
    @property
    def gives(self) -> str: ...  # noqa: D102
    @property
    def works_off(self) -> bool: ...  # noqa: D102
    @property
    def own(self) -> str: ...  # noqa: D102


class TargetTraits(msgspec.Struct, frozen=True):
    """The facts about a target that decide its nature."""

    states: Collection[str]
    """Names of its states."""
    properties: Collection[str]
    """Names of its properties, with their units (`drift_mps`)."""
    interactions: Sequence[PlayedInteraction]
    surface: str = ""
    """The surface that it stands on; empty for none."""
    blocks: bool = False
    """True if it closes the road at its place."""


def is_never_negative(state: str, interactions: Iterable[PlayedInteraction]) -> bool:
    """True if a target's state is an amount: heat, flow, people, or what one of its interactions moves.

    `state`: the author's name. Declarations, draws and events give it 0 or more.
    """
    amounts = (FIRE.level, LEAK.level, PEOPLE)
    return state in amounts or any(state == interaction.own for interaction in interactions)


def traits_of(entity: Entity) -> TargetTraits:
    """The facts about a target of an instance."""
    return TargetTraits(
        states=[spec.field for spec in entity.state],
        properties=entity.properties,
        interactions=entity.interactions,
        surface=str(entity.properties.get("on", "")),
        blocks=entity.blocked_m is not None,
    )


def nature_of(traits: TargetTraits) -> TargetNature:
    """The nature of a target. A property `status` of its own replaces the nature's word."""
    for levelled in (FIRE, LEAK):
        if levelled.level in traits.states:
            return levelled
    if traits.blocks:
        return BLOCKAGE
    if "drift_mps" in traits.properties:
        return ADRIFT
    if PEOPLE in traits.states:
        return QUEUE
    if traits.surface == "bridge" and "width_m" in traits.properties:
        return BREAK
    if any(interaction.gives and not interaction.source for interaction in traits.interactions):
        return STORE  # unlimited: the goods that it gives are not counted anywhere
    return TargetNature()


def worked_levels(
    nature: TargetNature, interactions: Iterable[PlayedInteraction], states: Collection[str]
) -> dict[str, str]:
    """Name of each interaction that works off a state → the state.

    An interaction works off the state that it takes. The nature's own level belongs to the first interaction that takes
    and gives nothing, if no other one takes it.
    """
    possible = tuple(interactions)
    workers = {each.name: each.takes for each in possible if each.works_off and each.takes in states}
    idle = next((each.name for each in possible if not each.takes and not each.gives), "")
    if nature.level in states and nature.level not in workers.values() and idle:
        workers[idle] = nature.level
    return workers


def later_words(nature: TargetNature, interactions: Sequence[PlayedInteraction], states: Collection[str]) -> set[str]:
    """The status words that a target can have after its first one."""
    words = {nature.vanished, DORMANT}
    if nature.lasts:
        return words
    workers = worked_levels(nature, interactions, states)
    for interaction in interactions:
        if interaction.gives and not interaction.own:
            continue  # an unlimited supply never ends
        over = nature.over if interaction.name in workers else ""
        words.add(interaction.status or over or interaction.done_word)
    return words
