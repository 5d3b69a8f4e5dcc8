"""Battery, speed, line of sight, distance in space, and the sender and time of a message: types, errors, printing."""

from __future__ import annotations

import pytest

from lingjing.dsl.printing.printer import to_ljs
from lingjing.mission.conditions.survey import Condition, survey_mission
from lingjing.mission.diagnostics import Diagnostic
from lingjing.testing import compile_text, compiled

RULE = "  adjudicate odd(u: uav, r: detection) {{ when {} }}\n  unlock rescue"


def with_rule(small: str, condition: str) -> str:
    return small.replace("  unlock rescue", RULE.format(condition), 1)


def errors(small: str, condition: str) -> list[Diagnostic]:
    return [item for item in compile_text(with_rule(small, condition)).diagnostics if item.severity == "error"]


@pytest.mark.parametrize(
    "condition",
    [
        "u.battery >= 20 %",
        "speed(u) <= 5 m/s and speed(boat) > 1 km/h",
        "line_of_sight(u, boat)",
        "distance(u, boat) <= 80 m and distance(u, (3 m, 4 m, 5 m)) > 2 m",
        "distance(boat, r.position) <= 80 m",
        "r.sender == scout[2]",
        "r.sender != skipper",
        "scout[1] == r.sender",
        "r.sender in [scout[1], skipper]",
        "r.sender in { skipper, commander }",
        "r.role == searcher",
        "r.role in [searcher, rescuer]",
        "now - r.sent <= 60 s",
    ],
)
def test_a_rule_reads_it_and_prints_as_it_was_written(small: str, condition: str) -> None:
    assert errors(small, condition) == []
    mission = compiled(with_rule(small, condition))
    again = compiled(to_ljs(mission))
    assert again.rules == mission.rules


@pytest.mark.parametrize(
    ("condition", "code", "words"),
    [
        ("u.speed > 1 m/s", "LJ0102", "write `speed(u)`"),
        ("u.fuel > 1 %", "LJ0102", "has no field `fuel`"),
        ("boat.battery > 1 %", "LJ0102", "`boat` has no field `battery`"),
        ("u.battery > 20 m", "LJ0203", "cannot compare"),
        ("speed(r) > 1 m/s", "LJ0201", "an entity is due"),
        ("speed(uav) > 1 m/s", "LJ0201", "bind one"),
        ("line_of_sight(u, (1 m, 2 m))", "LJ0201", "an entity is due"),
        ("sees(u, boat)", "LJ0101", "write `line_of_sight`"),
        ("r.sender == scout", "LJ0201", "name one: `scout[1]`"),
        ("r.sender == scout[0]", "LJ0201", "counted 1, 2, 3"),
        ("r.sender == skipper[1]", "LJ0201", "write `skipper`"),
        ("r.sender == searcher", "LJ0201", "compare the role"),
        ("r.sender == skiper", "LJ0101", "did you mean `skipper`"),
        ("r.role == skipper", "LJ0201", "compare the sender"),
        ("r.role == sercher", "LJ0101", "did you mean `searcher`"),
        ('r.sender == "skipper"', "LJ0201", "write `skipper`"),
        ("r.sender == 3", "LJ0201", "an agent is due here"),
        ("r.sender == boat", "LJ0101", "no agent"),
        ("r.sent == 3", "LJ0202", "a bare number"),
        ("r.sended > 3 s", "LJ0102", "did you mean `sender`"),
    ],
)
def test_a_mistake_leads_to_the_right_form(small: str, condition: str, code: str, words: str) -> None:
    (error,) = errors(small, condition)
    assert error.code == code and words in f"{error.message} {error.hint}", error


def test_a_share_is_known_in_a_run_only(small: str) -> None:
    text = small.replace("weather {", "weather { turbulence = uav[1].battery, ", 1)
    (error,) = [item for item in compile_text(text).diagnostics if item.severity == "error"]
    assert (error.code, error.hint) == ("LJ0304", "use it in a rule")


def test_a_field_of_the_record_has_priority(small: str) -> None:
    text = small.replace("mission small", "record call : report { sender: text, sent: number }\nmission small", 1)
    text = text.replace("message detection", "message hail : call from searcher to all\n  message detection", 1)
    rule = (
        '  adjudicate odd(r: hail) { when r.sender == "a ship" and r.sent > 3 and r.role == searcher }\n  unlock rescue'
    )
    mission = compiled(text.replace("  unlock rescue", rule, 1))
    assert mission.rules[1].name == "odd"


def condition(small: str, text: str) -> Condition:
    return next(item for item in survey_mission(compiled(with_rule(small, text))).conditions if item.name == "odd")


@pytest.mark.parametrize(
    ("text", "key", "causes"),
    [
        ("u.battery > 20 %", "uav.battery", {"takeoff", "forward", "multirotor"}),
        ("speed(u) > 1 m/s", "uav.velocity", {"takeoff", "forward"}),
        ("r.sent > 60 s", "message detection.sent", {"detection"}),
    ],
)
def test_the_model_of_conditions_lists_its_causes(small: str, text: str, key: str, causes: set[str]) -> None:
    quantities = [quantity for leaf in condition(small, text).leaves for quantity in leaf.quantities]
    quantity = next(quantity for quantity in quantities if quantity.key == key)
    assert {cause.name for cause in quantity.causes} == causes and not quantity.hidden


@pytest.mark.parametrize(
    "text",
    ["exists v in victim: speed(v) > 1 m/s", "exists v in victim: line_of_sight(u, v)",
     "exists v in victim: distance(u, v) < 9 m"],
)  # fmt: skip
def test_a_value_of_a_hidden_body_is_hidden(small: str, text: str) -> None:
    assert condition(small, text).hidden


@pytest.mark.parametrize(
    ("success", "proved"),
    [
        ("exists u in uav: u.battery > 110 %", True),
        ("exists u in uav: speed(u) < 0 m/s", True),
        ("exists u in uav: line_of_sight(u, boat) and not line_of_sight(boat, u)", True),
        ("exists u in uav: distance(u, boat) <= 5 m and distance(boat, u) > 6 m", True),
        ("exists u in uav: distance_xy(u, boat) <= 5 m and distance(boat, u) > 6 m", False),
        ("exists r in detection: r.sent < 0 s", True),
        ("exists r in detection: r.sender == skipper and r.sender == commander", True),
        ("exists u in uav: u.battery > 90 % and speed(u) > 3 m/s and line_of_sight(u, boat)", False),
        ("forall u in uav: distance(u, boat) <= 60 m", False),
    ],
)
def test_the_proofs_know_their_bounds(small: str, success: str, proved: bool) -> None:
    text = small.replace("success when forall v in victim: rescued(v)", f"success when {success}", 1)
    codes = {item.code for item in compile_text(text).diagnostics if item.severity == "error"}
    assert bool(codes) is proved and all(code.startswith("LJ06") for code in codes), codes
