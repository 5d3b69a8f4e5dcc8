"""`blame`: what would have had to be different for a lost episode to be won, found by branches of it.

The search goes from coarse to fine. A null fork must be the episode itself. Then each (faculty, agent) pair in which an
agent departed from its reference is replaced from its first departure on, alone, and from a few later ones where that
loses and the agent has ways of its own. Where none repairs, all are at once. If that does not win either, what agents
then get wrong that they never came to before, or earlier than before, is replaced too, until it wins or nothing new
shows; and if it never wins, all of it from later on. Then smaller and smaller sets are tried (delta debugging; Zeller
and Hildebrandt 2002), and all sets of two. What repairs is narrowed to the smallest window of boundaries that still
does, by bisection over the boundaries at which something was replaced.
Shares are Shapley values of the game "which replaced
pairs win": exact for few players, else by sampled permutations (Castro, Gómez and Tejada 2009) from named streams.
Placebos say how often a branch wins that has no right to: one record replaced by itself, a destination moved by a few
metres, a pair that no repair contains replaced from somewhere on.

All branches of a trace are played under common random numbers: what a branch does not change draws what it drew.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import cast

import msgspec
from msgspec.structs import replace

from lingjing.causal.beginnings import LATER, later_beginnings, rows_of
from lingjing.causal.branch_host import BranchHost, HostProgress
from lingjing.causal.branching import BranchResult, NullFork, failed_answers, own_failures
from lingjing.causal.delta_debugging import minimize
from lingjing.causal.interventions import BranchPlan
from lingjing.causal.narrowing import Narrowing, ReplacedSpan, ReplacedTicks, Windows
from lingjing.causal.placebos import PlaceboKind, Placebos, judged_placebos, placebo_plans
from lingjing.causal.redriven import BranchOptions
from lingjing.causal.shapley import AgentFaculty, Share, coalitions, shapley_shares
from lingjing.errors import UsageError
from lingjing.trace.reader import Trace
from lingjing.trace.records import CUT_SHORT, Faculty, Substitution

EXACT_PLAYERS = 4
NARROWED = 3
"""So many repairs are narrowed, those that replace least first."""

MOST_PAIRS = 45
"""So many sets of two are tried: all of ten faculties of agents."""


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
    """One search; `_played` remembers what came of each plan that replaces pairs from somewhere on to the end."""

    def __init__(self, host: BranchHost, options: BlameOptions) -> None:
        self._host = host
        self._options = options
        self._played: dict[BranchPlan, BranchResult] = {}
        self._departures: dict[AgentFaculty, tuple[int, ...]] = {}
        """Those of the trace, and those that show only in branches."""
        self._in_trace: dict[AgentFaculty, tuple[int, ...]] = {}
        self._since: dict[AgentFaculty, int] = {}
        """From where pairs are replaced that are not from their first departure on: those that depart earlier, or at
        all, only where others are replaced, and those that repair from later on."""
        self._masked: set[AgentFaculty] = set()
        """Those of them that depart nowhere in the trace."""
        self._short = False
        self._unanswered: Counter[str] = Counter()
        self._own_failures = own_failures(host.trace)

    def run(self, told: Blame) -> Blame:
        """The whole search."""
        self._departures = dict(sorted(self._host.departures().items(), key=self._order))  # type: ignore[arg-type]
        self._in_trace = dict(self._departures)
        alone = [self._plan((pair,)) for pair in self._departures][: max(0, self._left - 1)]
        (null,) = self._play([BranchPlan(at=0)], "null fork", ahead=alone)
        told = replace(told, null=NullFork.of(null), departed=len(self._departures), complete=False)
        if null.differs is None:
            sets, complete = self._smallest()
            told = replace(told, tried=len(self._played))
            repairs = self._narrowed(sets)
            shares = self._shares(sets) if sets and self._options.shares else ()
            told = replace(told, repairs=repairs, complete=complete, shares=shares, placebos=self._placebos(sets))
        return replace(
            told,
            branches=self._host.played,
            exhausted=self._short,
            unanswered=dict(sorted(self._unanswered.items())),
            cpu_s=self._host.cpu_s + self._host.unused_s,
            driven_s=self._host.driven_s,
            pictures=self._host.pictures,
            camera_s=self._host.camera_s,
        )

    # -- branches

    @property
    def _left(self) -> int:
        return max(0, self._options.branches - self._host.played)

    def _play(
        self, plans: Sequence[BranchPlan], what: str, ahead: Sequence[BranchPlan] = ()
    ) -> tuple[BranchResult, ...]:
        results = self._host.play(plans, what, ahead)
        self._unanswered.update(failed_answers(results, self._own_failures))
        return results

    def _try(self, sets: Iterable[frozenset[AgentFaculty]], what: str) -> list[bool]:
        """Whether replacing each set wins, as far as the budget goes; what is not tried counts as lost."""
        plans = [self._plan(one) for one in sets]
        new = [plan for plan in dict.fromkeys(plans) if plan not in self._played]
        within = new[: self._left]
        self._short |= len(within) < len(new)
        self._played |= zip(within, self._play(within, what), strict=True)
        return [plan in self._played and self._played[plan].success for plan in plans]

    def _branch(self, pairs: frozenset[AgentFaculty]) -> BranchResult | None:
        """The branch in which just these were replaced; None if it was not played."""
        return self._played.get(self._plan(pairs))

    def _plan(self, pairs: Iterable[AgentFaculty], windows: Windows = ()) -> BranchPlan:
        """The pairs replaced, each in its window or from where it is to be replaced."""
        narrow = {pair: (first, last) for pair, first, last in windows}
        spans = {pair: narrow.get(pair, (self._start(pair), None)) for pair in pairs}
        return BranchPlan(
            at=min(first for first, _ in spans.values()),
            substitutions=tuple(
                Substitution(faculty=pair[0], agent=pair[1], first=spans[pair][0], last=spans[pair][1])
                for pair in self._departures
                if pair in spans
            ),
        )

    def _start(self, pair: AgentFaculty) -> int:
        """From where a pair is replaced that is to the end."""
        return self._since.get(pair, self._departures[pair][0])

    def _order(self, item: tuple[tuple[str, str], tuple[int, ...]]) -> tuple[int, int, str]:
        """By first departure, then the agents' order."""
        agents = [agent.id for agent in self._host.trace.header.instance.agents]
        return item[1][0], agents.index(item[0][1]), item[0][0]

    # -- what repairs

    def _smallest(self) -> tuple[list[frozenset[AgentFaculty]], bool]:
        """All repairing sets of the smallest size, and whether all sets of that size were tried."""
        if found := self._alone() + self._alone_later():
            return found, not self._short
        if not self._departures or not self._all_repair():
            return [], not self._short
        if found := self._alone():
            return found, not self._short
        pairs = list(self._departures)
        one = self._reduced(pairs)
        every_two = [frozenset(two) for two in combinations(pairs, 2) if not self._masked >= set(two)]
        twos = every_two[:MOST_PAIRS]
        found = [two for two, won in zip(twos, self._try(twos, "two at a time"), strict=True) if won]
        every = not self._short and len(twos) == len(every_two)
        if found:
            return found, every
        return [one], every and len(one) <= 2

    def _alone(self) -> list[frozenset[AgentFaculty]]:
        """The pairs of the trace that repair alone."""
        singles = [frozenset((pair,)) for pair in self._departures if pair not in self._masked]
        return [one for one, won in zip(singles, self._try(singles, "one at a time"), strict=True) if won]

    def _alone_later(self) -> list[frozenset[AgentFaculty]]:
        """The pairs that repair alone from a later departure on. Half of the branches that are left may be spent on it;
        an agent that decided as its reference before has nothing that replacing it from its first departure spoils."""
        begins = {
            pair: self._later_beginnings(pair)
            for pair in self._departures
            if (branch := self._branch(frozenset((pair,)))) and not branch.success
            if not self._right_at_first(pair[1])
        }
        found: list[frozenset[AgentFaculty]] = []
        room = self._left // 2
        for turn in range(LATER):
            asked = [(pair, ticks[turn]) for pair, ticks in begins.items() if turn < len(ticks)]
            within = asked[:room]
            self._short |= len(within) < len(asked)
            room -= len(within)
            plans = [self._plan((pair,), ((pair, tick, None),)) for pair, tick in within]
            results = self._play(plans, "later beginnings")
            self._played |= zip(plans, results, strict=True)
            for (pair, tick), result in zip(within, results, strict=True):
                if result.success:
                    self._since[pair] = tick
                    found += [frozenset((pair,))]
                    del begins[pair]
        return found

    def _all_repair(self) -> bool:
        """Whether replacing everything wins, from the first departure of all on or from a later one of some pair."""
        later = sorted({tick for pair in self._departures for tick in self._later_beginnings(pair)[:1]})
        if self._all_repair_from(min(ticks[0] for ticks in self._departures.values())):
            return True
        for begin in later[:LATER]:
            self._since = dict.fromkeys(self._departures, begin)
            if self._all_repair_from(begin):
                return True
        return False

    def _later_beginnings(self, pair: AgentFaculty) -> list[int]:
        return later_beginnings(self._departures[pair], self._agreed(pair))

    def _all_repair_from(self, begin: int) -> bool:
        """Whether replacing everything wins. Where it does not, what shows only then is added to what there is, and it
        is tried again."""
        while self._left:
            plan = self._plan(self._departures)
            (result,) = self._play([replace(plan, watch=True)], "all at once")
            self._played[plan] = result
            shown: dict[AgentFaculty, list[int]] = {}
            for part in result.departed:
                shown.setdefault((cast("Faculty", part.faculty), part.agent), []).append(part.boundary)
            if result.success or not shown:
                return result.success
            self._since |= dict.fromkeys(shown, begin)
            self._masked |= shown.keys() - self._departures.keys()
            for pair, ticks in shown.items():
                self._departures[pair] = tuple(sorted({*ticks, *self._departures.get(pair, ())}))
        self._short = True
        return False

    def _reduced(self, pairs: Sequence[AgentFaculty]) -> frozenset[AgentFaculty]:
        """A set that repairs and of which no pair can be left out."""

        def first_repairing(candidates: Sequence[tuple[AgentFaculty, ...]]) -> int | None:
            won = self._try([frozenset(one) for one in candidates if one], "fewer at a time")
            return next((number for number, good in enumerate(won) if good), None)

        return frozenset(minimize(pairs, first_repairing))

    # -- when

    def _narrowed(self, sets: Sequence[frozenset[AgentFaculty]]) -> tuple[Repair, ...]:
        """The repairs, with the windows of the first of them; all of these are narrowed beside each other."""
        found = {one: branch for one in sets if (branch := self._branch(one))}
        ranked = sorted(found, key=lambda one: (any(map(self._is_late, one)), len(found[one].replaced)))
        replaced = [self._ticks(one, found[one]) for one in ranked]
        narrowings = [Narrowing(self._begins(ticks), ticks) for ticks in replaced[:NARROWED]]
        spans = [{pair: ReplacedSpan(self._start(pair), ticks[pair]) for pair in ticks} for ticks in replaced]
        best = [found[one] for one in ranked]
        cut: set[int] = set()
        while asked := [(number, one) for number, search in enumerate(narrowings) if (one := search.question())]:
            plans = [self._plan(ranked[number], one) for number, one in asked][: self._left]
            ahead = [*self._later(sets), *(self._plan(ranked[number], further) for number, _ in asked
                                           for further in narrowings[number].guesses())]  # fmt: skip
            played = self._play(plans, "which boundaries", ahead)
            cut.update(number for number, _ in asked[len(plans) :])
            for place, (number, one) in enumerate(asked):
                won = place < len(played) and played[place].success
                if won:
                    best[number] = played[place]  # the last one that wins is that of the smallest windows
                narrowings[number].answer(one, self._ticks(ranked[number], played[place]) if won else None)
        self._short |= bool(cut)
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
            for pair in self._departures
            if pair in pairs
        }

    def _begins(self, replaced: ReplacedTicks) -> dict[AgentFaculty, list[int]]:
        """From where each pair of a repair may have to be replaced: of a pair alone the departures in the trace, of
        several what the branch replaced, for one may depart only where another is replaced."""
        begins: dict[AgentFaculty, list[int]] = {}
        for pair, ticks in replaced.items():
            start, departed = self._start(pair), ticks if len(replaced) > 1 else self._from(pair)
            begins[pair] = [start, *(tick for tick in departed if tick > start)]
        return begins

    def _repair(self, spans: Mapping[AgentFaculty, ReplacedSpan], branch: BranchResult, *, narrowed: bool) -> Repair:
        causes = tuple(self._cause(pair, span) for pair, span in spans.items())
        return Repair(causes=causes, score=branch.score, ticks=branch.ticks, narrowed=narrowed)

    def _later(self, sets: Sequence[frozenset[AgentFaculty]]) -> list[BranchPlan]:
        """What shares and placebos are going to need, whatever narrowing finds."""
        players = self._players(sets)
        wanted = coalitions(players) if self._options.shares and len(players) <= EXACT_PLAYERS else []
        plans = [self._plan(one) for one in wanted if one]
        return plans + [plan for some in self._placebo_plans(sets, self._left).values() for plan in some]

    def _cause(self, pair: AgentFaculty, span: ReplacedSpan) -> Cause:
        faculty, agent = pair
        onset, ticks = self._departures[pair][0], span.replaced
        return Cause(
            agent=agent,
            faculty=faculty,
            boundary=onset if self._right_until(agent, onset) else self._begun(pair, ticks[0] if ticks else onset),
            first=span.first,
            last=ticks[-1] if ticks else span.first,
            replaced=len(ticks),
            rows=len(rows_of(self._departures[pair], self._agreed(pair))),
            late=self._is_late(pair),
            masked=pair in self._masked,
        )

    def _right_until(self, agent: str, onset: int) -> bool:
        """Whether an agent decided something right before a boundary, and nothing else."""
        departed = (ticks[0] for (_, who), ticks in self._departures.items() if who == agent)
        return min(departed) == onset and self._right_at_first(agent)

    def _right_at_first(self, agent: str) -> bool:
        """Whether the first thing that an agent decided was right."""
        departed = min(ticks[0] for (_, who), ticks in self._departures.items() if who == agent)
        return any(who == agent and ticks[0] < departed for (_, who), ticks in self._host.agreements.items())

    def _begun(self, pair: AgentFaculty, first: int) -> int:
        """Where the departures of a pair begin that lead up to a boundary, with none right in between."""
        right = max((tick for tick in self._agreed(pair) if tick < first), default=-1)
        return min((tick for tick in self._from(pair) if right < tick <= first), default=first)

    def _agreed(self, pair: AgentFaculty) -> tuple[int, ...]:
        """Where a pair agreed with its reference; what shows only where others are replaced was never compared."""
        return () if pair in self._masked else self._host.agreements.get((pair[0], pair[1]), ())

    def _is_late(self, pair: AgentFaculty) -> bool:
        """Whether a pair is replaced from later than its first departure on."""
        return self._since.get(pair, 0) > self._departures[pair][0]

    def _from(self, pair: AgentFaculty) -> list[int]:
        """The departures of a pair from where it is to be replaced."""
        return [tick for tick in self._departures[pair] if tick >= self._start(pair)]

    # -- how much, and by luck

    def _players(self, sets: Sequence[frozenset[AgentFaculty]]) -> list[AgentFaculty]:
        """Whose shares are told: the pairs of repairs, and a few others."""
        involved = list(dict.fromkeys(pair for pair in self._departures if any(pair in one for one in sets)))
        others = [pair for pair in self._departures if pair not in involved]
        return involved[: 2 * EXACT_PLAYERS] + others[: max(0, EXACT_PLAYERS - 1 - len(involved))]

    def _shares(self, sets: Sequence[frozenset[AgentFaculty]]) -> tuple[Share, ...]:
        players = self._players(sets)
        return shapley_shares(players, self._values, exact=len(players) <= EXACT_PLAYERS, seed=self._options.seed)

    def _values(self, sets: Sequence[frozenset[AgentFaculty]]) -> list[float | None]:
        """1 for a set that wins, 0 for one that loses, None for one that the budget does not reach."""
        empty: frozenset[AgentFaculty] = frozenset()
        self._try([one for one in sets if one != empty], "shares")
        branches = {one: self._branch(one) for one in sets if one != empty}
        return [0.0 if one == empty else float(told.success) if (told := branches[one]) else None for one in sets]

    def _placebos(self, sets: Sequence[frozenset[AgentFaculty]]) -> Placebos:
        plans = self._placebo_plans(sets, self._left)
        wanted = self._placebo_plans(sets, self._options.placebos)
        self._short |= sum(map(len, plans.values())) < sum(map(len, wanted.values()))
        return judged_placebos(plans, self._play([plan for some in plans.values() for plan in some], "placebos"))

    def _placebo_plans(self, sets: Sequence[frozenset[AgentFaculty]], most: int) -> dict[PlaceboKind, list[BranchPlan]]:
        """As many as were asked for and there are places for, `most` at most."""
        involved = {pair for one in sets for pair in one}
        innocent = {pair: ticks for pair, ticks in self._in_trace.items() if pair not in involved}
        return placebo_plans(self._host.trace, innocent, min(self._options.placebos, most), self._options.seed)
