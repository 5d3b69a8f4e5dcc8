"""Every shipped mission starts with its real engines, at the last value of its sweeps where it declares any."""

from __future__ import annotations

from collections import Counter

import pytest

import lingjing
from lingjing.bench.columns import Column, columns
from lingjing.envs.stepping import SteppedEpisodes
from lingjing.testing import shipped_missions
from lingjing.trace.records import Decision

pytestmark = pytest.mark.slow

LAST = {column.mission: column for sweeps in (False, True) for column in columns(shipped_missions(), sweeps=sweeps)}
GROUPS = {"cd": {"point": 20, "van": 5}, "ufr": {"fire": 6, "uav": 5}, "ssr": {"victim": 3, "uav": 3}}


def test_the_tested_columns_cover_every_shipped_mission() -> None:
    assert LAST.keys() == {path.stem for path in shipped_missions()}


IN_EVERY_RUN = ("bi", "ssr")
"""The missions that `make test` starts at the last value of their sweeps; `make thorough` starts the others."""


@pytest.mark.parametrize(
    "column",
    [
        pytest.param(column, id=column.name, marks=() if mission in IN_EVERY_RUN else pytest.mark.thorough)
        for mission, column in LAST.items()
    ],
)
def test_a_shipped_mission_starts(column: Column) -> None:
    game = SteppedEpisodes(lingjing.compile(str(column.path)), column.mode, column.settings, "random", "inline")
    try:
        instance = game.instance(3)
        agents = [agent.id for agent in instance.agents]
        game.begin(3, agents)
        for tick in (1, 2):
            assert game.step({agent: Decision() for agent in agents}).record.tick == tick
        counted = Counter(entity.group for entity in instance.entities)
        assert GROUPS.get(column.mission, {}).items() <= counted.items()
    finally:
        game.close()
