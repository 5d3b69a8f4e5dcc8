"""Seeded mutations of a good mission: the result is always a bounded list of diagnostics in order."""

from __future__ import annotations

import random
import re
import time

import pytest

from lingjing.dsl.diagnostics.codes import CODES
from lingjing.testing import compile_text

TOKEN = re.compile(r'"[^"\n]*"|\w+|<=|>=|==|->|\.\.|\S|\n')
JUNK = [
    "{",
    "}",
    "(",
    ")",
    "[",
    "]",
    '"',
    ",",
    "\n",
    "..",
    ".",
    "in",
    "when",
    "exists q:",
    "~",
    "hidden ",
    "\x00",
    "𝕏",
    "\\",
]


def mutated(text: str, chance: random.Random) -> str:
    """Apply one to six edits of tokens or characters."""
    for _ in range(chance.randint(1, 6)):
        spots = list(TOKEN.finditer(text)) or [re.match("", text)]
        first, second = chance.choice(spots), chance.choice(spots)
        assert first is not None and second is not None
        edit = chance.randrange(5)
        if edit == 0:
            text = text[: first.start()] + text[first.end() :]
        elif edit == 1:
            text = text[: first.end()] + " " + first[0] + text[first.end() :]
        elif edit == 2:
            text = text[: first.start()] + second[0] + text[first.end() :]
        elif edit == 3:
            text = text[: first.start()] + chance.choice(JUNK) + text[first.start() :]
        else:
            text = text[: max(first.start(), second.start())] + text[max(first.end(), second.end()) :]
    return text


@pytest.mark.parametrize("block", range(8))
def test_mutations_end_in_diagnostics(small: str, block: int) -> None:
    for seed in range(block * 60, block * 60 + 60):
        text = mutated(small, random.Random(seed))
        compilation = compile_text(text)
        starts = [item.span.start for item in compilation.diagnostics]
        assert starts == sorted(starts)
        for item in compilation.diagnostics:
            assert item.code in CODES and item.message
            assert 0 <= item.span.start <= item.span.end <= len(compilation.source.text)
        assert (compilation.mission is None) == bool(compilation.diagnostics) or not compilation.diagnostics


@pytest.mark.parametrize(
    "text",
    [
        "{" * 10_000,
        "ljs 1\n" + "mission m {\n" * 10_000,
        "ljs 1\nmission m { param x = " + "-" * 10_000 + "1 }",
        "ljs 1\nmission m { param x = " + "not " * 10_000 + "1 }",
        "ljs 1\nmission m { param x = a" + ".b" * 10_000 + " }",
        "ljs 1\nmission m { param x = a" + "[1]" * 10_000 + " }",
        "ljs 1\nmission m { param x = 1" + " + 1" * 10_000 + " }",
        "ljs 1\nmission m { success when " + "exists r: " * 10_000 + "true }",
        "ljs 1\nmission m { param x = " + "9" * 300_000 + " }",
        "ljs 1\nmission m { param x = " + "1" * 200_000 + "a1 }",
        '"' * 100_000,
        "#" * 900_000,
        "a " * 100_000,
        "a,\n" * 50_000,
        "\u202e" * 5_000,
        "goal " * 50_000,
        "= " * 50_000,
        "} " * 50_000,
        "ljs 1\nuse " + "std." * 10_000 + "air",
    ],
    ids=lambda text: text[:24],
)
def test_very_large_texts_give_diagnostics_quickly(text: str) -> None:
    began = time.process_time()
    assert compile_text(text).diagnostics
    assert time.process_time() - began < 10  # detects quadratic algorithms, which would take minutes
