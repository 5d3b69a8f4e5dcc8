"""The rows of the adjudication table with an inspected route: LD and CR, in their order."""

from __future__ import annotations

import msgspec
import pytest

from lingjing.testing import Stage, does, says
from tests.missions import staging as kit

edge = pytest.mark.parametrize(("beyond", "counts"), [(0.0, True), (-0.01, True), (0.01, False)])

FIRST = (-304.0, -200.0, 0.0)
SECOND = (-304.0, 0.0, 0.0)
OTHER = (-104.0, -304.0, 0.0)
"""Waypoints of routes, on whole metres and away from every jam of these seeds."""

GOALS = {"ld": "stop_node", "cr": "goal_place"}
both_missions = pytest.mark.parametrize("name", ["ld", "cr"])


def opened(name, **settings):
    """An episode with a van on the route FIRST, SECOND, goal, and after a replan on OTHER, goal."""
    instance = kit.still(kit.staged(name, None, 0, tuple(sorted(settings.items())))[0])
    goal = next(entity.position for entity in instance.entities if entity.id == GOALS[name])
    stage = Stage(routes=[(FIRST, SECOND, goal), (OTHER, goal)])
    return kit.playing(name, stage=stage, instance=instance, **settings)


def look_at(play, *places):
    """Fly the UAV over the places, one a tick."""
    for x, y, *_ in places:
        play.stage.places["uav"] = (x, y, 60.0)
        play.do()


def inspect(play, name):
    play.do()  # the route is planned at the first boundary
    look_at(play, FIRST, SECOND, play.entity(GOALS[name]).position)


# -- the inspection


@both_missions
@edge
def test_a_waypoint_is_inspected_within_twenty_five_metres_inclusively(name, beyond, counts):
    with opened(name) as play:
        play.do()
        look_at(play, (FIRST[0] - 25.0 - beyond, FIRST[1]), SECOND, play.entity(GOALS[name]).position)
        assert (play.stages() == ["inspect"]) is counts


@both_missions
def test_waypoints_must_be_inspected_in_order(name):
    with opened(name) as play:
        play.do()
        look_at(play, SECOND, FIRST, play.entity(GOALS[name]).position)
        assert play.stages() == []
        look_at(play, SECOND, play.entity(GOALS[name]).position)
        assert play.stages() == ["inspect"]


@both_missions
def test_the_van_may_not_drive_before_its_route_is_inspected(name):
    with opened(name) as play:
        x, y, _ = play.entity(GOALS[name]).position
        play.do()
        play.do({"driver": does("setDestination", x=x, y=y)})
        assert ("rejected", "not_permitted") in play.reasons("driver")
        look_at(play, FIRST, SECOND, (x, y))
        play.do({"driver": does("setDestination", x=x, y=y)})
        assert play.reasons("driver")[1:] == [("accepted", ""), ("completed", "")]


@both_missions
def test_a_van_at_the_goal_of_an_uninspected_route_has_not_arrived(name):
    """Reports of a clear route make no difference."""
    with opened(name) as play:
        play.put("van", GOALS[name])
        hub = {"driver": says("progress", task="arrive", state="done")}
        play.do({**hub, "inspector": says("progress", task="inspect", state="clear")})
        play.wait(3)
        assert ("accepted", "") in play.reasons("driver") and ("accepted", "") in play.reasons("inspector")
        assert play.emitted() == play.kinds() == [] and not play.done


@both_missions
@edge
def test_the_van_arrives_within_thirty_metres_inclusively(name, beyond, counts):
    with opened(name) as play:
        inspect(play, name)
        assert play.emitted() == []
        play.put("van", GOALS[name], east=-(30.0 + beyond))
        play.wait(3)
        arrived = {"ld": "driven", "cr": "arrived"}[name]
        assert play.emitted() == ([f"arrive {GOALS[name]}"] if counts else [])
        assert play.kinds() == ([(arrived, GOALS[name])] if counts else [])
        assert play.success is (counts and name == "cr")


@both_missions
def test_a_replan_restarts_the_inspection(name):
    with opened(name) as play:
        inspect(play, name)
        assert play.stages() == ["inspect"]
        play.do({"inspector": says("jammed", waypoint=2, position=SECOND[:2])})
        x, y, _ = play.entity(GOALS[name]).position
        play.do({"driver": does("setDestination", x=x, y=y)})
        assert ("rejected", "not_permitted") in play.reasons("driver")
        play.put("van", GOALS[name])
        play.wait(2)
        arrived = {"ld": "driven", "cr": "arrived"}[name]
        assert (arrived, GOALS[name]) not in play.kinds()
        look_at(play, OTHER, (x, y))
        play.do()
        assert (arrived, GOALS[name]) in play.kinds()


# -- congestion


@both_missions
@edge
def test_congestion_is_recorded_within_twenty_five_metres_inclusively(name, beyond, counts):
    with opened(name) as play:
        x, y, _ = play.entity("jam[1]").position
        look_at(play, (x, y + 25.0 + beyond))
        play.wait(2)
        assert play.emitted() == (["record jam[1]"] if counts else [])


@both_missions
def test_congestion_is_recorded_by_a_uav_that_flies_over_it_within_a_tick(name):
    """At both boundaries it is 120 m away; in between, for 4 s of 20 s, it is near enough."""
    with opened(name) as play:
        play.do()
        x, y, _ = play.entity("jam[1]").position
        begin = play.published.record.time_s
        play.stage.places["uav"] = lambda time_s: (x, y - 120.0 + 12.0 * (time_s - begin), 60.0)
        play.do()
        assert play.emitted() == ["record jam[1]"]
        assert abs(play.stage.places["uav"](play.published.record.time_s)[1] - y) > 100.0


def test_congestion_that_is_only_claimed_is_not_recorded():
    """The policy reports the exact place of the jam, but the UAV has never been near it."""
    with opened("cr") as play:
        play.do()
        play.do({"inspector": says("jammed", waypoint=1, position=play.entity("jam[1]").position[:2])})
        play.wait(2)
        assert play.emitted() == play.kinds() == []


@pytest.mark.parametrize("name", ["ld", "cr"])
def test_a_route_with_a_jam_on_it_is_not_verified_by_flying_over_it(name):
    """The UAV has visited every waypoint, and no report of a jam was sent. The arrival counts only after a replan."""
    with opened(name) as play:
        jam, goal = play.entity("jam[1]").position, play.entity(GOALS[name]).position
        play.stage.routes[0] = (FIRST, jam, goal)
        play.do()
        look_at(play, FIRST, jam, goal)
        play.put("van", GOALS[name])
        play.wait(2)
        arrived = {"ld": "driven", "cr": "arrived"}[name]
        assert (arrived, GOALS[name]) not in play.kinds() and not play.done
        play.do({"inspector": says("jammed", waypoint=2, position=jam[:2])})
        look_at(play, OTHER, goal)
        play.wait(2)
        assert (arrived, GOALS[name]) in play.kinds()


@pytest.mark.parametrize(("radius", "beside", "verified"), [
    (None, 14.9, False), (None, 15.1, True), (4.0, 14.9, False), (20.0, 19.9, False), (20.0, 20.1, True),
])  # fmt: skip
def test_a_jam_without_a_radius_blocks_the_length_of_its_queue(radius, beside, verified):
    """The road engine lets vehicles queue within the radius of the jam, 15 m at least."""
    with opened("cr") as play:
        jam, goal = play.entity("jam[1]"), play.entity(GOALS["cr"]).position
    others = {key: value for key, value in jam.properties.items() if key != "radius_m"}
    narrow = msgspec.structs.replace(jam, properties=others | ({} if radius is None else {"radius_m": radius}))
    instance = kit.still(kit.staged("cr", None, 0, ())[0])
    entities = tuple(narrow if entity.id == jam.id else entity for entity in instance.entities)
    place = (jam.position[0] + beside, jam.position[1], 0.0)
    stage = Stage(routes=[(FIRST, place, goal)])
    with kit.playing("cr", stage=stage, instance=msgspec.structs.replace(instance, entities=entities)) as play:
        play.do()
        look_at(play, FIRST, place, goal)
        play.put("van", GOALS["cr"])
        play.wait(2)
        assert (("arrived", GOALS["cr"]) in play.kinds()) is verified


@pytest.mark.parametrize(("off", "named", "wins"), [
    (12.0, 2, True), (12.1, 2, False), (0.0, 1, False), (0.0, 0, False),
])  # fmt: skip
def test_at_tier_1_a_route_counts_only_after_both_jams_were_reported_at_their_places(off, named, wins):
    """The route is clear in each case: a player that names wrong places, or none, may have it by chance."""
    instance = kit.still(kit.staged("cr", None, 0, (("evidence", 1.0),))[0])
    checks = tuple(msgspec.structs.replace(check, pictured=False) for check in instance.inspections)
    instance = msgspec.structs.replace(instance, inspections=checks)
    goal = next(entity.position for entity in instance.entities if entity.id == GOALS["cr"])
    stage = Stage(routes=[(FIRST, goal), (OTHER, goal), (FIRST, SECOND, goal)])
    with kit.playing("cr", stage=stage, instance=instance) as play:
        play.do()
        for number in range(1, named + 1):
            x, y, _ = play.entity(f"jam[{number}]").position
            play.do({"inspector": says("jammed", waypoint=1, position=(x + off, y))})
            play.wait(1)
        look_at(play, *play.stage.routes[named])
        play.put("van", GOALS["cr"])
        play.wait(2)
        assert ("arrived", GOALS["cr"]) in play.kinds()
        assert (play.done and play.success) is wins


@pytest.mark.parametrize("most", [0.0, 3.0, 6.0])
def test_replans_are_limited(most):
    with opened("cr", replans_most=most) as play:
        play.do()
        for _ in range(int(most) + 1):
            play.do({"inspector": says("jammed", waypoint=1, position=FIRST[:2])})
        outcomes = [status for status, _ in play.reasons("inspector")]
        assert outcomes == ["accepted"] * int(most) + ["rejected"]
        routes = [route.number for boundary in play.all for route in boundary.record.routes]
        assert routes == list(range(1, int(most) + 2))


# -- LD: the dog, last


def delivered_to_the_stop(play):
    inspect(play, "ld")
    play.put("van", "stop_node")
    play.wait(2)


@edge
def test_the_dog_delivers_within_the_target_house_region_inclusively(beyond, counts):
    with opened("ld") as play:
        delivered_to_the_stop(play)
        assert play.kinds() == [("driven", "stop_node")] and not play.done
        play.put("dog", "house", north=-(15.0 + beyond))
        play.wait(3)
        assert play.kinds()[1:] == ([("delivered", "house")] if counts else [])
        assert play.success is counts
        order = [stage for stage in play.stages() if stage != "guide_in"]
        assert order == ["inspect", "drive", *(["deliver"] if counts else [])]


def test_a_dog_at_the_house_before_the_van_has_arrived_has_delivered_nothing():
    with opened("ld") as play:
        play.put("dog", "house")
        play.wait(3)
        assert play.emitted() == [] and not play.done
        inspect(play, "ld")
        play.wait(3)
        assert "receive house" not in play.emitted() and not play.done


def test_the_dog_may_not_move_before_the_van_has_arrived():
    with opened("ld") as play:
        play.do({"courier": does("forward", distance=5.0)})
        assert play.reasons("courier") == [("rejected", "not_permitted")]
        delivered_to_the_stop(play)
        play.do({"courier": does("forward", distance=5.0)})
        assert play.reasons("courier")[1:] == [("accepted", ""), ("completed", "")]


@pytest.mark.parametrize("most", [10.0, 25.0])
def test_moves_of_the_inspector_are_limited(most):
    with opened("ld", moves_most=most) as play:
        for _ in range(int(most) + 1):
            play.do({"inspector": does("takeoff")})
            if play.done:
                break
        outcomes = [status for status, _ in play.reasons("inspector") if status != "completed"]
        assert outcomes.count("accepted") == min(int(most), play.instance.budget.ticks)
        assert outcomes[int(most) :] == ["rejected"]


def test_steps_of_the_dog_do_not_count_as_moves():
    with opened("ld", moves_most=10.0) as play:
        delivered_to_the_stop(play)
        for _ in range(12):
            play.do({"courier": does("forward", distance=1.0)})
        assert [status for status, _ in play.reasons("courier")].count("accepted") == 12
