"""The head and the ending of a page: data of an episode that do not change from step to step."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from lingjing.mission.geometry2d import Extent, Vector2
from lingjing.mission.instance import Entity, Instance
from lingjing.scene.surroundings import OVERHEAD_M
from lingjing.terminal import visible
from lingjing.trace.records import CUT_SHORT, Header, Outcome
from lingjing.viewer.state import EpisodeState

LEAST_M = 120.0
"""Smallest width of the shown extent, metres. Chosen."""


class AgentCard(msgspec.Struct, frozen=True):
    """An agent and the entities that it controls."""

    id: str
    role: str
    policy: str
    privileged: bool
    controls: tuple[str, ...]


class EntityCard(msgspec.Struct, frozen=True):
    """An entity of the view."""

    id: str
    role: str
    type: str
    label: str
    colour: int
    """Number of the asset, from 0, which selects its colour. -1 for a target."""


class RelationCard(msgspec.Struct, frozen=True):
    """A coordination relation that the mission declares between groups of agents or between stages."""

    kind: str
    source: str
    target: str
    mutual: bool


class EpisodeHead(msgspec.Struct, frozen=True):
    """The data of an episode that apply to all steps."""

    mission: str
    title: str
    goal: str
    seed: int
    mode: str
    policies: tuple[str, ...]
    ticks: int
    """The budget of the mission."""
    tick_s: float
    """Length of a tick, seconds."""
    agents: tuple[AgentCard, ...]
    relations: tuple[RelationCard, ...]
    regions: tuple[tuple[Vector2, ...], ...]
    """Outlines, metres."""
    frame: Extent
    """The shown extent: west, south, east, north; metres."""
    credit: str
    """Credit for the map, which must be shown; "" if none is required."""
    truth: bool
    """True if the page contains hidden entities and true boxes."""


class EndingCard(msgspec.Struct, frozen=True):
    """The ending of an episode."""

    state: str
    """`won`, `lost`, `cut` (it did not end by itself) or `open` (no end is recorded)."""
    line: str
    """The cause in words."""
    why: str = ""
    """The whole explanation; "" if the truth must not be shown."""


def head_of(header: Header, credit: str, *, truth: bool, places: Iterable[Vector2] = ()) -> EpisodeHead:
    """Return the head of an episode. `places` are known positions of its entities that may be shown."""
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
            dict.fromkeys(
                RelationCard(relation.kind, relation.source, relation.target, relation.mutual)
                for relation in instance.relations
            )
        ),
        regions=regions,
        frame=_frame(instance, (point for polygon in regions for point in polygon), places, truth=truth),
        credit=visible(credit),
        truth=truth,
    )


def card_of(entity: Entity, colour: int) -> EntityCard:
    """Return the card of an entity, which a page receives when the entity is first shown."""
    return EntityCard(entity.id, entity.role, visible(entity.type), visible(entity.label), colour)


def ending_of(outcome: Outcome | None, cause: str, why: str = "") -> EndingCard:
    """Return the ending. `cause` and `why` are the texts of `lingjing.analysis.ending`."""
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
    """Return the box around everything that may be shown, at least `LEAST_M` wide and high."""
    state = EpisodeState(instance, truth=truth)
    spots: list[Vector2] = [*corners, *places, *(place for _, place, _ in state.visible_targets())]
    spots += [(asset.position[0], asset.position[1]) for asset in state.assets if asset.position[2] < OVERHEAD_M]
    xs, ys = [x for x, _ in spots] or [0.0], [y for _, y in spots] or [0.0]
    wide, high = max(max(xs) - min(xs), LEAST_M) / 2, max(max(ys) - min(ys), LEAST_M) / 2
    x, y = (max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2
    return x - wide, y - high, x + wide, y + high
