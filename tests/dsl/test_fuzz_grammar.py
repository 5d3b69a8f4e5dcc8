"""Any input gives diagnostics quickly: sentences of the grammar, bytes, extreme sizes, unusual characters."""

from __future__ import annotations

import os
import random
import re
import resource
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lingjing.dsl.diagnostics.codes import CODES
from lingjing.dsl.source.text import decode_source
from lingjing.dsl.syntax.tables import load_tables
from lingjing.dsl.syntax.tokens import INNER, STATEMENTS, SYMBOLS
from lingjing.errors import UsageError
from lingjing.testing import Compilation, compile_text
from lingjing.testing.missions import compile_source

CHECKED = settings(max_examples=120, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
SPELT = {
    **{kind: text for text, kind in SYMBOLS.items() if kind != "OP"},
    **{kind: word for word, kind in {**STATEMENTS, **INNER}.items()},
    "NL": "\n",
    "SEP": ",",
    "COMMA": ",",
    "LSET": "{",
    "RSET": "}",
}
SECONDS = 1.0
"""Processor time for an input of a few kilobytes, seconds (chosen; processor time does not depend on other
processes)."""


def sound(compilation: Compilation) -> None:
    """Check a compilation: known codes, places inside the text and in order, and a mission exactly if there is no
    error.
    """
    end = len(compilation.source.text)
    starts = [item.span.start for item in compilation.diagnostics]
    assert starts == sorted(starts)
    for item in compilation.diagnostics:
        assert item.code in CODES and item.message
        assert 0 <= item.span.start <= item.span.end <= end
        for edit in item.fix.edits if item.fix else ():
            assert 0 <= edit.span.start <= edit.span.end <= end
    if compilation.mission is not None:
        assert not any(item.severity == "error" for item in compilation.diagnostics)


def timed(text: str) -> Compilation:
    began = time.process_time()
    compilation = compile_text(text)
    assert time.process_time() - began < SECONDS
    return compilation


def sentence(chance: random.Random, most: int) -> str:
    """A random sentence of the grammar, by a walk through the parser's tables; completed if possible."""
    tables = load_tables()
    states, words = [tables.start], []
    for _ in range(most):
        kinds = [kind for kind in tables.states[states[-1]] if kind.isupper() and kind != "ERROR"]
        chance.shuffle(kinds)
        for kind in kinds:
            stack = list(states)
            if _shift(tables, stack, kind):
                break
        else:
            break
        if kind == "$END":
            break
        states = stack
        words.append(_spell(kind, chance))
    return " ".join(words)


def _shift(tables: object, stack: list[int], kind: str) -> bool:
    for _ in range(10_000):
        action = tables.states[stack[-1]].get(kind)  # type: ignore[attr-defined]
        if action is None:
            return False
        if action >= 0:
            stack.append(action)
            return True
        rule = tables.rules[~action]  # type: ignore[attr-defined]
        if rule.size:
            del stack[-rule.size :]
        stack.append(tables.states[stack[-1]][rule.origin])  # type: ignore[attr-defined]
        if kind == "$END" and stack[-1] == tables.end:  # type: ignore[attr-defined]
            return True
    raise AssertionError("a reduction without end")


def _spell(kind: str, chance: random.Random) -> str:
    if kind in SPELT:
        return SPELT[kind]
    if kind == "NAME":
        return chance.choice(
            ("uav", "boat", "victim", "search", "x", "海", "std", "quadrotor", "position", "star", "tick")
        )
    if kind == "NUMBER":
        return chance.choice(("0", "1", "3", "1e9", "0.5"))
    if kind == "QUANTITY":
        return chance.choice(("1 m", "30 deg", "10 s", "5 m/s", "20 %", "1e300 km"))
    if kind == "STRING":
        return chance.choice(('"a"', '""', '"{uav}"', '"{"'))
    return chance.choice(("+", "*", "==", "<", ">="))


@pytest.mark.parametrize("block", range(6))
def test_random_sentences_of_the_grammar_give_sound_results(block: int) -> None:
    for seed in range(block * 50, block * 50 + 50):
        chance = random.Random(seed)
        text = sentence(chance, chance.choice((10, 40, 150)))
        sound(timed(f"ljs 1\n{text}\n"))
        sound(timed(f"ljs 1\nmission m {{\n{text}\n}}\n"))


@CHECKED
@given(st.binary(max_size=400))
def test_any_bytes_give_sound_results_or_a_usage_error(data: bytes) -> None:
    try:
        source = decode_source(data, "x.ljs")
    except UsageError as error:
        assert "x.ljs" in str(error)
        return
    sound(compile_source(source))


@CHECKED
@given(st.text(alphabet=st.characters(), max_size=300))
def test_any_text_gives_sound_results(text: str) -> None:
    sound(timed(text))


@CHECKED
@given(st.data())
def test_any_text_inserted_into_a_mission_gives_sound_results(data: st.DataObject) -> None:
    small = (Path(__file__).parents[2] / "docs" / "errors" / "example.ljs").read_text()
    at = data.draw(st.integers(0, len(small)))
    end = data.draw(st.integers(at, min(len(small), at + 60)))
    inserted = data.draw(st.text(alphabet="(){}[]\"'\\\n\r\t\u202e\u0301,;:=~<>.*+-/09eEax #", max_size=40))
    sound(timed(small[:at] + inserted + small[end:]))


@CHECKED
@given(st.data())
def test_flipped_bytes_of_a_mission_give_sound_results_or_a_usage_error(data: st.DataObject) -> None:
    raw = bytearray((Path(__file__).parents[2] / "docs" / "errors" / "example.ljs").read_bytes())
    for _ in range(data.draw(st.integers(1, 8))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    try:
        sound(compile_source(decode_source(bytes(raw), "x.ljs")))
    except UsageError:
        return


DEEP = 10_000
NESTED = {
    "()": "(" * DEEP + "1" + ")" * DEEP,
    "[]": "[" * DEEP + "1" + "]" * DEEP,
    "{}": "1 }\n" + "a {\n" * DEEP + "}\n" * DEEP,
    "open (": "(" * DEEP,
    "open [": "[" * DEEP,
    "open {": "{" * DEEP,
    "-": "-" * DEEP + "1",
    "- -": "- " * DEEP + "1",
    "not": "not " * DEEP + "true",
    "+": "1" + " + 1" * DEEP,
    "and": "true" + " and true" * DEEP,
    "mixed": "1" + " + 1 * 2 and not 3 <= 4 or 5" * (DEEP // 5),
    "calls": "f(" * DEEP + "1" + ")" * DEEP,
    "index": "a" + "[1]" * DEEP,
    "fields": "a" + ".b" * DEEP,
    "ranges": "1" + "..1" * DEEP,
    "exists": "exists r: " * DEEP + "true",
    "for": "count(" * 1000 + "x" + " for x in y)" * 1000,
}


@pytest.mark.parametrize("kind", sorted(NESTED))
@pytest.mark.parametrize("frame", ["param x = {}", "success when {}", "goal {}", "clock {{ tick = {} }}"])
def test_ten_thousand_levels_of_nesting_give_diagnostics_quickly(kind: str, frame: str) -> None:
    began = time.process_time()
    compilation = compile_text("ljs 1\nmission m {\n" + frame.format(NESTED[kind]) + "\n}\n")
    assert time.process_time() - began < SECONDS
    sound(compilation)
    assert compilation.mission is None


@pytest.mark.parametrize(
    "number",
    [
        "1e999",
        "1e-999",
        "9" * 1_000_000,
        "0." + "3" * 1_000_000,
        "1e" + "9" * 100_000,
        "1" * 400,
        "0x10",
        "1_000",
        "१२",
    ],
    ids=lambda text: text[:8],
)
def test_extreme_numbers_give_sound_results_quickly(small: str, number: str) -> None:
    for unit in ("", " m"):
        sound(timed(small.replace("uavs = 2 in", f"uavs = {number}{unit} in")))


def test_a_line_of_ten_megabytes_is_refused_quickly() -> None:
    data = b"ljs 1 # " + b"x" * 10_000_000
    began = time.process_time()
    with pytest.raises(UsageError, match="line of"):
        decode_source(data, "x.ljs")
    assert time.process_time() - began < SECONDS


def test_long_texts_from_a_program_compile_in_bounded_time_and_memory() -> None:
    """A text from a program may exceed the limits of files. Its compilation takes linear time and bounded memory."""
    began = time.process_time()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for text in ("goal " * 60_000, "= " * 60_000, '"' * 1_000_000):
        sound(compile_text(text))
    assert time.process_time() - began < 10 * SECONDS, "it took 27 s when each text was searched from its line's start"
    growth = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert growth < 4e5, "kilobytes of the process at its highest"


def test_import_cycles_end_in_diagnostics(tmp_path: Path, small: str) -> None:
    for name, other in (("a", "b"), ("b", "c"), ("c", "a")):
        (tmp_path / f"{name}.ljs").write_text(f"ljs 1\nuse .{other}\nasset kind_{name} {{ engine = vessel }}\n")
    main = tmp_path / "m.ljs"
    main.write_text(small.replace("ljs 2\n", "ljs 2\nuse .a\n", 1))
    from lingjing.testing import compile_file

    compilation = compile_file(str(main))
    assert {item.code for item in compilation.diagnostics} <= {"LJ0119", "LJ0120"} and compilation.mission is None


def test_paths_cannot_leave_the_project(tmp_path: Path, small: str) -> None:
    (tmp_path / "secret.ljs").write_text("ljs 1\nasset secret { engine = vessel }\n")
    inner = tmp_path / "project"
    inner.mkdir()
    os.symlink(tmp_path / "secret.ljs", inner / "link.ljs")
    for path in ("..secret", ".link", "...secret", "./../secret", '"../secret"'):
        (inner / "m.ljs").write_text(small.replace("ljs 2\n", f"ljs 2\nuse {path}\n", 1))
        from lingjing.testing import compile_file

        assert compile_file(str(inner / "m.ljs")).mission is None, path


@pytest.mark.parametrize("size", [10_000, 10_000_000, 10**15])
def test_a_sweep_with_too_many_values_is_an_error(small: str, size: int) -> None:
    line = f"  sweep s over uavs in 1..{size}, altitude in [40 m, 50 m, 60 m]\n"
    compilation = timed(small.replace("  region ", line + "  region ", 1))
    assert {"LJ0206", "LJ0503"} & {item.code for item in compilation.diagnostics}


def test_newlines_tabs_and_a_byte_order_mark_do_not_change_the_mission(small: str) -> None:
    mission = compile_text(small).mission
    assert mission is not None
    lines = small.split("\n")
    mixed = "".join(line + ("\n", "\r\n", "\r")[number % 3] for number, line in enumerate(lines))
    tabbed = small.replace("  ", "\t")
    for text in (mixed, tabbed, "\ufeff" + small):
        other = compile_text(text)
        assert other.diagnostics == ()
        assert other.mission is not None and other.mission.groups == mission.groups


def test_names_are_kept_in_nfc(small: str) -> None:
    composed, apart = "bo\u00e9", "boe\u0301"
    text = re.sub(r"\bboat\b", apart, small.replace("asset boat", f"asset {composed}"))
    assert composed in text and apart in text
    compilation = compile_text(text)
    assert compilation.diagnostics == ()
    assert compilation.mission is not None and composed in {group.name for group in compilation.mission.groups}


def test_chinese_names_are_permitted(small: str) -> None:
    for name, chinese in (("boat", "救生艇"), ("search", "搜索区"), ("victim", "落水者")):
        small = re.sub(rf"\b{name}\b", chinese, small)
    compilation = compile_text(small)
    assert compilation.diagnostics == ()


@pytest.mark.parametrize(
    "control", [chr(code) for code in (0x61C, 0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A))]
)
@pytest.mark.parametrize("place", ["# a comment {}\n  goal", 'goal "Find {} everybody."\n #'])
def test_bidirectional_control_characters_are_reported_everywhere(small: str, control: str, place: str) -> None:
    compilation = compile_text(small.replace("goal", place.replace("{}", control), 1))
    assert ("LJ0001", f"U+{ord(control):04X}") in {(item.code, item.message[:6]) for item in compilation.diagnostics}


def test_zero_bytes_are_reported(small: str) -> None:
    (diagnostic,) = compile_text(small.replace("uavs = 2", "uavs = \x002")).diagnostics
    assert diagnostic.code == "LJ0001" and "U+0000" in diagnostic.message


@pytest.mark.parametrize("filling", ["\n", "#\n", "\\n\\n\\n\n"], ids=["blank", "comments", "escapes"])
def test_many_blank_or_comment_lines_take_little_memory(filling: str) -> None:
    """A repeated group of a pattern costs half a kilobyte per repetition: five gigabytes for ten million blank
    lines."""
    small = (Path(__file__).parents[2] / "docs" / "errors" / "example.ljs").read_text()
    lines = filling * 300_000
    text = small.replace('"Find everybody."', f'"""{lines}"""') if "n" in filling else f"{lines}{small}"
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert compile_text(text).mission is not None
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024 < 120
