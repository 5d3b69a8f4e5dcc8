"""The formatter: the layout that it decides, the parts that it leaves to the author, and its invariants."""

from __future__ import annotations

import random
import re
from pathlib import Path

import msgspec
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lingjing.dsl.formatting.formatter import WIDTH, format_text
from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.syntax.lexer import lex
from lingjing.testing import compile_text
from lingjing.testing.missions import SourceText

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "scenarios").rglob("*.ljs"))
TEXTS = {file.name: file.read_text(encoding="utf-8") for file in FILES}


def formatted(text: str) -> str:
    outcome = format_text(text)
    assert outcome.text is not None, outcome.diagnostics
    return outcome.text


def inside(lines: str) -> str:
    """Format lines of a mission's block, and return them without the block."""
    text = formatted(f"mission m {{\n{lines}\n}}\n")
    assert text.startswith("mission m {\n") and text.endswith("}\n")
    return "".join(line.removeprefix("  ") for line in text.splitlines(keepends=True)[1:-1])


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_every_shipped_file_is_formatted(file: Path) -> None:
    assert formatted(file.read_text(encoding="utf-8")) == file.read_text(encoding="utf-8"), f"lingjing fmt {file}"


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("param  a=3 in 1 .. 10", "param a = 3 in 1..10\n"),
        ("region r=box( (0m,1 m) ,( -2m , 3  m ))", "region r = box((0 m, 1 m), (-2 m, 3 m))\n"),
        ("asset a[ i in 1..3 ]:b{position=at( i ,[p])}", "asset a[i in 1..3] : b { position = at(i, [p]) }\n"),
        ("message m:report from a,b to all", "message m : report from a, b to all\n"),
        ("adjudicate f(v:a,r : m){when exists x : g(x)}", "adjudicate f(v: a, r: m) { when exists x: g(x) }\n"),
        ("success when not f and a[1 ].x-3 m<=- 2 m", "success when not f and a[1].x - 3 m <= - 2 m\n"),
        ("failure when -( b )>0 or not(a)", "failure when -(b) > 0 or not (a)\n"),
        ("param a = 1.50e3 m in 0.0 m..20%", "param a = 1.50e3 m in 0.0 m..20 %\n"),
        ("mode star in {star,broadcast}", "mode star in { star, broadcast }\n"),
        ("comms { }", "comms {}\n"),
        ("scene x{datum=sea level at-3 m}", "scene x { datum = sea level at -3 m }\n"),
        ("agent a as b controls x [1],y{observes x.*,e . f}", "agent a as b controls x[1], y { observes x.*, e.f }\n"),
    ],
)  # fmt: skip
def test_spaces_are_normalised(line: str, expected: str) -> None:
    assert inside(line) == expected


@pytest.mark.parametrize("line", ["use .boats", "use   .boats", "use .boats.tug{tug}"])
def test_a_relative_use_keeps_its_space(line: str) -> None:
    named = " { tug }" if "{" in line else ""
    path = ".boats.tug" if "tug" in line else ".boats"
    assert formatted(f"ljs 1\n{line}\n") == f"ljs 1\nuse {path}{named}\n"


def test_line_breaks_of_the_author_are_kept() -> None:
    lines = "actions {\n  takeoff, land,\n  stop\n}\nclock { tick = 1 s, sync = 1 s }\n"
    assert inside(lines) == "actions {\n  takeoff, land\n  stop\n}\nclock { tick = 1 s, sync = 1 s }\n"


def test_blank_lines_are_kept_but_never_two() -> None:
    assert inside("\n\nparam a = 1\n\n\n\nparam b = 2\nparam c = 3\n\n") == (
        "param a = 1\n\nparam b = 2\nparam c = 3\n"
    )


def test_comments_stay_where_they_were() -> None:
    lines = (
        "# above\nparam a = 1   # beside\n\n\n# own\n\n# more\nclock {   # at the brace\n"
        "# first\ntick = 1 s # t\n  # last\n} # after\nbudget {\n# alone\n}\n# end"
    )
    assert inside(lines) == (
        "# above\nparam a = 1  # beside\n\n# own\n\n# more\nclock {  # at the brace\n"
        "  # first\n  tick = 1 s  # t\n  # last\n}  # after\nbudget {\n  # alone\n}\n# end\n"
    )


def test_comments_between_arguments_keep_their_lines() -> None:
    lines = "region r = polygon((0 m, 0 m), # south\n (1 m, 0 m),\n # far\n (1 m, 1 m))"
    assert inside(lines) == (
        "region r = polygon((0 m, 0 m),  # south\n    (1 m, 0 m),\n    # far\n    (1 m, 1 m))\n"
    )  # fmt: skip


def test_neighbouring_lines_are_not_aligned() -> None:
    lines = (
        "param a    = 1 in 1..2\nparam long = 10 m in 1 m..20 m\n\nparam alone = 1\n"
        "relation competition a->b\nrelation guidance a->b"
    )
    assert inside(lines) == (
        "param a = 1 in 1..2\nparam long = 10 m in 1 m..20 m\n\nparam alone = 1\n"
        "relation competition a -> b\nrelation guidance a -> b\n"
    )


def test_wide_blocks_are_opened_and_wide_lists_are_wrapped() -> None:
    points = ", ".join(f"({n}000.25 m, -{n}000.25 m)" for n in range(1, 9))
    text = inside(f"region r = polygon({points})\nasset a : b {{ position = at(1, [{points}]), heading = 3 deg }}")
    assert max(map(len, text.splitlines())) <= WIDTH
    assert text.splitlines()[2] == "asset a : b {"
    assert text.splitlines()[-1] == "}"
    assert inside(text) == text


def test_a_long_text_may_exceed_the_line_width() -> None:
    text = f'goal "{"x" * 200}"\n'
    assert inside(text) == text


def test_empty_files_and_files_with_only_comments_are_formatted() -> None:
    assert formatted("\n\n # a\r\n\r\n\r\n#b  ") == "# a\n\n#b\n"
    assert formatted("") == ""


def test_long_texts_keep_their_lines() -> None:
    text = 'mission m {\n  goal """\n    One.\n      Two.  # no comment\n    """\n  param a = 1\n}\n'
    assert formatted(text) == text
    assert formatted(text.replace("\n", "\r\n")) == text


def test_line_ends_are_unified_and_a_byte_order_mark_is_removed() -> None:
    assert formatted("\ufeffljs 1\r\nuse std.air\r\r\nuse std.sea") == "ljs 1\nuse std.air\n\nuse std.sea\n"


def test_syntax_errors_are_listed_without_output() -> None:
    outcome = format_text("mission m {\n  param = \n  clock { tick 3 s\n")
    assert outcome.text is None
    assert {d.code for d in outcome.diagnostics} >= {"LJ0003", "LJ0010"}


def test_semantic_errors_do_not_prevent_formatting() -> None:
    assert inside("clock { tick = 3 kg }") == "clock { tick = 3 kg }\n"


# -- properties

_MISSION = re.compile(r"\bmission\b")


def perturbed(text: str, seed: int) -> str:
    """The same text with other white space: spaces, indentation, line ends, blank lines, breaks within brackets."""
    chance = random.Random(seed)
    tokens = lex(text, Reporter(SourceText(text)))
    assert tokens is not None
    pieces, at, depth = [], 0, 0
    for token in tokens:
        if token.start < at or (token.type == "NL" and token.start == token.end):
            continue
        gap = text[at : token.start]
        pieces.append(_other_space(gap, chance, breakable=depth > 0 and gap == " "))
        word = text[token.start : token.end]
        if token.unit:
            word = token.text + chance.choice(["", " ", "   ", "\t"]) + token.unit
        pieces.append(word)
        depth += (token.type in ("LPAR", "LSQB")) - (token.type in ("RPAR", "RSQB"))
        at = token.end
    pieces.append(_other_space(text[at:], chance, breakable=False))
    return "".join(pieces)


def _other_space(gap: str, chance: random.Random, *, breakable: bool) -> str:
    parts = re.split(r"(#[^\n]*|\n)", gap)
    made = []
    for part in parts:
        if part == "\n":
            made.append(chance.choice(["\n", "\r\n", "  \n", "\t\n"]) + " " * chance.randrange(5))
        elif part.startswith("#"):
            made.append(part + " " * chance.randrange(3))
        elif part == "":
            made.append("")
        elif breakable and chance.random() < 0.2:
            made.append("\n" + " " * chance.randrange(4))
        else:
            made.append(chance.choice([" ", "  ", "\t", "   "]))
    spaced = "".join(made)
    if gap.count("\n") > 1 and "#" not in gap:
        spaced += "\n" * chance.randrange(3)
    return spaced


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(name=st.sampled_from(sorted(TEXTS)), seed=st.integers(0, 2**32))
def test_the_result_does_not_depend_on_the_white_space_of_the_source(name: str, seed: int) -> None:
    assert formatted(perturbed(TEXTS[name], seed)) == formatted(TEXTS[name])


WORDS = ("why", "über", "「灵境」", '} { ( " ,')


def commented(text: str, seed: int) -> tuple[str, list[str]]:
    """The text with comments behind some lines and on lines of their own, and these comments in order."""
    chance = random.Random(seed)
    lines, comments = [], []

    def comment() -> str:
        comments.append(f"# no. {len(comments)} {chance.choice(WORDS)}")
        return comments[-1]

    for line in text.splitlines():
        if chance.random() < 0.15:
            lines.extend([*[""] * chance.randrange(3), " " * chance.randrange(6) + comment()])
        lines.append(
            line + chance.choice(["", "  "]) + comment() if chance.random() < 0.15 and "#" not in line else line
        )
    return "\n".join(lines) + "\n", comments


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(name=st.sampled_from(sorted(TEXTS)), seed=st.integers(0, 2**32))
def test_comments_anywhere_are_kept_in_order_and_formatting_is_stable(name: str, seed: int) -> None:
    text, comments = commented(TEXTS[name], seed)
    once = formatted(text)
    assert [c.rstrip() for c in comments] == re.findall(r"# no\. \d+ .*", once)
    assert formatted(once) == once


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(name=st.sampled_from([n for n, t in sorted(TEXTS.items()) if _MISSION.search(t)]), seed=st.integers(0, 2**32))
def test_formatting_does_not_change_the_mission(name: str, seed: int) -> None:
    def mission(text: str) -> object:
        compiled = compile_text(text)
        assert compiled.mission is not None, compiled.diagnostics
        return msgspec.structs.replace(compiled.mission, origin=msgspec.convert({}, type(compiled.mission.origin)))

    text = perturbed(TEXTS[name], seed)
    assert mission(text) == mission(formatted(text))


def test_override_stays_with_its_statement() -> None:
    text = "ljs 1\nmission m {\n  param a = 1, override weather { wind = 1 m/s from 3 deg }\n  override mode star\n}\n"
    assert format_text(text).text == text
    spread = "ljs 1\nmission m {\n  override asset boat {\n    speed <= 3 m/s  # slow\n  }\n}\n"
    assert format_text(spread).text == spread
