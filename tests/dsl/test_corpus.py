"""The share of faults that the compiler finds, over corpora with seeds that recovery was not tuned on.

Recovery was tuned on seeds below 100. The full run is `benchmarks/language.py`; other seeds: `tests/dsl/corpus.py`.
"""

from __future__ import annotations

import random

import pytest

from lingjing.testing import compile_text
from tests.dsl import corpus

HELD_OUT = 1001


@pytest.fixture(scope="module")
def missions() -> list[corpus.Mission]:
    return corpus.good_missions()


@pytest.mark.parametrize(("faults", "files"), [(1, 90), (3, 60), (10, 30)])
def test_nine_of_ten_faults_are_found_with_few_spurious_errors(
    missions: list[corpus.Mission], faults: int, files: int
) -> None:
    outcome = corpus.Outcome()
    for planted, _ in corpus.corpus(missions, HELD_OUT, files, faults):
        corpus.judge(planted, outcome)
    assert outcome.planted.total() >= 0.95 * files * faults
    assert outcome.recall >= 0.9, corpus.table(outcome, 0)
    assert outcome.spurious_a_file <= 0.2, corpus.table(outcome, 0)


def test_nine_of_ten_unbalanced_braces_are_found_near_their_line(missions: list[corpus.Mission]) -> None:
    outcome = corpus.Outcome()
    for planted, _ in corpus.corpus(missions, HELD_OUT, 60, 1, ("brace",)):
        corpus.judge(planted, outcome)
    assert outcome.recall >= 0.9 and outcome.spurious_a_file <= 0.5, corpus.table(outcome, 0)


def test_a_seed_gives_the_same_files(missions: list[corpus.Mission]) -> None:
    first = [planted for planted, _ in corpus.corpus(missions, 5, 6, 3)]
    assert first == [planted for planted, _ in corpus.corpus(missions, 5, 6, 3)]
    assert first != [planted for planted, _ in corpus.corpus(missions, 6, 6, 3)]


@pytest.mark.parametrize("kind", sorted(corpus.KINDS))
def test_each_kind_of_fault_changes_the_text_and_has_a_valid_line(missions: list[corpus.Mission], kind: str) -> None:
    for seed in range(5):
        fault = corpus.KINDS[kind](missions[0], random.Random(seed))
        if fault is None:
            continue
        text, lines = corpus.apply(missions[0].text, [fault])
        assert text != missions[0].text and 1 <= lines[0] <= text.count("\n") + 1


def test_no_planted_file_is_a_good_mission(missions: list[corpus.Mission]) -> None:
    for planted, _ in corpus.corpus(missions, HELD_OUT, 40, 1):
        assert compile_text(planted.text).mission is None, planted.faults
