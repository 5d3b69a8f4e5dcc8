"""`RepairingSets`: the smallest sets of pairs that win a lost episode when they are replaced.

From coarse to fine. Each pair alone, from its first departure on; where that loses and its agent has ways of its own,
from a few later ones on. Where none repairs, all at once. If that does not win either, what agents then get wrong that
they never came to before, or earlier than before, is replaced too, until it wins or nothing new shows; and if it never
wins, all of it from later on. Then smaller and smaller sets are tried (delta debugging; Zeller and Hildebrandt 2002),
and all sets of two.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import cast

from msgspec.structs import replace

from lingjing.causal.beginnings import LATER
from lingjing.causal.branch_budget import BranchBudget
from lingjing.causal.delta_debugging import minimize
from lingjing.causal.departures import Departures
from lingjing.causal.shapley import AgentFaculty
from lingjing.trace.records import Faculty

MOST_PAIRS = 45
"""So many sets of two are tried: all of ten faculties of agents."""


class RepairingSets:
    """One search for them. What it learns of departures stays in `departures`, for whoever narrows its sets."""

    def __init__(self, branches: BranchBudget, departures: Departures) -> None:
        self._branches = branches
        self._departures = departures

    def smallest(self) -> tuple[list[frozenset[AgentFaculty]], bool]:
        """All repairing sets of the smallest size, and whether all sets of that size were tried."""
        branches, departures = self._branches, self._departures
        if found := self._alone() + self._alone_later():
            return found, not branches.short
        if not departures.pairs or not self._all_repair():
            return [], not branches.short
        if found := self._alone():
            return found, not branches.short
        pairs = list(departures.pairs)
        one = self._reduced(pairs)
        every_two = [frozenset(two) for two in combinations(pairs, 2) if not departures.masked >= set(two)]
        twos = every_two[:MOST_PAIRS]
        found = self._repairing(twos, "two at a time")
        every = not branches.short and len(twos) == len(every_two)
        if found:
            return found, every
        return [one], every and len(one) <= 2

    def _repairing(self, sets: Sequence[frozenset[AgentFaculty]], what: str) -> list[frozenset[AgentFaculty]]:
        """Those of the sets that win, as far as the budget goes."""
        won = self._branches.won([self._departures.plan(one) for one in sets], what)
        return [one for one, good in zip(sets, won, strict=True) if good]

    def _alone(self) -> list[frozenset[AgentFaculty]]:
        """The pairs of the trace that repair alone."""
        departures = self._departures
        singles = [frozenset((pair,)) for pair in departures.pairs if pair not in departures.masked]
        return self._repairing(singles, "one at a time")

    def _alone_later(self) -> list[frozenset[AgentFaculty]]:
        """The pairs that repair alone from a later departure on. Half of the branches that are left may be spent on it;
        an agent that decided as its reference before has nothing that replacing it from its first departure spoils."""
        branches, departures = self._branches, self._departures
        begins = {
            pair: departures.later_beginnings(pair)
            for pair in departures.pairs
            if (branch := branches.result(departures.plan((pair,)))) and not branch.success
            if not departures.right_at_first(pair[1])
        }
        found: list[frozenset[AgentFaculty]] = []
        room = branches.left // 2
        for turn in range(LATER):
            asked = [(pair, ticks[turn]) for pair, ticks in begins.items() if turn < len(ticks)]
            within = asked[:room]
            branches.short |= len(within) < len(asked)
            room -= len(within)
            plans = [departures.plan((pair,), ((pair, tick, None),)) for pair, tick in within]
            for (pair, tick), good in zip(within, branches.won(plans, "later beginnings"), strict=True):
                if good:
                    departures.begin_at((pair,), tick)
                    found += [frozenset((pair,))]
                    del begins[pair]
        return found

    def _all_repair(self) -> bool:
        """Whether replacing everything wins, from the first departure of all on or from a later one of some pair."""
        departures = self._departures
        later = sorted({tick for pair in departures.pairs for tick in departures.later_beginnings(pair)[:1]})
        if self._all_repair_from(min(ticks[0] for ticks in departures.pairs.values())):
            return True
        for begin in later[:LATER]:
            departures.begin_at(departures.pairs, begin)
            if self._all_repair_from(begin):
                return True
        return False

    def _all_repair_from(self, begin: int) -> bool:
        """Whether replacing everything wins. Where it does not, what shows only then is added to what there is, and it
        is tried again."""
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
        """A set that repairs and of which no pair can be left out."""

        def first_repairing(candidates: Sequence[tuple[AgentFaculty, ...]]) -> int | None:
            plans = [self._departures.plan(one) for one in candidates if one]
            return next(
                (number for number, good in enumerate(self._branches.won(plans, "fewer at a time")) if good), None
            )

        return frozenset(minimize(pairs, first_repairing))
