"""Damaged texts: every verb that reads one reports a diagnostic, without a traceback and without exit code 70."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from lingjing.errors import ExitCode
from lingjing.testing import mission_file, run_command

TOKEN = re.compile(r'"[^"\n]*"|\d[\d.]*(?:e\d+)?(?: (?:[a-zA-Z%]+\d?))?|\w+|[<>=~]=?|\.\.|->|\s+|.', re.DOTALL)
NUMBERS = ("1e308", "1e308 m", "1e308 s", "9e999", "0", "-1", "1e-308", "5e-324", "1e18", "0.5", "1e308 * 1e308")
VALUES = ("1 / 0", "[]", "()", "{}", "1..0", "i", "tick", "none", "uniform(1e308 m, 1e308 m)", "sites(search)")
ODD = ("\u202e", "\x00", "\u0301", "\u2028", "\x85", "\x0b", "²", "Ⅳ", "½", "\r", "\\", "'", '"', '"""', "}", "(", "]")
VERBS: tuple[tuple[str, ...], ...] = (
    ("validate",),
    ("validate", "--unsafe-fixes", "--diff"),
    ("validate", "--output-format", "sarif"),
    ("fmt", "--diff"),
    ("compile",),
    ("compile", "--emit", "ljs"),
    ("compile", "--emit", "reset-scenario"),
    ("graph", "--format", "svg"),
    ("docs",),
)
Words = list[str]


def _is_number(word: str) -> bool:
    return word[0].isdigit()


def _is_word(word: str) -> bool:
    return not word.isspace()


def _replaced(chance: random.Random, words: Words, fits: Callable[[str], bool], others: tuple[str, ...]) -> None:
    at = chance.choice([k for k, word in enumerate(words) if fits(word)])
    words[at] = chance.choice(others)


def mutant(text: str, chance: random.Random) -> str:
    """Return the text with one to three tokens deleted, doubled, swapped or replaced, or cut at the end."""
    words = TOKEN.findall(text)
    for _ in range(chance.choice((1, 1, 2, 3))):
        kind = chance.randrange(8)
        at = chance.choice([k for k, word in enumerate(words) if _is_word(word)])
        if kind < 3:
            _replaced(chance, words, _is_number, NUMBERS if kind else VALUES)
        elif kind == 3:
            words[at] = ""
        elif kind == 4:
            words[at] = f"{words[at]} {words[at]}"
        elif kind == 5:
            words[at] += chance.choice(ODD)
        elif kind == 6:
            _replaced(chance, words, _is_word, tuple(word for word in words if _is_word(word)))
        else:
            words = words[: max(at, len(words) // 2)]
        words = [word for word in words if word] or ["x"]
    return "".join(words)


def check_every_verb(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Check that every verb exits with 0, 1 or 2, and prints an error unless it is 0."""
    for verb, *options in VERBS:
        code = run_command([verb, *options, str(file)])
        captured = capsys.readouterr()
        assert code in (ExitCode.OK, ExitCode.MISSION, ExitCode.USAGE), (verb, options, captured.err)
        assert "Traceback" not in captured.err and (code == ExitCode.OK or captured.out or captured.err)


@pytest.mark.parametrize("name", ["bi", "cd", "cr", "idf", "ld", "queue", "ssr", "ufr", "upr", "vdn"])
def test_mutants_of_the_missions_give_no_traceback(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = mission_file(name).read_text(encoding="utf-8")
    file = tmp_path / f"{name}.ljs"
    for seed in range(3):
        file.write_text(mutant(text, random.Random(f"{name} {seed}")), encoding="utf-8", newline="")
        check_every_verb(file, capsys)


@pytest.mark.parametrize("tail", ['"', '""', '"""', '"""\n"', '" """ "a', '"\\', '"a" "b"\n"', '"{', '"}\n"""'])
def test_stray_quotes_after_a_mission_give_no_traceback(
    tail: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    example = (Path(__file__).parents[2] / "docs" / "errors" / "example.ljs").read_text()
    file = tmp_path / "quotes.ljs"
    for text in (f"{example}{tail}", f"{example.rstrip()}{tail}\n"):
        file.write_text(text)
        check_every_verb(file, capsys)


LARGE = (
    ("tick = 10 s", "tick = 1e308 s"),
    ("sync = 500 ms", "sync = 1e-300 ms"),
    ("(100 m, 100 m)", "(100 m, 1e308 m)"),
    ("[1..3]", "[1..1e308]"),
    ("3 by 3", "1e308 by 3"),
    ("640 by 480", "1e308 by 1e308"),
    ("apart >= 10 m", "apart >= 1e-308 m"),
    ("altitude = 100 m in 40 m..160 m", "altitude = 1e300 km"),
    ("spread 8 m", "spread 1e-300 m"),
    ("speed <= 3 m/s", "speed <= 1e200 * 1e200 m/s"),
)


@pytest.mark.parametrize(("old", "new"), LARGE)
def test_extreme_numbers_give_no_traceback(
    old: str, new: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    example = (Path(__file__).parents[2] / "docs" / "errors" / "example.ljs").read_text()
    assert old in example
    file = tmp_path / "large.ljs"
    file.write_text(example.replace(old, new))
    check_every_verb(file, capsys)
