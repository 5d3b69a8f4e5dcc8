"""Missions that were written for `ljs 1` go on compiling: stored copies of the shipped ones of the first release."""

from pathlib import Path

import pytest

from lingjing.dsl.loading.load import load_mission
from lingjing.mission.instantiate import instantiate

STORED = sorted((Path(__file__).parent / "data" / "ljs-1").glob("*.ljs"))


def test_there_are_stored_missions() -> None:
    assert len(STORED) >= 10


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_a_stored_mission_compiles_and_can_be_drawn(path: Path) -> None:
    mission = load_mission(str(path))
    assert instantiate(mission, seed=1).entities
