"""`Departures`: where agents decided otherwise than their references, and from where on that is to be replaced.

What is replaced is always a pair of a faculty and its agent. As a rule it is from the pair's first departure in the
trace on to the end; a search may find that a later beginning repairs, or pairs that depart only where others are
replaced.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import cast

from lingjing.causal.beginnings import later_beginnings, rows_of
from lingjing.causal.interventions import BranchPlan
from lingjing.causal.narrowing import Windows
from lingjing.causal.shapley import AgentFaculty
from lingjing.trace.records import Faculty, Substitution

PairTicks = Mapping[tuple[str, str], Sequence[int]]
"""Boundaries by (faculty, agent), ascending."""


class Departures:
    """The departures and agreements of a trace by pair, and what a search found of them. `pairs` are in the order of
    their first departures, of equals in that of `agents`; those that show only in branches follow."""

    def __init__(self, departed: PairTicks, agreed: PairTicks, agents: Sequence[str]) -> None:
        def first_and_agent(item: tuple[tuple[str, str], Sequence[int]]) -> tuple[int, int, str]:
            (faculty, agent), ticks = item
            return ticks[0], agents.index(agent), faculty

        ordered = sorted(departed.items(), key=first_and_agent)
        self.pairs = {(cast("Faculty", faculty), agent): tuple(ticks) for (faculty, agent), ticks in ordered}
        self.in_trace = dict(self.pairs)
        self.masked: set[AgentFaculty] = set()
        """Those that depart nowhere in the trace."""
        self._agreed = agreed
        self._since: dict[AgentFaculty, int] = {}

    def begin_at(self, pairs: Iterable[AgentFaculty], tick: int) -> None:
        """From now on these are replaced from that boundary on."""
        self._since |= dict.fromkeys(pairs, tick)

    def show(self, shown: Mapping[AgentFaculty, Sequence[int]], begin: int) -> None:
        """Add what agents got wrong in a branch in which others were replaced; it is replaced from `begin` on."""
        self.begin_at(shown, begin)
        self.masked |= shown.keys() - self.pairs.keys()
        for pair, ticks in shown.items():
            self.pairs[pair] = tuple(sorted({*ticks, *self.pairs.get(pair, ())}))

    def start(self, pair: AgentFaculty) -> int:
        """From where a pair is replaced that is to the end."""
        return self._since.get(pair, self.pairs[pair][0])

    def from_start(self, pair: AgentFaculty) -> list[int]:
        """The departures of a pair from where it is to be replaced."""
        return [tick for tick in self.pairs[pair] if tick >= self.start(pair)]

    def is_late(self, pair: AgentFaculty) -> bool:
        """Whether a pair is replaced from later than its first departure on."""
        return self._since.get(pair, 0) > self.pairs[pair][0]

    def later_beginnings(self, pair: AgentFaculty) -> list[int]:
        """From where else a pair might be replaced, likeliest first."""
        return later_beginnings(self.pairs[pair], self._right(pair))

    def rows(self, pair: AgentFaculty) -> int:
        """In how many rows a pair departed, with something right between two."""
        return len(rows_of(self.pairs[pair], self._right(pair)))

    def right_at_first(self, agent: str) -> bool:
        """Whether the first thing that an agent decided was right."""
        departed = self._first(agent)
        return any(who == agent and ticks[0] < departed for (_, who), ticks in self._agreed.items())

    def began(self, pair: AgentFaculty, replaced: int) -> int:
        """Where it began to go wrong what is first replaced at a boundary: the first departure of an agent that had
        decided something right before it and nothing wrong; of any other, where the departures of the pair begin that
        lead up to there with none right in between."""
        onset = self.pairs[pair][0]
        if onset == self._first(pair[1]) and self.right_at_first(pair[1]):
            return onset
        right = max((tick for tick in self._right(pair) if tick < replaced), default=-1)
        return min((tick for tick in self.from_start(pair) if right < tick <= replaced), default=replaced)

    def plan(self, pairs: Iterable[AgentFaculty], windows: Windows = ()) -> BranchPlan:
        """The pairs replaced, each in its window or from where it is to be replaced."""
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
        return min(ticks[0] for (_, who), ticks in self.pairs.items() if who == agent)

    def _right(self, pair: AgentFaculty) -> Sequence[int]:
        """Where a pair agreed with its reference; what shows only where others are replaced was never compared."""
        return () if pair in self.masked else self._agreed.get((pair[0], pair[1]), ())
