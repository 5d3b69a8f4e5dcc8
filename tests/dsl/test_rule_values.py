"""Battery, speed, line of sight, distance in space, and the sender and time of a message: types, errors, printing."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from lingjing.testing import Compilation, compile_text, compiled, run_command

RULE = "  adjudicate odd(u: uav, r: detection) {{ when {} }}\n  unlock rescue"


def with_rule(small: str, condition: str) -> str:
    return small.replace("  unlock rescue", RULE.format(condition), 1)


def errors(small: str, condition: str) -> list[tuple[str, str]]:
    """Code and text of each error."""
    return errors_of(compile_text(with_rule(small, condition)))


def errors_of(compilation: Compilation) -> list[tuple[str, str]]:
    return [(item.code, f"{item.message} {item.hint}") for item in compilation.diagnostics if item.severity == "error"]


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
def test_a_rule_that_reads_such_a_value_is_printed_as_it_was_written(
    small: str, condition: str, printed_again: Callable[[str], tuple[object, object]]
) -> None:
    assert errors(small, condition) == []
    before, after = printed_again(with_rule(small, condition))
    assert before == after


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
def test_a_mistake_gives_one_error_that_names_the_right_form(small: str, condition: str, code: str, words: str) -> None:
    ((actual, message),) = errors(small, condition)
    assert actual == code and words in message


def test_a_battery_level_can_be_read_in_rules_only(small: str) -> None:
    text = small.replace("weather {", "weather { turbulence = uav[1].battery, ", 1)
    ((code, message),) = errors_of(compile_text(text))
    assert code == "LJ0304" and message.endswith("use it in a rule")


def test_a_field_of_the_record_has_priority(small: str) -> None:
    text = small.replace("mission small", "record call : report { sender: text, sent: number }\nmission small", 1)
    text = text.replace("message detection", "message hail : call from searcher to all\n  message detection", 1)
    rule = (
        '  adjudicate odd(r: hail) { when r.sender == "a ship" and r.sent > 3 and r.role == searcher }\n  unlock rescue'
    )
    mission = compiled(text.replace("  unlock rescue", rule, 1))
    assert mission.rules[1].name == "odd"


def quantities(small: str, text: str, folder: Path) -> list[dict[str, object]]:
    """The quantities that the condition reads, as `mission.json` lists them."""
    source, target = folder / "small.ljs", folder / "small.json"
    source.write_text(with_rule(small, text))
    assert run_command(["compile", str(source), "-o", str(target)]) == 0
    condition = next(item for item in json.loads(target.read_text())["conditions"] if item.get("name") == "odd")
    return [quantity for leaf in condition["leaves"] for quantity in leaf.get("quantities", [])]


@pytest.mark.parametrize(
    ("text", "owner", "name", "causes"),
    [
        ("u.battery > 20 %", "uav", "battery", {"takeoff", "forward", "multirotor"}),
        ("speed(u) > 1 m/s", "uav", "velocity", {"takeoff", "forward"}),
        ("r.sent > 60 s", "detection", "sent", {"detection"}),
    ],
)
def test_the_list_of_conditions_names_the_causes_of_a_quantity(
    small: str, text: str, owner: str, name: str, causes: set[str], tmp_path: Path
) -> None:
    listed = quantities(small, text, tmp_path)
    (quantity,) = [each for each in listed if (each.get("owner"), each.get("name")) == (owner, name)]
    assert {cause["name"] for cause in quantity["causes"]} == causes and not quantity.get("hidden")  # type: ignore[attr-defined]


@pytest.mark.parametrize("text", ["speed(v) > 1 m/s", "line_of_sight(u, v)", "distance(u, v) < 9 m"])
def test_a_value_of_a_hidden_body_is_hidden(small: str, text: str, tmp_path: Path) -> None:
    listed = quantities(small, f"exists v in victim: {text}", tmp_path)
    assert any(each.get("hidden") and each.get("owner") == "victim" for each in listed)


@pytest.mark.parametrize(
    ("success", "proved"),
    [
        ("exists u in uav: u.battery > 100 %", True),
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
def test_proofs_use_the_bounds_of_battery_speed_distance_and_messages(small: str, success: str, proved: bool) -> None:
    text = small.replace("success when forall v in victim: rescued(v)", f"success when {success}", 1)
    codes = {code for code, _ in errors_of(compile_text(text))}
    assert bool(codes) is proved and all(code.startswith("LJ06") for code in codes), codes
