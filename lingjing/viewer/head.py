"""What a page is told of an episode once, before its steps."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from lingjing.mission.geometry2d import Extent, Vector2
from lingjing.mission.instance import Entity, Instance
from lingjing.scene.surroundings import OVERHEAD_M
from lingjing.terminal import visible
from lingjing.trace.records import CUT_SHORT, Header, Outcome
from lingjing.viewer.state import Watched

LEAST_M = 120.0
"""The shown part of the world is at least so wide, metres."""


class AgentCard(msgspec.Struct, frozen=True):
    """An agent as a page names it, and the entities that it controls."""

    id: str
    role: str
    policy: str
    privileged: bool
    controls: tuple[str, ...]


class EntityCard(msgspec.Struct, frozen=True):
    """An entity that may be shown; `colour` numbers assets from 0, -1 is a target."""

    id: str
    role: str
    type: str
    label: str
    colour: int


class RelationCard(msgspec.Struct, frozen=True):
    """A coordination relation that the mission declares, between groups of agents or stages."""

    kind: str
    source: str
    target: str
    mutual: bool


class EpisodeHead(msgspec.Struct, frozen=True):
    """The episode but for its boundaries. `frame` is what to show of the world (west, south, east, north; metres);
    `credit` names whose map it is and must be shown; `truth` says whether hidden things are in it."""

    mission: str
    title: str
    goal: str
    seed: int
    mode: str
    policies: tuple[str, ...]
    ticks: int
    tick_s: float
    agents: tuple[AgentCard, ...]
    relations: tuple[RelationCard, ...]
    regions: tuple[tuple[Vector2, ...], ...]
    frame: Extent
    credit: str
    truth: bool


class EndingCard(msgspec.Struct, frozen=True):
    """How the episode ended: `line` in words, `why` the whole explanation where the truth may be shown. `state` is
    `won`, `lost`, `cut` (it did not end by itself) or `open` (no end is recorded)."""

    state: str
    line: str
    why: str = ""


def head_of(header: Header, credit: str, *, truth: bool, places: Iterable[Vector2] = ()) -> EpisodeHead:
    """The head of an episode; `places` are where its entities were, as far as that is known and may be shown."""
    instance = header.instance
    bindings = {binding.agent: binding for binding in header.bindings}
    agents = [
        AgentCard(
            id=visible(agent.id),
            role=visible(agent.role),
            policy=visible(bindings[agent.id].policy) if agent.id in bindings else "",
            privileged=agent.id in bindings and bindings[agent.id].privileged,
            controls=agent.controls,
        )
        for agent in instance.agents
    ]
    regions = tuple(region.polygon for region in instance.regions if region.polygon and (truth or not region.hidden))
    return EpisodeHead(
        mission=visible(instance.mission),
        title=visible(instance.title),
        goal=visible(instance.goal),
        seed=instance.seed,
        mode=instance.mode,
        policies=tuple(dict.fromkeys(card.policy for card in agents if card.policy)),
        ticks=instance.budget.ticks,
        tick_s=instance.clock.tick_s,
        agents=tuple(agents),
        relations=tuple(
            dict.fromkeys(RelationCard(one.kind, one.source, one.target, one.mutual) for one in instance.relations)
        ),
        regions=regions,
        frame=_frame(instance, (point for polygon in regions for point in polygon), places, truth=truth),
        credit=visible(credit),
        truth=truth,
    )


def card_of(entity: Entity, colour: int) -> EntityCard:
    """What a page is told of an entity when it is first shown."""
    return EntityCard(entity.id, entity.role, visible(entity.type), visible(entity.label), colour)


def ending_of(outcome: Outcome | None, cause: str, why: str = "") -> EndingCard:
    """The ending: `cause` is `lingjing why`'s line of what ended it."""
    if outcome is None:
        state = "open"
    elif outcome.reason in CUT_SHORT:
        state = "cut"
    else:
        state = "won" if outcome.success else "lost"
    return EndingCard(state, visible(cause), visible(why))


def _frame(
    instance: Instance, corners: Iterable[Vector2], places: Iterable[Vector2], *, truth: bool
) -> tuple[float, float, float, float]:
    """The box around everything that may be shown, widened to `LEAST_M`."""
    watched = Watched(instance, truth=truth)
    spots: list[Vector2] = [*corners, *places, *(place for _, place, _ in watched.seen_targets())]
    spots += [(one.position[0], one.position[1]) for one in watched.assets if one.position[2] < OVERHEAD_M]
    xs, ys = [x for x, _ in spots] or [0.0], [y for _, y in spots] or [0.0]
    wide, high = max(max(xs) - min(xs), LEAST_M) / 2, max(max(ys) - min(ys), LEAST_M) / 2
    x, y = (max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2
    return x - wide, y - high, x + wide, y + high
