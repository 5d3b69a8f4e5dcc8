"""The extension for Visual Studio Code: its grammar contains the words of the compiler."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from types import ModuleType

import pytest

from lingjing.dsl.syntax.tokens import INNER, STATEMENTS
from lingjing.mission.functions import DISTRIBUTIONS, FUNCTIONS
from lingjing.mission.units import UNITS

ROOT = Path(__file__).parents[2]
EXTENSION = ROOT / "editors" / "vscode"

regex = pytest.importorskip("regex", reason="the grammar's patterns use \\p{L}")


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("textmate_tool", ROOT / "tools" / "textmate.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def rules() -> dict[str, dict[str, object]]:
    return json.loads((EXTENSION / "syntaxes" / "ljs.tmLanguage.json").read_text(encoding="utf-8"))["repository"]


def test_the_committed_grammar_is_up_to_date_with_the_tables(tool: ModuleType) -> None:
    committed = (EXTENSION / "syntaxes" / "ljs.tmLanguage.json").read_text(encoding="utf-8")
    assert committed == tool.text(), "run: python tools/textmate.py"


@pytest.mark.parametrize("word", sorted(STATEMENTS))
def test_every_keyword_is_coloured_in_a_statement_and_not_as_a_property_name(rules, word: str) -> None:
    heads = [rules[name]["match"] for name in ("declaration", "statement")]
    assert any(regex.search(head, f"  {word} name") for head in heads)
    assert not any(regex.search(head, f"  {word} = 3") for head in heads)


@pytest.mark.parametrize("word", sorted(INNER))
def test_every_inner_word_is_coloured(rules, word: str) -> None:
    names = ("inner", "wordOperator", "constant", "statement")
    assert any(regex.search(rules[name]["match"], f"{{ {word} x") for name in names)


@pytest.mark.parametrize("unit", [*sorted(UNITS), "km/h", "m/s^2"])
def test_every_unit_is_coloured_completely(rules, unit: str) -> None:
    match = regex.search(rules["number"]["match"], f"= 3.5 {unit}, x")
    assert (match[1], match[2]) == ("3.5", unit)


def test_functions_distributions_declared_names_and_numbers_are_coloured(rules) -> None:
    for word in FUNCTIONS:
        assert regex.search(rules["function"]["patterns"][0]["match"], f"{word}(")
    for word in DISTRIBUTIONS:
        assert regex.search(rules["distribution"]["match"], f"~ {word}(")
    match = regex.search(rules["declaration"]["match"], "  param altitude = 3 m")
    assert (match[1], match[2]) == ("param", "altitude")
    assert regex.search(rules["number"]["match"], "in 1..10")[1] == "1"


def test_the_manifest_names_files_that_are_there() -> None:
    manifest = json.loads((EXTENSION / "package.json").read_text(encoding="utf-8"))
    language, grammar = manifest["contributes"]["languages"][0], manifest["contributes"]["grammars"][0]
    for path in (manifest["main"], language["configuration"], grammar["path"], "README.md", "LICENSE"):
        assert (EXTENSION / path).is_file(), path
    assert manifest["contributes"]["configuration"]["properties"]["lingjing.command"]["default"] == ["lingjing", "lsp"]
    json.loads((EXTENSION / "language-configuration.json").read_text(encoding="utf-8"))
