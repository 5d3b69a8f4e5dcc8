"""Targets alone and with interactions: fires, leaks, goods, queues, jams, late targets, weather."""

import msgspec
import pytest
from pytest import approx

from lingjing.engines.city.engine import CityEngine
from lingjing.engines.city.target import entity_nature
from lingjing.errors import UsageError
from lingjing.mission.instance import AgentSpec, Clock, Entity, EventSpec, InteractionSpec, StateSpec, Weather
from lingjing.plugins.engine import EngineSpec
from lingjing.scene.city import City
from lingjing.trace.records import BodyState

DRY = City(id="dry", origin=(31.0, 121.5), bounds=(-1000.0, -1000.0, 1000.0, 1000.0))


def specs(fields):
    """`demand_kg` is the state `demand` in kilograms."""
    return tuple(StateSpec(name=name, unit=unit) for name, _, unit in (field.partition("_") for field in fields))


def act(name, by, within_m, **more):
    return InteractionSpec(name=name, by=by, within_m=within_m, **more)


def target(name, *acts, position=(0.0, 0.0, 0.0), state=(), dormant=False, **properties):
    return Entity(
        id=name,
        group=name.partition("[")[0],
        index=0,
        role="target",
        type="thing",
        engine="city",
        position=position,
        properties=properties,
        state=specs(state),
        dormant=dormant,
        interactions=acts,
    )


def actor(name, engine, state=(), **properties):
    return Entity(
        id=name,
        group=name.partition("[")[0],
        index=0,
        role="asset",
        type="mover",
        engine=engine,
        position=(500.0, 0.0, 0.0),
        properties=properties,
        state=specs(state),
    )


def fire(lasting_s=None, **more):
    put_out = act("extinguish", "road", 30.0, lasting_s=lasting_s)
    return target("fire", put_out, state=("heat",), **{"heat": 1.0, **more})


def leak(**more):
    return target("leak", act("seal", "quadruped", 5.0), state=("flow",), flow=1.0, **more)


def point(name="point[1]", demand=250.0, x=0.0):
    return target(
        name,
        act("deliver", "road", 30.0, takes="demand", source="load", status="served"),
        position=(x, 0.0, 0.0),
        state=("demand_kg",),
        demand_kg=demand,
    )


def depot():
    return target(
        "depot",
        act("restock", "road", 50.0, gives="load", up_to="payload", status="open"),
        position=(300.0, 0.0, 0.0),
    )


def van(number):
    return actor(f"van[{number}]", "road", state=("load_kg",), load_kg=200.0, payload_kg=200.0)


TRUCK, DOG = actor("truck", "road"), actor("dog", "quadruped")


@pytest.fixture
def play(player, instance_of):
    def start(*entities, weather=None, city=DRY, sync_s=0.5, seed=1, **changes):
        instance = msgspec.structs.replace(instance_of(entities, weather, sync_s), **changes)
        played = player(CityEngine(), instance, city, "city", seed)
        for entity in entities:
            for interaction in entity.interactions:
                assert played.command(entity.id, f"unlock.{interaction.name}", origin="kernel").status == "accepted"
        return played

    return start


def at(name, x, y=0.0, velocity=(0.0, 0.0, 0.0), status=""):
    return BodyState(id=name, position=(x, y, 0.0), velocity=velocity, status=status)


def states(played):
    return {state.id: state for state in played.boundary.states}


@pytest.mark.parametrize(("x", "reached"), [(29.999, True), (30.0, True), (30.001, False)])
def test_a_fire_goes_out_while_the_truck_stays_within_reach(play, x, reached):
    played = play(fire(), TRUCK)
    assert (played.state.status, played.state.resources) == ("burning", {"heat": 1.0})
    played.step((at("truck", x),))
    assert played.state.resources["heat"] == 1.0  # the truck may arrive exactly at the interval's end
    played.run(5.0, (at("truck", x),))
    assert played.state.resources["heat"] == (approx(0.5) if reached else 1.0)
    played.run(20.0, (at("truck", x),))
    assert [(event.kind, event.entities, event.time_s) for event in played.events] == (
        [("extinguish", ("fire", "truck"), approx(10.5))] if reached else []
    )
    assert played.state.status == ("out" if reached else "burning")
    assert played.state.resources["heat"] == (0.0 if reached else 1.0)


def test_a_fire_without_a_truck_recovers_to_its_full_heat(play):
    played = play(fire(), TRUCK)
    played.run(5.5, (at("truck", 10.0),))
    assert played.state.resources["heat"] == approx(0.5)
    played.run(15.0)
    assert played.state.resources["heat"] == approx(0.75)
    played.run(60.0)
    assert played.state.resources["heat"] == 1.0
    assert played.events == []


def test_driving_past_a_fire_does_not_put_it_out(play):
    played = play(fire(), TRUCK)
    for step in range(40):
        played.step((at("truck", -140.0 + 7.0 * step, velocity=(14.0, 0.0, 0.0)),))
    assert played.events == []


def test_a_type_declares_how_long_an_interaction_lasts(play):
    played = play(fire(lasting_s=0.0), TRUCK)
    played.step((at("truck", 30.0),))
    assert [event.time_s for event in played.events] == [0.5]
    slow = play(fire(lasting_s=60.0, heat=0.5), TRUCK)
    slow.run(40.0, (at("truck", 30.0),))
    assert [event.time_s for event in slow.events] == [approx(30.5)]


def test_a_leak_flows_until_it_is_sealed_and_keeps_the_progress(play):
    played = play(leak(), DOG)
    played.run(3.0, (at("dog", 5.0),))
    assert (played.state.status, played.state.resources["flow"]) == ("leaking", approx(0.5))
    played.run(30.0)
    assert played.state.resources["flow"] == approx(0.5)
    played.run(3.0, (at("dog", 5.0),))
    assert (played.state.status, played.state.resources["flow"]) == ("sealed", 0.0)
    assert [event.kind for event in played.events] == ["seal"]


def test_an_interaction_restarts_when_another_actor_takes_over(play):
    door = target("door", act("receive", "road", 15.0, lasting_s=4.0, status="served"))
    played = play(door, van(1), van(2))
    for number in range(20):  # the actors alternate every two seconds
        played.step((at(f"van[{1 + number // 4 % 2}]", 5.0),))
    assert played.events == []
    played.run(5.0, (at("van[2]", 5.0),))
    assert [event.entities for event in played.events] == [("door", "van[2]")]
    assert played.state.status == "served"


def test_an_order_larger_than_one_load_is_split_between_vans_until_it_is_complete(play):
    played = play(point(), depot(), van(1), van(2))
    played.step((at("van[1]", 30.0), at("van[2]", 30.001)))
    assert [(e.entities, e.values["amount_kg"], e.values["left_kg"]) for e in played.events] == [
        (("point[1]", "van[1]"), 200.0, 50.0)
    ]
    order = states(played)["point[1]"]
    assert (order.status, order.resources) == ("waiting", {"demand": 50.0, "load@van[1]": -200.0})
    played.run(5.0, (at("van[1]", 0.0),))
    assert len(played.events) == 1  # an empty van delivers nothing
    played.step((at("van[2]", 30.0),))
    order = states(played)["point[1]"]
    assert played.events[-1].values["amount_kg"] == 50.0
    assert (order.status, order.resources["demand"]) == ("served", 0.0)
    assert order.resources["load@van[2]"] == -50.0


@pytest.mark.parametrize(("x", "filled"), [(250.0, True), (249.999, False)])
def test_a_van_is_filled_at_the_warehouse_up_to_its_payload(play, x, filled):
    played = play(point(demand=120.0), depot(), van(1))
    played.step((at("van[1]", 0.0),))
    played.step((at("van[1]", x),))
    restocks = [event for event in played.events if event.kind == "restock"]
    assert [event.values["amount_kg"] for event in restocks] == ([120.0] if filled else [])
    assert states(played)["depot"].resources == ({"load@van[1]": 120.0} if filled else {})
    assert states(played)["depot"].status == "open"
    played.run(5.0, (at("van[1]", x),))
    assert len([event for event in played.events if event.kind == "restock"]) == len(restocks)


def test_the_nearest_van_serves_and_ties_follow_the_order_of_declaration(play):
    near = play(point(demand=100.0), van(1), van(2))
    near.step((at("van[1]", 20.0), at("van[2]", -10.0)))
    assert near.events[0].entities == ("point[1]", "van[2]")
    same = play(point(demand=100.0), van(1), van(2))
    same.step((at("van[1]", 20.0), at("van[2]", -20.0)))
    assert same.events[0].entities == ("point[1]", "van[1]")


def test_the_load_of_a_van_is_not_delivered_twice_to_two_points_in_reach(play):
    points = [point("point[1]", 150.0), point("point[2]", 150.0, x=10.0)]
    played = play(*points, van(1))
    played.run(3.0, (at("van[1]", 5.0),))
    assert [event.values["amount_kg"] for event in played.events] == [150.0, 50.0]
    assert sum(state.resources["load@van[1]"] for state in played.boundary.states) == -200.0


def test_a_stock_of_the_target_runs_out(play):
    collect = act("collect", "vessel", 20.0, lasting_s=2.0, gives="cargo", source="content", status="collected")
    barrel = target("barrel", collect, state=("content_kg",), content_kg=200.0)
    played = play(barrel, actor("boat", "vessel", state=("cargo_kg",), cargo_kg=0.0))
    played.run(2.0, (at("boat", 20.0),))
    assert played.events == []
    played.run(1.0, (at("boat", 20.0),))
    assert [event.values["amount_kg"] for event in played.events] == [200.0]
    assert (played.state.status, played.state.resources) == ("collected", {"content": 0.0, "cargo@boat": 200.0})


def test_an_interaction_that_gives_without_limit_is_a_usage_error(instance_of):
    spring = target("spring", act("fill", "road", 10.0, gives="load"))
    instance = instance_of([spring, van(1)])
    with pytest.raises(UsageError, match="`fill` of `spring` gives `van\\[1\\]` `load` without end"):
        CityEngine().reset(EngineSpec(engine="city", instance=instance, owns=("spring",)), DRY, 1)


def test_a_recorded_jam_blocks_until_its_event_clears_it(play):
    jam = target("jam", act("record", "multirotor", 25.0, status="recorded"), blocks=True)
    clears = EventSpec(name="clears", tick=2, vanish=("jam",))
    played = play(jam, actor("uav", "multirotor"), events=(clears,))
    played.run(10.0, (at("uav", 25.0),))
    assert [event.kind for event in played.events] == ["record"]
    assert played.state.status == "blocking"
    played.run(9.5)
    assert played.state.status == "blocking"
    played.step()
    assert played.state.status == "cleared"


def test_a_target_before_its_appearance_is_dormant(play):
    late = msgspec.structs.replace(point(demand=50.0), dormant=True)
    comes = EventSpec(name="order", tick=1, appear=("point[1]",))
    played = play(late, van(1), events=(comes,))
    played.run(9.5, (at("van[1]", 0.0),))
    assert (played.state.status, played.events) == ("dormant", [])
    played.step((at("van[1]", 0.0),))
    assert played.time_s == 10.0
    assert (played.state.status, [event.time_s for event in played.events]) == ("served", [10.0])


@pytest.mark.parametrize("status", ["dormant", "dead"])
def test_a_dormant_or_dead_actor_does_not_interact(play, status):
    played = play(leak(), DOG)
    played.run(20.0, (at("dog", 0.0, status=status),))
    assert played.events == []


def test_a_role_acts_only_with_the_bodies_of_its_agents(play):
    helped = target("crash", act("help", "medic", 30.0))
    medic = AgentSpec(
        id="medic", name="medic", index=0, role="medic", controls=("dog",), commands=("dog",), observes=()
    )
    played = play(helped, TRUCK, DOG, actor("cat", "quadruped"), agents=(medic,))
    played.run(0.5, (at("truck", 1.0), at("cat", 1.0), at("dog", 31.0)))
    assert played.events == []
    played.run(0.5, (at("truck", 1.0), at("cat", 1.0), at("dog", 29.0)))
    assert [event.entities for event in played.events] == [("crash", "dog")]


def test_a_queue_grows_and_shrinks_by_its_seed(play):
    def shop(**rates):
        return target("shop", act("join", "quadruped", 5.0), state=("people",), people=4, **rates)

    def counts(seed, **rates):
        played = play(shop(**rates), DOG, seed=seed)
        played.run(600.0)
        return [boundary.states[0].resources["people"] for boundary in played.history]

    assert set(counts(1)) == {4.0}
    grown = counts(1, arrivals_hz=0.05)
    assert grown == counts(1, arrivals_hz=0.05) != counts(2, arrivals_hz=0.05)
    assert grown[-1] == approx(4 + 30, abs=20)
    assert min(counts(3, departures_hz=0.1)) == 0.0
    assert play(shop(), DOG).state.status == "queueing"


def test_a_bridge_fracture_keeps_its_status_and_position(play, open_sea):
    span = target("span", act("inspect", "multirotor", 25.0), position=(0.0, 0.0, 12.0), on="bridge", width_m=8.0)
    played = play(span, actor("uav", "multirotor"), city=open_sea, weather=Weather(wave_height_m=1.0))
    played.run(2.0, (at("uav", 25.0),))
    assert [event.kind for event in played.events] == ["inspect"]
    assert (played.state.status, played.state.position) == ("fractured", (0.0, 0.0, 12.0))


def test_a_type_may_name_its_first_status_word():
    assert entity_nature(target("hydrant", status="frozen")).word == "frozen"
    assert entity_nature(target("goal")).word == "waiting"


def test_a_change_of_the_current_changes_the_drift(play, open_sea):
    swimmer = target("swimmer", position=(0.0, 0.0, -3.5), drift_mps=1.0)
    turn = EventSpec(name="tide", tick=1, weather=Weather(current_mps=0.5, current_to_deg=270.0))
    weather = Weather(current_mps=0.5, current_to_deg=90.0)
    played = play(swimmer, weather=weather, city=open_sea, events=(turn,), clock=Clock(tick_s=60.0, sync_s=0.5))
    played.run(60.0)
    east = played.state.position[0]
    assert east == approx(60.0, abs=25.0)
    played.run(60.0)
    assert played.state.position[0] == approx(east - 60.0, abs=35.0)


def test_a_state_keeps_its_value_until_a_declared_interaction_changes_it(play):
    """Neither a name nor a unit matters: people without arrivals and departures are a stock, in numbers or by mass."""
    for state, up_to in (
        ("people", "seats"),
        ("people_kg", "seats_kg"),
        ("heat_kg", "seats_kg"),
        ("flow_m3", "seats_m3"),
    ):
        board = act("board", "road", 10.0, gives="riders", source=state.partition("_")[0], up_to="seats")
        stop = target("stop", board, state=(state,), **{state: 4.0})
        riders = state.replace(state.partition("_")[0], "riders")
        bus = actor("bus", "road", state=(riders,), **{riders: 0.0, up_to: 3.0})
        played = play(stop, bus)
        played.run(100.0)
        plain = state.partition("_")[0]
        assert played.state.resources == {plain: 4.0}
        played.step((at("bus", 10.0),))
        assert played.state.resources == {plain: 1.0, "riders@bus": 3.0}


def test_people_who_board_leave_the_queue_and_it_keeps_growing(play):
    board = act("board", "road", 10.0, gives="riders", source="people")
    shop = target("shop", board, state=("people",), people=4, arrivals_hz=0.05)
    played = play(shop, actor("bus", "road", state=("riders",), riders=0.0))
    played.run(1.0, (at("bus", 10.0),))
    assert played.state.resources["people"] == 0.0
    played.run(600.0)
    assert played.state.resources["people"] > 10.0


def test_interactions_of_one_target_reduce_only_their_own_states(play):
    depot = target(
        "depot",
        act("drop", "road", 10.0, takes="demand", source="load"),
        act("cool", "quadruped", 2.0, takes="heat", lasting_s=10.0),
        act("wash", "quadruped", 2.0, takes="soot", lasting_s=20.0),
        state=("demand_kg", "heat", "soot_kg"),
        demand_kg=300.0,
        heat=1.0,
        soot_kg=8.0,
    )
    played = play(depot, van(1), DOG)
    played.run(5.5, (at("van[1]", 5.0), at("dog", 1.0)))
    assert played.state.resources == {
        "demand": 100.0, "heat": approx(0.5), "soot": approx(6.0), "load@van[1]": -200.0
    }  # fmt: skip
    played.run(20.0, (at("dog", 1.0),))
    assert [event.kind for event in played.events] == ["drop", "cool", "wash"]


def test_an_actor_without_the_moved_state_takes_no_part(play):
    played = play(point(), TRUCK)
    played.run(5.0, (at("truck", 0.0),))
    assert played.events == []
    assert played.state.resources == {"demand": 250.0}


def test_one_state_in_two_units_is_a_usage_error(instance_of):
    for own in ({"source": "weight"}, {"up_to": "seats"}):
        named = target("crate", act("load", "road", 9.0, gives="load", **own), state=("weight",), weight=5.0)
        with pytest.raises(UsageError, match="`load` of `crate` moves `load` of `van\\[1\\]` in different units"):
            seated = msgspec.structs.replace(van(1), properties={**van(1).properties, "seats": 4.0})
            instance = instance_of([named, seated])
            CityEngine().reset(EngineSpec(engine="city", instance=instance, owns=("crate",)), DRY, 1)
