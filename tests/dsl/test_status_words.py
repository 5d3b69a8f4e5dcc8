"""A status is compared with the words that its engine and its interactions can give, quoted or not."""

from __future__ import annotations

import pytest

from lingjing.dsl.checking.scope import GroupInfo, PropertyType, TypeDecl
from lingjing.dsl.checking.status_words import status_words
from lingjing.dsl.diagnostics.fixes import fix_source
from lingjing.dsl.printing.printer import to_ljs
from lingjing.mission.diagnostics import Diagnostic, Span
from lingjing.mission.functions import Type
from lingjing.mission.units import BY_NAME
from lingjing.testing import compile_text
from lingjing.testing.missions import SourceText, compile_source

RULE = "  adjudicate odd(v: victim) {{ when {} }}\n  unlock rescue"
BURNING = "  target blaze : fire_source { position = (300 m, -560 m) }\n"


def diagnostics(small: str, condition: str) -> tuple[Diagnostic, ...]:
    return compile_text(with_rule(small, condition)).diagnostics


def with_rule(small: str, condition: str) -> str:
    text = small.replace("use std.messages", "use std.fire { fire_source }\nuse std.messages", 1)
    text = text.replace("  asset boat", BURNING + "  asset boat", 1)
    return text.replace("  unlock rescue", RULE.format(condition), 1)


@pytest.mark.parametrize(
    "condition",
    [
        "v.status == rescued",
        'v.status == "rescued"',
        "rescued == v.status",
        '"adrift" != v.status',
        "v.status != adrift and boat.status == moving",
        "v.status in [adrift, rescued]",
        'v.status in ["adrift", rescued]',
        "v.status in { adrift, dormant }",
        "uav[1].status == hovering",
        "blaze.status == out",
        "boat.status == uav[1].status",
    ],
)
def test_a_word_of_the_engine_or_an_interaction_is_permitted(small: str, condition: str) -> None:
    compilation = compile_text(with_rule(small, condition))
    assert compilation.mission is not None, compilation.diagnostics
    assert compile_text(to_ljs(compilation.mission)).mission is not None


@pytest.mark.parametrize(
    ("condition", "code", "message", "hint"),
    [
        ("boat.status == movin", "LJ0109", "the status of `boat` is never `movin`", "did you mean `moving`?"),
        ('boat.status == "movin"', "LJ0109", "the status of `boat` is never `movin`", "did you mean `moving`?"),
        ('"movin" == boat.status', "LJ0109", "the status of `boat` is never `movin`", "did you mean `moving`?"),
        ("v.status in [adrift, resceud]", "LJ0109", "is never `resceud`", "did you mean `rescued`?"),
        (
            "v.status == boat",
            "LJ0201",
            "a status word is due here, this is a `boat` entity",
            "adrift, dormant, rescued",
        ),
        (
            "boat == v.status",
            "LJ0201",
            "a status word is due here, this is a `boat` entity",
            "adrift, dormant, rescued",
        ),
        ("v.status == searcher", "LJ0201", "a status word is due here", "adrift, dormant, rescued"),
        ("v.status == 3", "LJ0201", "a status word is due here, this is a bare number", "adrift"),
        ('blaze.status == "extinguished"', "LJ0109", "never `extinguished`", "its words: burning, dormant, out"),
        ("blaze.status == sealed", "LJ0109", "never `sealed`", "its words: burning, dormant, out"),
        ("blaze.status == v", "LJ0201", "this is a `victim` entity", "burning"),
    ],
)
def test_any_other_word_or_value_is_an_error(small: str, condition: str, code: str, message: str, hint: str) -> None:
    (item,) = diagnostics(small, condition)
    assert item.code == code and message in item.message and hint in item.hint


def test_a_misspelt_word_is_corrected_on_request(small: str) -> None:
    for wrong, right in (("movin", "moving"), ('"idel"', "idle")):
        broken = SourceText(with_rule(small, f"boat.status == {wrong}"))
        fixed = fix_source(broken, compile_source, unsafe=True)
        assert fixed.text == with_rule(small, f"boat.status == {right}")


def declaration(engine: str) -> TypeDecl:
    return TypeDecl("thing", "target", engine, {}, (), {}, {}, Span("", 0, 0, 1, 1, 1, 1))


def test_an_engine_without_a_description_permits_every_word(small: str) -> None:
    assert status_words(GroupInfo("thing", "target", declaration("unheard_of"), {})) is None
    assert status_words(GroupInfo("thing", "target", None, {})) is None
    own = "asset hover { engine = unheard_of, on = ground }\nmission small"
    text = small.replace("mission small", own, 1).replace(
        "  asset boat", "  asset h : hover { position = (700 m, -900 m) }\n  asset boat", 1
    )
    for word in ('"levitating"', "levitating"):
        changed = text.replace("  unlock rescue", RULE.format(f"h.status == {word}"), 1)
        assert [item for item in compile_text(changed).diagnostics if item.code != "LJ0505"] == []


def test_a_target_of_another_engine_has_the_words_of_that_engine() -> None:
    words = status_words(GroupInfo("thing", "target", declaration("vessel"), {}))
    assert words == ("aground", "dormant", "idle", "moving")


def test_a_declared_initial_status_replaces_the_default_one(small: str) -> None:
    thaw = "interaction thaw { by = vessel, within = 9 m }"
    own = f"target hydrant {{ engine = city, status = frozen, {thaw} }}\nmission small"
    text = small.replace("mission small", own, 1)
    for status, word, good in (
        ("", "frozen", True),
        ("", "waiting", False),
        (", status = iced", "iced", True),
        (", status = iced", "frozen", False),
        ("", "thawed", True),
    ):
        entity = f"  target h : hydrant {{ position = (700 m, -900 m){status} }}\n  asset boat"
        changed = text.replace("  asset boat", entity, 1).replace("  unlock rescue", RULE.format(f"h.status == {word}"))
        codes = [item.code for item in compile_text(changed).diagnostics]
        assert codes == ([] if good else ["LJ0109"]), (status, word, codes)


def test_a_heat_state_with_a_unit_does_not_make_a_target_a_fire() -> None:
    heat = {"heat": PropertyType(Type("quantity", BY_NAME["power"].dimension), state=True)}
    assert status_words(GroupInfo("thing", "target", declaration("city"), heat)) == ("dormant", "waiting")
