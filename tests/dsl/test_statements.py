"""The table of statements: it is complete, the files derived from it are up to date, and a new row works everywhere."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lingjing import Mission
from lingjing.dsl.checking.checker import _CHECKS
from lingjing.dsl.pages.statements import statements_page
from lingjing.dsl.printing.layouts import has_layout
from lingjing.dsl.printing.printer import _WRITERS
from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.parser import parse
from lingjing.dsl.syntax.statement_kinds import FILE, TYPE, Form
from lingjing.dsl.syntax.statements import KINDS, PARAGRAPHS, STATEMENTS, keyword_of
from lingjing.mission.instance import Instance
from lingjing.testing import compile_text, instantiate
from lingjing.testing.missions import SourceText

ROOT = Path(__file__).parents[2]
SINGLE = {"goal", "capabilities", "scene", "clock", "budget", "weather", "comms", "modes", "success", "failure"}
"""Fields of a mission that hold one value; the checker reads them by name."""


def test_files_derived_from_the_table_are_up_to_date() -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "tools" / "statements.py"), "--check"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


def test_each_keyword_has_one_row() -> None:
    assert len(KINDS) == len(STATEMENTS)


def test_each_part_of_a_mission_has_a_statement_that_is_checked_and_printed() -> None:
    parts = {kind.part for kind in STATEMENTS if kind.part}
    assert parts == set(Mission.__struct_fields__) - {
        "format",
        "name",
        "title",
        "origin",
        "base",
        "weather_alternatives",
        "goals",
    }
    assert parts == set(_CHECKS) | SINGLE
    assert all(has_layout(part) != (part in _WRITERS) for part in parts)
    assert {kind.paragraph for kind in STATEMENTS if kind.part} == set(PARAGRAPHS)


def test_every_block_that_contains_statements_is_opened_by_a_statement() -> None:
    places = {place for kind in STATEMENTS for place in kind.within} - {FILE, TYPE}
    assert all(KINDS[place].opens_block for place in places)


def test_fields_of_patterns_are_fields_of_nodes() -> None:
    for kind in STATEMENTS:
        labels = {element.label for form in kind.forms if not form.built for element in form.elements()} - {""}
        fields = set(kind.node.__struct_fields__) if kind.node is not None else set()
        assert labels <= fields, kind.keyword


@pytest.mark.parametrize("keyword", KINDS)
def test_each_example_is_parsed_as_its_statement(keyword: str) -> None:
    report = Reporter(SourceText(KINDS[keyword].example))
    (item,) = parse(report).items
    assert report.diagnostics == []
    if KINDS[keyword].node is None:
        assert isinstance(item, s.PropertyLine) and getattr(item, keyword)
    else:
        assert keyword_of(item) == keyword


def test_a_pattern_names_its_symbols_and_groups() -> None:
    elements = Form("name:NAME [per variable:NAME in domain:NAME] at [drawn:~] at:value [guard]").elements()
    assert [(element.symbol, element.label, element.word, element.group) for element in elements] == [
        ("NAME", "name", "", 0), ("PER", "", "per", 1), ("NAME", "variable", "", 1), ("IN", "", "in", 1),
        ("NAME", "domain", "", 1), ("AT", "", "at", 0), ("TILDE", "drawn", "", 2), ("value", "at", "", 0),
        ("guard", "guard", "", 3),
    ]  # fmt: skip


def test_the_reference_page_shows_forms_words_and_limits() -> None:
    page = statements_page()
    assert "message ‹name› : ‹type› from ‹senders›, … to ‹recipients›, … [when ‹condition›]" in page
    assert "‹kind› is one of `hard`, `soft`." in page
    assert "| `loss` | `=` | bare number | at least 0, at most 1 | `0` |" in page


def test_documented_defaults_are_those_of_a_mission_without_the_lines(small: str) -> None:
    def written(keyword: str, *without: str) -> str:
        keys = [key for key in KINDS[keyword].keys.values() if key.default and key.name not in without]
        return f"{keyword} {{ {', '.join(f'{key.name} {key.relations[0]} {key.default}' for key in keys)} }}"

    settings = (["weather"], ["comms"], ["budget"])
    lines = [line for line in small.splitlines() if line.split()[:1] not in settings and "star" not in line]
    bare = "\n".join(lines).replace("  scene", "  budget { ticks <= 60 }\n  scene", 1)
    budget = written("budget").replace("{ ", "{ ticks <= 60, ")
    full = "\n".join(lines).replace("  scene", f"  {written('weather')}\n  {written('comms')}\n  {budget}\n  scene", 1)
    before, after = (instance_of(text) for text in (bare, full))
    assert (before.weather, before.comms, before.budget) == (after.weather, after.comms, after.budget)


def instance_of(text: str) -> Instance:
    compilation = compile_text(text)
    assert compilation.mission is not None, compilation.diagnostics
    return instantiate(compilation.mission, seed=1)


# -- a new statement

ROW = """
    StatementKind(
        "landmark", s.LandmarkLine, (Form("name:NAME at place:value [guard]"),), ("mission",),
        example="landmark pier at (10 m, 20 m)", doc="a place with a name",
        part="landmarks", paragraph="places", layout=Layout("landmark {name} at {place}" + _WHEN),
    ),
"""
NODE = """
class LandmarkLine(Statement, frozen=True, gc=False):
    name: Name
    place: Expression
    guard: Expression | None


"""
CHECK = """
    def landmark(self, node: s.LandmarkLine) -> model.Landmark | None:
        place = self.rules.of.expect(node.place, STATIC, POSITION, "a landmark")
        guard = self.settings.guard(node.guard)
        return None if place is UNKNOWN else model.Landmark(name=node.name.text, place=place.ir, when=guard)

"""
CHECK_IMPORTS = """
from lingjing.dsl.checking.values import STATIC, UNKNOWN
from lingjing.mission.functions import POSITION
"""
PART = """
class Landmark(Record, frozen=True, kw_only=True):
    name: str
    place: Expr
    when: Guard | None = None


"""

INSERTIONS: dict[str, list[tuple[str, str]]] = {
    "lingjing/dsl/syntax/statements.py": [(')  # fmt: skip\n"""Every statement', ROW)],
    "lingjing/dsl/syntax/tree.py": [("class Faulty(", NODE)],
    "lingjing/dsl/checking/checker.py": [
        ("    # -- private\n", CHECK),
        ('    "sweeps": lambda', '    "landmarks": lambda mission, node: mission.landmark(node),\n'),
        ("from lingjing.dsl.syntax import tree as s\n", CHECK_IMPORTS),
    ],
    "lingjing/mission/model.py": [
        ("class Mission(Record", PART),
        ("    sweeps: tuple[Sweep, ...]", "    landmarks: tuple[Landmark, ...] = ()\n"),
    ],
}
"""The four files that a new statement touches → what is inserted, and before which text."""

USE = """
import sys
from lingjing.testing import compile_text
from lingjing.dsl.formatting.formatter import format_text
from lingjing.dsl.pages.page import page
from lingjing.dsl.printing.printer import canonical, round_trip_losses, to_ljs
from lingjing.lsp.analysis import Analysis
from lingjing.lsp.complete import complete
from lingjing.lsp.explain import explain
from lingjing.lsp.outline import outline

LINE = "landmark pier at (10 m, 20 m) when mode == broadcast"
text = open(sys.argv[1], encoding="utf-8").read().replace("  success", "  " + LINE + "\\n  success", 1)

def offered(line):
    changed = text.replace(LINE, line, 1)
    at = changed.index("|")
    return {item.label for item in complete(Analysis(changed.replace("|", ""), "t"), at).items}

mission = compile_text(text).mission
assert [item.name for item in mission.landmarks] == ["pier"]
printed = to_ljs(mission)
assert LINE in printed and round_trip_losses(mission, printed) == ()
assert LINE in format_text(text.replace(LINE, LINE.replace(" ", "  "))).text
assert "## Places" in page(mission) and LINE in page(mission)
assert "landmark" in offered("|") and "at" in offered("landmark pier |") and "when" in offered("landmark pier at x |")
analysis = Analysis(text, "t")
assert explain(analysis, text.index("landmark"))[0] == "`landmark pier at (10 m, 20 m)`: a place with a name."
assert any(child.keyword == "landmark" for entry in outline(analysis.tree) for child in entry.children)
faults = [(item.code, item.message) for item in compile_text(text.replace("landmark", "landmrak")).diagnostics]
assert faults == [("LJ0011", "no statement is called `landmrak`")], faults
faults = [item.code for item in compile_text(text.replace("(10 m, 20 m)", "3 m")).diagnostics]
assert faults == ["LJ0201"], faults
print("landmark works")
"""


@pytest.fixture
def edited(tmp_path: Path) -> Path:
    """A copy of the sources with the insertions. The other folders are links."""
    copied = {"dsl", "lsp", "mission"}
    (tmp_path / "lingjing").mkdir()
    for child in (ROOT / "lingjing").iterdir():
        if child.name in copied:
            shutil.copytree(child, tmp_path / "lingjing" / child.name, ignore=shutil.ignore_patterns("__pycache__"))
        elif child.name != "__pycache__":
            (tmp_path / "lingjing" / child.name).symlink_to(child)
    for folder in ("tools", "editors", "docs", "schemas"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("*.jpg", "*.png", "*.svg"))
    (tmp_path / "scenarios").symlink_to(ROOT / "scenarios")
    for file, insertions in INSERTIONS.items():
        text = (tmp_path / file).read_text(encoding="utf-8")
        for place, addition in insertions:
            assert place in text, (file, place)
            text = text.replace(place, addition + place, 1)
        (tmp_path / file).write_text(text, encoding="utf-8")
    return tmp_path


def test_a_new_statement_touches_at_most_four_files(edited: Path) -> None:
    assert len(INSERTIONS) <= 4
    environment = {**os.environ, "PYTHONPATH": str(edited), "PYTHONDONTWRITEBYTECODE": "1"}

    def run(*arguments: str) -> str:
        done = subprocess.run(
            [sys.executable, *arguments], env=environment, cwd=edited, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    run(str(edited / "tools" / "statements.py"))
    assert run("-c", USE, str(ROOT / "scenarios" / "ssr.ljs")) == "landmark works\n"
    assert '"landmarks"' in (edited / "schemas" / "mission.schema.json").read_text(encoding="utf-8")
    assert "### `landmark`" in (edited / "docs" / "statements.md").read_text(encoding="utf-8")
    assert "|landmark|" in (edited / "editors/vscode/syntaxes/ljs.tmLanguage.json").read_text(encoding="utf-8")
