"""Narrowing of a repair to the smallest windows of boundaries, by bisection.

Its questions follow from earlier answers alone. So several narrowings can run in parallel, and the next questions can
be predicted before an answer arrives.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

from lingjing.causal.shapley import AgentFaculty

Windows = tuple[tuple[AgentFaculty, int, int | None], ...]
"""The first and last boundary (None: to the end) of the substitution of some pairs; other pairs are substituted
without a limit.
"""

ReplacedTicks = Mapping[AgentFaculty, Sequence[int]]
"""The boundaries at which a branch replaced something, by pair."""


_Trial = Callable[[int, int | None], ReplacedTicks | None]
"""Plays a window (first and last boundary) of a pair; returns the replaced boundaries if the episode is won, else
None.
"""


class ReplacedSpan(NamedTuple):
    """The substitution of a pair."""

    first: int
    """The boundary at which it starts."""
    replaced: Sequence[int]
    """The boundaries at which something is replaced. The first of them may be later: a reference that starts here may
    agree with the agent at first.
    """


class _UnansweredError(Exception):
    """The search needs an answer that is not known yet."""

    def __init__(self, question: Windows) -> None:
        super().__init__(question)
        self.question = question


class _UnforeseenError(Exception):
    """The next question depends on the replacements of a branch that was not played yet."""


class Narrowing:
    """The narrowing of one repair.

    `begins` are the boundaries at which the substitution of each pair may have to start; in the repairing branch it
    started at the first of them, and replaced `replaced`. For one pair after the other, the last start that still
    repairs is searched, then the first end.
    """

    def __init__(self, begins: ReplacedTicks, replaced: ReplacedTicks) -> None:
        self._begins = begins
        self._replaced = replaced
        self._answers: dict[Windows, ReplacedTicks | None] = {}

    def answer(self, question: Windows, replaced: ReplacedTicks | None) -> None:
        """Store the boundaries that were replaced with these windows if the episode was won, else None."""
        self._answers[question] = replaced

    def question(self) -> Windows | None:
        """Return the windows to try next, or None."""
        return self._next(self._answers)

    def guesses(self) -> Iterator[Windows]:
        """Yield the windows to try after that, for either answer, as far as they can be predicted."""
        question = self.question()
        if question is None:
            return
        outcomes: tuple[ReplacedTicks | None, ...] = ({}, None)  # the replaced boundaries are not known beforehand
        for assumed in outcomes:
            further = self._next({**self._answers, question: assumed})
            if further is not None:
                yield further

    def spans(self) -> dict[AgentFaculty, ReplacedSpan]:
        """Return the smallest window of each pair. Call it when no question is left."""
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
        spans: dict[AgentFaculty, ReplacedSpan] = {}
        windows: Windows = ()
        replaced: ReplacedTicks = self._replaced
        for pair, begins in self._begins.items():

            def trial(
                first: int, last: int | None, pair: AgentFaculty = pair, windows: Windows = windows
            ) -> ReplacedTicks | None:
                question = (*windows, (pair, first, last))
                if question not in answers:
                    raise _UnansweredError(question)
                return answers[question]

            begin, replaced = _last_start(begins, replaced, trial)
            ticks, replaced = _until_first_end(begin, pair, replaced, trial)
            spans[pair] = ReplacedSpan(begin, ticks)
            if ticks:
                windows = (*windows, (pair, begin, ticks[-1]))
        return spans


def _last_start(starts: Sequence[int], replaced: ReplacedTicks, trial: _Trial) -> tuple[int, ReplacedTicks]:
    """Return the last start from which the repair works, and the boundaries that it then replaces."""
    start = starts[_greatest(len(starts), lambda index: trial(starts[index], None) is not None)]
    return start, replaced if start == starts[0] else trial(start, None) or {}


def _until_first_end(
    start: int, pair: AgentFaculty, replaced: ReplacedTicks, trial: _Trial
) -> tuple[Sequence[int], ReplacedTicks]:
    """Return the pair's replaced boundaries up to the first end that still wins, and all replaced boundaries."""
    if pair not in replaced:
        raise _UnforeseenError
    ends = replaced[pair]
    if not ends:
        return (), replaced
    end = _least(len(ends), lambda index: trial(start, ends[index]) is not None)
    return ends[: end + 1], replaced if end == len(ends) - 1 else trial(start, ends[end]) or {}


def _greatest(count: int, holds: Callable[[int], bool]) -> int:
    """Return the greatest index that satisfies a monotone condition, which holds for 0 and up to some index."""
    return count - 1 - _least(count, lambda index: holds(count - 1 - index))


def _least(count: int, holds: Callable[[int], bool]) -> int:
    """Return the least index that satisfies a monotone condition, which holds for the last and from some index on."""
    low, high = 0, count - 1
    while low < high:
        middle = (low + high) // 2
        if holds(middle):
            high = middle
        else:
            low = middle + 1
    return high
