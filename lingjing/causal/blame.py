"""The search for the causes of a lost episode, by branches.

First the null fork must equal the episode. Then the smallest repairing sets are searched (`repairing_sets`). Each
repair is narrowed by bisection to the smallest window of boundaries that still wins. Shares are Shapley values of the
game "which substituted pairs win": exact for few players, else from sampled permutations (Castro, Gómez and Tejada
2009) with named streams. Placebos measure how often a branch wins by chance: a decision replaced by itself, a
destination moved by a few metres, or the substitution of a pair that is in no repair.

All branches of a trace are played under common random numbers: draws that a branch does not affect are unchanged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec
from msgspec.structs import replace

from lingjing.causal.branch_budget import BranchBudget
from lingjing.causal.branch_host import BranchHost, HostProgress
from lingjing.causal.branching import BranchResult, NullFork
from lingjing.causal.departures import Departures
from lingjing.causal.interventions import BranchPlan
from lingjing.causal.narrowing import Narrowing, ReplacedSpan, ReplacedTicks
from lingjing.causal.placebos import PlaceboKind, Placebos, placebo_plans, placebo_result
from lingjing.causal.redriven import BranchOptions
from lingjing.causal.repairing_sets import RepairingSets
from lingjing.causal.shapley import AgentFaculty, Share, coalitions, shapley_shares
from lingjing.errors import UsageError
from lingjing.trace.reader import Trace
from lingjing.trace.records import CUT_SHORT, Faculty

EXACT_PLAYERS = 4
"""The greatest number of players for exact Shapley values: 2⁴ coalitions. Chosen."""

NARROWED = 3
"""The number of repairs that are narrowed, those with the fewest replaced records first. Chosen."""


class BlameOptions(msgspec.Struct, frozen=True, kw_only=True):
    """Options of the search. The fields without a comment are those of `BranchOptions`."""

    branches: int = 120
    """The greatest number of branches."""
    jobs: int = 2
    """Branches played in parallel."""
    placebos: int = 8
    """The number of placebos."""
    shares: bool = True
    """True if Shapley shares are computed."""
    seed: int = 0
    """The seed of permutations and placebos."""
    reference: str = "oracle"
    files: tuple[str, ...] = ()
    policies: dict[str, str] = {}
    calls: str = "replay"


class Cause(msgspec.Struct, frozen=True, kw_only=True):
    """One faculty of one agent that caused the loss."""

    agent: str
    faculty: Faculty
    boundary: int
    """The onset. For an agent that agreed with its reference before: its first departure. For any other agent: the
    first departure of the run that leads up to the first replaced record. For a masked cause: the first departure in
    the branch.
    """
    first: int
    """First boundary of the smallest window in which the substitution repairs; `fork` plays this window."""
    last: int
    """Last boundary of the window."""
    replaced: int
    """The number of records that are replaced in the window."""
    rows: int = 1
    """The number of runs of departures, that is, of departures without an agreement in between."""
    late: bool = False
    """True if the substitution starts after the first departure, because a substitution from the first departure on
    does not repair the episode, alone or in a set with all other departures.
    """
    masked: bool = False
    """True if the agent departs only in branches in which other pairs are substituted."""


class _Repair(msgspec.Struct, frozen=True, kw_only=True):
    """A set of causes: their substitution wins the episode, and no smaller set does."""

    causes: tuple[Cause, ...]
    score: float
    """The score of the branch that substitutes exactly these causes."""
    ticks: int
    """The ticks of the branch of `score`."""
    narrowed: bool = True
    """True if the windows were narrowed; else they cover everything that was replaced."""


class Blame(msgspec.Struct, frozen=True, kw_only=True):
    """The result of the search."""

    path: str
    """The trace."""
    success: bool
    """True if the episode was won; then nothing was searched."""
    reason: str
    score: float
    null: NullFork | None = None
    """The null fork; None if nothing was searched."""
    departed: int = 0
    """The number of pairs with departures in the trace."""
    repairs: tuple[_Repair, ...] = ()
    """All repairs of the smallest size, in the order of `_repair_order`."""
    complete: bool = True
    """True if all sets of that size were tried."""
    shares: tuple[Share, ...] = ()
    """Shapley shares, the greatest first."""
    placebos: Placebos | None = None
    """The placebos; None if none were planned."""
    branches: int = 0
    """The number of played branches."""
    exhausted: bool = False
    """True if the budget of branches was too small for the search."""
    tried: int = 0
    """The number of sets that were substituted to find the smallest."""
    unanswered: dict[str, int] = {}
    """Branches with replaced answers of policies, by reason, without the trace's own reasons."""
    cpu_s: float = 0.0
    """CPU time of the branches, including unused branches ahead, seconds."""
    driven_s: float = 0.0
    """CPU time of the replay of the episode, seconds."""
    pictures: int = 0
    """The number of requested pictures."""
    camera_s: float = 0.0
    """CPU time of the camera, seconds."""


def blame(trace: Trace, options: BlameOptions | None = None, progress: HostProgress | None = None) -> Blame:
    """Search for the repairs of a lost episode. A won episode needs no branch.

    Raises `UsageError` for an episode that was cut short, or that cannot be branched here.
    """
    outcome = trace.outcome
    if outcome is None or outcome.reason in CUT_SHORT:
        raise UsageError(f"{trace.path} was cut short", hint="blame needs an episode that ended by itself")
    result = Blame(path=str(trace.path), success=outcome.success, reason=outcome.reason, score=outcome.score)
    if outcome.success:
        return result
    options = options or BlameOptions()
    branched = BranchOptions(
        trace=str(trace.path), files=options.files, policies=options.policies, calls=options.calls,
        reference=options.reference, jobs=options.jobs,
    )  # fmt: skip
    with BranchHost(trace, branched, progress) as host:
        return _Search(host, options).run(result)


def _repair_order(repair: _Repair) -> tuple[bool, bool, int, int, int]:
    """Return the sort key of a repair.

    Narrowed repairs come first, then those that start at the first departures, then those with fewer replaced records,
    then those with fewer runs of departures (with many runs, a repair by chance is more likely), then earlier ones.
    Windows begin as late as possible. A later window often compensates for the loss of an earlier one, so earlier
    windows have precedence.
    """
    causes = repair.causes
    late = any(cause.late for cause in causes)
    replaced, rows = sum(cause.replaced for cause in causes), sum(cause.rows for cause in causes)
    return not repair.narrowed, late, replaced, rows, min(cause.first for cause in causes)


class _Search:
    """One search for the causes of a loss."""

    def __init__(self, host: BranchHost, options: BlameOptions) -> None:
        self._host = host
        self._options = options
        self._branches = BranchBudget(host, options.branches)
        agents = [agent.id for agent in host.trace.header.instance.agents]
        departed = host.departures()  # `host.agreements` is known after it
        self._departures = Departures(departed, host.agreements, agents)

    def run(self, result: Blame) -> Blame:
        """Run the search."""
        branches, departures = self._branches, self._departures
        alone = [departures.plan((pair,)) for pair in departures.pairs][: max(0, branches.left - 1)]
        (null,) = branches.play([BranchPlan(at=0)], "null fork", ahead=alone)
        result = replace(result, null=NullFork.of(null), departed=len(departures.pairs), complete=False)
        if null.differs is None:
            sets, complete = RepairingSets(branches, departures).smallest()
            result = replace(result, tried=branches.kept)
            repairs = self._narrow(sets)
            shares = self._shares(sets) if sets and self._options.shares else ()
            result = replace(result, repairs=repairs, complete=complete, shares=shares, placebos=self._placebos(sets))
        return replace(
            result,
            branches=self._host.played,
            exhausted=branches.short,
            unanswered=dict(sorted(branches.unanswered.items())),
            cpu_s=self._host.cpu_s + self._host.unused_s,
            driven_s=self._host.driven_s,
            pictures=self._host.pictures,
            camera_s=self._host.camera_s,
        )

    def _branch(self, pairs: frozenset[AgentFaculty]) -> BranchResult | None:
        """Return the branch that substitutes exactly these pairs, or None if it was not played."""
        return self._branches.result(self._departures.plan(pairs))

    # -- windows

    def _narrow(self, sets: Sequence[frozenset[AgentFaculty]]) -> tuple[_Repair, ...]:
        """Return the repairs with the windows of the first `NARROWED` ones, which are narrowed in parallel."""
        branches, departures = self._branches, self._departures
        wins = {item: branch for item in sets if (branch := self._branch(item))}
        ranked = sorted(wins, key=lambda item: (any(map(departures.is_late, item)), len(wins[item].replaced)))
        replaced = [self._ticks(item, wins[item]) for item in ranked]
        narrowings = [Narrowing(self._starts(ticks), ticks) for ticks in replaced[:NARROWED]]
        spans = [{pair: ReplacedSpan(departures.start(pair), ticks[pair]) for pair in ticks} for ticks in replaced]
        best = [wins[item] for item in ranked]
        cut: set[int] = set()
        while questions := [(number, item) for number, search in enumerate(narrowings) if (item := search.question())]:
            plans = [departures.plan(ranked[number], item) for number, item in questions][: branches.left]
            ahead = [*self._later(sets), *(departures.plan(ranked[number], further) for number, _ in questions
                                           for further in narrowings[number].guesses())]  # fmt: skip
            played = branches.play(plans, "which boundaries", ahead)
            cut.update(number for number, _ in questions[len(plans) :])
            for place, (number, item) in enumerate(questions):
                won = place < len(played) and played[place].success
                if won:
                    best[number] = played[place]  # the last winning plan has the smallest windows
                narrowings[number].answer(item, self._ticks(ranked[number], played[place]) if won else None)
        branches.short |= bool(cut)
        spans[:NARROWED] = [search.spans() for search in narrowings]
        repairs = [
            self._repair(spans[number], best[number], narrowed=number < NARROWED and number not in cut)
            for number in range(len(ranked))
        ]
        return tuple(sorted(repairs, key=_repair_order))

    def _ticks(self, pairs: frozenset[AgentFaculty], branch: BranchResult) -> dict[AgentFaculty, Sequence[int]]:
        """Return the boundaries at which a branch replaced something, for each pair of a repair."""
        return {
            pair: [part.boundary for part in branch.replaced if (part.faculty, part.agent) == pair]
            for pair in self._departures.pairs
            if pair in pairs
        }

    def _starts(self, replaced: ReplacedTicks) -> dict[AgentFaculty, list[int]]:
        """Return the boundaries at which the substitution of each pair may have to start.

        For a single pair these are the departures in the trace. For several, they are those that the branch replaced,
        because one pair may depart only where another is substituted.
        """
        starts: dict[AgentFaculty, list[int]] = {}
        for pair, ticks in replaced.items():
            start, departed = (
                self._departures.start(pair),
                ticks if len(replaced) > 1 else self._departures.from_start(pair),
            )
            starts[pair] = [start, *(tick for tick in departed if tick > start)]
        return starts

    def _repair(self, spans: Mapping[AgentFaculty, ReplacedSpan], branch: BranchResult, *, narrowed: bool) -> _Repair:
        causes = tuple(self._cause(pair, span) for pair, span in spans.items())
        return _Repair(causes=causes, score=branch.score, ticks=branch.ticks, narrowed=narrowed)

    def _cause(self, pair: AgentFaculty, span: ReplacedSpan) -> Cause:
        departures, ticks = self._departures, span.replaced
        return Cause(
            agent=pair[1],
            faculty=pair[0],
            boundary=departures.onset(pair, ticks[0] if ticks else departures.pairs[pair][0]),
            first=span.first,
            last=ticks[-1] if ticks else span.first,
            replaced=len(ticks),
            rows=departures.runs(pair),
            late=departures.is_late(pair),
            masked=pair in departures.masked,
        )

    def _later(self, sets: Sequence[frozenset[AgentFaculty]]) -> list[BranchPlan]:
        """Return the plans that shares and placebos will need, independent of the result of narrowing."""
        players = self._players(sets)
        chosen = coalitions(players) if self._options.shares and len(players) <= EXACT_PLAYERS else []
        plans = [self._departures.plan(coalition) for coalition in chosen if coalition]
        return plans + [plan for group in self._placebo_plans(sets, self._branches.left).values() for plan in group]

    # -- shares and placebos

    def _players(self, sets: Sequence[frozenset[AgentFaculty]]) -> list[AgentFaculty]:
        """Return the pairs with shares: those of repairs, and a few others."""
        pairs = list(self._departures.pairs)
        involved = [pair for pair in pairs if any(pair in repair_set for repair_set in sets)]
        others = [pair for pair in pairs if pair not in involved]
        return involved[: 2 * EXACT_PLAYERS] + others[: max(0, EXACT_PLAYERS - 1 - len(involved))]

    def _shares(self, sets: Sequence[frozenset[AgentFaculty]]) -> tuple[Share, ...]:
        players = self._players(sets)
        return shapley_shares(players, self._values, exact=len(players) <= EXACT_PLAYERS, seed=self._options.seed)

    def _values(self, sets: Sequence[frozenset[AgentFaculty]]) -> list[float | None]:
        """Return 1 for a set that wins, 0 for one that loses, None for one beyond the budget."""
        not_empty = [item for item in sets if item]
        self._branches.won([self._departures.plan(item) for item in not_empty], "shares")
        branches = {item: self._branch(item) for item in not_empty}
        return [(float(branch.success) if (branch := branches[item]) else None) if item else 0.0 for item in sets]

    def _placebos(self, sets: Sequence[frozenset[AgentFaculty]]) -> Placebos:
        plans = self._placebo_plans(sets, self._branches.left)
        requested = self._placebo_plans(sets, self._options.placebos)
        self._branches.short |= sum(map(len, plans.values())) < sum(map(len, requested.values()))
        return placebo_result(
            plans, self._branches.play([plan for group in plans.values() for plan in group], "placebos")
        )

    def _placebo_plans(self, sets: Sequence[frozenset[AgentFaculty]], most: int) -> dict[PlaceboKind, list[BranchPlan]]:
        """Return the requested placebos, at most `most`, as far as the trace allows them."""
        involved = {pair for repair_set in sets for pair in repair_set}
        innocent = {pair: ticks for pair, ticks in self._departures.in_trace.items() if pair not in involved}
        return placebo_plans(self._host.trace, innocent, min(self._options.placebos, most), self._options.seed)
