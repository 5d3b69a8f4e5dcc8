"""Drawn params and counts, hidden ones among them, and requirements that the draws must meet."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from lingjing.errors import ExitCode, MissionError, UsageError
from lingjing.mission.instance import Instance
from lingjing.testing import Stage, brief_of, compile_text, compiled, does, episode, instantiate, run_command

TEXT = """ljs 2
use std.sea {{ lifeboat, person_in_water }}
use std.messages {{ status }}
mission drawn "Drawn" {{
  goal "{goal}"
  scene bay {{ datum = sea level at -3.5 m }}
  clock {{ tick = 10 s, sync = 1 s }}
  budget {{ ticks <= {ticks} }}
  {params}
  region search = box((-100 m, -1400 m), (100 m, -1200 m))
  target victim[1..victims] : person_in_water {{ {hidden}position ~ sites(search), drift = 0.1 m/s }}
  asset boat : lifeboat {{ position = (10 m, -1350 m), heading = 30 deg }}
  agent skipper as rescuer controls boat {{ observes boat.*, events{more} }}
  message note : status from rescuer to all
  {lines}
  declassify end because "it ends when all are rescued"
  success when {success}
}}
"""


DRAWN = "param victims ~ integer(2, 5)"
HIDDEN = "param hidden victims ~ integer(2, 5)"


def text(
    params: str = "param victims ~ integer(2, 5)", *lines: str, goal: str = "Go.", hidden: str = "hidden ",
    more: str = "", success: str = "forall v in victim: emitted(rescue, v)", ticks: int = 100,
) -> str:  # fmt: skip
    unlock = "unlock rescue(v: victim) when true"
    return TEXT.format(
        params=params, lines="\n  ".join((unlock, *lines)), goal=goal, hidden=hidden, more=more, success=success,
        ticks=ticks,
    )  # fmt: skip


def codes(source: str) -> list[str]:
    return [item.code for item in compile_text(source).diagnostics if item.severity == "error"]


def places(instance: Instance) -> list[tuple[float, ...]]:
    return [entity.position for entity in instance.entities if entity.group == "victim"]


def test_each_seed_draws_a_count_and_the_count_changes_the_place_of_no_member() -> None:
    mission, fixed = compiled(text()), compiled(text("param victims = 5"))
    counts = set()
    for seed in range(20):
        instance = instantiate(mission, seed=seed)
        count = int(instance.settings["victims"])
        counts.add(count)
        assert len(places(instance)) == count
        assert places(instance) == places(instantiate(fixed, seed=seed))[:count], "no other draw changes"
    assert counts == {2, 3, 4, 5}


def test_a_setting_replaces_the_draw_within_its_range() -> None:
    mission = compiled(text())
    assert len(places(instantiate(mission, settings={"victims": 3.0}))) == 3
    for value, words in ((6.0, "2..5"), (2.5, "whole numbers")):
        with pytest.raises(UsageError, match="cannot be drawn") as caught:
            instantiate(mission, settings={"victims": value})
        assert words in str(caught.value)


@pytest.mark.parametrize(
    "param",
    ["param victims ~ integer(2, 5)", "param hidden victims ~ integer(2, 5)", "param victims ~ choice([2, 4])",
     "param least = 2 in 1..4\n  param victims ~ integer(least, 5)"],
)  # fmt: skip
def test_drawn_params_and_requirements_are_printed_as_they_were_written(
    param: str, printed_again: Callable[[str], tuple[object, object]]
) -> None:
    before, after = printed_again(text(param, 'require victims >= 2 because "two at least"'))
    assert before == after


@pytest.mark.parametrize(
    ("source", "code"),
    [
        (text("param victims ~ integer(2, 5.5)"), "LJ0206"),
        (text("param victims ~ integer(5, 2)"), "LJ0206"),
        (text("param victims ~ integer(2, 5 m)"), "LJ0203"),
        (text('param victims ~ choice(["a", "b"])'), "LJ0201"),
        (text("param victims = integer(2, 5)"), "LJ0302"),
        (text("param victims ~ integer(2, 5) in 2..5"), "LJ0110"),
        (text("param victims ~ integer(2, 5)", success="emitted(rescue, victim[6])"), "LJ0206"),
        (text(DRAWN, 'require now > 3 s because "x"'), "LJ0304"),
        (text(DRAWN, 'require boat.status == moving because "x"'), "LJ0304"),
        (text(DRAWN, 'require emitted(rescue, victim[1]) because "x"'), "LJ0304"),
        (text(DRAWN, 'require exists r in note: true because "x"'), "LJ0304"),
        (text(DRAWN, 'require victims because "x"'), "LJ0201"),
    ],
)
def test_a_wrong_draw_or_requirement_is_an_error(source: str, code: str) -> None:
    assert codes(source) == [code]


@pytest.mark.parametrize(
    ("source", "code"),
    [
        (text(HIDDEN, goal="Find {victims}."), "LJ0401"),
        (text(HIDDEN, goal="Find {victim}."), "LJ0401"),
        (text(HIDDEN, hidden=""), "LJ0401"),
        (text(HIDDEN, "param double = 2 * victims"), "LJ0401"),
        (text(HIDDEN, "reveal image(victim) to rescuer"), "LJ0401"),
        (text(HIDDEN, "limit moves <= victims counts boat.moveTo"), "LJ0401"),
        (text(HIDDEN, "stage late { done when now > 500 s, ticks <= victims }"), "LJ0401"),
        (text(HIDDEN, "region near = circle((0 m, 0 m), victims * 9 m)", goal="{near}"), "LJ0401"),
        (text(HIDDEN, "permit boat.moveTo when victims > 3"), "LJ0404"),
        (text(HIDDEN, "constraint hard c { always now < 1 s * victims }"), "LJ0404"),
        (text(HIDDEN, "stage late { done when victims > 3, ticks <= 3 }"), "LJ0404"),
        (text(HIDDEN, "agent more[1..victims] as extra { observes events }"), "LJ0401"),
        (text(HIDDEN).replace("declassify end", "#"), "LJ0404"),
    ],
)
def test_a_hidden_count_reaches_no_text_and_no_command(source: str, code: str) -> None:
    assert code in codes(source)


def inputs(count: int) -> list[bytes]:
    """Everything that the agent receives with a hidden count of this size, the brief first."""
    param = HIDDEN.replace("(2, 5)", f"({count}, {count})")
    soft = "constraint soft c { always victims < 3 or now < 20 s, penalty = 10 % }"
    rule = "adjudicate many() { when count(true for v in victim) > 2 and victims > 2 }"
    mission = compiled(text(param, soft, rule, more=", victim.*", success="now > 900 s"))
    assert mission.parameters[0].hidden and mission.groups[0].hides_count
    instance = instantiate(mission)
    rows = [msgspec.msgpack.encode(brief_of(instance, "skipper"))]
    with episode(mission, seed=0, stage=Stage()) as play:
        for tick in range(4):
            seen = play.published.observations["skipper"]
            inbox = play.inbox("skipper")
            rows.append(msgspec.msgpack.encode((seen.entities, seen.events, inbox.messages, inbox.receipts, play.done)))
            play.do({"skipper": does("moveTo", x=500.0 + tick % 2, y=-1900.0)})
    return rows


def test_the_input_of_agents_does_not_depend_on_the_hidden_count() -> None:
    assert inputs(2) == inputs(4)
    briefs = []
    for count in (2, 4):
        instance = instantiate(text(HIDDEN.replace("(2, 5)", f"({count}, {count})")))
        briefs.append(brief_of(msgspec.structs.replace(instance, hidden_settings=()), "skipper"))
    assert briefs[0] != briefs[1], "without the guard the brief differs"


def test_a_requirement_holds_for_every_seed_and_redraws_only_the_values_that_it_reads() -> None:
    rule = 'require forall v in victim: distance_xy(v, boat) >= 90 m because "the boat must travel"'
    params = "param victims ~ integer(2, 3)\n  param other ~ uniform(0, 1)"
    free, bound = compiled(text(params)), compiled(text(params, rule))
    redrawn = 0
    for seed in range(15):
        before, after = instantiate(free, seed=seed), instantiate(bound, seed=seed)
        assert all((x - 10) ** 2 + (y + 1350) ** 2 >= 90**2 for x, y, _ in places(after))
        assert before.settings == after.settings or before.settings["other"] == after.settings["other"]
        kept = all((x - 10) ** 2 + (y + 1350) ** 2 >= 90**2 for x, y, _ in places(before))
        assert (places(before) == places(after)) is kept
        redrawn += not kept
        assert instantiate(bound, seed=seed) == after
    assert 3 <= redrawn <= 14


def test_a_requirement_that_no_draw_meets_names_its_reason_and_the_seed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = text("param victims ~ integer(2, 3)", 'require victims >= 4 because "a team is needed"')
    file = tmp_path / "drawn.ljs"
    file.write_text(source)
    assert run_command(["run", str(file), "--seed", "7", "-o", str(tmp_path / "out")]) == ExitCode.MISSION
    error = capsys.readouterr().err
    assert f"{file}:{1 + source[: source.index('victims >= 4')].count(chr(10))}:" in error
    assert "`victims >= 4`" in error and "a team is needed" in error and not (tmp_path / "out").exists()
    required = compiled(text("param victims ~ integer(2, 4)", 'require victims >= 4 because "x"'))
    narrow = msgspec.structs.replace(required, parameters=compiled(text("param victims ~ integer(2, 3)")).parameters)
    with pytest.raises(MissionError, match="seed 7 meets the requirement in none of 101 draws of `victims`"):
        instantiate(narrow, seed=7)


@pytest.mark.parametrize(
    ("params", "success", "proved"),
    [
        ("param victims ~ integer(2, 5)", "count(emitted(rescue, v) for v in victim) >= 6", True),
        ("param victims ~ integer(2, 5)", "count(emitted(rescue, v) for v in victim) >= 5", False),
        ("param victims ~ integer(2, 5)", "victims > 5", True),
        ("param victims ~ choice([2, 4])", "victims == 3 and now > 20 s", True),
        ("param victims = 3\n  param wait ~ uniform(5 s, 900 s)", "now > wait * 3", False),
        ("param victims = 3\n  param wait ~ uniform(500 s, 900 s)", "now > wait * 3", True),
        ("param victims ~ integer(0, 90)", "count(emitted(rescue, v) for v in victim) >= 91", True),
        ("param victims ~ integer(0, 140)", "count(emitted(rescue, v) for v in victim) >= 141", False),
    ],
)
def test_a_proof_holds_for_every_value_of_the_draw(params: str, success: str, proved: bool) -> None:
    compilation = compile_text(text(params, success=success))
    errors = [item for item in compilation.diagnostics if item.severity == "error"]
    assert bool(errors) is proved and all(item.code.startswith("LJ06") for item in errors), errors


def test_a_note_reports_that_a_member_count_with_too_many_values_prevents_proofs() -> None:
    (note,) = (item for item in compile_text(text("param victims ~ integer(0, 140)")).diagnostics)
    assert (note.code, note.severity) == ("LJ0615", "note")
    assert "`victim` depends on `victims`, which has too many values" in note.message
    assert compile_text(text("param victims ~ integer(0, 90)")).diagnostics == ()


BUOY = "target buoy : person_in_water { position ~ sites(box((-200 m, -1400 m), (200 m, -1300 m))) }"
APART = 'require forall v in victim: distance_xy(v, buoy) >= 90 m because "x"'


def test_a_requirement_over_hidden_values_repeats_no_public_draw() -> None:
    """A public place that was drawn anew would reveal something about the hidden ones."""
    params = "param victims ~ integer(2, 3)"
    free, bound = compiled(text(params, BUOY)), compiled(text(params, BUOY, APART))
    redrawn = 0
    for seed in range(15):
        before, after = instantiate(free, seed=seed), instantiate(bound, seed=seed)
        assert before.settings == after.settings
        public = [[entity.position for entity in each.entities if entity.group == "buoy"] for each in (before, after)]
        assert public[0] == public[1]
        redrawn += places(before) != places(after)
    assert redrawn >= 5


def test_a_hidden_constant_chooses_no_public_place() -> None:
    fixed = "target rock : person_in_water { hidden position = (0 m, -1350 m) }"
    rule = 'require distance_xy(rock, buoy) >= 150 m because "x"'
    source = text("param victims = 2 in 1..5", BUOY, fixed, rule)
    (leak,) = [item for item in compile_text(source).diagnostics if item.severity == "error"]
    assert leak.code == "LJ0404" and "`buoy` is drawn anew until" in leak.message
    assert "`rock.position`" in leak.message
    assert codes(source.replace("  success", '  declassify buoy because "x"\n  success')) == []
