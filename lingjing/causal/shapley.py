"""Shapley shares of a game whose players are replaced or not, and whose value is whether the episode is then won."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import combinations
from math import factorial
from statistics import fmean, stdev

import msgspec

from lingjing.mission.seeding import Stream
from lingjing.trace.records import Faculty

AgentFaculty = tuple[Faculty, str]
"""A faculty and its agent: a player of the game."""

Values = Callable[[Sequence[frozenset[AgentFaculty]]], list[float | None]]
"""The values of coalitions, None where one is not to be had."""

PERMUTATIONS = 24
_NORMAL = 1.96


class Share(msgspec.Struct, frozen=True, kw_only=True):
    """What one faculty of one agent contributes, on average over all orders in which the pairs can be replaced.

    The shares of all players sum up to what replacing all of them gains. `low` to `high` is the 95 % interval of the
    sampled mean (normal approximation); of an exact value both are the value.
    """

    agent: str
    faculty: Faculty
    share: float
    low: float
    high: float
    exact: bool


def shapley_shares(players: Sequence[AgentFaculty], values: Values, *, exact: bool, seed: int) -> tuple[Share, ...]:
    """Each player's share, the largest first; none where not even the value of all of them is to be had."""
    found = _exact(players, values) if exact else None
    if found is None:
        found = _sampled(players, values, seed)
    return tuple(sorted(found, key=lambda one: -one.share))


def coalitions(players: Sequence[AgentFaculty]) -> list[frozenset[AgentFaculty]]:
    """All of them, the smallest first."""
    return [frozenset(some) for size in range(len(players) + 1) for some in combinations(players, size)]


def _exact(players: Sequence[AgentFaculty], values: Values) -> list[Share] | None:
    """Over all coalitions; None if one of them has no value."""
    all_coalitions = coalitions(players)
    known = dict(zip(all_coalitions, values(all_coalitions), strict=True))
    if any(value is None for value in known.values()):
        return None
    shares, count = [], len(players)
    for player in players:
        total = 0.0
        for one in all_coalitions:
            if player not in one:
                weight = factorial(len(one)) * factorial(count - len(one) - 1) / factorial(count)
                total += weight * ((known[one | {player}] or 0.0) - (known[one] or 0.0))
        shares.append(Share(agent=player[1], faculty=player[0], share=total, low=total, high=total, exact=True))
    return shares


def _sampled(players: Sequence[AgentFaculty], values: Values, seed: int) -> list[Share]:
    """Over permutations, as many as have values."""
    gains: dict[AgentFaculty, list[float]] = {player: [] for player in players}
    for number in range(PERMUTATIONS):
        order = _shuffled(players, Stream(seed, f"shapley/{number}"))
        known = values([frozenset(order[:size]) for size in range(len(order) + 1)])
        if any(value is None for value in known):
            break
        for place, player in enumerate(order):
            gains[player].append((known[place + 1] or 0.0) - (known[place] or 0.0))
    return [_interval(player, each) for player, each in gains.items() if each]


def _interval(player: AgentFaculty, gains: Sequence[float]) -> Share:
    mean = fmean(gains)
    half = _NORMAL * stdev(gains) / math.sqrt(len(gains)) if len(gains) > 1 else 1.0
    low, high = max(-1.0, mean - half), min(1.0, mean + half)
    return Share(agent=player[1], faculty=player[0], share=mean, low=low, high=high, exact=False)


def _shuffled(players: Sequence[AgentFaculty], stream: Stream) -> list[AgentFaculty]:
    """Fisher and Yates, from a named stream."""
    order = list(players)
    for last in range(len(order) - 1, 0, -1):
        other = stream.below(last + 1)
        order[last], order[other] = order[other], order[last]
    return order
