"""`held`, `within`, `before` and `count` over an episode: conditions that read other moments than the present one."""

from __future__ import annotations

import math
from collections.abc import Mapping

import msgspec

from lingjing.mission import expression as ex
from lingjing.mission.feasibility.condition_values import (
    Occurrences,
    World,
)
from lingjing.mission.feasibility.proof import spelled
from lingjing.mission.feasibility.steps import NEVER, StepClock, Steps, common, first, joined
from lingjing.mission.feasibility.truths import (
    NO,
    YES,
    Extents,
    Moment,
    Reason,
    Truth,
    constant,
    lasting,
    unknown,
)
from lingjing.mission.intervals import Bounds
from lingjing.mission.values import Value


def held(truth: Truth, duration: Bounds, on: World) -> Truth:
    """`held(c, d)`: the condition has held at all macro-steps of the last `d` seconds."""
    clock, shortest = on.clock, max(0.0, duration.low)
    may = tuple((begin, high) for low, high in truth.may if (begin := clock.after(low, shortest)) <= high)
    must: Steps = ()
    if math.isfinite(duration.high):
        later = ((clock.after(low, max(0.0, duration.high)) + 1, high) for low, high in truth.must)
        must = tuple((begin, high) for begin, high in later if begin <= high)
    reason = truth.reason
    if truth.may and not may:
        words = f"a condition that must last {spelled(shortest)} s can hold for {_longest(truth.may, clock)} s at most"
        reason = Reason(lambda: words, "LJ0613")
    elif truth.may and reason is None and first(may) > 0:
        reason = Reason(lambda: f"a condition must last {spelled(shortest)} s", "LJ0613")
    return Truth(may, must, truth.if_true, reason=reason, ends=truth.ends)


def _longest(steps: Steps, clock: StepClock) -> str:
    return spelled(round(max(clock.time_s(high) - clock.time_s(low) for low, high in steps), 3))


def _rising(truth: Truth) -> Steps:
    """The macro-steps at which a condition can become true: not those at which it certainly was true just before."""
    barred = tuple((low + 1, high) for low, high in truth.must if low < high)
    rises: list[tuple[int, int]] = []
    for low, high in truth.may:
        start = low
        for begin, end in barred:
            if begin <= high and end >= start:
                if start < begin:
                    rises.append((start, begin - 1))
                start = end + 1
        if start <= high:
            rises.append((start, high))
    return tuple(rises)


def soon_after(sooner: Truth, later: Truth, limit_s: float, on: World) -> Truth:
    """`within(a, b, d)`: `b` became true at most `d` seconds after `a` did."""
    clock = on.clock
    extents = {**lasting(sooner.if_true), **lasting(later.if_true)}
    if not sooner.may or not later.may:
        reason = sooner.reason if not sooner.may else later.reason
        return Truth((), (), reason=reason)
    near = _until_later(_rising(sooner), limit_s, clock)
    step = first(common(near, _rising(later)))
    if step == NEVER:
        words = f"the second condition cannot become true within {spelled(limit_s)} s after the first one"
        begins = later.reason if first(later.may) > first(sooner.may) else sooner.reason
        if begins is not None:
            cause = begins
            return Truth((), (), reason=msgspec.structs.replace(cause, words=lambda: f"{words}: {cause.words()}"))
        return Truth((), (), reason=Reason(lambda: words, "LJ0613"))
    reason = later.reason if first(later.may) >= first(sooner.may) else sooner.reason
    return Truth(clock.since(step), (), extents, reason=reason)


def _until_later(steps: Steps, seconds: float, clock: StepClock) -> Steps:
    """The macro-steps at most some seconds after a step of the set."""
    if math.isinf(seconds):
        return clock.since(first(steps)) if seconds > 0 and steps else ()
    if seconds < 0:
        return ()
    ends = (min(clock.last, clock.after(high, seconds + clock.sync_s)) for _, high in steps)
    whole: Steps = ()
    for (low, _), end in zip(steps, ends, strict=True):
        whole = joined(whole, ((low, end),))
    return whole


def before(node: ex.Call, sooner: Truth, later: Truth, names: Mapping[str, Value], on: World) -> Truth:
    """`before(a, b)`: `a` became true for the first time before `b` did, or `b` never did."""
    clock = on.clock
    begin, barred = first(sooner.may), first(later.must)
    if not sooner.may:
        return Truth((), (), reason=sooner.reason)
    if begin >= barred:
        words = "the second condition of `before` is certainly true by then"
        return Truth((), (), reason=Reason(lambda: words, "LJ0613"))
    alone = on.without(node.arguments[1], node.arguments[0], names)
    if not alone.may:
        words = "the first condition of `before` needs the second one"
        return Truth((), (), reason=Reason(lambda: words, "LJ0612"))
    return Truth(clock.since(first(alone.may)), (), lasting(sooner.if_true), reason=alone.reason or sooner.reason)


def times(occurrences: Occurrences, least: Bounds, *, strict: bool, on: World) -> Truth:
    """Return the truth of "at least `least` occurrences", or of "more than `least`" if `strict`.

    `least` is an interval from the easiest to the hardest number.
    """
    easy, hard = least.low, least.high
    if not math.isfinite(easy):
        return unknown(on.clock) if easy < 0 else constant(False, on.clock)
    number = math.floor(easy) + 1 if strict else math.ceil(easy)
    if number <= 0:
        return constant(True, on.clock) if easy == hard else unknown(on.clock)
    moments, name = occurrences.moments, occurrences.key[1]
    if number <= len(moments):
        moment = moments[number - 1]
    elif occurrences.pause is None or not moments:
        words = f"`{name}` happens {len(moments)} times at most"
        moment = Moment(NEVER, Reason(lambda: words, "LJ0612"))
    else:
        last = moments[-1]
        step = last.step + (number - len(moments)) * occurrences.pause
        clock = on.clock
        when = f"`{name}` happens {number} times not before {spelled(clock.time_s(min(step, NEVER // 2)))} s"
        late = occurrences.pause > 0 and step < NEVER // 2
        moment = Moment(min(step, NEVER), Reason(lambda: when, "LJ0613") if late else last.reason)
    happened: Extents = {occurrences.key: Bounds(float(number), math.inf)}
    fewer: Extents = {occurrences.key: Bounds(0.0, number - 1.0)}
    if occurrences.fact:
        happened = {**happened, occurrences.fact: YES}
        fewer = {**fewer, occurrences.fact: NO} if number == 1 else fewer
    must = on.clock.since(occurrences.certain) if number == 1 else ()
    if easy != hard:
        return Truth(on.clock.since(moment.step), (), happened, reason=moment.reason)
    return Truth(on.clock.since(moment.step), must, happened, fewer, moment.reason)


__all__ = ["before", "held", "soon_after", "times"]
