"""`TimeLimit`: the time available for a condition, in ticks, seconds and words."""

from __future__ import annotations

import msgspec

from lingjing.mission.conditions.outline import Outline
from lingjing.mission.feasibility.proof import spelled


class TimeLimit(msgspec.Struct, frozen=True):
    """A budget of ticks."""

    ticks: float
    seconds: float
    """The duration of these ticks in simulated seconds."""
    at: str
    """The path of the budget."""
    words: str
    """The budget in words, for messages."""


def episode(outline: Outline) -> TimeLimit:
    """The limit of the whole episode."""
    return _limit(outline, outline.ticks, "budget/ticks", "the budget")


def of_stage(outline: Outline, name: str, ticks: float) -> TimeLimit:
    """The limit of a stage, or that of the episode if it is shorter."""
    whole = episode(outline)
    return _limit(outline, ticks, f"stage/{name}", f"the budget of stage `{name}`") if ticks < whole.ticks else whole


def _limit(outline: Outline, ticks: float, at: str, owner: str) -> TimeLimit:
    tick_s = outline.instance.clock.tick_s
    seconds = ticks * tick_s
    plural = "tick" if ticks == 1 else "ticks"
    words = f"{owner} is {spelled(ticks)} {plural} of {spelled(tick_s)} s = {spelled(seconds)} s"
    return TimeLimit(ticks, seconds, at, words)
