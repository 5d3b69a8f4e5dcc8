"""One missing declaration is one error, and no fix renames something else."""

from __future__ import annotations

import pytest

from lingjing.dsl.diagnostics.fixes import fix_source
from lingjing.testing import compile_text
from lingjing.testing.missions import SourceText, compile_source

# replaced text of the small mission, its replacement, the name, a part of the hint
MISSING = [
    ("  param uavs = 2 in 1..10\n", "", "uavs", "declare it: `param uavs = …`"),
    ("as searcher controls", "as seeker controls", "searcher", "declare an agent with it: `agent … as searcher"),
    ("use std.air { quadrotor }\n", "", "quadrotor", "add it: `use std.air { quadrotor }`"),
    (
        "use std.sea { lifeboat, person_in_water }\n",
        "",
        "person_in_water",
        "add it: `use std.sea { lifeboat, person_in_water }`",
    ),
    ("lifeboat, person_in_water }", "lifeboat }", "person_in_water", "add it: `use std.sea { person_in_water }`"),
    ("use std.messages { report, assignment }\n", "", "report", "add it: `use std.messages { report }`"),
    ("  region search", "  region harbour", "search", "declare it: `region search = …`"),
]


@pytest.mark.parametrize(("good", "bad", "name", "hint"), MISSING, ids=[case[2] + case[1] for case in MISSING])
def test_a_missing_declaration_is_one_error_with_its_statement(
    small: str, good: str, bad: str, name: str, hint: str
) -> None:
    (item,) = compile_text(small.replace(good, bad, 1)).diagnostics
    assert item.code == "LJ0101" and f"`{name}`" in item.message and hint in item.hint, item


@pytest.mark.parametrize(("good", "bad"), [(case[0], case[1]) for case in MISSING if "use std" in case[3]])
def test_the_fix_adds_the_forgotten_use(small: str, good: str, bad: str) -> None:
    fixed = fix_source(SourceText(small.replace(good, bad, 1)), compile_source, unsafe=True)
    assert fixed.compilation.diagnostics == ()
    now, then = fixed.compilation.mission, compile_text(small).mission
    assert now is not None and then is not None and now.groups == then.groups and now.messages == then.messages


def test_a_declaration_of_another_kind_is_not_taken_for_a_misspelt_one(small: str) -> None:
    """`jam` is a group, and a number is due at every use of `jams`."""
    jam = "  target jam[1..jams] : person_in_water { position = (900 m, -900 m) }\n  asset boat"
    text = small.replace("  asset boat", jam, 1).replace("when rescued(v) }", "when rescued(v) and jams > 0 }", 1)
    (item,) = compile_text(text).diagnostics
    assert item.message == "nothing is called `jams`" and item.hint == "declare it: `param jams = …`"
    assert item.fix is None and len(item.related) == 1


def test_an_unknown_name_in_a_condition_gets_no_fix_to_a_similar_role(small: str) -> None:
    text = small.replace("as searcher controls", "as searching controls", 1).replace("searcher", "scout")
    condition = "boat.heading == searcing and boat.heading != searcing"
    changed = text.replace("  unlock rescue", f"  adjudicate odd(v: victim) {{ when {condition} }}\n  unlock rescue", 1)
    named = [item for item in compile_text(changed).diagnostics if "searcing" in item.message]
    assert [item.message for item in named] == ["nothing is called `searcing`"] and named[0].fix is None


def test_a_misspelt_declaration_is_reported_at_its_place(small: str) -> None:
    text = small.replace("param uavs", "param uvas", 1)
    (item,) = compile_text(text).diagnostics
    assert item.span.line == text[: text.index("uvas")].count("\n") + 1 and item.fix is not None
    fixed = fix_source(SourceText(text), compile_source, unsafe=True)
    assert fixed.text == small


def test_all_uses_of_a_misspelt_name_are_one_error_and_one_fix(small: str) -> None:
    text = small.replace("boat, v)", "boaat, v)").replace("boat.*", "boaat.*")
    (item,) = compile_text(text).diagnostics
    assert item.message == "nothing is called `boaat`" and len(item.related) == 1
    assert fix_source(SourceText(text), compile_source, unsafe=True).text == small


def test_a_bare_word_in_place_of_a_text_gets_a_fix_with_quotes(small: str) -> None:
    rule = "  adjudicate sure(r: detection) {{ when r.cell == {} }}\n  unlock rescue"
    text = small.replace("  unlock rescue", rule.format("kiln"), 1)
    (item,) = compile_text(text).diagnostics
    assert item.hint == 'a text stands in quotes: `"kiln"`'
    fixed = fix_source(SourceText(text), compile_source, unsafe=True)
    assert fixed.text == small.replace("  unlock rescue", rule.format('"kiln"'), 1)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        ("emitted(extinguish, v)", "`extinguish` is no interaction of `victim`"),
        ("emitted(rescue, boat)", "`rescue` is no interaction of `boat`"),
    ],
)
def test_an_interaction_belongs_to_the_type_of_the_entity(small: str, call: str, message: str) -> None:
    text = small.replace("use std.messages", "use std.fire { fire_source }\nuse std.messages", 1)
    text = text.replace("emitted(rescue, v)", call, 1)
    assert [item.message for item in compile_text(text).diagnostics] == [message]


def test_a_rule_without_brackets_gets_a_hint(small: str) -> None:
    text = small.replace("{ done when rescued(v) }", "{ done when rescued }", 1)
    (item,) = compile_text(text).diagnostics
    assert (item.code, item.hint) == ("LJ0101", "`rescued` is a rule: write `rescued(v)`")
