"""The grammar for constrained decoding permits formatted missions, and no other words at the start of a statement."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from lark import Lark
from lark.exceptions import LarkError

from lingjing.dsl.pages.gbnf import gbnf

ACCEPTED = """ljs 2
use std.sea { lifeboat, person_in_water }

mission small "A small rescue" {
  goal "Bring the boat."
  clock { tick = 20 s, sync = 1 s }
  target victim[1..3] : person_in_water { hidden position ~ sites(area, apart >= 80 m) }
  adjudicate rescued(v: victim) { when emitted(rescue, v) and distance_xy(boat, v) <= 50 m }
  message detection : report from searcher to all
  success when forall v: rescued(v)
  expect {
    oracle wins at least 2 of 3 within 40 ticks for seeds 0..2 with victims = 2, mode = star
    draws spread over area
  }
}
"""


@pytest.fixture(scope="module")
def permits() -> Callable[[str], bool]:
    """A recogniser of the grammar: GBNF and lark's notation differ in the names and signs of rules."""
    rules = []
    for line in gbnf().splitlines():
        name, body = line.split(" ::= ", 1)
        body = re.sub(r"(\[(?:\\.|[^\]])+\])", lambda match: "/" + match[1].replace("/", r"\/") + "/", body)
        rules.append(f"{_lark(name)}: {_named(body)}")
    parser = Lark("\n".join(rules), start="root", parser="earley", lexer="dynamic")

    def check(text: str) -> bool:
        try:
            parser.parse(text)
        except LarkError:
            return False
        return True

    return check


def _lark(name: str) -> str:
    return name.replace("-", "_")


def _named(body: str) -> str:
    """The body with rule names of lark; texts and classes stay."""
    parts = re.split(r'("(?:\\.|[^"\\])*"|/(?:\\.|[^/])*/)', body)
    return "".join(part if number % 2 else part.replace("-", "_") for number, part in enumerate(parts))


def test_the_grammar_permits_a_formatted_mission(permits: Callable[[str], bool]) -> None:
    assert permits(ACCEPTED)


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("success when", "if success"), ("clock {", "clock ["), ("wins at", "winning at"), ("[1..3]", "[1 to"),
        (" : person_in_water", " person_in_water"), ('"Bring the boat."', "Bring the boat."),
    ],
)  # fmt: skip
def test_the_grammar_rejects_faulty_texts(permits: Callable[[str], bool], before: str, after: str) -> None:
    assert before in ACCEPTED and not permits(ACCEPTED.replace(before, after))
