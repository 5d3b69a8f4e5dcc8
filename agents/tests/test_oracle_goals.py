"""Whole episodes of the oracle with the real engines: amounts, distances, regions and transport."""

from __future__ import annotations

from pathlib import Path

import pytest

import lingjing

pytestmark = pytest.mark.slow
EXAMPLES = Path(__file__).parents[2] / "scenarios" / "examples"
WON_ELSEWHERE = {"castaways", "chase", "overwatch", "parcels", "rounds"}
"""The examples that the oracle wins with the same seed in `tests/play/test_examples.py`."""

LONG = {"campus", "patrol"}
"""The examples with long episodes: more than two seconds of processor time each."""


def played(mission: Path | str, folder: Path, **settings: float):
    return lingjing.run(
        mission, policy="oracle", seed=0, out=folder / "run", overview=False, world="inline", settings=settings
    )


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.thorough] * (name in LONG))
        for name in sorted({path.stem for path in EXAMPLES.glob("*.ljs")} - WON_ELSEWHERE)
    ],
)
def test_the_examples_are_won(name: str, tmp_path: Path) -> None:
    result = played(EXAMPLES / f"{name}.ljs", tmp_path)
    assert result.success, (result.reason, result.warnings)


def test_each_thought_names_the_goal_and_its_condition(tmp_path: Path) -> None:
    result = played(EXAMPLES / "convoy.ljs", tmp_path)
    for record in lingjing.read(result.trace).boundaries[:1]:
        for entry in record.decisions:
            assert "I go for hospital, because `distance_xy(t, hospital) <= close` of success is not met" in (
                entry.decision.thought
            )


def test_a_lost_episode_names_the_condition_that_the_oracle_cannot_work_towards(tmp_path: Path) -> None:
    """Two trucks must part, and no goal of the oracle is to keep a distance."""
    text = (EXAMPLES / "convoy.ljs").read_text(encoding="utf-8")
    success = "success when forall t in truck: distance_xy(t, hospital) <= close"
    apart = text.replace(success, "success when distance_xy(truck[1], truck[2]) >= 90 m").replace("<= 40,", "<= 4,")
    assert success in text
    mission = tmp_path / "apart.ljs"
    mission.write_text(apart, encoding="utf-8")
    result = played(mission, tmp_path)
    assert not result.success
    (note,) = [line for line in result.warnings if "cannot work towards" in line]
    drivers = "`driver[1]`, `driver[2]`, `driver[3]`"
    assert note.startswith(f"{drivers}: cannot work towards `distance_xy(truck[1], truck[2]) >= 90 m` of success: ")
    assert "which verb setDestination" in note


TRIAL = """\
ljs 2
use std.ground {{ car }}
target blaze {{
  engine = city, on = road
  state heat = 100 %
  interaction extinguish {{ by = road, within = 30 m }}
}}
target halt {{
  engine = city, on = road
  state waiting = 6
  interaction board {{ by = road, within = 30 m, gives = seated, from = waiting, up_to = seats, status = empty }}
}}
target depot {{
  engine = city, on = road
  interaction fill {{ by = road, within = 30 m, gives = seated, up_to = seats }}
}}
target shelter {{
  engine = city, on = road
  state beds = 50
  interaction alight {{ by = road, within = 30 m, takes = beds, from = seated, status = full }}
}}
target destination {{ engine = city, on = road }}
asset coach : car {{ state seated = 0, seats = 4 }}
mission trial "Trial" {{
  goal "Try it."
  scene commercial {{ extent = 400 m, blocks = 2 by 2, height = 6 m..9 m }}
  clock {{ tick = 10 s, sync = 500 ms }}
  budget {{ ticks <= 30, policy <= 90 s, engine <= 30 s }}
  mode broadcast
  region yard = box((-30 m, 60 m), (30 m, 120 m))
  target f : blaze {{ position = (0 m, 150 m) }}
  target stop : halt {{ position = (0 m, 90 m) }}
  target store : depot {{ position = (0 m, 150 m) }}
  target home : shelter {{ position = (0 m, -150 m) }}
  target corner : destination {{ position = (0 m, 150 m) }}
  asset bus : coach {{ position = (0 m, -50 m), actions {{ setDestination, stop }} }}
  agent driver as driver controls bus {{ observes bus.*, corner.position }}
  {rules}
  success when {success}
}}
"""

AT_HOME = "distance_xy(bus, home) <= 30 m"
LASTING = """adjudicate stayed(d: corner) { when held(distance_xy(bus, d) <= 30 m, 25 s) }
  adjudicate rested(d: home) { when held(distance_xy(bus, d) <= 30 m, 25 s) }"""


@pytest.mark.parametrize(
    ("success", "rules"),
    [
        ("distance_xy(bus, corner) <= 30 m", ""),
        ("bus.seated >= bus.seats", ""),
        ("stop.waiting == 0 and bus.seated == 0", ""),
        ("f.heat <= 50 % and bus in yard", ""),
        ("stop.status == empty or bus.seats >= 9", ""),
        ("f.heat <= 0", "unlock extinguish(x: f) when home.beds <= 46"),
        ("emitted(extinguish, f) and distance_xy(bus, home) <= 30 m", ""),
        (f"{AT_HOME} and before(distance_xy(bus, corner) <= 30 m, {AT_HOME})", ""),
        ("stayed(corner) and rested(home)", LASTING),
    ],
)
def test_one_bus_reaches_each_kind_of_goal(success: str, rules: str, tmp_path: Path) -> None:
    mission = tmp_path / "trial.ljs"
    mission.write_text(TRIAL.format(success=success, rules=rules), encoding="utf-8")
    result = played(mission, tmp_path)
    assert result.success, (result.reason, result.warnings)
