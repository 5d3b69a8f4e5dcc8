"""The rows of the adjudication table where an actor's place alone decides: VDN, IDF and CD."""

from __future__ import annotations

import pytest

from lingjing.testing import CENTRE_BOX, does, reports, says, together
from tests.missions import staging as kit

edge = pytest.mark.parametrize(("beyond", "counts"), [(0.0, True), (-0.01, True), (0.01, False)])


# -- VDN: the dog within 30 m of the building


@edge
def test_the_dog_arrives_within_thirty_metres_inclusively(beyond, counts):
    with kit.playing("vdn") as play:
        play.put("dog", "home", east=-(30.0 + beyond))
        play.wait(3)
        assert play.emitted() == (["arrive home"] if counts else [])
        assert play.kinds() == ([("arrived", "home")] if counts else [])
        assert play.success is counts


def test_a_dog_outside_the_compound_has_not_arrived_even_near_the_building():
    """The wall is in between: the target region lies inside the compound."""
    with kit.playing("vdn") as play:
        house = play.entity("home")
        assert house.position[1] < -119, "this seed's house stands near the southern wall"
        play.put("dog", "home", north=-30.0)  # 30 m from the house, beyond the wall at -150 m
        assert play.stage.places["dog"][1] < -150.0
        play.wait(3)
        assert play.emitted() == play.kinds() == []


def test_a_dog_that_stops_has_not_arrived():
    with kit.playing("vdn") as play:
        for _ in range(3):
            play.do({"navigator": does("stop")})
        assert play.kinds() == [] and not play.done


def test_each_subtask_has_forty_ticks():
    """A dog that never enters the compound fails in its first subtask, long before the 140 ticks of the mission."""
    with kit.playing("vdn") as play:
        assert play.instance.budget.ticks == 140
        play.wait(39)
        assert not play.done
        play.do()
        assert play.published.evaluation.reason == "late"
        assert play.published.evaluation.detail.startswith("the stage `enter` was not done in the 40 ticks")


def test_a_subtask_done_in_its_last_tick_is_in_time():
    with kit.playing("vdn") as play:
        play.wait(39)
        play.stage.places["dog"] = (5.0, -100.0, 0.0)
        play.do()
        assert play.stages() == ["enter"] and not play.done


# -- IDF: a dog within 2 m of each fire, and the engine's event that it is extinguished


@edge
def test_a_dog_extinguishes_a_fire_within_two_metres_inclusively(beyond, counts):
    with kit.playing("idf", fires=1.0) as play:
        play.put("dog[2]", "fire[1]", north=2.0 + beyond)
        play.wait(5)
        assert play.emitted() == (["extinguish fire[1]"] if counts else [])
        assert play.success is counts


def test_a_dog_that_leaves_early_does_not_extinguish_the_fire():
    """If the dog leaves before the fire is out, the fire burns on and grows again."""
    with kit.playing("idf", fires=1.0) as play:
        play.put("dog[1]", "fire[1]")
        play.do()
        play.stage.places.pop("dog[1]")
        play.wait(5)
        assert play.emitted() == [] and not play.done


def test_success_requires_every_fire_to_be_extinguished():
    with kit.playing("idf") as play:
        fires = [entity.id for entity in play.instance.entities if entity.group == "fire"]
        for name in fires:
            assert not play.done
            play.put("dog[3]", name)
            play.wait(4)
        assert play.emitted() == [f"extinguish {name}" for name in fires]
        assert play.success


def test_a_claim_that_a_fire_is_extinguished_does_not_count():
    with kit.playing("idf", fires=1.0) as play:
        place = play.entity("fire[1]").position[:2]
        play.do({"searcher[1]": does("takePhoto")})
        claim = reports("sighting", "f1-dog[1]-front", "fire_source", place)
        out = says("progress", task="fire[1]", state="extinguished")
        play.do({"searcher[1]": together(claim, out)})
        play.wait(3)
        assert ("accepted", "") in play.reasons("searcher[1]")
        assert play.kinds() == [] and play.emitted() == [] and not play.done


def test_a_sighting_is_matched_by_its_box_and_does_not_extinguish_the_fire():
    with kit.playing("idf", fires=1.0) as play:
        play.stage.boxes = {"fire[1]": CENTRE_BOX}
        play.do({"searcher[2]": does("takePhoto")})
        place = play.entity("fire[1]").position[:2]
        play.do({"searcher[2]": reports("sighting", "f1-dog[2]-front", "fire_source", place, kit.shifted(0.499))})
        assert play.stages() == []
        play.do({"searcher[2]": reports("sighting", "f1-dog[2]-front", "fire_source", place, kit.shifted(0.501))})
        assert play.stages() == ["detect fire[1]"] and not play.done


# -- CD: deliveries within 30 m, loading within 50 m, 200 kg a van


def demand(play, name):
    state = {each.id: each for each in play.published.record.snapshots[-1].states}[name]
    return state.resources["demand"]


def load(play, name):
    state = {each.id: each for each in play.published.record.snapshots[-1].states}[name]
    return state.resources["load_kg"]


def moved(play, kind):
    """(target, van, kilograms) of the engine's events of a kind."""
    events = [event for boundary in play.all for event in boundary.record.task_events if event.kind == kind]
    return [(*event.entities, event.values["amount_kg"]) for event in events]


modes = pytest.mark.parametrize("mode", ["star", "broadcast"])


def spread_out(play):
    """Stand the vans apart from everything, so that nothing happens by itself."""
    for number in range(1, 6):
        play.stage.places[f"van[{number}]"] = (2000.0 + 100.0 * number, 2000.0, 0.0)


@modes
@edge
def test_a_van_delivers_within_thirty_metres_inclusively(mode, beyond, counts):
    with kit.playing("cd", mode, points=5.0) as play:
        spread_out(play)
        play.do()
        play.put("van[1]", "point[2]", east=-(30.0 + beyond))
        play.wait(2)
        assert moved(play, "deliver") == ([("point[2]", "van[1]", 100.0)] if counts else [])
        assert play.kinds() == ([("served", "point[2]")] if counts else [])
        assert demand(play, "point[2]") == (0.0 if counts else 100.0)
        assert load(play, "van[1]") == (100.0 if counts else 200.0)


@modes
@edge
def test_a_van_loads_within_fifty_metres_of_the_warehouse_inclusively(mode, beyond, counts):
    with kit.playing("cd", mode, points=5.0) as play:
        spread_out(play)
        play.put("van[2]", "point[3]")
        play.wait(2)
        assert load(play, "van[2]") == 100.0
        play.put("van[2]", "depot", north=-(50.0 + beyond))
        play.wait(3)
        assert moved(play, "restock") == ([("depot", "van[2]", 100.0)] if counts else [])
        assert load(play, "van[2]") == (200.0 if counts else 100.0)


@modes
def test_the_large_order_takes_more_than_one_load(mode):
    """The demand is 250 kg and a van holds 200 kg. A longer stay delivers nothing more."""
    with kit.playing("cd", mode, points=5.0) as play:
        spread_out(play)
        play.put("van[1]", "point[1]")
        play.wait(5)
        assert moved(play, "deliver") == [("point[1]", "van[1]", 200.0)]
        assert demand(play, "point[1]") == 50.0 and load(play, "van[1]") == 0.0
        assert play.kinds() == []
        play.put("van[2]", "point[1]")
        play.wait(2)
        assert moved(play, "deliver")[1:] == [("point[1]", "van[2]", 50.0)]
        assert play.kinds() == [("served", "point[1]")]
        assert load(play, "van[2]") == 150.0


@modes
def test_one_van_may_split_the_order_over_two_trips(mode):
    with kit.playing("cd", mode, points=5.0) as play:
        spread_out(play)
        for stop in ("point[1]", "depot", "point[1]"):
            play.put("van[4]", stop)
            play.wait(3)
        assert [amount for *_, amount in moved(play, "deliver")] == [200.0, 50.0]
        assert play.kinds() == [("served", "point[1]")]


@modes
def test_delivery_claims_of_drivers_do_not_count(mode):
    with kit.playing("cd", mode, points=5.0) as play:
        spread_out(play)
        play.do()
        for number in range(1, 6):
            play.do({"driver[1]": says("handover", stop=f"point[{number}]", delivered=250.0, left=0.0)})
        play.do()
        assert play.reasons("driver[1]") == [("accepted", "")] * 5
        assert demand(play, "point[1]") == 250.0
        assert play.kinds() == [] and play.published.evaluation.reward == 0.0


@modes
def test_the_score_follows_the_deliveries_that_the_engine_confirms(mode):
    """Points are served one after another; the success is that of the last one."""
    with kit.playing("cd", mode, points=5.0) as play:
        spread_out(play)
        play.do()
        rewards = []
        for number in range(5, 0, -1):
            van = f"van[{number}]"
            play.put(van, f"point[{number}]")
            play.wait(2)
            rewards.append(play.published.evaluation.reward)
        assert rewards == sorted(rewards) and not play.done
        assert demand(play, "point[1]") == 50.0
        play.put("van[5]", "point[1]")
        play.wait(2)
        assert play.success
        delivered = sum(amount for *_, amount in moved(play, "deliver"))
        assert delivered == 250.0 + 4 * 100.0


@modes
def test_a_started_restocking_must_end_before_the_success(mode):
    """All is delivered while a van that is not full drives to the warehouse. This van has to load first."""
    with kit.playing("cd", mode, points=5.0) as play:
        spread_out(play)
        play.put("van[3]", "point[5]")
        play.wait(2)
        play.do({"driver[3]": does("setDestination", x=0.0, y=0.0)})
        play.stage.places["van[3]"] = (2000.0, 0.0, 0.0)
        for van, point in (("van[1]", 1), ("van[2]", 1), ("van[2]", 2), ("van[4]", 3), ("van[5]", 4)):
            play.put(van, f"point[{point}]")
            play.wait(2)
        assert sum(amount for *_, amount in moved(play, "deliver")) == 250.0 + 4 * 100.0
        assert not play.done
        play.put("van[3]", "depot", east=50.001)
        play.wait(2)
        assert not play.done
        play.put("van[3]", "depot", east=49.999)
        play.wait(2)
        assert moved(play, "restock")[-1] == ("depot", "van[3]", 100.0)
        assert play.success


def test_an_empty_van_delivers_nothing():
    with kit.playing("cd", points=5.0) as play:
        spread_out(play)
        play.put("van[1]", "point[1]")
        play.wait(2)
        play.put("van[1]", "point[2]")
        play.wait(3)
        assert [target for target, *_ in moved(play, "deliver")] == ["point[1]"]
        assert demand(play, "point[2]") == 100.0
