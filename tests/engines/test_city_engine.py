"""The city engine: targets drift and bob, stay in the water, and are served once unlocked and reached."""

import math

import pytest
from pytest import approx

from lingjing.engines import sea
from lingjing.engines.city.engine import CityEngine
from lingjing.mission.instance import Weather
from lingjing.trace.records import BodyState

CURRENT = Weather(current_mps=0.15, current_to_deg=60.0, wave_height_m=0.5)


@pytest.fixture
def drift(player, instance_of, boat, uav, victim, open_sea):
    def start(weather=CURRENT, city=open_sea, seed=1, victims=None):
        entities = [boat(), uav(), *(victims or [victim()])]
        return player(CityEngine(), instance_of(entities, weather), city, "city", seed)

    return start


def afloat(east, velocity=(0.0, 0.0, 0.0), name="boat"):
    return BodyState(id=name, position=(east, 0.0, -3.5), velocity=velocity, heading_deg=33.0)


def unlock(play, name="rescue", target="victim[1]"):
    return play.command(target, f"unlock.{name}", origin="kernel")


def test_a_target_drifts_with_the_current_at_its_own_speed(drift):
    play = drift()
    play.run(600.0)
    x, y, _ = play.state.position
    assert math.hypot(x, y) == approx(60.0, abs=15.0)
    assert math.degrees(math.atan2(x, y)) == approx(60.0, abs=15.0)
    assert play.state.status == "adrift"


def test_a_target_drifts_with_the_wind_if_there_is_no_current(drift):
    play = drift(Weather(wind_mps=5.0, wind_from_deg=270.0))
    play.run(300.0)
    assert play.state.position[0] == approx(30.0, abs=10.0)


def test_a_target_without_wind_and_current_stays_in_place(drift):
    play = drift(Weather())
    assert play.run(60.0).states[0].position == (0.0, 0.0, -3.5)


def test_the_drift_of_a_target_depends_on_seed_and_target(drift, victim):
    pair = [victim(1), victim(2, (0.0, 0.0, -3.5))]
    ends = [state.position for seed in (1, 2) for state in drift(seed=seed, victims=pair).run(100.0).states]
    assert len(set(ends)) == 4


def test_a_target_moves_vertically_with_the_waves(drift):
    play = drift()
    play.run(20.0)
    x, y, z = play.state.position
    assert z == approx(-3.5 + sea.elevation(sea.waves(CURRENT), x, y, 20.0))


def test_a_drifting_target_stays_in_the_water(drift, quay, victim):
    play = drift(
        Weather(current_mps=0.5, current_to_deg=90.0), quay, victims=[victim(1, (-45.0, 0.0, -3.5), drift_mps=0.5)]
    )
    play.run(300.0)
    for boundary in play.history:
        x, y, _ = boundary.states[0].position
        assert not (abs(x) < 40.0 and abs(y) < 40.0)


def test_an_interaction_does_not_happen_without_an_unlock(drift):
    play = drift()
    play.run(20.0, (afloat(5.0),))
    assert play.events == []
    assert play.state.status == "adrift"


def test_an_unlocked_interaction_happens_when_the_actor_is_there(drift):
    play = drift()
    assert unlock(play).status == "accepted"
    play.run(5.0, (afloat(80.0),))
    assert play.events == []
    play.step((afloat(40.0),))
    (event,) = play.events
    assert (event.kind, event.entities, event.time_s) == ("rescue", ("victim[1]", "boat"), 5.5)
    assert event.values["distance_m"] == approx(40.0, abs=1.0)
    assert play.state.status == "rescued"
    play.run(10.0, (afloat(20.0),))
    assert len(play.events) == 1


def test_an_unlock_completes_and_may_be_repeated(drift):
    play = drift()
    first, second = unlock(play), unlock(play)
    assert (first.status, second.status) == ("accepted", "accepted")
    play.step()
    assert [(r.request, r.status) for r in play.receipts] == [
        (first.request, "completed"),
        (second.request, "completed"),
    ]


@pytest.mark.parametrize(("east", "happens"), [(50.0, True), (50.001, False)])
def test_the_radius_is_inclusive(drift, east, happens):
    play = drift(Weather())
    unlock(play)
    play.step((afloat(east),))
    assert bool(play.events) == happens


def test_mirrors_are_extrapolated_to_the_end_of_the_interval(drift):
    play = drift(Weather())
    unlock(play)
    play.step((afloat(51.0, velocity=(-3.0, 0.0, 0.0)),))
    assert play.events[0].values["distance_m"] == approx(49.5)


def test_only_bodies_of_the_named_engine_interact(drift):
    play = drift(Weather())
    unlock(play)
    play.step((afloat(1.0, name="uav[1]"), afloat(60.0)))
    assert play.events == []


def test_a_rescued_target_moves_with_its_rescuer(drift):
    play = drift()
    unlock(play)
    play.step((afloat(10.0),))
    play.step((afloat(100.0, velocity=(2.0, 0.0, 0.0)),))
    assert play.state.position == (101.0, 0.0, -3.5)
    assert play.state.velocity == (2.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("verb", "origin", "target", "reason"),
    [
        ("unlock.rescue", "agent", "victim[1]", "no_authority"),
        ("unlock.extinguish", "kernel", "victim[1]", "unknown_verb"),
        ("takeoff", "kernel", "victim[1]", "unknown_verb"),
        ("unlock.rescue", "kernel", "victim[9]", "unknown_resource"),
    ],
)
def test_commands_other_than_unlocks_are_refused(drift, verb, origin, target, reason):
    receipt = drift().command(target, verb, origin=origin)
    assert (receipt.status, receipt.reason) == ("rejected", reason)
