"""The tenth mission is written in the language alone: three shops, a UAV that counts, a dog that joins one queue."""

from __future__ import annotations

import msgspec
import pytest

from lingjing.kernel.episode import policy_barrier
from lingjing.mission.tasks import declared, matching_members, required_tasks
from lingjing.testing import CENTRE_BOX, PluginHost, Stage, does, reports, says
from lingjing.testing.expressions import Aggregate, Attr, Binary, Call, Number, Ref, Symbol
from tests.missions import staging as kit

SHOPS = ("shop[1]", "shop[2]", "shop[3]")


def queues(play):
    return {name: play.entity(name).properties["people"] for name in SHOPS}


def tally(play, shop, tick, people=None, box=CENTRE_BOX):
    x, y, _ = play.entity(shop).position
    counted = queues(play)[shop] if people is None else people
    return reports("tally", f"f{tick}-uav-nadir", "queue_of_people", (x, y), box, people=counted)


def count(play, shop, people=None, box=CENTRE_BOX):
    """Take a picture of one shop and report the number of people."""
    play.stage.boxes = {shop: CENTRE_BOX}
    play.do({"counter": does("takePhoto")})
    tick = play.published.record.tick
    play.do({"counter": tally(play, shop, tick, people, box)})


def join(play, shop, off=0.0):
    play.put("dog", shop, east=off)
    play.wait(3)


def longest(play):
    return max(queues(play), key=queues(play).__getitem__)


@pytest.mark.parametrize("mode", ["star", "broadcast"])
@pytest.mark.parametrize(("beyond", "counts"), [(0.0, True), (-0.01, True), (0.01, False)])
def test_the_dog_joins_the_longest_queue_within_five_metres_inclusively(mode, beyond, counts):
    with kit.playing("queue", mode) as play:
        for shop in SHOPS:
            count(play, shop)
        join(play, longest(play), -(5.0 + beyond))
        assert play.success is counts
        assert play.emitted() == ([f"join {longest(play)}"] if counts else [])


def test_joining_a_shorter_queue_is_recorded_but_is_no_success():
    with kit.playing("queue") as play:
        for shop in SHOPS:
            count(play, shop)
        wrong = min(queues(play), key=queues(play).__getitem__)
        join(play, wrong)
        assert play.emitted() == [f"join {wrong}"]
        assert not play.done and all(kind != "joined" for kind, *_ in play.kinds())


def test_no_queue_can_be_joined_before_all_are_counted():
    with kit.playing("queue") as play:
        for shop in SHOPS[:2]:
            count(play, shop)
        for shop in SHOPS:
            join(play, shop)
        assert play.emitted() == [] and not play.done


@pytest.mark.parametrize(("wrong", "counts"), [(1.25, True), (0.75, True), (1.26, False), (0.5, False)])
def test_a_count_may_be_wrong_by_a_quarter(wrong, counts):
    with kit.playing("queue") as play:
        shop = longest(play)
        count(play, shop, people=queues(play)[shop] * wrong)
        assert (("counted", shop) in play.kinds()) is counts
        assert ("matched", shop) in play.kinds()


def test_a_count_without_a_matching_box_is_not_accepted():
    with kit.playing("queue") as play:
        count(play, SHOPS[0], box=kit.shifted(0.49))
        assert play.kinds() == []


def test_the_lengths_of_the_queues_are_hidden_and_depend_on_the_seed():
    """The brief gives the places of the shops, and not the number of waiting people, which only pictures show."""
    drawn = set()
    for seed in range(6):
        instance, _ = kit.staged("queue", None, seed)
        shops = [entity for entity in instance.entities if entity.group == "shop"]
        people = [shop.properties["people"] for shop in shops]
        assert len(set(people)) == len(people), "no two queues are equally long"
        drawn.add(tuple(people))
        assert all(shop.hidden == ("people",) for shop in shops)
    assert len(drawn) > 1
    with kit.playing("queue") as play:
        views = {view.id: view for view in play.published.observations["walker"].entities}
        assert views["shop[1]"].position is not None and not views["shop[1]"].resources


def test_observations_and_briefs_do_not_depend_on_the_lengths_of_the_queues():
    instance = kit.still(kit.staged("queue")[0])
    other = msgspec.structs.replace(
        instance,
        entities=tuple(
            msgspec.structs.replace(entity, properties={**entity.properties, "people": entity.properties["people"] + 7})
            if entity.group == "shop"
            else entity
            for entity in instance.entities
        ),
    )
    seen = []
    for each in (instance, other):
        with kit.playing("queue", instance=each) as play:
            play.do({"counter": does("takePhoto")})
            play.do({"counter": says("order", assignee="dog", task="wait")})
            records = [seen.sha256 for step in play.all for seen in step.record.observations]
            seen.append((records, play.kernel.briefs()))
    assert seen[0] == seen[1]


def test_an_order_of_the_counter_gives_the_declared_relations_to_the_walker():
    with kit.playing("queue") as play:
        count(play, SHOPS[1])
        play.do({"counter": says("order", assignee="dog", task="join", position=(1.0, 2.0))})
        kinds = [(relation.kind, relation.source, relation.target) for relation in play.relations]
        assert ("information_handoff", "counter", "walker") in kinds
        assert ("guidance", "counter", "walker") in kinds
        assert ("dependency", "detect", "tell") in kinds


# -- tasks for policies that read rules


@pytest.mark.parametrize("seed", range(4))
def test_the_required_task_is_joining_the_longest_queue(seed):
    instance, _ = kit.staged("queue", None, seed)
    people = {entity.id: entity.properties["people"] for entity in instance.entities if entity.group == "shop"}
    assert [(task.name, task.target) for task in required_tasks(instance)] == [
        ("join", max(people, key=people.__getitem__))
    ]


def attr(variable, name):
    return Attr(base=Ref(name=variable, kind="local"), name=name)


def test_a_comparison_selects_members_only_by_declared_values():
    instance, _ = kit.staged("queue")
    shops = tuple(entity for entity in instance.entities if entity.group == "shop")
    least = Aggregate(function="min", variable="p", domain="shop", body=attr("p", "people"))
    shortest = Binary(operator="<=", left=attr("q", "people"), right=least)
    (chosen,) = matching_members(shortest, "q", shops, instance)
    assert chosen.properties["people"] == min(shop.properties["people"] for shop in shops)
    event = Call(function="emitted", arguments=(Symbol(name="join"), Ref(name="q", kind="local")))
    assert matching_members(event, "q", shops, instance) == shops
    no_shop = Binary(operator=">", left=attr("q", "people"), right=Number(value=1000.0))
    assert matching_members(no_shop, "q", shops, instance) == shops
    unknown = Binary(operator=">", left=attr("q", "colour"), right=Number(value=1.0))
    assert matching_members(Binary(operator="and", left=unknown, right=shortest), "q", shops, instance) == (chosen,)


def test_a_stock_that_interactions_change_has_no_declared_value():
    instance, _ = kit.staged("cd", "star", 0, (("points", 5.0),))
    point = next(entity for entity in instance.entities if entity.group == "point")
    van = next(entity for entity in instance.entities if entity.group == "van")
    assert declared(point, "demand_kg") is None
    assert declared(van, "payload_kg") == van.properties["payload_kg"]
    assert len(required_tasks(instance)) == 5


# -- played episodes


def played(policy, seed, ticks):
    """An episode with one policy for all agents and the real engines, except that pictures show only what is below."""
    host = PluginHost()
    plugin = host.policy(policy)
    instance, _ = kit.staged("queue", None, seed)
    privileged = frozenset(agent.id for agent in instance.agents) if plugin.privileged else frozenset()
    stage = Stage(sight_m=30.0)
    engines = ("city", "multirotor", "quadruped")
    with kit.playing("queue", seed=seed, real=engines, instance=instance, stage=stage, privileged=privileged) as play:
        barrier = policy_barrier(play.kernel, {agent.id: plugin.factory() for agent in instance.agents})
        try:
            for _ in range(ticks):
                if play.done:
                    break
                seen = play.published
                inputs = {name: (seen.observations[name], seen.inboxes[name]) for name in seen.observations}
                play.published = play.kernel.step(barrier.act(inputs, play.kernel.exhausted()))
                play.all.append(play.published)
        finally:
            barrier.close()
        return play


@pytest.mark.thorough
def test_the_oracle_wins_the_queue_mission():
    play = played("oracle", 5, 60)
    assert play.success
    (event,) = (event for boundary in play.all for event in boundary.record.task_events if event.kind == "join")
    people = {entity.id: entity.properties.get("people", 0.0) for entity in play.instance.entities}
    assert event.entities == (max(people, key=people.__getitem__), "dog")


def test_the_random_policy_does_not_win_the_queue_mission():
    play = played("random", 0, 6)
    assert not play.done and play.published.evaluation.reward == 0.0
