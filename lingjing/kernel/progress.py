"""How far an episode has come: the part of the registry that budgets, inspections, stages and constraints keep."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec
from msgspec import field


class Spent(msgspec.Struct, frozen=True):
    """What one agent's policy calls have cost so far: model tokens, US dollars, messages admitted."""

    tokens: int = 0
    money_usd: float = 0.0
    messages: int = 0


class Inspected(msgspec.Struct, frozen=True):
    """How far an inspection has come on the route numbered `route` (0: there is none yet).

    `seen` are the places of its waypoints that were inspected; `complete_s` is when the last one was, None before.
    """

    route: int = 0
    seen: frozenset[int] = frozenset()
    complete_s: float | None = None


class EpisodeProgress(msgspec.Struct, frozen=True):
    """The progress of an episode at one boundary.

    `used` counts by limit (`stage.name`, or `name` for the whole episode); `spent` by agent; `began` holds the tick at
    which a stage began for a subject; `broken` the time at which a constraint was first broken by a subject.
    """

    used: Mapping[str, int] = field(default_factory=dict)
    spent: Mapping[str, Spent] = field(default_factory=dict)
    inspected: Mapping[str, Inspected] = field(default_factory=dict)
    began: Mapping[tuple[str, str], int] = field(default_factory=dict)
    broken: Mapping[tuple[str, str], float] = field(default_factory=dict)
