"""`TimeLimit`: the time that a condition has, in mission time and in words."""

from __future__ import annotations

import msgspec

from lingjing.mission.feasibility.outline import Outline
from lingjing.mission.feasibility.proof import spelled


class TimeLimit(msgspec.Struct, frozen=True):
    """Ticks and the seconds they last; `at` is the path of the budget."""

    ticks: float
    seconds: float
    at: str
    words: str


def episode(outline: Outline) -> TimeLimit:
    """The whole episode's."""
    return _limit(outline, outline.ticks, "budget/ticks", "the budget")


def of_stage(outline: Outline, name: str, ticks: float) -> TimeLimit:
    """A stage's own, if that is shorter."""
    whole = episode(outline)
    return _limit(outline, ticks, f"stage/{name}", f"the budget of stage `{name}`") if ticks < whole.ticks else whole


def _limit(outline: Outline, ticks: float, at: str, owner: str) -> TimeLimit:
    tick_s = outline.instance.clock.tick_s
    seconds = ticks * tick_s
    plural = "tick" if ticks == 1 else "ticks"
    words = f"{owner} is {spelled(ticks)} {plural} of {spelled(tick_s)} s = {spelled(seconds)} s"
    return TimeLimit(ticks, seconds, at, words)
