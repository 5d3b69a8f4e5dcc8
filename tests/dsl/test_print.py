"""A mission printed as text compiles to an equal mission."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lingjing
from lingjing.dsl.formatting.formatter import format_text
from lingjing.dsl.printing.phrases import Phrases, number_text
from lingjing.dsl.printing.printer import _KNOWN, canonical, round_trip_losses, to_ljs, unprintable_paths
from lingjing.errors import MissionError
from lingjing.mission import document
from lingjing.mission.units import UNITS, si_value
from lingjing.testing import compile_text
from lingjing.testing import declarations as model
from lingjing.testing import expressions as ex

ROOT = Path(__file__).parents[2]
MISSIONS = sorted([*(ROOT / "scenarios").glob("*.ljs"), *(ROOT / "scenarios" / "examples").glob("*.ljs")])
DOCUMENTS = sorted((ROOT / "scenarios" / "reset").rglob("*.json"))


def compiled(text: str) -> model.Mission:
    compilation = compile_text(text)
    assert compilation.mission is not None, compilation.diagnostics
    return compilation.mission


@pytest.mark.parametrize("file", [*MISSIONS, *DOCUMENTS], ids=lambda file: file.name)
def test_text_to_json_to_text_to_json_is_stable(file: Path) -> None:
    first = document.decode(document.encode(lingjing.compile(file)), "first.json")
    text = to_ljs(first)
    second = compiled(text)
    assert canonical(second) == canonical(first)
    assert to_ljs(document.decode(document.encode(second), "second.json")) == text
    assert format_text(text).text == text
    assert [place for place in round_trip_losses(first, text) if place != "$.origin.document"] == []


def test_types_of_libraries_are_printed_as_imports(small: str) -> None:
    text = to_ljs(compiled(small))
    assert "use std.air { quadrotor }\n" in text
    assert "asset boat : lifeboat { position = (12.4 m, -51.8 m), heading = 30 deg, speed <= 3 m/s }\n" in text
    assert "endurance" not in text and "within" not in text


def test_types_and_records_of_the_file_itself_are_written_out(small: str) -> None:
    types = (
        "asset glider {\n  engine = multirotor\n  band = 1 m..9 m\n"
        "  hidden fuel ~ uniform(1 kg, 2 kg)\n  state load = 0 kg\n"
        "  verb go(x: length in 0 m..9 m, how: name optional)\n  verb stop()\n}\n"
        "target fire { engine = city, heat = 3 kW, "
        "interaction douse { by = vessel, within = 9 m, lasting = 3 s, status = out } }\n"
        "record sighting : report { class: name, sure: number in 0..1 optional }\n"
    )
    changed = small.replace("mission small", types + "mission small").replace(
        "  agent skipper",
        "  asset kite[1..2] : glider { position = at(i, [(9 m, 2 m)], spread 3 m), actions { go = 2 m in 1 m..4 m } }\n"
        "  asset hawk : glider { position = (99 m, 9 m) }\n"
        "  target blaze : fire { position = (3 m, 4 m) }\n"
        "  unlock douse(b: blaze) when distance_xy(boat, b) <= 9 m\n"
        "  message seen : sighting from searcher to all\n"
        "  agent skipper",
    )
    mission = compiled(changed)
    text = to_ljs(mission)
    assert canonical(compiled(text)) == canonical(mission)
    assert "interaction douse { by = vessel, within = 9 m, lasting = 3 s, status = out }" in text
    assert round_trip_losses(mission, text) == ()


def test_rules_keep_their_brackets(small: str) -> None:
    conditions = [
        "not (matched(v, r) and tick > 3 s) or boat.heading - (3 deg - 2 deg) * 2 in 0 deg..9 deg",
        "(exists q in detection: matched(v, q)) and boat.status in { moving, idle } or not matched(v, r)",
        "-(boat.position.x - -3 m) / (2 * 3) <= - 2 m and 2 m - (1 m - 1 m) > 1 m / 3",
        "forall q in detection: matched(v, q) and exists w in victim: matched(w, q) or matched(w, r)",
    ]
    for condition in conditions:
        changed = small.replace(
            "unlock rescue(v", f"adjudicate odd(v: victim, r: detection) {{ when {condition} }}\n  unlock rescue(v"
        )
        mission = compiled(changed)
        assert canonical(compiled(to_ljs(mission))) == canonical(mission), condition


@given(value=st.floats(0, 1e12) | st.integers(0, 10**9).map(float), unit=st.sampled_from([*sorted(UNITS), "km/h", ""]))
def test_a_printed_number_reads_back_as_exactly_the_same_value(value: float, unit: str) -> None:
    si = si_value(value, unit) if unit else value
    text = number_text(si, unit)
    number, _, shown = text.partition(" ")
    assert shown == unit
    assert (si_value(float(number), unit) if unit else float(number)) == si


def test_numbers_are_printed_in_a_short_form() -> None:
    assert number_text(si_value(35, "min"), "min") == "35 min"
    assert number_text(si_value(0.3, "kn"), "kn") == "0.3 kn"
    assert number_text(2300.0, "km") == "2.3 km"
    assert number_text(0.2, "%") == "20 %"


_NAMES = st.sampled_from("abc").map(lambda name: ex.Ref(name, "param"))
_TREES = st.recursive(
    st.integers(-9, 9).map(lambda n: ex.Number(float(n))) | _NAMES,
    lambda inner: st.one_of(
        st.builds(ex.Binary, st.sampled_from("+-*/"), inner, inner),
        st.builds(lambda operand: ex.Unary("-", operand), inner),
        st.builds(lambda a, b: ex.Call("max", (a, b)), inner, inner),
    ),
    max_leaves=12,
)


@given(tree=_TREES)
def test_arithmetic_reads_back_as_an_equal_tree(tree: ex.Expr) -> None:
    """Checked by parsing alone: the parsed phrase has the operators of the tree in the same places."""
    from lingjing.dsl.source.reporter import Reporter
    from lingjing.dsl.syntax import tree as s
    from lingjing.dsl.syntax.parser import parse
    from lingjing.testing.missions import SourceText

    phrases = Phrases(PLAIN)
    report = Reporter(SourceText(f"param x = {phrases.text(tree)}"))
    (item,) = parse(report).items
    assert report.diagnostics == [] and isinstance(item, s.Param)

    def raised(node: s.Expression) -> ex.Expr:
        match node:
            case s.NumberLiteral():
                return ex.Number(node.value)
            case s.Name():
                return ex.Ref(node.text, "param")
            case s.UnaryExpr():
                return ex.Unary("-", raised(node.operand))
            case s.BinaryExpr():
                return ex.Binary(node.operator, raised(node.left), raised(node.right))  # type: ignore[arg-type]
            case s.CallExpr():
                return ex.Call(node.function.text, tuple(raised(argument.value) for argument in node.arguments))
        raise AssertionError(node)

    assert raised(item.value) == tree


SMALLEST = """\
ljs 1
use std.sea { lifeboat }
mission m "M" {
  goal "g"
  scene bay
  clock { tick = 1 s, sync = 1 s }
  budget { ticks <= 3 }
  asset boat : lifeboat { position = (0 m, 0 m) }
  agent a as b controls boat
  success when boat.heading < 3 deg
}
"""


PLAIN = compiled(SMALLEST)


def test_texts_keep_every_character() -> None:
    mission = msgspec.structs.replace(compiled(SMALLEST), title='"quoted" \\ 灵境\n\ttab', goal="# no comment")
    assert compiled(to_ljs(mission)).title == mission.title
    assert compiled(to_ljs(mission)).goal == mission.goal


def test_long_texts_printed_over_several_lines_read_back_unchanged(small: str) -> None:
    lines = ["Look \\ down.", "", '  Twice "there".', "Speak."]
    mission = msgspec.structs.replace(PLAIN, goal="\n".join(lines))
    assert 'goal """\n' in to_ljs(mission)
    for text in ("\n".join(lines), "a\n b", " a\nb", "a\nb\n", "a\nb ", 'a\n"b"', 'a\n""" b', "\n\n", "  a\n  b"):
        assert compiled(to_ljs(msgspec.structs.replace(PLAIN, goal=text))).goal == text, repr(text)


def test_parts_that_cannot_be_printed_are_reported() -> None:
    mission = compiled(SMALLEST)
    assert unprintable_paths(mission) == ()
    documented = msgspec.structs.replace(
        mission, parameters=(model.Parameter(name="p", default=ex.Number(1.0), doc="why"),)
    )
    assert unprintable_paths(documented) == ("$.parameters[0].doc",)
    assert "$.parameters" in round_trip_losses(documented, to_ljs(documented))


def test_a_name_that_is_no_word_is_a_clear_error() -> None:
    mission = msgspec.structs.replace(compiled(SMALLEST), name="two words")
    with pytest.raises(MissionError, match=r"cannot be written as \.ljs"):
        to_ljs(mission)


def test_every_part_of_a_mission_is_printed_or_named() -> None:
    """A new field of `Mission` must be printed, or named by `unprintable_paths` when it is set."""
    fields = set(model.Mission.__struct_fields__)
    assert fields - _KNOWN <= NOT_PRINTED


NOT_PRINTED: set[str] = {"base"}
"""`base`: a mission that extends another is printed whole."""


def test_states_that_entities_give_their_own_values_are_declared_by_their_types() -> None:
    text = """ljs 2
use std.sea { lifeboat }
target barrel {
  engine = city
  state content = 200 kg
  state spare = 3
  interaction collect { by = vessel, within = 20 m, lasting = 60 s, gives = cargo, from = content, status = collected }
}
asset tug : lifeboat { state cargo = 0 kg }
mission s "A" {
  goal "g"
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 60 }
  target keg : barrel { position = (-10 m, -1250 m), hidden state content ~ uniform(100 kg, 200 kg) }
  target urn : barrel { position = (-10 m, -1150 m), state content = 2000 g, state spare ~ uniform(1, 3) }
  asset boat : tug { position = (-10 m, -1350 m), state cargo = 5 kg }
  agent a as r controls boat { observes boat.* }
  success when emitted(collect, urn)
  declassify end because "the mission is over"
}
"""
    mission = compiled(text)
    assert round_trip_losses(mission, to_ljs(mission)) == ()
