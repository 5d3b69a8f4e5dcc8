"""`lingjing validate --deep`: instances that have no place in the built city, by seed and mode."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from lingjing.errors import ExitCode
from lingjing.testing import instantiate, run_command

BAY = """ljs 2
use std.sea { lifeboat, person_in_water }
mission m "M" {
  goal "Go."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 1 s }
  budget { ticks <= 100 }
  mode broadcast
  target victim : person_in_water { position ~ sites(box((-100 m, -1000 m), (300 m, -700 m))) }
  asset boat : lifeboat { position = BOAT }
  agent skipper as rescuer controls boat { observes boat.*, events }
  success when emitted(rescue, victim)
}
"""


YARD = """ljs 2
use std.ground { car }
use std.traffic { destination }
mission m "M" {
  goal "Go."
  scene residential { extent = 800 m, inside = box((-250 m, -250 m), (250 m, 250 m)) }
  clock { tick = 10 s, sync = 1 s }
  budget { ticks <= 100 }
  target place : destination { position = (300 m, 300 m) }
  asset van : car { position = (0 m, 0 m) }
  agent driver as driver controls van { observes van.*, events }
  success when distance_xy(van, place) <= 40 m
}
"""

Capture = pytest.CaptureFixture[str]
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def validate(tmp_path: Path, capsys: Capture) -> Run:
    """A call of `lingjing validate` on the mission with a place of its boat: exit code, output, errors."""

    def run(boat: str, *options: str) -> tuple[int, str, str]:
        file = tmp_path / "m.ljs"
        file.write_text(BAY.replace("BOAT", boat))
        code = run_command(["validate", str(file), *options])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


def test_a_mission_that_fits_is_valid_for_each_seed(validate: Run) -> None:
    assert validate("(10 m, -1350 m)", "--deep", "--seeds", "0-3") == (ExitCode.OK, "", "")


def test_a_place_outside_of_the_scene_is_an_error_at_its_declaration(validate: Run) -> None:
    code, shown, _ = validate("(10 m, 3350 m)", "--deep", "--seeds", "2-4")
    assert code == ExitCode.MISSION
    assert ":10:9: error[LJ0211]: `boat` begins at (10 m, 3,350 m" in shown and "seeds" not in shown, (
        "found without a city"
    )


def test_a_place_too_far_from_any_road_is_found_only_by_building_the_city(tmp_path: Path, capsys: Capture) -> None:
    file = tmp_path / "yard.ljs"
    file.write_text(YARD)
    assert run_command(["validate", str(file)]) == ExitCode.OK
    capsys.readouterr()
    code = run_command(["validate", str(file), "--deep", "--seeds", "0-1", "--output-format", "json"])
    (finding,) = json.loads(capsys.readouterr().out)
    assert (code, finding["code"], finding["span"]["line"]) == (ExitCode.MISSION, "LJ0211", 9)
    assert finding["message"].startswith("seeds 0-1: `place` cannot begin where it is declared")


def test_bodies_that_the_city_moves_are_reported_in_a_note(capsys: Capture) -> None:
    assert run_command(["validate", "queue", "--deep", "--seeds", "1"]) == ExitCode.OK
    assert capsys.readouterr().out.startswith("queue: note: seed 1: moved from their declared places")


@pytest.mark.parametrize(
    ("options", "message"),
    [(("--seeds", "3"), "--seeds selects the instances of --deep"), (("--deep", "--seeds", "5-2"), "runs backwards")],
)
def test_wrong_options_are_usage_errors(validate: Run, options: tuple[str, ...], message: str) -> None:
    code, _, complaint = validate("(10 m, -1350 m)", *options)
    assert code == ExitCode.USAGE and message in complaint


def test_a_group_that_was_drawn_again_is_reported_in_a_note_with_its_seeds(tmp_path: Path, capsys: Capture) -> None:
    text = BAY.replace("BOAT", "(10 m, -1350 m)").replace("emitted(rescue, victim)", "emitted(rescue, victim[1])")
    text = text.replace("target victim :", "target victim[1..5] :").replace("-700 m)))", "-700 m)), apart >= 170 m)")
    file = tmp_path / "crowded.ljs"
    file.write_text(text)
    assert run_command(["validate", str(file), "--deep", "--seeds", "0-9"]) == ExitCode.OK
    printed = "".join(capsys.readouterr())
    anew = [seed for seed in range(10) if instantiate(text, seed=seed).redrawn]
    assert 0 < len(anew) < 10
    assert f"{', '.join(map(str, anew))}: drawn anew" in printed, printed
    assert "`victim.position`" in printed
