"""One run reports all errors of a file in source order. A faulty statement hides no errors of others."""

from __future__ import annotations

import pytest

from lingjing.testing import compile_text
from lingjing.testing.missions import Diagnostic


def test_many_errors_come_in_one_run_and_in_source_order(small: str) -> None:
    broken = (
        small.replace("tick = 10 s", "tick = 10 m")
        .replace("visibility = 8 km", "visibilty = 8 km")
        .replace(": quadrotor", ": quadrotr")
        .replace("distance_xy(boat, v)", "distance_xy(boot, v)")
        .replace("observes cells }", "observes victim[2].position }")
        .replace("stage detect per v in victim {", "stage detect per v victim {")
    )
    assert codes(compile_text(broken).diagnostics) == [
        ("LJ0203", 9),
        ("LJ0108", 11),
        ("LJ0101", 21),
        ("LJ0401", 29),
        ("LJ0101", 34),
        ("LJ0010", 35),
    ]


def test_a_faulty_statement_causes_no_further_errors(small: str) -> None:
    diagnostics = compile_text(small.replace("target victim[1..3] :", "target victim[1..3 :")).diagnostics
    assert {item.span.line for item in diagnostics} == {18}


def test_the_content_of_a_block_with_a_faulty_head_is_still_checked(small: str) -> None:
    broken = small.replace("asset uav[1..uavs] : quadrotor {", "asset uav[1..uavs] quadrotor {").replace(
        "hfov = 84 deg, channels = [rgb]", "hfov = = 84 deg, channels = [rgb]"
    )
    assert codes(compile_text(broken).diagnostics) == [("LJ0010", 21), ("LJ0010", 23)]


def test_an_unclosed_block_is_reported_where_it_should_end(small: str) -> None:
    diagnostics = compile_text(small.rstrip()[:-1]).diagnostics
    assert codes(diagnostics) == [("LJ0003", 39)]
    assert diagnostics[0].related[0].span.line == 6


@pytest.mark.parametrize(
    ("head", "line"),
    [
        ("event gust at 3 tick", "weather { wind = 3 m/s from 10 deg }"),
        ("constraint hard fence per u in uav", "always u in search"),
        ("inspection check of boat by uav", "within = 25 m"),
        ("stage last", "done when now > 3 s"),
    ],
)
def test_a_missing_opening_brace_is_one_error_in_every_block(small: str, head: str, line: str) -> None:
    text = small.replace("  success", f"  {head}\n    {line}\n  }}\n  success", 1)
    messages = [item.message for item in compile_text(text).diagnostics]
    assert messages == [f"`{{` is due after this `{head.split()[0]}`"]


def test_without_indentation_an_unclosed_block_is_reported_at_its_brace(small: str) -> None:
    flat = "\n".join(line.strip() for line in small.rstrip()[:-1].split("\n"))
    diagnostics = compile_text(flat).diagnostics
    assert codes(diagnostics) == [("LJ0003", 6)]
    assert diagnostics[0].message == "`{` is never closed"


@pytest.mark.parametrize(
    ("old", "new", "code", "line"),
    [
        ("  target victim[1..3] : person_in_water {", "  target victim[1..3] : person_in_water", "LJ0010", 18),
        ("  target victim[1..3] : person_in_water {", "  target victim[1..3] : person_in_water {{", "LJ0003", 18),
        ("apart >= 10 m)\n  }", "apart >= 10 m)\n", "LJ0003", 19),
        ("apart >= 10 m)\n  }", "apart >= 10 m)\n  }}", "LJ0004", 20),
        ("channels = [rgb] }", "channels = [rgb]", "LJ0003", 23),
        ("channels = [rgb] }", "channels = [rgb] }}", "LJ0004", 23),
    ],
)
def test_an_unbalanced_brace_causes_no_errors_in_other_blocks(
    small: str, old: str, new: str, code: str, line: int
) -> None:
    assert small.count(old) == 1
    assert codes(compile_text(small.replace(old, new)).diagnostics) == [(code, line)]


def test_an_unclosed_text_causes_no_errors_in_the_rest_of_the_block(small: str) -> None:
    assert codes(compile_text(small.replace('"A small mission"', '"A small mission')).diagnostics) == [("LJ0002", 6)]


def test_a_statement_with_a_misspelt_keyword_still_declares_its_name(small: str) -> None:
    diagnostics = compile_text(small.replace("  asset boat", "  aset boat")).diagnostics
    assert codes(diagnostics) == [("LJ0011", 26)]
    assert diagnostics[0].fix is not None and diagnostics[0].fix.edits[0].text == "asset"


def test_a_misspelt_declaration_is_reported_once_where_it_stands(small: str) -> None:
    diagnostics = compile_text(small.replace("  asset boat", "  asset baot")).diagnostics
    assert codes(diagnostics) == [("LJ0101", 26)]
    assert len(diagnostics[0].related) == 4


def test_continued_lines_and_any_newline_are_read(small: str) -> None:
    longer = small.replace("when emitted(rescue, v) and distance", "when emitted(rescue, v)\n    and distance").replace(
        "[(1 m, 2 m), (3 m, 4 m)], spread", "[(1 m, 2 m),\n (3 m, 4 m)],\n # a comment\n spread"
    )
    assert compile_text(longer).diagnostics == ()
    mission = compile_text(small).mission
    for ending in ("\r\n", "\r"):
        other = compile_text("\ufeff" + small.replace("\n", ending))
        assert other.diagnostics == ()
        assert other.mission is not None and mission is not None and other.mission.groups == mission.groups
    diagnostics = compile_text(small.replace("boat, v)", "boot, v)").replace("\n", "\r")).diagnostics
    assert codes(diagnostics) == [("LJ0101", 34)]


def test_a_comma_equals_a_newline_in_a_block(small: str) -> None:
    flat = compile_text(small).mission
    tall = compile_text(
        small.replace("tick = 10 s, sync", "tick = 10 s\n    sync").replace("takeoff, forward", "takeoff\nforward")
    )
    assert flat is not None and tall.mission is not None
    assert (tall.mission.clock, tall.mission.groups) == (flat.clock, flat.groups)


def test_keywords_are_names_where_they_cannot_be_keywords() -> None:
    text = "ljs 1\nrecord order : other {\n  target: name\n  goal: text optional\n  mode: name\n}\n"
    assert compile_text(text).diagnostics == ()


def codes(diagnostics: tuple[Diagnostic, ...]) -> list[tuple[str, int]]:
    return [(item.code, item.span.line) for item in diagnostics]
