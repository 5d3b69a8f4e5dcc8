"""`lingjing generate`: composed missions validate, equal seeds give equal texts, and certificates state the verdict."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from lingjing.authoring.composing import PLANS, Composed, compose
from lingjing.authoring.running import CheckRunner
from lingjing.authoring.screening import screen
from lingjing.errors import ExitCode
from lingjing.testing import compile_text, run_command

Capture = pytest.CaptureFixture[str]
SEEDS = range(40)
CERTIFIED = 10
"""Seed of a mission that the oracle wins, with few and short episodes."""

TEXT = """ljs 2
use std.sea { lifeboat, person_in_water }
mission generated_small "Small" {
  goal "Bring the boat to the person."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 20 s, sync = 1 s }
  budget { ticks <= 8 }
  region area = box((60 m, -1300 m), (160 m, -1200 m))
  target victim : person_in_water { position ~ sites(area) }
  asset boat : lifeboat { position = (110 m, -1360 m), heading = 0 deg, actions { moveTo } }
  agent skipper as rescuer controls boat { observes boat.*, victim.position, events }
  success when emitted(rescue, victim)
  expect { oracle wins for seeds 0, idle loses for seeds 0, draws spread over area }
}
"""

ROOFLESS = """ljs 2
use std.ground { fire_truck }
use std.fire { building_fire }
mission generated_small "Roofless" {
  goal "Extinguish the fire."
  scene residential { extent = 500 m, blocks = 2 by 2, height = 6 m..18 m }
  clock { tick = 20 s, sync = 1 s }
  budget { ticks <= 8 }
  region area = box((100 m, 100 m), (130 m, 130 m))
  target fire : building_fire { position ~ sites(area) }
  asset truck : fire_truck { position = (0 m, 10 m), actions { setDestination, stop } }
  agent driver_agent as driver controls truck { observes truck.*, fire.position, events }
  success when emitted(extinguish, fire)
  expect { oracle wins for seeds 0, draws spread over area }
}
"""


def test_composed_missions_validate_and_differ() -> None:
    composed = [compose(seed) for seed in SEEDS]
    assert composed == [compose(seed) for seed in SEEDS]
    assert len({each.text for each in composed}) == len(composed)
    assert {each.plan for each in composed} == set(PLANS)
    assert {each.mode for each in composed} == {"single", "broadcast", "star"}
    faulty = {each.name: compile_text(each.text).diagnostics for each in composed if not _is_valid(each.text)}
    assert faulty == {}


def _is_valid(text: str) -> bool:
    return compile_text(text).mission is not None


def small(text: str) -> Composed:
    return Composed(
        name="generated_small", text=text, plan="each", bodies=("lifeboat",), errands=("rescue person_in_water",),
        mode="broadcast", ticks=8,
    )  # fmt: skip


def test_a_certificate_names_the_first_test_that_fails() -> None:
    with CheckRunner() as runner:
        good = screen(0, small(TEXT), runner)
        assert (good.verdict, good.reason) == ("certified", "")
        assert [check.text for check in good.checks] == [
            "draws spread over area", "idle loses for seeds 0", "oracle wins for seeds 0"
        ]  # fmt: skip
        assert screen(0, small(TEXT.replace("sites(area)", "sites(aera)")), runner).verdict == "invalid"
        assert screen(0, small(TEXT.replace("~ sites(area)", "= (110 m, -1250 m)")), runner).verdict == "draws"
        won = screen(0, small(TEXT.replace("emitted(rescue, victim)", "now >= 20 s")), runner)
        assert won.verdict == "idle" and "0 of 1 episodes were lost; seed 0: won at tick 1" in won.reason
        roofless = screen(0, small(ROOFLESS), runner)
        assert roofless.verdict == "unplaced" and "no flat roof" in roofless.reason
        late = screen(0, small(TEXT.replace("oracle wins", "oracle wins within 1 ticks")), runner)
        assert late.verdict == "oracle" and [check.state for check in late.checks] == ["passed", "passed", "failed"]


@pytest.mark.episodes
def test_a_certified_mission_has_its_text_and_its_certificate(tmp_path: Path, capsys: Capture) -> None:
    command = ["generate", "--seed", str(CERTIFIED), "-o", str(tmp_path)]
    assert run_command(command) == ExitCode.OK
    assert capsys.readouterr().out == f"generated_{CERTIFIED}  certified\n1 mission: 1 certified\n"
    text, file = tmp_path / f"generated_{CERTIFIED}.ljs", tmp_path / f"generated_{CERTIFIED}.json"
    assert text.read_text() == compose(CERTIFIED).text
    certificate = json.loads(file.read_text())
    assert certificate["verdict"] == "certified" and certificate["seed"] == CERTIFIED
    states = {check["text"].split()[0]: (check["state"], check["episodes"]) for check in certificate["checks"]}
    assert states["oracle"] == ("passed", 5) and states["idle"] == states["random"] == ("passed", 3)
    before = file.stat().st_mtime_ns
    assert run_command(command) == ExitCode.OK  # the stored certificate is used
    assert file.stat().st_mtime_ns == before


def test_a_text_is_printed_without_screening(capsys: Capture) -> None:
    assert run_command(["generate", "--seed", "3", "--print"]) == ExitCode.OK
    assert capsys.readouterr().out == compose(3).text


@pytest.mark.parametrize("words", [["--seed", "x"], ["--seed", "1", "--count", "0"], ["--seed", "1", "-j", "0"]])
def test_wrong_arguments_are_usage_errors(words: list[str], tmp_path: Path, capsys: Capture) -> None:
    assert run_command(["generate", *words, "-o", str(tmp_path / "out")]) == ExitCode.USAGE
    assert "hint: " in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_written_is_a_usage_error(tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "file").write_text("")
    assert run_command(["generate", "--seed", "1", "-o", str(tmp_path / "file" / "x")]) == ExitCode.USAGE
    assert "hint: name another folder with -o" in capsys.readouterr().err
