"""Checks of missions: one expectation of one file each, with its name on the command line."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import msgspec

from lingjing.errors import UsageError
from lingjing.mission import model
from lingjing.play.policy_files import is_file

_WORDS = re.compile(r"\(|\)|[^\s()]+")
_WORDS_MOST = 100
"""Most words of a selection (chosen)."""


class MissionCheck(msgspec.Struct, frozen=True, kw_only=True):
    """One expectation of one file."""

    file: str
    """The file or shipped name, as the user wrote it."""
    path: Path
    """The mission's file."""
    mission: model.Mission
    expectation: model.Expectation
    text: str
    """The expectation as `.ljs` text."""

    @property
    def name(self) -> str:
        """The name in reports, as pytest names tests: `ssr.ljs::oracle wins`."""
        return f"{self.file}::{self.text}"


def checks_of(file: str, path: Path, mission: model.Mission) -> tuple[MissionCheck, ...]:
    """The checks of a mission, in the order of its text."""
    from lingjing.dsl.printing.printer import Printer

    printer = Printer(mission)
    return tuple(
        MissionCheck(file=file, path=path, mission=mission, expectation=each, text=printer.expectation(each))
        for each in mission.expectations
    )


def policy_beside(policy: str, mission_file: Path) -> str:
    """The policy of an expectation. The path of a policy's file begins at the folder of the mission's file."""
    if not is_file(policy):
        return policy
    file, colon, name = policy.partition(":")
    return f"{(mission_file.parent / file).resolve()}{colon}{name}"


def selected(checks: Iterable[MissionCheck], expression: str) -> tuple[MissionCheck, ...]:
    """The checks with a name that the expression selects: parts of names, `and`, `or`, `not` and brackets.

    Letter case does not matter, and an empty expression selects all. Raises `UsageError` for another expression.
    """
    if not expression.strip():
        return tuple(checks)
    accepts = _Selection(expression).read()
    return tuple(check for check in checks if accepts(check.name.lower()))


_Accepts = Callable[[str], bool]


class _Selection:
    """One pass over the words of a selection."""

    def __init__(self, expression: str) -> None:
        self.expression = expression
        self.words: list[str] = _WORDS.findall(expression.lower())
        if len(self.words) > _WORDS_MOST:
            raise self._error(f"it has more than {_WORDS_MOST} words")

    def read(self) -> _Accepts:
        """Return the function that tests a name in lower case."""
        accepts = self._alternatives()
        if self.words:
            raise self._error(f"`{self.words[0]}` does not fit")
        return accepts

    def _alternatives(self) -> _Accepts:
        parts = list(self._separated("or", self._conjunction))
        return lambda name: any(part(name) for part in parts)

    def _conjunction(self) -> _Accepts:
        parts = list(self._separated("and", self._operand))
        return lambda name: all(part(name) for part in parts)

    def _separated(self, word: str, part: Callable[[], _Accepts]) -> Iterator[_Accepts]:
        yield part()
        while self.words[:1] == [word]:
            self.words.pop(0)
            yield part()

    def _operand(self) -> _Accepts:
        if not self.words or self.words[0] in ("and", "or", ")"):
            raise self._error("a part of a name is missing")
        word = self.words.pop(0)
        if word == "not":
            refused = self._operand()
            return lambda name: not refused(name)
        if word == "(":
            inner = self._alternatives()
            if self.words[:1] != [")"]:
                raise self._error("`)` is missing")
            self.words.pop(0)
            return inner
        return lambda name: word in name

    def _error(self, why: str) -> UsageError:
        return UsageError(f"-k {self.expression}: {why}", hint="write it like -k 'oracle and not star'")
