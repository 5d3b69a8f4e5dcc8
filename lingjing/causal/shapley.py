"""Shapley shares of a game: the players are pairs, substituted or not, and the value is 1 if the episode is won."""

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
"""Returns the values of coalitions, None for an unknown value."""

PERMUTATIONS = 24
"""The number of sampled permutations. Chosen."""

_NORMAL = 1.96
"""The 97.5 % quantile of the normal distribution."""


class Share(msgspec.Struct, frozen=True, kw_only=True):
    """The contribution of one pair, averaged over all orders of substitution.

    The shares of all players add up to the value of substituting all of them.
    """

    agent: str
    faculty: Faculty
    share: float
    """The contribution, -1 to 1."""
    low: float
    """Lower end of the 95 % interval of the sampled mean (normal approximation); `share` if it is exact."""
    high: float
    """Upper end of the interval of `low`."""
    exact: bool
    """True if all coalitions were played."""


def shapley_shares(players: Sequence[AgentFaculty], values: Values, *, exact: bool, seed: int) -> tuple[Share, ...]:
    """Return each player's share, the greatest first; empty if even the value of all players is unknown."""
    shares = _exact(players, values) if exact else None
    if shares is None:
        shares = _sampled(players, values, seed)
    return tuple(sorted(shares, key=lambda item: -item.share))


def coalitions(players: Sequence[AgentFaculty]) -> list[frozenset[AgentFaculty]]:
    """Return all coalitions, the smallest first."""
    return [frozenset(some) for size in range(len(players) + 1) for some in combinations(players, size)]


def _exact(players: Sequence[AgentFaculty], values: Values) -> list[Share] | None:
    """Return the shares over all coalitions; None if the value of one is unknown."""
    all_coalitions = coalitions(players)
    known = dict(zip(all_coalitions, values(all_coalitions), strict=True))
    if any(value is None for value in known.values()):
        return None
    shares, count = [], len(players)
    for player in players:
        total = 0.0
        for coalition in all_coalitions:
            if player not in coalition:
                weight = factorial(len(coalition)) * factorial(count - len(coalition) - 1) / factorial(count)
                total += weight * ((known[coalition | {player}] or 0.0) - (known[coalition] or 0.0))
        shares.append(Share(agent=player[1], faculty=player[0], share=total, low=total, high=total, exact=True))
    return shares


def _sampled(players: Sequence[AgentFaculty], values: Values, seed: int) -> list[Share]:
    """Return the shares over permutations, as far as their values are known."""
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
    """Return a random order of the players (Fisher and Yates) from a named stream."""
    order = list(players)
    for last in range(len(order) - 1, 0, -1):
        other = stream.below(last + 1)
        order[last], order[other] = order[other], order[last]
    return order
