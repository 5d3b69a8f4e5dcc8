"""Deadlines of single members: `deadline` of an entity and of a stage."""

from __future__ import annotations

import pytest

from lingjing.dsl.printing.printer import to_ljs
from lingjing.errors import MissionError
from lingjing.kernel.rule_sentences import rule_sentences
from lingjing.mission.conditions.declared_values import deadlines_s
from lingjing.mission.feasibility import prove
from lingjing.testing import compile_text, compiled, instantiate

STAGE = "  stage execute per v in victim { done when rescued(v) }"


def with_deadline(small: str, line: str, deadline: str = "v.deadline") -> str:
    text = small.replace("apart >= 10 m)\n", f"apart >= 10 m)\n    {line}\n", 1)
    declassified = '  declassify execute because "the time of a rescue is known"\n'
    return text.replace(STAGE, STAGE.replace(" }", f", deadline = {deadline} }}") + "\n" + declassified, 1)


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
def test_each_member_has_its_own_deadline(small: str, line: str, deadline: str, times: list[float]) -> None:
    text = with_deadline(small, line, deadline)
    mission = compiled(text)
    assert list(deadlines_s(instantiate(mission)).values()) == times
    again = compiled(to_ljs(mission))
    assert again.stages == mission.stages and again.groups == mission.groups


def test_a_deadline_is_drawn_for_each_member_and_changes_no_other_draw(small: str) -> None:
    plain, timed = compiled(small), compiled(with_deadline(small, "deadline ~ uniform(100 s, 400 s)"))
    for seed in range(3):
        before, after = instantiate(plain, seed=seed), instantiate(timed, seed=seed)
        times = deadlines_s(after)
        assert len(set(times.values())) == 3 and all(100.0 <= time <= 400.0 for time in times.values())
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
    sentence = next(each for each in rule_sentences(instantiate(text)) if "must be done by" in each)
    assert "a time that each victim has" in sentence and "100" not in sentence
    public = next(
        each for each in rule_sentences(instantiate(text.replace("hidden deadline", "deadline"))) if "by 100 s" in each
    )
    assert "100 s for victim[1], 200 s for victim[2], 300 s for victim[3]" in public


def test_a_deadline_over_a_number_that_changes_is_an_error_of_validation(small: str) -> None:
    text = with_deadline(small, "state people = 3", "1 s * v.people")
    errors = [item for item in compile_text(text).diagnostics if item.severity == "error"]
    assert errors, "the type has no state `people`"
    boat = small.replace("heading = 30 deg, speed", "heading = 30 deg, deadline = 50 s, speed", 1)
    with pytest.raises(MissionError):
        compiled(boat.replace(STAGE, STAGE.replace(" }", ", deadline = v.deadline }"), 1))


@pytest.mark.parametrize(("deadline", "proved"), [("5 s", True), ("590 s", False)])
def test_a_deadline_before_the_earliest_rescue_is_proved_impossible(small: str, deadline: str, proved: bool) -> None:
    text = with_deadline(small, "drift = 1 m/s", deadline)
    far = text.replace("(12.4 m, -51.8 m)", "(12.4 m, -900 m)").replace("ticks <= 60", "ticks <= 120")
    compilation = compile_text(far)
    mission = compilation.mission
    proofs = prove(mission) if mission is not None else ()
    errors = [item for item in compilation.diagnostics if item.severity == "error"]
    assert bool(proofs or errors) is proved
    if proved:
        assert "deadline of stage `execute`" in (errors or proofs)[0].message
