"""The status words that `kinds.json` lists for an engine are those that its code can give.

mypy holds the code to the words: each `status` returns a `Literal`.
"""

from __future__ import annotations

from typing import get_args

import pytest

from lingjing.engines.fixed_wing.aeroplane import AeroplaneStatus
from lingjing.engines.multirotor.drone import DroneStatus
from lingjing.engines.quadruped.tasks import DogStatus
from lingjing.engines.road.vehicle import VehicleStatus
from lingjing.engines.satellite.engine import SatelliteStatus
from lingjing.engines.vessel.boat import BoatStatus
from lingjing.mission.kinds import builtin_engines

STATUSES = {
    "multirotor": DroneStatus,
    "plane": AeroplaneStatus,
    "quadruped": DogStatus,
    "road": VehicleStatus,
    "satellite": SatelliteStatus,
    "vessel": BoatStatus,
}


@pytest.mark.parametrize("engine", sorted(STATUSES))
def test_the_listed_words_are_those_of_the_code(engine: str) -> None:
    words = builtin_engines()[engine].words
    assert words is not None and sorted(words) == sorted(get_args(STATUSES[engine]))


def test_every_engine_with_bodies_except_the_city_lists_its_status_words() -> None:
    described = {name for name, kind in builtin_engines().items() if kind.words is not None}
    assert described == STATUSES.keys() == builtin_engines().keys() - {"city", "camera", "remote"}
