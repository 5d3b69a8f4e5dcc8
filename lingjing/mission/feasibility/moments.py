"""`Moments`: the earliest moment of every fact that a condition may wait for, as a fixpoint.

A fact has preconditions, of which the moments are computed in turn, as in planning with the deletions left out: a fact
that has happened stays. The moments begin at *never* and fall until nothing changes, so that facts that wait for each
other stay at *never* (Bonet and Geffner 2001, the heuristic h_max; ADR 0039). Whatever is unknown is possible at once.
A moment is therefore never later than in any run.

Two sets of bounds hold besides: those of hard constraints at every macro-step, and those of an episode that has not
failed yet at every boundary before its last.

A subclass has a method `_KIND` for each kind of fact, which computes the fact's moment from its names.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping

import msgspec

from lingjing.mission import expression as ex
from lingjing.mission.conditions.episode import EpisodeKnowledge
from lingjing.mission.conditions.outline import Body, Outline, able_agents
from lingjing.mission.feasibility.condition_values import Message, World, truth_of
from lingjing.mission.feasibility.readings import Readings
from lingjing.mission.feasibility.steps import NEVER, StepClock, step_clock
from lingjing.mission.feasibility.truths import (
    AT_ONCE,
    YES,
    Extent,
    Extents,
    Moment,
    Quantity,
    Reason,
    Truth,
    contradiction,
    in_words,
    merged,
    unknown,
)
from lingjing.mission.fold import Meanings
from lingjing.mission.model import Rule
from lingjing.mission.values import Value

_MAX_NODES = 40_000
"""Nodes of conditions that one pass evaluates (chosen); the rest is unknown."""

_MAX_PASSES = 40
"""Passes until the moments no longer change (chosen). If they still do, nothing is proved."""

Fact = tuple[str, ...]
"""A fact that can happen: its kind, and the names that it is about."""


class Moments(World):
    """The moments of the facts of one outline."""

    def __init__(self, outline: Outline, barred: tuple[ex.Expr, dict[str, Value]] | None = None) -> None:
        """`barred` is a condition, with its bound names, that has never held in the episodes of this analysis."""
        self.outline = outline
        self._barred_condition = barred
        self._without: dict[tuple[object, ...], Truth] = {}
        self.clock: StepClock = step_clock(outline.instance)
        self.knowledge = EpisodeKnowledge(outline)
        self.settled = True
        self._meanings = Meanings(Readings())
        self._rules: dict[str, Rule] = {rule.name: rule for rule in outline.instance.rules}
        self._able = {agent.id for agent in able_agents(outline.instance)}
        self._commanded = {
            name for agent in outline.instance.agents if agent.id in self._able for name in agent.commands
        }
        self._moments: dict[Fact, Moment] = {}
        self._certain: dict[Fact, int] = {}
        self._implied: dict[Fact, Extents] = {}
        self._done: set[Fact] = set()
        self._stack: list[Fact] = []
        self._defined: dict[int, tuple[ex.Expr, bool]] = {}
        self._waited = self._frozen = False
        self._left = _MAX_NODES
        self._marks = 0
        self._steady: Extents = {}
        self._before_end: Extents = {}
        self._by_body: dict[int, tuple[Extents, dict[object, list[tuple[Quantity, Extent]]]]] = {}
        """`id` of an object of bounds → the object, and its bounds on the place of each body."""
        self._steady = self._extents_of_constraints()
        self._before_end = self._extents_before_failure()

    def settle(self, roots: Callable[[], None]) -> None:
        """Evaluate the roots until the moments of all facts no longer change. Without success, `settled` is False."""
        for _ in range(_MAX_PASSES):
            before = self._times()
            self._done.clear()
            self._waited, self._left = False, _MAX_NODES
            roots()
            if not self._waited or before == self._times():
                return
        self.settled = False

    def _times(self) -> tuple[dict[Fact, int], dict[Fact, int]]:
        return {fact: moment.step for fact, moment in self._moments.items()}, dict(self._certain)

    def truth(self, condition: ex.Expr, names: dict[str, Value], *, early: bool = False) -> Truth:
        """The truth of a condition at one instant; with `early`, at a boundary before the last one."""
        truth = truth_of(self._meanings.of(condition)(names, self), self)
        assumed = self._before_end if early else self._steady
        clash = contradiction(_of_any_message(truth.if_true), assumed) if truth.may and assumed else ()
        return Truth((), (), reason=self._barred(clash)) if clash else truth

    def _barred(self, clash: Quantity) -> Reason:
        if clash in self._steady:
            return Reason(lambda: f"a hard constraint forbids what it needs of {in_words(clash)}", "LJ0614")
        return Reason(lambda: f"{in_words(clash)} would be failure, which ends the mission first", "LJ0613", "failure")

    def exhausted(self) -> bool:
        """True if too many nodes were evaluated."""
        self._left -= 1
        return self._left < 0

    def defined(self, node: ex.Expr) -> bool:
        """True if every value in the expression exists at all times."""
        known = self._defined.get(id(node))
        if known is None:
            known = self._defined[id(node)] = node, self.knowledge.defined(node)
        return known[1]

    def fresh_mark(self) -> str:
        """A mark for the messages of one quantifier."""
        self._marks += 1
        return f"#{self._marks}"

    def _extents_of_constraints(self) -> Extents:
        """The bounds that hold at every macro-step of a winning episode."""
        kept = (
            self.subject_truth(constraint.condition, names).if_true
            for constraint in self.outline.instance.constraints
            if constraint.kind == "hard"
            for names in self.subjects(constraint.variable, constraint.domain)
        )
        known = () if self._barred_condition is None else (self._barred_condition,)
        return self._static(itertools.chain(kept, (self.subject_truth(*each).if_false for each in known)))

    def _extents_before_failure(self) -> Extents:
        """The bounds that hold at every boundary of a winning episode before its last."""
        failure = self.outline.instance.failure
        if failure is None:
            return self._steady
        before = (self.subject_truth(each, {}).if_false for each in (failure,))
        return self._static(itertools.chain((self._steady,), before))

    def subject_truth(self, condition: ex.Expr, names: dict[str, Value]) -> Truth:
        """The truth of a condition without further assumptions."""
        return truth_of(self._meanings.of(condition)(names, self), self)

    def _static(self, each: Iterable[Extents]) -> Extents:
        """The common bounds of several conditions, with every fact possible at once. Contradictory ones are left out.

        `each` is lazy: a moment that is computed before all bounds are known would be kept.
        """
        self._frozen = True
        whole: Extents = {}
        for extents in each:
            whole = merged(whole, extents) or whole
        self._frozen, self._left = False, _MAX_NODES
        return whole

    def without(self, barred: ex.Expr, wanted: ex.Expr, names: Mapping[str, Value]) -> Truth:
        """The truth of a condition in an episode in which another one has never held."""
        nested = self._frozen or self._barred_condition is not None
        if nested or any(isinstance(value, Message) for value in names.values()):
            return unknown(self.clock)
        bound = tuple((name, id_of(value)) for name, value in sorted(names.items(), key=lambda pair: pair[0]))
        key = (id(barred), id(wanted), bound)
        if key not in self._without:
            self._without[key] = self._alone(barred, wanted, dict(names))
        return self._without[key]

    def _alone(self, barred: ex.Expr, wanted: ex.Expr, names: dict[str, Value]) -> Truth:
        other = type(self)(self.outline, (barred, names))
        truths: list[Truth] = []
        other.settle(lambda: truths.append(other.truth(wanted, names)))
        return truths[-1] if other.settled else unknown(self.clock)

    def subjects(self, variable: str | None, domain: str | None) -> Iterable[dict[str, Value]]:
        """The bound names of a declaration that is stated per member of a group."""
        if variable is None or domain is None:
            return ({},)
        return ({variable: body} for body in self.outline.groups.get(domain, ()))

    def moment(self, fact: Fact) -> Moment:
        """The earliest moment of a fact."""
        if self._frozen:
            return AT_ONCE
        if fact in self._done:
            return self._moments[fact]
        if fact in self._stack:
            self._waited = True
            again = f"that for {shown(fact)} again"
            return self._moments.get(fact) or Moment(NEVER, Reason(lambda: again, "LJ0606"))
        self._stack.append(fact)
        moment: Moment = getattr(self, f"_{fact[0]}")(*fact[1:])
        self._stack.pop()
        before = self._moments.get(fact)
        if before is not None and before.step < moment.step:
            moment = before
        self._moments[fact] = moment
        self._done.add(fact)
        return moment

    def _never(self, words: str, code: str, at: str = "") -> Moment:
        return Moment(NEVER, Reason(lambda: words, code, at))

    def _at_boundary(self, truth: Truth, at: str, *, at_least: int = 0) -> Moment:
        """The first boundary at which a condition may hold."""
        step = self.clock.first_boundary(truth.may, at_least)
        reason = truth.reason or truth.ends
        if reason is not None and not reason.at:
            reason = msgspec.structs.replace(reason, at=at)
        return Moment(step, reason)


def _of_any_message(extents: Extents) -> Extents:
    """The extents, with each event that has happened for a certain message as one that has happened for some."""
    general = {
        tuple("*" if str(part)[:1] in ("#", "*") else part for part in key): extent
        for key, extent in extents.items()
        if extent == YES
    }
    return {**general, **extents}


def is_of_message(key: Quantity) -> bool:
    """True if a quantity is about one certain message."""
    return any(str(part)[:1] in ("#", "*") and part != "*" for part in key)


def shown(fact: Fact) -> str:
    """A fact in a message."""
    kind, *of = fact
    if kind == "command":
        return f"`{of[0]}.{of[1]}`"
    if kind in ("performed", "reached", "unlock"):
        return f"`{of[0]}` of `{of[1]}`"
    if kind == "achieved":
        return f"`{of[0]}({', '.join(name for name in of[1:] if name)})`"
    if kind == "event":
        return f"the event `{of[0]}`"
    nouns = {
        "motion": "the motion of",
        "climb": "the motion of",
        "picture": "a picture of",
        "photo": "a picture by",
        "report": "a",
    }
    return f"{nouns.get(kind, 'an assignment of')} `{of[0]}`"


def id_of(value: Value) -> str | None:
    """The id of a body, or the mark of a message; None for other values."""
    match value:
        case Body():
            return value.id
        case Message(mark=mark):
            return mark
    return None
