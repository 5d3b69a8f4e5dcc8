"""`Narrowing`: the smallest windows of boundaries in which a repair has to be made, by bisection.

Its questions follow from its answers alone. So several narrowings can go on beside each other, and what one will ask
next can be told before it is answered.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

from lingjing.causal.shapley import AgentFaculty

Windows = tuple[tuple[AgentFaculty, int, int | None], ...]
"""From which to which boundary a pair is replaced (None: to the end); pairs that are not among them are replaced
wherever they can be."""

ReplacedTicks = Mapping[AgentFaculty, Sequence[int]]
"""The boundaries at which a branch replaced something of each pair."""


Tried = Callable[[int, int | None], ReplacedTicks | None]
"""What is replaced if a pair is from one boundary to another and the episode is won with that; None if it is not."""


class ReplacedSpan(NamedTuple):
    """From which boundary on a pair is to be replaced, and at which boundaries something then is. The two may begin
    apart: a reference that begins anew where its agent departed may agree with it at first."""

    first: int
    replaced: Sequence[int]


class _UnansweredError(Exception):
    """The search needs an answer that is not there yet."""

    def __init__(self, question: Windows) -> None:
        super().__init__(question)
        self.question = question


class _UnforeseenError(Exception):
    """What is asked next depends on what a branch replaces that was not played yet."""


class Narrowing:
    """The search for one repair. `begins` are the boundaries from which each of its pairs may have to be replaced; from
    the first of them on each was in the branch that repaired, and `replaced` is what that branch replaced. Pair after
    pair, the last of them is looked for from which it still repairs, then the first boundary after which nothing more
    has to be replaced."""

    def __init__(self, begins: ReplacedTicks, replaced: ReplacedTicks) -> None:
        self._begins = begins
        self._replaced = replaced
        self._answers: dict[Windows, ReplacedTicks | None] = {}

    def answer(self, question: Windows, replaced: ReplacedTicks | None) -> None:
        """Take note of what was replaced with these windows if the episode is won with them; None if it is not."""
        self._answers[question] = replaced

    def question(self) -> Windows | None:
        """What has to be tried next; None if nothing has."""
        return self._next(self._answers)

    def guesses(self) -> Iterator[Windows]:
        """What will have to be tried after that: if it repairs, and if not, as far as that can be foreseen."""
        asked = self.question()
        if asked is None:
            return
        outcomes: tuple[ReplacedTicks | None, ...] = ({}, None)  # what a branch replaces is not known beforehand
        for assumed in outcomes:
            further = self._next({**self._answers, asked: assumed})
            if further is not None:
                yield further

    def spans(self) -> dict[AgentFaculty, ReplacedSpan]:
        """The smallest window of each pair, once no question is left."""
        return self._search(self._answers)

    def _next(self, answers: Mapping[Windows, ReplacedTicks | None]) -> Windows | None:
        try:
            self._search(answers)
        except _UnansweredError as open_:
            return open_.question
        except _UnforeseenError:
            pass
        return None

    def _search(self, answers: Mapping[Windows, ReplacedTicks | None]) -> dict[AgentFaculty, ReplacedSpan]:
        found: dict[AgentFaculty, ReplacedSpan] = {}
        windows: Windows = ()
        replaced: ReplacedTicks = self._replaced
        for pair, begins in self._begins.items():

            def tried(
                first: int, last: int | None, pair: AgentFaculty = pair, windows: Windows = windows
            ) -> ReplacedTicks | None:
                question = (*windows, (pair, first, last))
                if question not in answers:
                    raise _UnansweredError(question)
                return answers[question]

            begin, replaced = _last_begin(begins, replaced, tried)
            ticks, replaced = _until_first_end(begin, pair, replaced, tried)
            found[pair] = ReplacedSpan(begin, ticks)
            if ticks:
                windows = (*windows, (pair, begin, ticks[-1]))
        return found


def _last_begin(begins: Sequence[int], replaced: ReplacedTicks, tried: Tried) -> tuple[int, ReplacedTicks]:
    """The last boundary from which the repair works, and what it then replaces; from the first, it is `replaced`."""
    begin = begins[_greatest(len(begins), lambda index: tried(begins[index], None) is not None)]
    return begin, replaced if begin == begins[0] else tried(begin, None) or {}


def _until_first_end(
    begin: int, pair: AgentFaculty, replaced: ReplacedTicks, tried: Tried
) -> tuple[Sequence[int], ReplacedTicks]:
    """The boundaries at which the pair is replaced up to the first after which nothing more has to be."""
    if pair not in replaced:
        raise _UnforeseenError
    ends = replaced[pair]
    if not ends:
        return (), replaced
    end = _least(len(ends), lambda index: tried(begin, ends[index]) is not None)
    return ends[: end + 1], replaced if end == len(ends) - 1 else tried(begin, ends[end]) or {}


def _greatest(count: int, holds: Callable[[int], bool]) -> int:
    """The greatest of 0..count-1 for which something holds that holds for 0, and up to some point."""
    return count - 1 - _least(count, lambda index: holds(count - 1 - index))


def _least(count: int, holds: Callable[[int], bool]) -> int:
    """The least of 0..count-1 for which something holds that holds for the last one, and from some point on."""
    low, high = 0, count - 1
    while low < high:
        middle = (low + high) // 2
        if holds(middle):
            high = middle
        else:
            low = middle + 1
    return high
