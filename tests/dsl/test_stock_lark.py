"""Stock lark over the shipped grammar, driven as `docs/language.md` shows it, accepts what the own parser accepts."""

from __future__ import annotations

import ast
import random
import re
from collections.abc import Iterator
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
from lark import Lark, Transformer
from lark.exceptions import LarkError

from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.syntax import tree
from lingjing.dsl.syntax.builder import Builder
from lingjing.dsl.syntax.lexer import lex
from lingjing.dsl.syntax.parser import parse, parse_tokens
from lingjing.testing.missions import SourceText
from tests.dsl.test_fuzz import mutated

ROOT = Path(__file__).parents[2]
SHIPPED = sorted((ROOT / "scenarios").rglob("*.ljs"))
TEST_MODULES = sorted(Path(__file__).parent.glob("*.py"))
BLOCK = re.compile(r"^```ljs[^\n]*\n(.*?)\n```$", re.MULTILINE | re.DOTALL)
SMALL_FILE = 8_000
"""Bytes: mutations of larger shipped files would take most of the test's time."""
SHORT_TEXT = 40
"""Characters: shorter texts of tests are names and single words."""
SYNTAX = frozenset(("LJ0010", "LJ0011"))
"""Codes that the parsing loop reports; the lexer may report them too, on its own reporter."""


@cache
def documented() -> dict[str, Any]:
    """The names that the Python example of the page defines."""
    page = (ROOT / "docs" / "language.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"^```python\n(.*?)\n```$", page, re.MULTILINE | re.DOTALL)
    names: dict[str, Any] = {}
    exec(example, names)
    return names


@cache
def parser() -> Lark:
    """Stock lark with the example's lexer, and the children that the own tree is built of."""
    return Lark(
        documented()["grammar"], parser="lalr", lexer=documented()["LjsLexer"], start="file",
        keep_all_tokens=True, maybe_placeholders=True,
    )  # fmt: skip


def own_tree(text: str) -> tree.File | None:
    """The tree of the own lexer and parser; None where either reports an error of syntax."""
    source = SourceText(text)
    lexing, parsing = Reporter(source), Reporter(source)
    tokens = lex(text, lexing)
    if tokens is None or any(diagnostic.severity == "error" for diagnostic in lexing.diagnostics):
        return None
    made = parse_tokens(tokens, parsing)
    return None if SYNTAX & {diagnostic.code for diagnostic in parsing.diagnostics} else made


def lark_tree(text: str) -> tree.File | None:
    """The tree that the same reductions make of lark's parse; None where lark raises."""
    try:
        parsed = parser().parse(text)
    except LarkError:
        return None
    report = Reporter(SourceText(text))
    tokens = {(token.type, token.start): token for token in lex(text, report) or ()}

    class Reductions(Transformer[Any, Any]):
        def __default_token__(self, token: Any) -> Any:
            return tokens[token.type, token.start_pos]

    for name, reduction in Builder(report).actions().items():
        setattr(Reductions, name, lambda self, children, reduction=reduction: reduction(*children))
    made = Reductions().transform(parsed)
    assert isinstance(made, tree.File)
    return made


def check_both(texts: Iterator[str]) -> tuple[int, int]:
    """Parse each text with both, compare the trees, and return how many were accepted and rejected."""
    counts = [0, 0]
    for text in texts:
        own, stock = own_tree(text), lark_tree(text)
        assert own == stock, text
        counts[own is None] += 1
    return counts[0], counts[1]


def literals() -> Iterator[str]:
    """Every text in a test module of this folder, alone and as the content of a mission."""
    for module in TEST_MODULES:
        for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and len(node.value) < 100_000:
                yield node.value
                yield f"ljs 1\nmission m {{\n{node.value}\n}}\n"


def examples() -> Iterator[str]:
    """The blocks of the pages on the language and on its diagnostics."""
    for page in (ROOT / "docs" / "language.md", *sorted((ROOT / "docs" / "errors").glob("*.md"))):
        for text in re.findall(
            r"^```ljs[^\n]*\n(.*?)\n```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
        ):
            yield text
            yield f"ljs 1\nmission m {{\n{text}\n}}\n"


def test_the_example_of_the_page_parses() -> None:
    assert documented()["tree"].data == "file"


def test_shipped_files_are_accepted_by_both_parsers() -> None:
    accepted, rejected = check_both(path.read_text(encoding="utf-8") for path in SHIPPED)
    assert (accepted, rejected) == (len(SHIPPED), 0) and accepted > 20


@pytest.mark.parametrize("step", [5, pytest.param(1, marks=pytest.mark.thorough)])
def test_both_parsers_agree_on_the_texts_of_these_tests(step: int) -> None:
    """Each text alone and in a mission; every fifth text in `make test`."""
    accepted, rejected = check_both(islice(dict.fromkeys(literals()), 0, None, step))
    assert min(accepted, rejected) > 1000 / step


def test_both_parsers_agree_on_the_examples_of_the_documentation() -> None:
    accepted, rejected = check_both(examples())
    assert accepted > 100 and rejected > 10


@pytest.mark.parametrize("count", [120, pytest.param(520, marks=pytest.mark.thorough)])
def test_both_parsers_agree_on_mutations(small: str, count: int) -> None:
    """Of a small mission, of shipped files and of the texts of these tests in turn."""
    sources = (
        [small],
        [path.read_text(encoding="utf-8") for path in SHIPPED if path.stat().st_size < SMALL_FILE],
        [text for text in dict.fromkeys(literals()) if len(text) > SHORT_TEXT],
    )

    def mutations() -> Iterator[str]:
        for seed in range(count):
            chance = random.Random(seed)
            yield mutated(chance.choice(sources[seed % len(sources)]), chance)

    accepted, rejected = check_both(mutations())
    assert accepted > count / 100 and rejected > count / 5, (accepted, rejected)


def test_the_error_token_of_the_parser_is_no_word_of_the_language() -> None:
    """`ERROR` stands in the grammar for the own parser's recovery alone: no text gives one."""
    assert own_tree("ERROR") == lark_tree("ERROR") is not None
    assert parse(Reporter(SourceText("param = 3 4\n"))).items, "the own parser goes on behind an error"
