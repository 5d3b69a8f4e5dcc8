"""Tests of narrowing: its questions, its results and its predicted questions."""

import pytest

from lingjing.causal.narrowing import Narrowing, ReplacedSpan, Windows
from lingjing.causal.shapley import AgentFaculty

WAY: AgentFaculty = ("waypoint", "skipper")
SIGHT: AgentFaculty = ("perception", "scout[1]")


LAST = 99


def answered(narrowing: Narrowing, question: Windows, needed: dict[AgentFaculty, tuple[int, int]]) -> None:
    """Answer a question: a window replaces all its boundaries, and the branch wins if these include the needed ones."""
    windows = {pair: (first, LAST if last is None else last) for pair, first, last in question}
    won = all(first <= needed[pair][0] and needed[pair][1] <= last for pair, (first, last) in windows.items())
    everywhere = {pair: windows.get(pair, (0, LAST)) for pair in needed}
    replaced = {pair: range(first, min(last, 31) + 1) for pair, (first, last) in everywhere.items()}
    narrowing.answer(question, replaced if won else None)


@pytest.mark.parametrize("needed", [(4, 4), (4, 31), (9, 13), (30, 31)])
def test_the_smallest_window_is_found(needed: tuple[int, int]) -> None:
    narrowing, questions = Narrowing({WAY: range(4, 32)}, {WAY: range(4, 32)}), 0
    while (question := narrowing.question()) is not None:
        answered(narrowing, question, {WAY: needed})
        questions += 1
    span = narrowing.spans()[WAY]
    assert (span.first, span.replaced[0], span.replaced[-1]) == (needed[0], *needed)
    assert questions <= 10


def test_a_window_is_found_if_the_full_replacement_changes_few_boundaries() -> None:
    """An agent that is corrected early departs no more; in the episode it departed several times."""
    narrowing = Narrowing({WAY: [19, 23, 24, 45]}, {WAY: [19]})
    while (question := narrowing.question()) is not None:
        ((_, first, last),) = question
        won = first <= 24 and (last is None or last >= 26)
        narrowing.answer(
            question,
            {WAY: [boundary for boundary in (24, 26, 27) if last is None or boundary <= last]} if won else None,
        )
    assert narrowing.spans() == {WAY: ReplacedSpan(24, [24, 26])}


def test_a_window_begins_at_the_tried_start_and_not_at_the_first_replaced_boundary() -> None:
    """A reference that starts again where its agent had departed can agree with it at first."""
    narrowing = Narrowing({WAY: [4, 9, 12]}, {WAY: [4, 12]})
    while (question := narrowing.question()) is not None:
        ((_, first, last),) = question
        won = first <= 9 and (last is None or last >= 12)
        narrowing.answer(question, {WAY: [4, 12] if first <= 4 else [12]} if won else None)
    assert narrowing.spans() == {WAY: ReplacedSpan(9, [12])}


def test_pairs_are_narrowed_in_order_within_the_windows_of_earlier_pairs() -> None:
    needed = {SIGHT: (2, 3), WAY: (8, 8)}
    narrowing = Narrowing({SIGHT: [1, 2, 3, 5], WAY: [7, 8, 9]}, {SIGHT: [1, 2, 3, 5], WAY: [7, 8, 9]})
    while (question := narrowing.question()) is not None:
        assert len(question) == 1 or question[0] == (SIGHT, 2, 3)
        answered(narrowing, question, needed)
    spans = narrowing.spans()
    assert [(spans[pair].first, spans[pair].replaced[-1]) for pair in (SIGHT, WAY)] == [(2, 3), (8, 8)]


def test_a_predictable_next_question_is_among_the_guesses() -> None:
    needed = {WAY: (17, 22)}
    narrowing, foreseen, questions = Narrowing({WAY: range(32)}, {WAY: range(32)}), 0, 0
    while (question := narrowing.question()) is not None:
        guesses = list(narrowing.guesses())
        answered(narrowing, question, needed)
        following = narrowing.question()
        foreseen, questions = foreseen + (following in guesses), questions + (following is not None)
    assert questions - foreseen <= 1  # the first end depends on the boundaries that the last start replaces
    assert list(narrowing.guesses()) == []


def test_a_pair_without_replaced_boundaries_has_no_question() -> None:
    narrowing = Narrowing({WAY: [4]}, {WAY: []})
    assert narrowing.question() is None and narrowing.spans() == {WAY: ReplacedSpan(4, ())}
