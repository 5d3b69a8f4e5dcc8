"""Mistakes that people and language models make lead to their correction: one cause, one error, the right way out.

`data/mistakes/mistakes.toml` lists them. Each is planted in `data/mistakes/harbour.ljs` alone. A fix must give back
the mission, not only a text that compiles.
"""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path

import msgspec
import pytest

from lingjing.testing import compile_text

DATA = Path(__file__).parent / "data" / "mistakes"
BASE = (DATA / "harbour.ljs").read_text(encoding="utf-8")
MISTAKES: list[list[str]] = tomllib.loads((DATA / "mistakes.toml").read_text(encoding="utf-8"))["mistakes"]


@cache
def intended(text: str) -> object:
    """The mission of a text without the facts about its file; None for a faulty text."""
    mission = compile_text(text).mission
    return None if mission is None else msgspec.structs.replace(mission, origin=type(mission.origin)())


def test_the_mission_without_mistakes_is_good_and_the_list_is_long() -> None:
    assert compile_text(BASE).diagnostics == ()
    assert len({mistake[0] for mistake in MISTAKES}) == len(MISTAKES) >= 80


@pytest.mark.parametrize("mistake", MISTAKES, ids=[mistake[0].replace(" ", "-") for mistake in MISTAKES])
def test_a_mistake_is_one_error_that_leads_to_its_correction(mistake: list[str]) -> None:
    name, right, wrong, code, hint, fix, *meaning = mistake
    assert BASE.count(right) == 1, f"{name}: the replaced text is not unique"
    text = BASE.replace(right, wrong)
    errors = [item for item in compile_text(text).diagnostics if item.severity == "error"]
    assert [item.code for item in errors] == [code], [(item.span.line, item.message, item.hint) for item in errors]
    assert hint in errors[0].hint, errors[0]
    offered = errors[0].fix
    assert ("" if offered is None else "safe" if offered.safe else "likely") == fix, errors[0]
    if offered is None:
        return
    for edit in sorted(offered.edits, key=lambda edit: edit.span.start, reverse=True):
        text = text[: edit.span.start] + edit.text + text[edit.span.end :]
    assert intended(text) == intended(BASE.replace(right, meaning[0]) if meaning else BASE) is not None, text


@pytest.mark.parametrize("place", ["at -3.5 m }", "weather calm_sea", "loss = 0.1 }"])
def test_without_indentation_a_stray_brace_is_one_error(place: str) -> None:
    flat = "\n".join(line.strip() for line in BASE.split("\n"))
    (error,) = compile_text(flat.replace(place, f"{place} }}", 1)).diagnostics
    assert error.code == "LJ0004" and error.fix is not None
    assert error.span.line == flat[: flat.index(place)].count("\n") + 1


def test_each_block_with_colon_and_indentation_is_an_error_and_the_fixes_give_the_mission() -> None:
    """The whole mission as a Python author writes it: no block of several lines has braces."""
    text = re.sub(r"\n *\}(?=\n)", "", re.sub(r" \{\n", ":\n", BASE))
    errors = compile_text(text).diagnostics
    assert {error.code for error in errors} == {"LJ0010"} and len(errors) == BASE.count("{\n")
    edits = [edit for error in errors for edit in (error.fix.edits if error.fix is not None else ())]
    for edit in sorted(edits, key=lambda edit: (edit.span.start, edit.span.end), reverse=True):
        text = text[: edit.span.start] + edit.text + text[edit.span.end :]
    assert intended(text) == intended(BASE) is not None


OTHERS = tomllib.loads((DATA / "more_mistakes.toml").read_text(encoding="utf-8"))
"""Mistakes from other languages: those that lead to their correction, and those that do not yet."""


def errors_of(mistake: list[str]) -> list[tuple[str, str]]:
    """The code and the hint of each error of a text with a mistake."""
    _, right, wrong = mistake[:3]
    assert BASE.count(right) == 1, mistake
    items = compile_text(BASE.replace(right, wrong)).diagnostics
    return [(item.code, item.hint) for item in items if item.severity == "error"]


@pytest.mark.parametrize("mistake", OTHERS["mistakes"], ids=lambda mistake: mistake[0].replace(" ", "-"))
def test_a_mistake_from_another_language_is_one_error_with_a_hint(mistake: list[str]) -> None:
    assert errors_of(mistake) == [(mistake[3], mistake[4])]


def test_eleven_of_twelve_mistakes_from_other_languages_lead_to_their_correction() -> None:
    resolved, unresolved = OTHERS["mistakes"], OTHERS["unresolved"]
    assert len(resolved) >= 65 and 12 * len(resolved) >= 11 * (len(resolved) + len(unresolved))
    assert all(len(errors_of(mistake)) > 0 for mistake in unresolved)
