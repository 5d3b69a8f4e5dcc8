"""Beliefs about drifting targets."""

import pytest
from lingjing_agents.heuristic.rescuer import Rescuer
from lingjing_agents.heuristic.sightings import Sighting, Sightings
from lingjing_agents.heuristic.target_types import FIRES, PEOPLE

from agents.tests.agent_kit import REPORT as SPEC
from agents.tests.agent_kit import Inbox, brief, envelope, observe
from lingjing.plugins.policy import Weather

EAST = Weather(current_mps=1.0, current_to_deg=90.0)
NORTH = Weather(current_mps=2.0, current_to_deg=0.0)


def test_a_floating_target_drifts_with_each_current_while_it_lasts():
    known = Sightings(EAST)
    seen = known.add(Sighting(0.0, 0.0, 0.0, 0.9))
    assert known.where(seen, 10.0) == pytest.approx((10.0, 0.0))
    known.heed(NORTH, 10.0)
    assert known.where(seen, 15.0) == pytest.approx((10.0, 10.0))
    known.heed(NORTH, 15.0)
    assert known.where(seen, 20.0) == pytest.approx((10.0, 20.0))


@pytest.mark.parametrize(("kind", "moved"), [(PEOPLE, True), (FIRES, False)])
def test_people_drift_with_the_current_and_fires_do_not(kind, moved):
    known = kind.sightings(brief("skipper"))
    seen = known.add(Sighting(0.0, 0.0, 0.0, 0.9))
    known.heed(NORTH, 0.0)
    assert (known.where(seen, 10.0) != (0.0, 0.0)) == moved


def test_a_rescuer_predicts_the_drift_in_a_new_current():
    skipper = brief("skipper")
    ways = []
    for weather in (skipper.weather, NORTH):
        rules = Rescuer(skipper, skipper.resources[0])
        body = {"position": (0.0, -900.0, -3.5), "confidence": 0.9, "class": "person_in_water"}
        report = Inbox(messages=(envelope("scout[1]", SPEC, body),))
        rules.act(observe("skipper", 1, weather=skipper.weather), report)
        rules.act(observe("skipper", 2, weather=weather), Inbox())
        (sighting,) = rules._sightings.known
        ways.append(rules._sightings.where(sighting, 30.0))
    assert ways[1][1] - ways[0][1] > 15.0
