"""`Narrowing`: the smallest windows of boundaries in which a repair has to be made, by bisection.

Its questions follow from its answers alone. So several narrowings can go on beside each other, and what one will ask
next can be told before it is answered.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from lingjing.causal.shapley import AgentFaculty

Windows = tuple[tuple[AgentFaculty, int, int], ...]
"""From which to which boundary a pair is replaced; pairs that are not among them are replaced wherever they can be."""


class _UnansweredError(Exception):
    """The search needs an answer that is not there yet."""

    def __init__(self, question: Windows) -> None:
        super().__init__(question)
        self.question = question


class Narrowing:
    """The search for one repair: `ticks` are the boundaries at which each of its pairs was replaced. Pair after pair,
    the smallest run of them is looked for that still repairs: first its end is brought forward, then its beginning."""

    def __init__(self, ticks: Mapping[AgentFaculty, Sequence[int]]) -> None:
        self._ticks = ticks
        self._answers: dict[Windows, bool] = {}

    def answer(self, question: Windows, repairs: bool) -> None:
        """Take note of whether the episode is won with these windows."""
        self._answers[question] = repairs

    def question(self) -> Windows | None:
        """What has to be tried next; None if nothing has."""
        return self._next(self._answers)

    def guesses(self) -> Iterator[Windows]:
        """What will have to be tried after that: if it repairs, and if not."""
        asked = self.question()
        if asked is None:
            return
        for repairs in (True, False):
            further = self._next({**self._answers, asked: repairs})
            if further is not None:
                yield further

    def spans(self) -> dict[AgentFaculty, Sequence[int]]:
        """The boundaries of each pair's window, once no question is left."""
        return self._search(self._answers)

    def _next(self, answers: Mapping[Windows, bool]) -> Windows | None:
        try:
            self._search(answers)
        except _UnansweredError as open_:
            return open_.question
        return None

    def _search(self, answers: Mapping[Windows, bool]) -> dict[AgentFaculty, Sequence[int]]:
        found: dict[AgentFaculty, Sequence[int]] = {}
        windows: Windows = ()
        for pair, ticks in self._ticks.items():

            def repairs(first: int, last: int, pair: AgentFaculty = pair, windows: Windows = windows) -> bool:
                question = (*windows, (pair, first, last))
                if question not in answers:
                    raise _UnansweredError(question)
                return answers[question]

            found[pair] = _window(ticks, repairs)
            if found[pair]:
                windows = (*windows, (pair, found[pair][0], found[pair][-1]))
        return found


def _window(ticks: Sequence[int], repairs: Callable[[int, int], bool]) -> Sequence[int]:
    if not ticks:
        return ticks
    end = _least(len(ticks), lambda index: repairs(ticks[0], ticks[index]))
    begin = _least(end + 1, lambda back: repairs(ticks[end - back], ticks[end]))
    return ticks[end - begin : end + 1]


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
