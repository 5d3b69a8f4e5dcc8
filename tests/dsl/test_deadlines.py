"""Deadlines of single members: `deadline` of an entity and of a stage."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest

from lingjing.testing import brief_of, compile_text, instantiate

STAGE = "  stage execute per v in victim { done when rescued(v) }"


def with_deadline(small: str, line: str, deadline: str = "v.deadline") -> str:
    text = small.replace("apart >= 10 m)\n", f"apart >= 10 m)\n    {line}\n", 1)
    declassified = '  declassify execute because "the time of a rescue is known"\n'
    return text.replace(STAGE, STAGE.replace(" }", f", deadline = {deadline} }}") + "\n" + declassified, 1)


def sentence(text: str, seed: int = 0) -> str:
    """The rule about the deadlines in the brief of an agent."""
    rules = brief_of(instantiate(text, seed=seed), "skipper").rules
    return next(rule for rule in rules if "must be done by" in rule)


def times_of(text: str, seed: int = 0) -> list[float]:
    return [float(number) for number in re.findall(r"([\d.]+) s for victim", sentence(text, seed))]


def codes(text: str) -> list[str]:
    return [item.code for item in compile_text(text).diagnostics if item.severity == "error"]


@pytest.mark.parametrize(
    ("line", "deadline", "times"),
    [
        ("deadline = 100 s * i", "v.deadline", [100.0, 200.0, 300.0]),
        ("deadline = 300 s", "v.deadline - 60 s", [240.0, 240.0, 240.0]),
        ("drift = 1 m/s", "300 s", [300.0, 300.0, 300.0]),
        ("deadline = 90 s * i", "min(v.deadline, 12 * tick * uavs)", [90.0, 180.0, 240.0]),
    ],
)
def test_each_member_has_its_own_deadline(
    small: str, line: str, deadline: str, times: list[float], printed_again: Callable[[str], tuple[object, object]]
) -> None:
    text = with_deadline(small, line, deadline)
    assert times_of(text) == times
    before, after = printed_again(text)
    assert before == after


def test_a_deadline_is_drawn_for_each_member_and_changes_no_other_draw(small: str) -> None:
    timed = with_deadline(small, "deadline ~ uniform(100 s, 400 s)")
    for seed in range(3):
        before, after = instantiate(small, seed=seed), instantiate(timed, seed=seed)
        times = times_of(timed, seed)
        assert len(set(times)) == 3 and all(100.0 <= time <= 400.0 for time in times)
        assert [entity.position for entity in before.entities] == [entity.position for entity in after.entities]


@pytest.mark.parametrize(
    ("line", "deadline", "code"),
    [
        ("deadline = 100", "v.deadline", "LJ0202"),
        ("deadline = 0 s", "v.deadline", "LJ0206"),
        ("deadline = 100 m", "v.deadline", "LJ0203"),
        ("drift = 1 m/s", "v.deadline", "LJ0102"),
        ("deadline = 100 s", "now + 3 s", "LJ0304"),
        ("deadline = 100 s", "v.deadline * 2 m", "LJ0203"),
        ("deadline = 100 s", "v.position.east / 1 m/s", "LJ0304"),
    ],
)
def test_a_wrong_deadline_is_an_error(small: str, line: str, deadline: str, code: str) -> None:
    assert codes(with_deadline(small, line, deadline)) == [code]


def test_a_hidden_deadline_that_ends_the_episode_must_be_declassified(small: str) -> None:
    text = with_deadline(small, "hidden deadline = 100 s * i")
    assert codes(text) == []
    line = next(line for line in text.splitlines() if "declassify execute" in line)
    assert codes(text.replace(line, "")) == ["LJ0404"]
    assert codes(text.replace('goal "Find everybody."', 'goal "By {victim.deadline}."')) == ["LJ0401"]
    assert "a time that each victim has" in sentence(text) and "100" not in sentence(text)
    assert times_of(text.replace("hidden deadline", "deadline")) == [100.0, 200.0, 300.0]


@pytest.mark.parametrize(
    ("deadline", "expected"),
    [
        ("100 s * v.people", ["LJ0304"]),
        ("min(100 s, 9 s * (v.cargo / 1 kg))", ["LJ0304"]),
        ("100 s * v.rank", []),
        ("100 s * pier.people", ["LJ0304"]),
        ("100 s * pier.rank", []),
    ],
)
def test_a_deadline_over_a_state_is_an_error(small: str, deadline: str, expected: list[str]) -> None:
    """A state is a number that changes during a run. A property such as `rank` never changes."""
    crowd = "target crowd : person_in_water {\n  state people = 3\n  state cargo = 2 kg\n  rank = 2\n}\n"
    text = with_deadline(small, "drift = 1 m/s", deadline).replace(": person_in_water {", ": crowd {")
    text = text.replace("mission ", f"{crowd}mission ", 1)
    pier = "  target pier : crowd { position = (5 m, 5 m) }\n"
    assert codes(text.replace("  stage detect", f"{pier}  stage detect", 1)) == expected


@pytest.mark.parametrize(("deadline", "proved"), [("5 s", True), ("590 s", False)])
def test_a_deadline_before_the_earliest_rescue_is_proved_impossible(small: str, deadline: str, proved: bool) -> None:
    text = with_deadline(small, "drift = 1 m/s", deadline)
    far = text.replace("(12.4 m, -51.8 m)", "(12.4 m, -900 m)").replace("ticks <= 60", "ticks <= 120")
    errors = [item for item in compile_text(far).diagnostics if item.severity == "error"]
    assert bool(errors) is proved
    if proved:
        assert "deadline of stage `execute`" in errors[0].message


def test_a_stage_without_members_reads_the_deadline_of_a_single_entity(small: str) -> None:
    text = small.replace("speed <= 3 m/s }", "speed <= 3 m/s, deadline = 200 s }", 1)
    home = "  stage home { done when distance_xy(boat, (0 m, 0 m)) <= 10 m, deadline = boat.deadline }\n"
    text = text.replace(STAGE, home + STAGE, 1)
    assert codes(text) == []
    assert "200 s" in sentence(text)
