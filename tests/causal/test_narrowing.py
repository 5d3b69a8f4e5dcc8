"""Which boundaries a repair needs: what narrowing asks, finds and tells ahead."""

import pytest

from lingjing.causal.narrowing import Narrowing, Windows
from lingjing.causal.shapley import AgentFaculty

WAY: AgentFaculty = ("waypoint", "skipper")
SIGHT: AgentFaculty = ("perception", "scout[1]")


def holds(question: Windows, needed: dict[AgentFaculty, tuple[int, int]]) -> bool:
    return all(first <= needed[pair][0] and needed[pair][1] <= last for pair, first, last in question)


@pytest.mark.parametrize("needed", [(4, 4), (4, 31), (9, 13), (30, 31)])
def test_the_smallest_window_is_found(needed: tuple[int, int]) -> None:
    narrowing, asked = Narrowing({WAY: range(4, 32)}), 0
    while (question := narrowing.question()) is not None:
        narrowing.answer(question, repairs=holds(question, {WAY: needed}))
        asked += 1
    assert (narrowing.spans()[WAY][0], narrowing.spans()[WAY][-1]) == needed
    assert asked <= 10


def test_pair_after_pair_is_narrowed_within_the_windows_of_those_before() -> None:
    needed = {SIGHT: (2, 3), WAY: (8, 8)}
    narrowing = Narrowing({SIGHT: [1, 2, 3, 5], WAY: [7, 8, 9]})
    while (question := narrowing.question()) is not None:
        assert len(question) == 1 or question[0] == (SIGHT, 2, 3)
        narrowing.answer(question, repairs=holds(question, needed))
    assert narrowing.spans() == {SIGHT: [2, 3], WAY: [8]}


def test_what_is_asked_next_was_among_the_guesses() -> None:
    narrowing = Narrowing({WAY: range(40)})
    answers = [True, False, True, True, False, True, False, True, False, True, True]
    while (question := narrowing.question()) is not None:
        guesses = list(narrowing.guesses())
        narrowing.answer(question, repairs=answers.pop())
        following = narrowing.question()
        assert following is None or following in guesses
    assert list(narrowing.guesses()) == []


def test_what_was_never_replaced_asks_nothing() -> None:
    narrowing = Narrowing({WAY: []})
    assert narrowing.question() is None and narrowing.spans() == {WAY: []}
