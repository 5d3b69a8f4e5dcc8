"""The checks of an engine against its description in `kinds.json`, on which proofs rest: speeds and status words.

Proofs conclude from these values that a mission cannot be won in time. An engine that is faster than its description
makes them wrong.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from lingjing.mission.conditions.motion import Air, ceiling
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.kinds import engine_kind
from lingjing.mission.vocabulary import DORMANT
from lingjing.plugins.conformance.case import EngineCase, play, require
from lingjing.plugins.engine import Boundary
from lingjing.trace.records import BodyState

ALLOWANCE_M = 0.05
"""The distance in one interval that is allowed beyond the described speed, metres. Chosen: a contact moves a body
aside."""

_PUSHES = frozenset(("collided", "fell"))
"""The events after which a body's speed is not its own."""

_ROUNDING = 1.001
"""The factor for the rounding of times and positions. Chosen."""


def check_speed(case: EngineCase) -> None:
    """Check that no body moves faster over ground than `top_speed` of its `kinds.json` allows, and that a body without
    commands does not move by itself if the engine `stays`."""
    run = play(case)
    air = _air(case.instance)
    driven = {command.resource for command in case.commands if command.origin == "agent"}
    carried = {command.resource for command in case.commands} - driven  # an interaction may move it at once
    boundaries = (run.ready, *run.boundaries)
    for entity in (entity for entity in case.owned if entity.id not in carried):
        most_mps = ceiling(entity, {}, air, driven=entity.id in driven)
        if math.isfinite(most_mps):
            _check_speed(entity, most_mps, boundaries, is_driven=entity.id in driven)


def check_words(case: EngineCase) -> None:
    """Check that the engine gives its bodies only the status words that its `kinds.json` lists, if it lists any."""
    words = engine_kind(case.plugin.name).words
    if words is None:
        return
    run, owned = play(case), {entity.id: entity for entity in case.owned}
    for state in (state for boundary in (run.ready, *run.boundaries) for state in boundary.states):
        entity = owned.get(state.id)
        if entity is not None and state.status not in ("", *words, DORMANT):
            done = {interaction.done_word for interaction in entity.interactions}
            known = f"`kinds.json` lists {', '.join(words)}"
            require(state.status in done, f"`{state.id}` has the status `{state.status}`: {known}")


def _check_speed(entity: Entity, most_mps: float, boundaries: Sequence[Boundary], *, is_driven: bool) -> None:
    for first, second in pairwise(boundaries):
        if any(event.kind in _PUSHES and entity.id in event.entities for event in second.events):
            return  # from a contact or a fall on it moves as the other body pushes it
        before, after = _state_of(entity, first), _state_of(entity, second)
        start_s, end_s = first.time_s, second.time_s
        if before is None or after is None or end_s <= start_s:
            continue
        moved_m = math.dist(before.position[:2], after.position[:2])
        allowed_m = most_mps * (end_s - start_s) * _ROUNDING + ALLOWANCE_M
        bound = f"its `kinds.json` allows {most_mps:.2f} m/s" + ("" if is_driven else " without a command")
        require(
            moved_m <= allowed_m,
            f"`{entity.id}` moves {moved_m:.2f} m from {start_s:g} s to {end_s:g} s "
            f"({moved_m / (end_s - start_s):.2f} m/s), and {bound}",
        )


def _state_of(entity: Entity, boundary: Boundary) -> BodyState | None:
    return next((state for state in boundary.states if state.id == entity.id), None)


def _air(instance: Instance) -> Air:
    """Return the strongest wind and current of the mission."""
    weathers = (instance.weather, *(event.weather for event in instance.events if event.weather is not None))
    return Air(max(each.wind_mps for each in weathers), max(each.current_mps for each in weathers))


__all__ = ["ALLOWANCE_M", "check_speed", "check_words"]
