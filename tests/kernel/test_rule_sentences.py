"""The rules in briefs: true to the instance, complete, and without hidden values."""

import re

import msgspec
import pytest

import lingjing
from lingjing.kernel.rule_sentences import rule_sentences
from lingjing.mission.instance import Instance
from lingjing.mission.instance_text import InstanceText
from lingjing.testing import instantiate, mission_file
from lingjing.testing import rescue as kit
from lingjing.testing.expressions import Binary, Expr, Ref, Unary


def played(name: str, mode: str, seed: int = 1) -> Instance:
    return instantiate(lingjing.compile(mission_file(name)), seed=seed, mode=mode)


@pytest.mark.parametrize(
    ("name", "mode", "expected"),
    [
        ("ssr", "broadcast", ("[IoU ≥ 0.5]", "`rescue` is done to a victim by `boat` within 50 m", "lies in `search`")),
        ("bi", "single", ("[IoU ≥ 0.5]", "the horizontal distance from `r.position` to `f` is at most `25 m`")),
        ("ufr", "star", ("is at most `25 m`", "`extinguish` is done to a fire by `truck` within 30 m")),
        ("vdn", "single", ("is at most `30 m`", "the stage *enter* must be done within 40 ticks")),
        ("idf", "broadcast", ("`extinguish` is done to a fire by `dog[1]`, `dog[2]`, `dog[3]` within 2 m",)),
        (
            "upr",
            "star",
            (
                "is at most `10 m`",
                "within 5 m",
                "at most 20 of `guide` messages",
                "`walker` has for `dog` `forward` (0 to 7.5 m), `left` (0 to 90 degrees), `right` (0 to 90 degrees)",
            ),
        ),
        (
            "cr",
            "star",
            ("within 25 m (horizontally) of each of its waypoints, in their order", "at most 3 of `jammed`"),
        ),
        (
            "ld",
            "star",
            (
                "[≤ 15 m]",
                "every command to `dog` is rejected until",
                "`forward` (1 to 25 m)",
                "commands to `van` by all agents together",
            ),
        ),
        (
            "cd",
            "star",
            (
                "within 30 m",
                "within 50 m (horizontally), which raises the actor's load up to its payload",
                "is at most `0 kg`",
            ),
        ),
    ],
)
def test_rule_sentences_state_the_numbers_of_the_rules(name: str, mode: str, expected: tuple[str, ...]):
    text = "\n".join(rule_sentences(played(name, mode)))
    assert [part for part in expected if part not in text] == []


def test_a_changed_radius_changes_the_sentence():
    instance = played("ssr", "broadcast")
    nearer = msgspec.json.decode(
        msgspec.json.encode(instance).replace(b'"within_m":50.0', b'"within_m":12.5'), type=Instance
    )
    assert any("`boat` within 12.5 m" in sentence for sentence in rule_sentences(nearer))


@pytest.mark.parametrize("name", ["bi", "vdn", "ld", "idf", "upr", "ufr", "cr", "ssr"])
def test_hidden_values_do_not_change_the_rule_sentences(name: str):
    mission = lingjing.compile(mission_file(name))
    texts = {rule_sentences(instantiate(mission, seed=seed)) for seed in range(4)}
    assert len(texts) == 1


@pytest.mark.parametrize(
    ("condition", "text"),
    [
        (Unary("-", Binary("+", Ref("a", "local"), Ref("b", "local"))), "-(a + b)"),
        (Binary("==", Unary("not", Ref("a", "local")), Ref("b", "local")), "(not a) == b"),
        (Unary("not", Binary("==", Ref("a", "local"), Ref("b", "local"))), "not a == b"),
        (Binary("and", Unary("not", Ref("a", "local")), Ref("b", "local")), "not a and b"),
        (Binary("*", Unary("-", Ref("a", "local")), Ref("b", "local")), "-a * b"),
    ],
)
def test_operands_of_minus_and_not_keep_their_brackets(condition: Expr, text: str) -> None:
    assert InstanceText(kit.instance()).text(condition) == text


@pytest.mark.parametrize("name", ["bi", "vdn", "ld", "idf", "upr", "ufr", "cr", "ssr", "cd"])
def test_every_condition_of_the_hardened_missions_is_written_as_a_sentence(name: str):
    mission = lingjing.compile(mission_file(name))
    for mode in mission.modes.allowed:
        rules = rule_sentences(instantiate(mission, seed=1, mode=mode, tier=1))
        assert [rule for rule in rules if re.search(r"`\w+\(", rule)] == [], "a call of the language stands in a rule"
