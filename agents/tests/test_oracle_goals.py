"""Whole episodes of the oracle with the real engines: amounts, distances, regions and transport."""

from __future__ import annotations

from pathlib import Path

import pytest

import lingjing

pytestmark = pytest.mark.slow
EXAMPLES = Path(__file__).parents[2] / "scenarios" / "examples"


def played(mission: Path | str, folder: Path, **settings: float):
    return lingjing.run(
        mission, policy="oracle", seed=0, out=folder / "run", overview=False, world="inline", settings=settings
    )


@pytest.mark.parametrize("name", sorted(path.stem for path in EXAMPLES.glob("*.ljs")))
def test_the_examples_are_won(name: str, tmp_path: Path) -> None:
    result = played(EXAMPLES / f"{name}.ljs", tmp_path)
    assert result.success, (result.reason, result.warnings)


def test_each_thought_names_the_goal_and_its_condition(tmp_path: Path) -> None:
    result = played(EXAMPLES / "convoy.ljs", tmp_path)
    for record in lingjing.read_trace(result.trace).boundaries[:1]:
        for entry in record.decisions:
            assert "I go for hospital, because `distance_xy(t, hospital) <= close` of success is not met" in (
                entry.decision.thought
            )


def test_a_lost_episode_tells_which_condition_had_no_way(tmp_path: Path) -> None:
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
