"""`Truth`: when a condition may hold, when it certainly holds, and the bounds of quantities at such a moment.

`may` is never too small and `must` never too large, so that a condition with an empty `may` is false in every run.
`if_true` and `if_false` bound quantities at a moment at which the condition is true or false. Two conditions with
bounds that exclude each other are never true together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import msgspec

from lingjing.mission.feasibility.steps import NEVER, StepClock, Steps, common, first, joined
from lingjing.mission.intervals import Bounds

Words = frozenset[str]
"""The words that a status may have."""
Extent = Bounds | Words
"""The possible values of a quantity: a number, a fact as 0 or 1, or a status word."""
Quantity = tuple[object, ...]
"""The key of a quantity, such as `("north", "boat")` or `("emitted", "rescue", "victim")`."""
Extents = Mapping[Quantity, Extent]

YES, NO = Bounds(1.0, 1.0), Bounds(0.0, 0.0)
"""The extents of a fact that has happened and of one that has not."""

NOWHERE: Extents = {}


class Reason(msgspec.Struct, frozen=True):
    """The reason why something begins late, or never happens."""

    words: Callable[[], str]
    """The end of a sentence, computed only for a message."""
    code: str = ""
    """The diagnostic code of the deepest cause; "" for the usual one."""
    at: str = ""
    """The path of the deepest cause's declaration; "" for that of the condition."""
    waits: tuple[str, ...] = ()
    """The facts that wait for each other, the outermost first."""

    def behind(self, fact: str) -> Reason:
        """The reason of a fact that waits for this one."""
        return msgspec.structs.replace(self, waits=(fact, *self.waits))


class Moment(msgspec.Struct, frozen=True):
    """The first macro-step at which a fact may have happened."""

    step: int
    """Number of the macro-step from the start; `NEVER` if the fact cannot happen."""
    reason: Reason | None = None
    """The reason for the delay; None if nothing delays the fact."""


AT_ONCE = Moment(0)


def latest(moments: Iterable[Moment]) -> Moment:
    """The moment of a fact that needs all of these."""
    worst = AT_ONCE
    for moment in moments:
        if moment.step > worst.step:
            worst = moment
    return worst


def earliest(moments: Iterable[Moment]) -> Moment:
    """The moment of a fact that needs one of these; never if there is none."""
    best: Moment | None = None
    for moment in moments:
        if best is None or moment.step < best.step:
            best = moment
    return Moment(NEVER) if best is None else best


class Choice(msgspec.Struct, frozen=True):
    """Some of several conditions that hold at the same moment."""

    least: int
    """The least number of them."""
    parts: tuple[Extents, ...]
    """The bounds of quantities at a moment at which each is true."""

    def left_by(self, extents: Extents) -> bool:
        """True if enough of the conditions agree with the bounds."""
        return sum(not contradiction(part, extents) for part in self.parts) >= self.least


class Truth(msgspec.Struct, frozen=True):
    """The value of a condition over an episode."""

    may: Steps
    """The macro-steps at which it can be true."""
    must: Steps
    """The macro-steps at which it is certainly true."""
    if_true: Extents = NOWHERE
    if_false: Extents = NOWHERE
    reason: Reason | None = None
    """The reason why `may` begins late or is empty."""
    ends: Reason | None = None
    """The reason why `may` ends early."""
    choices: tuple[Choice, ...] = ()
    """Conditions of members, of which some hold while the condition is true."""
    denials: tuple[Choice, ...] = ()
    """Conditions of members, of which some hold while the condition is false."""


def unknown(clock: StepClock) -> Truth:
    """A condition of which nothing is known."""
    return Truth(clock.always, ())


def constant(holds: bool, clock: StepClock, reason: Reason | None = None) -> Truth:
    """A condition with the same value at all times."""
    return Truth(clock.always, clock.always) if holds else Truth((), (), reason=reason)


def since(moment: Moment, clock: StepClock, key: Quantity = ()) -> Truth:
    """A fact that can hold from a moment on."""
    yes, no = ({key: YES}, {key: NO}) if key else (NOWHERE, NOWHERE)
    return Truth(clock.since(moment.step), (), yes, no, moment.reason)


_LASTING = ("emitted", "achieved", "photographed", "assigned")
"""Facts that stay once they have happened."""


def lasting(extents: Extents) -> Extents:
    """The extents that still hold after the moment at which they held: facts that stay."""
    return {key: extent for key, extent in extents.items() if key and key[0] in _LASTING and extent == YES}


def opposite(truth: Truth, clock: StepClock) -> Truth:
    """Return the truth of `not x`."""
    may, must = clock.other(truth.must), clock.other(truth.may)
    return Truth(may, must, truth.if_false, truth.if_true, choices=truth.denials, denials=truth.choices)


def conjunction(parts: Iterable[Truth], clock: StepClock) -> Truth:
    """Return the truth of `a and b`."""
    whole: Truth | None = None
    for part in parts:
        whole = part if whole is None else _both(whole, part)
    return constant(True, clock) if whole is None else whole


def disjunction(parts: Iterable[Truth], clock: StepClock) -> Truth:
    """Return the truth of `a or b`."""
    whole: Truth | None = None
    for part in parts:
        whole = part if whole is None else _either(whole, part)
    return constant(False, clock) if whole is None else whole


def _both(left: Truth, right: Truth) -> Truth:
    extents = merged(left.if_true, right.if_true)
    choices = (*left.choices, *right.choices)
    refused = next((choice for choice in choices if extents is not None and not choice.left_by(extents)), None)
    may = () if extents is None or refused is not None else common(left.may, right.may)
    later = left if first(left.may) >= first(right.may) else right
    reason = later.reason
    if refused is not None:
        reason = _too_few(refused, extents or NOWHERE)
    elif not may and left.may and right.may:
        reason = _apart(left, right) if extents is not None else _contrary(left, right)
    return Truth(
        may,
        common(left.must, right.must),
        NOWHERE if extents is None else extents,
        widened(left.if_false, right.if_false),
        reason,
        left.ends or right.ends,
        choices,
    )


def _either(left: Truth, right: Truth) -> Truth:
    if not left.may:
        extents: Extents = right.if_true
    elif not right.may:
        extents = left.if_true
    else:
        extents = widened(left.if_true, right.if_true)
    earlier = left if first(left.may) <= first(right.may) else right
    return Truth(
        joined(left.may, right.may),
        joined(left.must, right.must),
        extents,
        merged(left.if_false, right.if_false) or NOWHERE,
        earlier.reason,
        left.ends if left.ends and right.ends else None,
        left.choices if not right.may else right.choices if not left.may else (),
        (*left.denials, *right.denials),
    )


def _apart(left: Truth, right: Truth) -> Reason | None:
    """The reason of two conditions that hold at different times only."""
    later, sooner = (left, right) if first(left.may) > first(right.may) else (right, left)
    begins, ends = later.reason, sooner.ends
    if begins is None or ends is None:
        return begins or ends
    return msgspec.structs.replace(begins, words=lambda: f"{begins.words()}, and {ends.words()}")


def _contrary(left: Truth, right: Truth) -> Reason:
    clash = contradiction(left.if_true, right.if_true)
    return Reason(lambda: f"the condition contradicts itself: {in_words(clash)}", "LJ0612")


def _too_few(choice: Choice, extents: Extents) -> Reason:
    clash = next(contradiction(part, extents) for part in choice.parts if contradiction(part, extents))
    words = f"{choice.least} of {len(choice.parts)} members are required"
    return Reason(lambda: f"the condition contradicts itself: {words}, and {in_words(clash)} is excluded", "LJ0612")


def contradiction(left: Extents, right: Extents) -> Quantity:
    """The first quantity with no common value; () if there is none."""
    for key, extent in left.items():
        other = right.get(key)
        if other is not None and _shared(extent, other) is None:
            return key
    return ()


def merged(left: Extents, right: Extents) -> Extents | None:
    """The extents at a moment at which both hold; None if they exclude each other."""
    if not left or not right:
        return left or right
    shared = dict(left)
    for key, extent in right.items():
        other = shared.get(key)
        if other is not None:
            common_extent = _shared(extent, other)
            if common_extent is None:
                return None
            extent = common_extent
        shared[key] = extent
    return shared


def widened(left: Extents, right: Extents) -> Extents:
    """The extents at a moment at which one of them holds."""
    if not left or not right:
        return NOWHERE
    hull: dict[Quantity, Extent] = {}
    for key, extent in left.items():
        other = right.get(key)
        if isinstance(extent, Bounds) and isinstance(other, Bounds):
            hull[key] = Bounds(min(extent.low, other.low), max(extent.high, other.high))
        elif isinstance(extent, frozenset) and isinstance(other, frozenset):
            hull[key] = extent | other
    return hull


def _shared(left: Extent, right: Extent) -> Extent | None:
    if isinstance(left, Bounds) and isinstance(right, Bounds):
        low, high = max(left.low, right.low), min(left.high, right.high)
        return Bounds(low, high) if low <= high else None
    if isinstance(left, frozenset) and isinstance(right, frozenset):
        return left & right or None
    return left


def in_words(key: Quantity) -> str:
    """A quantity in a message."""
    kind, *of = key
    names = ", ".join(str(name) for name in of if name != "*")
    if kind in ("east", "north", "elevation"):
        return f"`{names}.position.{kind}`"
    if kind in ("status", "heading"):
        return f"`{names}.{kind}`"
    if kind == "value":
        return f"`{of[0]}.{of[1]}`"
    if kind in ("field", "sent"):
        return f"`{of[1]}.{of[2]}`"
    if kind == "in":
        return f"`{of[0]} in {of[1]}`"
    if kind == "achieved":
        rule, *bound = of
        return f"`{rule}({', '.join(str(name) for name in bound if name != '*')})`"
    return f"`{kind}({names})`"
