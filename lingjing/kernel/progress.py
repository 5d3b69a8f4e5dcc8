"""The part of the registry that budgets, inspections, stages and constraints keep."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec
from msgspec import field


class Spent(msgspec.Struct, frozen=True):
    """The consumption of one agent so far."""

    tokens: int = 0
    """Model tokens, prompt and completion together."""
    money_usd: float = 0.0
    """Cost of model calls in US dollars."""
    messages: int = 0
    """Number of admitted messages."""


class Inspected(msgspec.Struct, frozen=True):
    """The state of one inspection on its present route."""

    route: int = 0
    """The number of the route; 0 if there is no route yet."""
    seen: frozenset[int] = frozenset()
    """Indices of the inspected waypoints."""
    complete_s: float | None = None
    """Simulated time in seconds at which the last waypoint was inspected; None before."""


class EpisodeProgress(msgspec.Struct, frozen=True):
    """The progress of an episode at one boundary."""

    used: Mapping[str, int] = field(default_factory=dict)
    """Counts by limit (`stage.name`, or `name` for the whole episode)."""
    claims: Mapping[tuple[str, str, str], str] = field(default_factory=dict)
    """Positive claims that a limit has counted, by identity (`lingjing.kernel.claims`), with their first report."""
    spent: Mapping[str, Spent] = field(default_factory=dict)
    """Consumption by agent."""
    inspected: Mapping[str, Inspected] = field(default_factory=dict)
    """Inspection states by inspection."""
    began: Mapping[tuple[str, str], int] = field(default_factory=dict)
    """The tick at which a stage began, by (stage, subject)."""
    broken: Mapping[tuple[str, str], float] = field(default_factory=dict)
    """The time in seconds at which a constraint was first broken, by (constraint, subject)."""
