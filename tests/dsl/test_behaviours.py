"""`behaviour flee|wander|follow` of a target: its properties, its errors, what it would reveal, and its proofs."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from lingjing.errors import MissionError
from lingjing.mission.instance import BehaviourSpec
from lingjing.testing import compile_text, instantiate, run_command

TEXT = """ljs 2
use std.ground {{ robot_dog }}
use std.sea {{ person_in_water }}
target stray {{ engine = city, on = ground }}
target barrier {{ engine = city, blocks = true }}
target wreck {{ engine = city, on = roof }}
mission strays "Strays" {{
  goal "Look."
  scene industrial {{ extent = 400 m, blocks = 2 by 2, height = 6 m..12 m }}
  clock {{ tick = 10 s, sync = 500 ms }}
  budget {{ ticks <= 6 }}
  param pace = 2 in 1..3
  param luck ~ uniform(1, 3)
  param hidden secret ~ uniform(1, 3)
  region yard = box((-80 m, -80 m), (80 m, 80 m))
  region corner = box((60 m, 60 m), (80 m, 80 m))
  asset dog[1..2] : robot_dog {{ position = at(i, [(0 m, 0 m), (5 m, 0 m)]), heading = 0 deg }}
  target ghost : stray {{ hidden position = (20 m, 20 m) }}
  region haunt = circle(ghost, 30 m)
  target hare[1..2] : stray {{ position = (10 m, 10 m)
    {line}
  }}
  {more}
  agent walker[i in 1..2] as walker controls dog[i] {{ observes dog[i].*, hare.position }}
  success when {success}
}}
"""
FLEE = "behaviour flee { from = dog, speed = 2 m/s, within = 60 m }"


def text(line: str = FLEE, more: str = "", success: str = "now > 30 s") -> str:
    return TEXT.format(line=line, more=more, success=success)


def errors(source: str) -> list[str]:
    return [f"{item.code} {item.message}" for item in compile_text(source).diagnostics if item.severity == "error"]


@pytest.mark.parametrize(
    ("line", "of_second"),
    [
        (FLEE, BehaviourSpec(kind="flee", speed_mps=2.0, of=("dog[1]", "dog[2]"), distance_m=60.0)),
        (
            "behaviour flee { from = dog[i], speed = pace * 0.5 m/s, within = 60 m }",
            BehaviourSpec(kind="flee", speed_mps=1.0, of=("dog[2]",), distance_m=60.0),
        ),
        (
            "behaviour follow { of = hare, speed = 1 m/s, distance = 0 m }",
            BehaviourSpec(kind="follow", speed_mps=1.0, of=("hare[1]",)),
        ),
        ("behaviour wander { in = yard, speed = 1 m/s }", BehaviourSpec(kind="wander", speed_mps=1.0, region="yard")),
    ],
)
def test_each_member_gets_its_behaviour_and_the_printed_text_keeps_it(
    line: str, of_second: BehaviourSpec, printed_again: Callable[[str], tuple[object, object]]
) -> None:
    source = text(line)
    assert errors(source) == []
    hares = [entity for entity in instantiate(source).entities if entity.group == "hare"]
    assert hares[1].behaviour == of_second
    before, after = printed_again(source)
    assert before == after


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("behaviour panic { speed = 1 m/s }", "LJ0109 no behaviour is called `panic`"),
        ("behaviour flee { from = dog, speed = 2 m/s }", "LJ0106 `behaviour flee` lacks `within`"),
        ("behaviour wander { in = yard, speed = 2 m/s, within = 3 m }", "LJ0108 `behaviour wander` knows no `within`"),
        ("behaviour wander { in = yard, speed = 0 m/s }", "LJ0206 `speed` must be above 0 m/s and at most 50 m/s"),
        ("behaviour wander { in = yard, speed = 2 }", "LJ0202"),
        ("behaviour wander { in = dog, speed = 2 m/s }", "LJ0201"),
        ("behaviour wander { in = box((0 m, 0 m), (9 m, 9 m)), speed = 2 m/s }", "LJ0201 `in` takes the name"),
        ("behaviour follow { of = yard, speed = 2 m/s, distance = 1 m }", "LJ0201 `of` names an asset, a target or"),
        ("behaviour follow { of = dog, speed = luck * 1 m/s, distance = 1 m }", "LJ0307 `speed` of a behaviour"),
        (f"{FLEE}, {FLEE}", "LJ0104 `hare` has two behaviours"),
    ],
)
def test_a_faulty_behaviour_has_one_error_that_names_it(line: str, error: str) -> None:
    reported = errors(text(line))
    assert len(reported) == 1 and reported[0].startswith(error), reported


@pytest.mark.parametrize(
    ("kind", "why"),
    [("barrier", "blocks a road"), ("wreck", "stands on a `roof`")],
)
def test_a_target_that_cannot_move_by_itself_has_no_behaviour(kind: str, why: str) -> None:
    reported = errors(text(more=f"target other : {kind} {{ position = (0 m, 9 m), {FLEE} }}"))
    assert len(reported) == 1 and reported[0].startswith(f"LJ0110 `other` {why}")


def test_an_asset_has_no_behaviour() -> None:
    reported = errors(text().replace("heading = 0 deg }", f"heading = 0 deg, {FLEE} }}"))
    assert len(reported) == 1 and reported[0].startswith("LJ0107")


@pytest.mark.parametrize(
    "line",
    [
        "behaviour flee { from = ghost, speed = 2 m/s, within = 60 m }",
        "behaviour follow { of = ghost, speed = 2 m/s, distance = 5 m }",
        "behaviour wander { in = haunt, speed = 2 m/s }",
        "behaviour flee { from = dog, speed = secret * 1 m/s, within = 60 m }",
    ],
)
def test_the_motion_of_a_public_target_must_not_depend_on_a_hidden_value(line: str) -> None:
    reported = errors(text(line))
    drawn = "secret" in line
    assert len(reported) == 1 and reported[0].startswith(
        "LJ0307" if drawn else "LJ0401 a hidden value reaches the motion of"
    )
    hidden = text(line).replace("hare[1..2] : stray { position", "hare[1..2] : stray { hidden position")
    assert drawn or errors(hidden.replace(", hare.position", "")) == []


def test_a_public_target_must_not_react_to_a_hidden_follower_of_a_hidden_target() -> None:
    """A hidden body may follow a hidden one. A public one that follows the follower would show both."""
    follows = "behaviour follow { of = ghost, speed = 1 m/s, distance = 5 m }"
    hidden = f"target spy : stray {{ hidden position = (0 m, 50 m), {follows} }}"
    reported = errors(text("behaviour flee { from = spy, speed = 1 m/s, within = 90 m }", hidden))
    assert len(reported) == 1 and reported[0].startswith("LJ0401") and "spy" in reported[0]


@pytest.mark.parametrize(
    ("line", "reachable"), [("", False), ("follow 1 m/s", False), ("follow 30 m/s", True), ("flee 30 m/s", True)]
)
def test_proofs_bound_the_distance_that_a_moving_target_can_cover(line: str, reachable: bool) -> None:
    kind, _, speed = line.partition(" ")
    ends = {"follow": f"follow {{ of = dog, speed = {speed}, distance = 1 m }}",
            "flee": f"flee {{ from = dog, speed = {speed}, within = 2 km }}"}  # fmt: skip
    far = text(f"behaviour {ends[kind]}" if kind else "heading = 0 deg", success="distance_xy(dog[1], hare[1]) <= 5 m")
    far = far.replace("(10 m, 10 m)", "(900 m, 10 m)").replace("extent = 400 m", "extent = 3 km")
    reported = errors("\n".join(line for line in far.splitlines() if " ~ " not in line))
    assert [error[:4] for error in reported] == ([] if reachable else ["LJ06"]), reported


def test_a_param_that_makes_the_speed_impossible_is_refused() -> None:
    source = text("behaviour wander { in = yard, speed = pace * 1 m/s - 1 m/s }")
    assert errors(source) == []
    with pytest.raises(MissionError, match=r"hare\[1\].*`wander` has a speed of 0 m/s"):
        instantiate(source, settings={"pace": 1.0})


def test_the_page_of_a_mission_shows_the_behaviour(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "strays.ljs").write_text(text())
    assert run_command(["docs", str(tmp_path / "strays.ljs")]) == 0
    line = "- moves by itself: `flee { from = dog, speed = 2 m/s, within = 60 m }`"
    assert capsys.readouterr().out.count(line) == 1


def compiled_document(source: str, path: Path) -> Any:
    """The `mission.json` of a text, as data."""
    path.write_text(source)
    assert run_command(["compile", str(path), "--emit", "mission", "-o", str(path.with_suffix(".json"))]) == 0
    return json.loads(path.with_suffix(".json").read_text())


def refusal(document: object, path: Path, capsys: pytest.CaptureFixture[str]) -> str:
    path.write_text(json.dumps(document))
    capsys.readouterr()
    assert run_command(["validate", str(path)]) == 1
    printed = capsys.readouterr()
    return printed.out + printed.err


def test_a_compiled_mission_is_checked_by_the_rules_of_its_text(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A `mission.json` that was edited shows a hidden place by a motion, and is refused as its text is."""
    source = text("behaviour flee { from = ghost, speed = 2 m/s, within = 60 m }")
    public = source.replace("hidden position = (20 m, 20 m)", "position = (20 m, 20 m)")
    document = compiled_document(public, tmp_path / "strays.ljs")
    (ghost,) = [group for group in document["groups"] if group["name"] == "ghost"]
    for prop in ghost["properties"]:
        prop["hidden"] = prop["name"] == "position"
    reported = refusal(document, tmp_path / "strays.json", capsys)
    assert "LJ0401" in reported and "the motion of `hare`" in reported


def test_a_compiled_mission_needs_the_declassifications_of_its_text(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = text(more='declassify end because "x"', success="distance_xy(ghost, dog[1]) < 5 m")
    document = compiled_document(source, tmp_path / "strays.ljs")
    document["declassified"] = []
    assert "LJ0404" in refusal(document, tmp_path / "strays.json", capsys)


@pytest.mark.parametrize(
    ("condition", "code"),
    [
        ("dog[1].battery >= 20", "LJ0206"),
        ("20 < dog[1].battery", "LJ0206"),
        ("exists d in dog: d.battery < -1", "LJ0206"),
        ("dog[1].battery >= 20 %", ""),
        ("dog[1].battery >= 0.2", ""),
    ],
)
def test_a_battery_level_is_compared_with_a_share(condition: str, code: str) -> None:
    reported = errors(text(success=f"now > 30 s and ({condition})"))
    assert [each.partition(" ")[0] for each in reported] == ([code] if code else [])
