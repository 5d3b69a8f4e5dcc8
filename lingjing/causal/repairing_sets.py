"""The search for the smallest repairs, that is, sets of pairs that win a lost episode when they are substituted.

The steps: each pair alone from its first departure; if it loses, and its agent departed from the start, from a few
later boundaries; if none repairs, all pairs together. If all together lose, pairs that depart only in that branch, or
earlier than before, are added until the branch wins or nothing new appears; if it never wins, all pairs from later
boundaries. Then smaller sets are tried (delta debugging; Zeller and Hildebrandt 2002), and all sets of two pairs.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import cast

from msgspec.structs import replace

from lingjing.causal.branch_budget import BranchBudget
from lingjing.causal.delta_debugging import minimize
from lingjing.causal.departures import Departures
from lingjing.causal.later_starts import LATER
from lingjing.causal.shapley import AgentFaculty
from lingjing.trace.records import Faculty

MOST_PAIRS = 45
"""The greatest number of sets of two pairs: all sets of ten pairs. Chosen."""


class RepairingSets:
    """One search. Its findings on departures stay in `departures`, for the narrowing of the sets."""

    def __init__(self, branches: BranchBudget, departures: Departures) -> None:
        self._branches = branches
        self._departures = departures

    def smallest(self) -> tuple[list[frozenset[AgentFaculty]], bool]:
        """Return all repairing sets of the smallest size, and whether all sets of that size were tried."""
        branches, departures = self._branches, self._departures
        if repairing := self._alone() + self._alone_later():
            return repairing, not branches.short
        if not departures.pairs or not self._all_repair():
            return [], not branches.short
        if repairing := self._alone():
            return repairing, not branches.short
        pairs = list(departures.pairs)
        reduced = self._reduced(pairs)
        every_two = [frozenset(two) for two in combinations(pairs, 2) if not departures.masked >= set(two)]
        twos = every_two[:MOST_PAIRS]
        repairing = self._repairing(twos, "two at a time")
        every = not branches.short and len(twos) == len(every_two)
        if repairing:
            return repairing, every
        return [reduced], every and len(reduced) <= 2

    def _repairing(self, sets: Sequence[frozenset[AgentFaculty]], work: str) -> list[frozenset[AgentFaculty]]:
        """Return the sets that win, within the budget."""
        won = self._branches.won([self._departures.plan(item) for item in sets], work)
        return [item for item, good in zip(sets, won, strict=True) if good]

    def _alone(self) -> list[frozenset[AgentFaculty]]:
        """Return the pairs of the trace that repair alone."""
        departures = self._departures
        singles = [frozenset((pair,)) for pair in departures.pairs if pair not in departures.masked]
        return self._repairing(singles, "one at a time")

    def _alone_later(self) -> list[frozenset[AgentFaculty]]:
        """Return the pairs that repair alone from a later start on.

        At most half of the remaining branches are used. Agents that agreed with their references at first are
        excluded: for them the first departure is the onset.
        """
        branches, departures = self._branches, self._departures
        starts = {
            pair: departures.later_starts(pair)
            for pair in departures.pairs
            if (branch := branches.result(departures.plan((pair,)))) and not branch.success
            if not departures.right_at_first(pair[1])
        }
        repairing: list[frozenset[AgentFaculty]] = []
        room = branches.left // 2
        for turn in range(LATER):
            requested = [(pair, ticks[turn]) for pair, ticks in starts.items() if turn < len(ticks)]
            within = requested[:room]
            branches.short |= len(within) < len(requested)
            room -= len(within)
            plans = [departures.plan((pair,), ((pair, tick, None),)) for pair, tick in within]
            for (pair, tick), good in zip(within, branches.won(plans, "later starts"), strict=True):
                if good:
                    departures.begin_at((pair,), tick)
                    repairing += [frozenset((pair,))]
                    del starts[pair]
        return repairing

    def _all_repair(self) -> bool:
        """Return whether substituting all pairs wins, from the first departure or from a later start of a pair."""
        departures = self._departures
        later = sorted({tick for pair in departures.pairs for tick in departures.later_starts(pair)[:1]})
        if self._all_repair_from(min(ticks[0] for ticks in departures.pairs.values())):
            return True
        for begin in later[:LATER]:
            departures.begin_at(departures.pairs, begin)
            if self._all_repair_from(begin):
                return True
        return False

    def _all_repair_from(self, begin: int) -> bool:
        """Return whether substituting all pairs wins. If not, newly visible departures are added and it is tried
        again.
        """
        branches, departures = self._branches, self._departures
        while branches.left:
            plan = departures.plan(departures.pairs)
            (result,) = branches.play([replace(plan, watch=True)], "all at once")
            branches.keep(plan, result)
            shown: dict[AgentFaculty, list[int]] = {}
            for part in result.departed:
                shown.setdefault((cast("Faculty", part.faculty), part.agent), []).append(part.boundary)
            if result.success or not shown:
                return result.success
            departures.show(shown, begin)
        branches.short = True
        return False

    def _reduced(self, pairs: Sequence[AgentFaculty]) -> frozenset[AgentFaculty]:
        """Return a repairing set from which no pair can be removed."""

        def first_repairing(candidates: Sequence[tuple[AgentFaculty, ...]]) -> int | None:
            plans = [self._departures.plan(candidate) for candidate in candidates if candidate]
            return next(
                (number for number, good in enumerate(self._branches.won(plans, "fewer at a time")) if good), None
            )

        return frozenset(minimize(pairs, first_repairing))
