"""Proofs about time and order: success cannot hold at any boundary that the episode reaches.

The episode reaches a boundary only if no hard constraint is broken, no failure holds and no stage is late before it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial

import msgspec

from lingjing.errors import LingjingError
from lingjing.mission import model
from lingjing.mission.certain import certain
from lingjing.mission.conditions.outline import Outline
from lingjing.mission.evaluate import number
from lingjing.mission.feasibility.limits import TimeLimit, episode, of_stage
from lingjing.mission.feasibility.milestones import Milestones
from lingjing.mission.feasibility.proof import Proof, spelled
from lingjing.mission.feasibility.steps import NEVER, StepClock, common, first
from lingjing.mission.feasibility.truths import Reason, Truth
from lingjing.mission.intervals import Bounds
from lingjing.mission.values import Value


class Cut(msgspec.Struct, frozen=True):
    """The end of every episode that has not been won by then."""

    step: int
    """The last macro-step at which success counts; -1 if there is none."""
    words: Callable[[], str]
    """The reason, as the end of a sentence."""
    at: str = ""
    """The path of the declaration that ends the episode; "" for the budget."""
    code: str = ""
    """The diagnostic code of a mission that is lost because of it; "" for the usual one."""


class Deadline(msgspec.Struct, frozen=True):
    """The result of the analysis of one outline."""

    cut: Cut
    proofs: tuple[Proof, ...]

    @property
    def is_lost_at_start(self) -> bool:
        """True if the episode is lost at its first boundary."""
        return self.cut.step < 0

    def limit(self, outline: Outline) -> TimeLimit:
        """The available time of the whole episode."""
        whole, clock = episode(outline), outline.instance.clock
        ticks = max(0, self.cut.step // max(1, round(clock.tick_s / clock.sync_s)))
        if not self.cut.at or ticks >= whole.ticks:
            return whole
        return TimeLimit(ticks, ticks * clock.tick_s, self.cut.at, self.cut.words())


def deadline(outline: Outline) -> Deadline:
    """The end of the episode, and the proofs that success cannot hold before it."""
    milestones = Milestones(outline)
    roots = _Roots(milestones)
    milestones.settle(roots.evaluate)
    if not milestones.settled:
        return Deadline(roots.end, ())
    cut = min((roots.end, *roots.cuts), key=lambda each: each.step)
    within = common(roots.success.may, milestones.clock.until(cut.step))
    if milestones.clock.first_boundary(within) < NEVER:
        return Deadline(cut, ())
    return Deadline(cut, (_proof(roots.success, cut, milestones),))


class _Roots:
    """The conditions that decide the end of an episode."""

    def __init__(self, milestones: Milestones) -> None:
        self._on = milestones
        self._instance = milestones.outline.instance
        last = milestones.clock.last
        whole = episode(milestones.outline)
        self.end = Cut(last, lambda: whole.words)
        self.success = Truth((), ())
        self.cuts: list[Cut] = []

    def evaluate(self) -> None:
        """Evaluate all of them with the present moments."""
        self.success = self._on.truth(self._instance.success, {})
        self.cuts = [*self._failure(), *self._constraints(), *self._stages()]

    def _failure(self) -> list[Cut]:
        if self._instance.failure is None:
            return []
        clock = self._on.clock
        step = clock.first_boundary(self._on.subject_truth(self._instance.failure, {}).must)
        if step == NEVER:
            return []
        time = spelled(clock.time_s(step))
        return [Cut(step, lambda: f"failure holds at {time} s at the latest and ends the episode", "failure")]

    def _constraints(self) -> list[Cut]:
        clock, cuts = self._on.clock, []
        for constraint in self._instance.constraints:
            if constraint.kind != "hard":
                continue
            for names in self._on.subjects(constraint.variable, constraint.domain):
                truth = self._on.subject_truth(constraint.condition, names)
                step = clock.first_boundary(clock.other(truth.may))
                if step < NEVER:
                    cuts.append(_broken(constraint, step, clock.time_s(step)))
        return cuts

    def _stages(self) -> list[Cut]:
        """Stages that cannot be done by their deadline, or without a predecessor within their own ticks."""
        clock, cuts = self._on.clock, []
        for stage in self._instance.stages:
            allowed = _ticks(stage, self._on.outline)
            if allowed is None and stage.deadline is None:
                continue
            begin = 0 if allowed is None else self._latest_begin(stage.name, ())
            allowed = None if begin >= NEVER else allowed
            for names in self._on.subjects(stage.variable, stage.domain):
                done = clock.first_boundary(self._on.subject_truth(stage.condition, names).may)
                deadline_s = self._deadline_s(stage, names)
                last = math.ceil(deadline_s / self._instance.clock.tick_s - 1e-9) if deadline_s < math.inf else None
                if allowed is not None and done > begin + allowed * clock.per_tick:
                    cuts.append(_late(stage, allowed, self._on.outline, clock, begin))
                if last is not None and done > last * clock.per_tick:
                    words = f"the deadline of stage `{stage.name}` is at {spelled(deadline_s)} s at the latest"
                    cuts.append(Cut(last * clock.per_tick, partial(str, words), f"stage/{stage.name}"))
        return cuts

    def _latest_begin(self, stage: str, behind: tuple[str, ...]) -> int:
        """The macro-step at which a stage has begun at the latest in every episode that goes on; `NEVER` if unknown."""
        order = [relation for relation in self._instance.relations if relation.kind == "dependency"]
        if any(relation.mutual and stage in (relation.source, relation.target) for relation in order):
            return NEVER
        sources = {relation.source for relation in order if relation.target == stage}
        return max((self._latest_end(source, (*behind, stage)) for source in sources), default=0)

    def _latest_end(self, name: str, behind: tuple[str, ...]) -> int:
        """The macro-step at which a stage is done at the latest: its condition certainly holds, or its ticks are over.
        One tick more, because a later stage counts at the boundary after it."""
        stage = next((each for each in self._instance.stages if each.name == name), None)
        if stage is None or name in behind:
            return NEVER
        clock, begin = self._on.clock, self._latest_begin(name, behind)
        certain = [
            clock.first_boundary(self._on.subject_truth(stage.condition, names).must)
            for names in self._on.subjects(stage.variable, stage.domain)
        ]
        ticks = _ticks(stage, self._on.outline)
        over = NEVER if ticks is None or begin >= NEVER else begin + ticks * clock.per_tick
        end = min(max((*certain, begin)), over)
        return end if end >= NEVER else end + clock.per_tick

    def _deadline_s(self, stage: model.Stage, names: Mapping[str, Value]) -> float:
        """The latest possible deadline of a stage for one subject, seconds; infinity without one."""
        bound = math.inf
        if stage.deadline is not None:
            value = certain(stage.deadline, names, self._on.knowledge)
            bound = value.high if isinstance(value, Bounds) else math.inf
        return bound


def _broken(constraint: model.Constraint, step: int, time_s: float) -> Cut:
    words = f"`{constraint.name}` is broken at {spelled(time_s)} s and ends the episode, lost"
    return Cut(step - 1, lambda: words, f"constraint/{constraint.name}", "LJ0614")


def _late(stage: model.Stage, allowed: int, outline: Outline, clock: StepClock, begin: int) -> Cut:
    words = of_stage(outline, stage.name, allowed).words
    if begin:
        words = f"{words}, which begin at {spelled(clock.time_s(begin))} s at the latest"
    return Cut(begin + allowed * clock.per_tick, lambda: words, f"stage/{stage.name}")


def _ticks(stage: model.Stage, outline: Outline) -> int | None:
    try:
        return None if stage.ticks is None else int(number(stage.ticks, outline.scope))
    except LingjingError:
        return None


def _proof(success: Truth, cut: Cut, milestones: Milestones) -> Proof:
    """The proof that success cannot hold until the episode ends."""
    clock = milestones.clock
    within = clock.first_boundary(success.may)
    reason = success.reason or success.ends
    if cut.step < 0:
        return Proof("LJ0511", cut.at, f"{cut.words()} before any agent acts", _HINTS["LJ0511"])
    if reason is None or (within < NEVER and cut.code):
        time = f" before {spelled(clock.time_s(within))} s" if within < NEVER else " at any boundary of the episode"
        when = f"success cannot hold{time}, and "
        return Proof(cut.code or "LJ0613", cut.at or "success", f"{when}{cut.words()}", _HINTS.get(cut.code, _LATE))
    code = reason.code or "LJ0613"
    chain = _chain(reason)
    if not success.may:
        message = f"success can never hold: {chain}"
    else:
        step = within if within < NEVER else first(success.may)
        message = f"success cannot hold before {spelled(clock.time_s(step))} s, because {chain}; {cut.words()}"
        code = "LJ0613" if code in ("LJ0612",) else code
    related: tuple[tuple[str, str], ...] = (
        ((cut.at, "the end of the episode"),) if cut.at else (("budget/ticks", "the budget"),)
    )
    if reason.at == "failure" or not reason.at:
        at = reason.at or "success"
    else:
        at, related = reason.at, (("success", "the condition"), *related)
    return Proof(code, at, message, _HINTS.get(code, _LATE), related)


def _chain(reason: Reason) -> str:
    """The facts that wait for each other, in words."""
    waits, words = list(dict.fromkeys(reason.waits)), reason.words()
    if len(waits) < 2:
        return f"{waits[0]} waits: {words}" if waits else words
    begin = f"{waits[0]} waits for {waits[1]}" + "".join(f", that for {fact}" for fact in waits[2:])
    return f"{begin}{', ' if words.startswith('that for') else '; '}{words}"


_LATE = "let it happen earlier, or give it more time"
_HINTS = {
    "LJ0511": "use a condition that does not hold yet: `now > …`, or the result of an action",
    "LJ0606": "let it wait for something that can happen earlier",
    "LJ0607": "let an agent control it, and give it a verb that moves it",
    "LJ0610": "raise the limit",
    "LJ0612": "correct the condition",
    "LJ0614": "loosen the constraint, or require something that it allows",
    "LJ0605": "let an agent send it, and raise the payload",
    "LJ0609": "give an asset a camera that can take it",
}
