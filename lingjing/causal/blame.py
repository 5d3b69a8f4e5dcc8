"""`blame`: what would have had to be different for a lost episode to be won, found by branches of it.

A null fork must be the episode itself. Then the smallest sets are looked for that repair it (`repairing_sets`). What
repairs is narrowed to the smallest window of boundaries that still does, by bisection over the boundaries at which
something was replaced. Shares are Shapley values of the game "which replaced pairs win": exact for few players, else by
sampled permutations (Castro, Gómez and Tejada 2009) from named streams. Placebos say how often a branch wins that has
no right to: one record replaced by itself, a destination moved by a few metres, a pair that no repair contains replaced
from somewhere on.

All branches of a trace are played under common random numbers: what a branch does not change draws what it drew.
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
from lingjing.causal.placebos import PlaceboKind, Placebos, judged_placebos, placebo_plans
from lingjing.causal.redriven import BranchOptions
from lingjing.causal.repairing_sets import RepairingSets
from lingjing.causal.shapley import AgentFaculty, Share, coalitions, shapley_shares
from lingjing.errors import UsageError
from lingjing.trace.reader import Trace
from lingjing.trace.records import CUT_SHORT, Faculty

EXACT_PLAYERS = 4
NARROWED = 3
"""So many repairs are narrowed, those that replace least first."""


class BlameOptions(msgspec.Struct, frozen=True, kw_only=True):
    """How hard to look: at most so many `branches`, `jobs` at a time, so many `placebos`, `shares` or none; `seed`
    starts the streams that permutations and placebos are drawn from. The others are those of `BranchOptions`."""

    branches: int = 120
    jobs: int = 2
    placebos: int = 8
    shares: bool = True
    seed: int = 0
    reference: str = "oracle"
    files: tuple[str, ...] = ()
    policies: dict[str, str] = {}
    calls: str = "replay"


class Cause(msgspec.Struct, frozen=True, kw_only=True):
    """One faculty of one agent that is to be blamed. `first` to `last` is the smallest window of boundaries in which
    replacing it repairs, as `fork` plays it again; `replaced` counts the records that are replaced in it. `boundary` is
    where it began: the first departure of an agent that decided as its reference before, and of any other the first of
    the departures that lead up to the first of those records with none right in between; `rows` counts such rows of
    departures. A `late` one is replaced from later on than its first departure: from there it does not repair alone,
    nor, in a set, with everything else that was done otherwise. A `masked` one shows only where others are replaced:
    `boundary` is that of its first departure there."""

    agent: str
    faculty: Faculty
    boundary: int
    first: int
    last: int
    replaced: int
    rows: int = 1
    late: bool = False
    masked: bool = False


class Repair(msgspec.Struct, frozen=True, kw_only=True):
    """A set of causes without which the episode is won, and no smaller one. `narrowed` says whether its windows were
    looked for; else they are all that was replaced. `score` and `ticks` are those of the branch in which just that was
    replaced."""

    causes: tuple[Cause, ...]
    score: float
    ticks: int
    narrowed: bool = True


class Blame(msgspec.Struct, frozen=True, kw_only=True):
    """What is to be blamed for a lost episode.

    `repairs` are all smallest repairing sets, in the order of `_least_and_earliest`; with `complete` all sets of that
    size were tried. `departed` counts the pairs in which agents departed from their
    references in the trace, `tried` the sets of them that were replaced to find the smallest. `exhausted` says that the
    budget of branches did not suffice for everything. `unanswered` counts the branches in which answers of policies
    were replaced for reasons for which none was in the trace. `cpu_s` is that of the branches, those included that idle
    workers began ahead for nothing; `driven_s` that of running the episode again, `camera_s` that of the camera,
    which drew `pictures` at most.
    """

    path: str
    success: bool
    reason: str
    score: float
    null: NullFork | None = None
    departed: int = 0
    repairs: tuple[Repair, ...] = ()
    complete: bool = True
    shares: tuple[Share, ...] = ()
    placebos: Placebos | None = None
    branches: int = 0
    exhausted: bool = False
    tried: int = 0
    unanswered: dict[str, int] = {}
    cpu_s: float = 0.0
    driven_s: float = 0.0
    pictures: int = 0
    camera_s: float = 0.0


def blame(trace: Trace, options: BlameOptions | None = None, progress: HostProgress | None = None) -> Blame:
    """Search for what repairs a lost episode; one that was won needs no branch.

    Raises `UsageError` for an episode that was cut short, or that cannot be branched here.
    """
    outcome = trace.outcome
    if outcome is None or outcome.reason in CUT_SHORT:
        raise UsageError(
            f"{trace.path} was cut short", hint="only an episode that ended by itself can be blamed on somebody"
        )
    told = Blame(path=str(trace.path), success=outcome.success, reason=outcome.reason, score=outcome.score)
    if outcome.success:
        return told
    options = options or BlameOptions()
    branched = BranchOptions(
        trace=str(trace.path), files=options.files, policies=options.policies, calls=options.calls,
        reference=options.reference, jobs=options.jobs,
    )  # fmt: skip
    with BranchHost(trace, branched, progress) as host:
        return _Search(host, options).run(told)


def _least_and_earliest(repair: Repair) -> tuple[bool, bool, int, int, int]:
    """The order of repairs. Narrowed ones come first; then those that repair whatever their agents did before. Of
    these, those that replace fewer records; of equals those whose departures have fewer rows: of many occasions one
    repairs by chance more easily. Then those that begin earlier: windows begin as late as they can, so of two the later
    one is often that nobody made good what the earlier one spoiled."""
    causes = repair.causes
    late = any(cause.late for cause in causes)
    replaced, rows = sum(cause.replaced for cause in causes), sum(cause.rows for cause in causes)
    return not repair.narrowed, late, replaced, rows, min(cause.first for cause in causes)


class _Search:
    """One search."""

    def __init__(self, host: BranchHost, options: BlameOptions) -> None:
        self._host = host
        self._options = options
        self._branches = BranchBudget(host, options.branches)
        agents = [agent.id for agent in host.trace.header.instance.agents]
        departed = host.departures()  # what agreed is known after it
        self._departures = Departures(departed, host.agreements, agents)

    def run(self, told: Blame) -> Blame:
        """The whole search."""
        branches, departures = self._branches, self._departures
        alone = [departures.plan((pair,)) for pair in departures.pairs][: max(0, branches.left - 1)]
        (null,) = branches.play([BranchPlan(at=0)], "null fork", ahead=alone)
        told = replace(told, null=NullFork.of(null), departed=len(departures.pairs), complete=False)
        if null.differs is None:
            sets, complete = RepairingSets(branches, departures).smallest()
            told = replace(told, tried=branches.kept)
            repairs = self._narrowed(sets)
            shares = self._shares(sets) if sets and self._options.shares else ()
            told = replace(told, repairs=repairs, complete=complete, shares=shares, placebos=self._placebos(sets))
        return replace(
            told,
            branches=self._host.played,
            exhausted=branches.short,
            unanswered=dict(sorted(branches.unanswered.items())),
            cpu_s=self._host.cpu_s + self._host.unused_s,
            driven_s=self._host.driven_s,
            pictures=self._host.pictures,
            camera_s=self._host.camera_s,
        )

    def _branch(self, pairs: frozenset[AgentFaculty]) -> BranchResult | None:
        """The branch in which just these were replaced; None if it was not played."""
        return self._branches.result(self._departures.plan(pairs))

    # -- when

    def _narrowed(self, sets: Sequence[frozenset[AgentFaculty]]) -> tuple[Repair, ...]:
        """The repairs, with the windows of the first of them; all of these are narrowed beside each other."""
        branches, departures = self._branches, self._departures
        found = {one: branch for one in sets if (branch := self._branch(one))}
        ranked = sorted(found, key=lambda one: (any(map(departures.is_late, one)), len(found[one].replaced)))
        replaced = [self._ticks(one, found[one]) for one in ranked]
        narrowings = [Narrowing(self._begins(ticks), ticks) for ticks in replaced[:NARROWED]]
        spans = [{pair: ReplacedSpan(departures.start(pair), ticks[pair]) for pair in ticks} for ticks in replaced]
        best = [found[one] for one in ranked]
        cut: set[int] = set()
        while asked := [(number, one) for number, search in enumerate(narrowings) if (one := search.question())]:
            plans = [departures.plan(ranked[number], one) for number, one in asked][: branches.left]
            ahead = [*self._later(sets), *(departures.plan(ranked[number], further) for number, _ in asked
                                           for further in narrowings[number].guesses())]  # fmt: skip
            played = branches.play(plans, "which boundaries", ahead)
            cut.update(number for number, _ in asked[len(plans) :])
            for place, (number, one) in enumerate(asked):
                won = place < len(played) and played[place].success
                if won:
                    best[number] = played[place]  # the last one that wins is that of the smallest windows
                narrowings[number].answer(one, self._ticks(ranked[number], played[place]) if won else None)
        branches.short |= bool(cut)
        spans[:NARROWED] = [search.spans() for search in narrowings]
        repairs = [
            self._repair(spans[number], best[number], narrowed=number < NARROWED and number not in cut)
            for number in range(len(ranked))
        ]
        return tuple(sorted(repairs, key=_least_and_earliest))

    def _ticks(self, pairs: frozenset[AgentFaculty], branch: BranchResult) -> dict[AgentFaculty, Sequence[int]]:
        """The boundaries at which a branch replaced something of each pair of a repair."""
        return {
            pair: [part.boundary for part in branch.replaced if (part.faculty, part.agent) == pair]
            for pair in self._departures.pairs
            if pair in pairs
        }

    def _begins(self, replaced: ReplacedTicks) -> dict[AgentFaculty, list[int]]:
        """From where each pair of a repair may have to be replaced: of a pair alone the departures in the trace, of
        several what the branch replaced, for one may depart only where another is replaced."""
        begins: dict[AgentFaculty, list[int]] = {}
        for pair, ticks in replaced.items():
            start, departed = (
                self._departures.start(pair),
                ticks if len(replaced) > 1 else self._departures.from_start(pair),
            )
            begins[pair] = [start, *(tick for tick in departed if tick > start)]
        return begins

    def _repair(self, spans: Mapping[AgentFaculty, ReplacedSpan], branch: BranchResult, *, narrowed: bool) -> Repair:
        causes = tuple(self._cause(pair, span) for pair, span in spans.items())
        return Repair(causes=causes, score=branch.score, ticks=branch.ticks, narrowed=narrowed)

    def _cause(self, pair: AgentFaculty, span: ReplacedSpan) -> Cause:
        departures, ticks = self._departures, span.replaced
        return Cause(
            agent=pair[1],
            faculty=pair[0],
            boundary=departures.began(pair, ticks[0] if ticks else departures.pairs[pair][0]),
            first=span.first,
            last=ticks[-1] if ticks else span.first,
            replaced=len(ticks),
            rows=departures.rows(pair),
            late=departures.is_late(pair),
            masked=pair in departures.masked,
        )

    def _later(self, sets: Sequence[frozenset[AgentFaculty]]) -> list[BranchPlan]:
        """What shares and placebos are going to need, whatever narrowing finds."""
        players = self._players(sets)
        wanted = coalitions(players) if self._options.shares and len(players) <= EXACT_PLAYERS else []
        plans = [self._departures.plan(one) for one in wanted if one]
        return plans + [plan for some in self._placebo_plans(sets, self._branches.left).values() for plan in some]

    # -- how much, and by luck

    def _players(self, sets: Sequence[frozenset[AgentFaculty]]) -> list[AgentFaculty]:
        """Whose shares are told: the pairs of repairs, and a few others."""
        pairs = list(self._departures.pairs)
        involved = [pair for pair in pairs if any(pair in one for one in sets)]
        others = [pair for pair in pairs if pair not in involved]
        return involved[: 2 * EXACT_PLAYERS] + others[: max(0, EXACT_PLAYERS - 1 - len(involved))]

    def _shares(self, sets: Sequence[frozenset[AgentFaculty]]) -> tuple[Share, ...]:
        players = self._players(sets)
        return shapley_shares(players, self._values, exact=len(players) <= EXACT_PLAYERS, seed=self._options.seed)

    def _values(self, sets: Sequence[frozenset[AgentFaculty]]) -> list[float | None]:
        """1 for a set that wins, 0 for one that loses, None for one that the budget does not reach."""
        some = [one for one in sets if one]
        self._branches.won([self._departures.plan(one) for one in some], "shares")
        branches = {one: self._branch(one) for one in some}
        return [(float(told.success) if (told := branches[one]) else None) if one else 0.0 for one in sets]

    def _placebos(self, sets: Sequence[frozenset[AgentFaculty]]) -> Placebos:
        plans = self._placebo_plans(sets, self._branches.left)
        wanted = self._placebo_plans(sets, self._options.placebos)
        self._branches.short |= sum(map(len, plans.values())) < sum(map(len, wanted.values()))
        return judged_placebos(plans, self._branches.play([one for some in plans.values() for one in some], "placebos"))

    def _placebo_plans(self, sets: Sequence[frozenset[AgentFaculty]], most: int) -> dict[PlaceboKind, list[BranchPlan]]:
        """As many as were asked for and there are places for, `most` at most."""
        involved = {pair for one in sets for pair in one}
        innocent = {pair: ticks for pair, ticks in self._departures.in_trace.items() if pair not in involved}
        return placebo_plans(self._host.trace, innocent, min(self._options.placebos, most), self._options.seed)
