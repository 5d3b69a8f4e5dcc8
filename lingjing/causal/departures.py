"""Departures of agents from their references, and the boundaries from which pairs are substituted.

A substitution always concerns a pair of a faculty and its agent. By default it lasts from the pair's first departure
in the trace to the end. A search may find that a later start repairs, or find pairs that depart only where others are
substituted.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import cast

from lingjing.causal.interventions import BranchPlan
from lingjing.causal.later_starts import later_starts, runs_of
from lingjing.causal.narrowing import Windows
from lingjing.causal.shapley import AgentFaculty
from lingjing.trace.records import Faculty, Substitution

PairTicks = Mapping[tuple[str, str], Sequence[int]]
"""Boundaries by (faculty, agent), ascending."""


class Departures:
    """The departures and agreements of a trace by pair, with the findings of a search.

    `pairs` are in the order of their first departures, then of `agents`; pairs that depart only in branches follow.
    """

    def __init__(self, departed: PairTicks, agreed: PairTicks, agents: Sequence[str]) -> None:
        def first_and_agent(item: tuple[tuple[str, str], Sequence[int]]) -> tuple[int, int, str]:
            (faculty, agent), ticks = item
            return ticks[0], agents.index(agent), faculty

        ordered = sorted(departed.items(), key=first_and_agent)
        self.pairs = {(cast("Faculty", faculty), agent): tuple(ticks) for (faculty, agent), ticks in ordered}
        self.in_trace = dict(self.pairs)
        self.masked: set[AgentFaculty] = set()
        """Pairs that do not depart anywhere in the trace."""
        self._agreed = agreed
        self._since: dict[AgentFaculty, int] = {}

    def begin_at(self, pairs: Iterable[AgentFaculty], tick: int) -> None:
        """Let the substitution of these pairs start at that boundary."""
        self._since |= dict.fromkeys(pairs, tick)

    def show(self, shown: Mapping[AgentFaculty, Sequence[int]], begin: int) -> None:
        """Add departures of a branch in which other pairs were substituted; these start at `begin`."""
        self.begin_at(shown, begin)
        self.masked |= shown.keys() - self.pairs.keys()
        for pair, ticks in shown.items():
            self.pairs[pair] = tuple(sorted({*ticks, *self.pairs.get(pair, ())}))

    def start(self, pair: AgentFaculty) -> int:
        """Return the boundary at which the substitution of a pair starts if it lasts to the end."""
        return self._since.get(pair, self.pairs[pair][0])

    def from_start(self, pair: AgentFaculty) -> list[int]:
        """Return the departures of a pair from its start on."""
        return [tick for tick in self.pairs[pair] if tick >= self.start(pair)]

    def is_late(self, pair: AgentFaculty) -> bool:
        """Return whether the substitution of a pair starts after its first departure."""
        return self._since.get(pair, 0) > self.pairs[pair][0]

    def later_starts(self, pair: AgentFaculty) -> list[int]:
        """Return other starts for a pair, the likeliest first."""
        return later_starts(self.pairs[pair], self._right(pair))

    def runs(self, pair: AgentFaculty) -> int:
        """Return the number of runs of departures of a pair."""
        return len(runs_of(self.pairs[pair], self._right(pair)))

    def right_at_first(self, agent: str) -> bool:
        """Return whether an agent agreed with its reference before its first departure."""
        departed = self._first(agent)
        return any(name == agent and ticks[0] < departed for (_, name), ticks in self._agreed.items())

    def onset(self, pair: AgentFaculty, replaced: int) -> int:
        """Return the onset of the error that is first replaced at boundary `replaced`.

        For an agent that agreed before, and did not depart before, it is its first departure. For any other agent it
        is the first departure of the pair's run that leads up to that boundary.
        """
        first_departure = self.pairs[pair][0]
        if first_departure == self._first(pair[1]) and self.right_at_first(pair[1]):
            return first_departure
        right = max((tick for tick in self._right(pair) if tick < replaced), default=-1)
        return min((tick for tick in self.from_start(pair) if right < tick <= replaced), default=replaced)

    def plan(self, pairs: Iterable[AgentFaculty], windows: Windows = ()) -> BranchPlan:
        """Return the plan that substitutes the pairs, each in its window or from its start."""
        narrow = {pair: (first, last) for pair, first, last in windows}
        spans = {pair: narrow.get(pair, (self.start(pair), None)) for pair in pairs}
        return BranchPlan(
            at=min(first for first, _ in spans.values()),
            substitutions=tuple(
                Substitution(faculty=pair[0], agent=pair[1], first=spans[pair][0], last=spans[pair][1])
                for pair in self.pairs
                if pair in spans
            ),
        )

    def _first(self, agent: str) -> int:
        return min(ticks[0] for (_, name), ticks in self.pairs.items() if name == agent)

    def _right(self, pair: AgentFaculty) -> Sequence[int]:
        """Return the agreements of a pair. A masked pair has none, because it was never compared in the trace."""
        return () if pair in self.masked else self._agreed.get((pair[0], pair[1]), ())
