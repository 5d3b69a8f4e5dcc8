"""Background movers, routes and unreachable links on their way from an engine to the other engines, camera and
kernel.
"""

import cProfile
from typing import ClassVar

import msgspec
import pytest
from msgspec.structs import replace

import tests.kernel.world_toys as toys
from lingjing.errors import InfrastructureError
from lingjing.kernel.world.boundary_checks import checked_boundary
from lingjing.kernel.world.selection import select_engines
from lingjing.mission.instance import RevealSpec
from lingjing.plugins.engine import Boundary
from lingjing.testing import PluginHost, does
from lingjing.testing import rescue as kit
from lingjing.testing.worlds import open_world
from lingjing.trace.records import BodyState, Route

TOYS = ("tests.kernel.world_toys:plugin", "tests.kernel.world_toys:painter")


@pytest.fixture
def world():
    world = open_world("inline", plugins=TOYS, installed=False)
    yield world
    world.close()


def crowded(*more, **changes):
    """Return a cat of the crowd's own engine, an ant with a camera, and a crowd of three."""
    return toys.instance(
        toys.entity("cat", "toy_crowd", 5.0),
        toys.entity("ant", "toy_a", 1.0, cameras=(toys.camera(),)),
        *more,
        **{"crowd": 3.0, **changes},
    )


def far_crowd(**changes):
    return crowded(toys.entity("owl", "far_crowd", 2.0), **changes)


def without_waits(boundary):
    return replace(boundary, engines=tuple((e.engine, e.time_s, e.frame) for e in boundary.engines))


def test_movers_are_in_the_snapshot_of_the_decision_boundary_alone(world):
    ready = world.reset(crowded(), toys.CITY)
    assert [mover.id for mover in ready.snapshots[0].ambient] == ["traffic/0", "traffic/1", "traffic/2"]
    boundary = world.step(1, ())
    assert [len(snapshot.ambient) for snapshot in boundary.snapshots] == [0] * 9 + [3]
    assert boundary.snapshots[-1].ambient[2].position == (3.0, 1.0, 0.0)


def test_every_other_engine_sees_the_entities_and_then_the_movers(world):
    world.reset(crowded(toys.entity("fox", "toy_crowd_too", 2.0)), toys.CITY)
    world.step(1, ())
    theirs = ["other/0", "other/1", "other/2"]
    assert toys.Crowd.seen["toy_crowd"] == ["ant", "fox", *theirs]
    assert toys.Crowd.seen["toy_crowd_too"] == ["cat", "ant", "traffic/0", "traffic/1", "traffic/2"]


def test_an_entity_that_reads_mirrors_depends_on_background_movers(world):
    def end(crowd):
        world.reset(crowded(crowd=crowd), toys.CITY)
        return world.step(1, ()).snapshots[-1].states[1]

    assert end(3.0) != end(4.0)


def test_routes_of_every_macro_step_and_the_latest_unreachable_links_are_reported(world):
    ready = world.reset(crowded(silence=1.0), toys.CITY)
    assert [(route.entity, route.number) for route in ready.routes] == [("cat", 1)]
    assert ready.unreachable_links == (("cat", "ant"),)
    boundary = world.step(1, ())
    assert [route.number for route in boundary.routes] == list(range(2, 12))
    assert boundary.unreachable_links == (("cat", "ant"),)
    world.reset(crowded(), toys.CITY)
    assert world.step(1, ()).unreachable_links == ()


@pytest.mark.parametrize("instance", [crowded(silence=1.0), far_crowd(silence=1.0)], ids=["local", "remote"])
def test_movers_and_pictures_are_equal_in_the_inline_and_the_process_world(world, instance):
    def played(world):
        boundaries = [world.reset(instance, toys.CITY), *[world.step(tick, ()) for tick in (1, 2)]]
        now = boundaries[-1].snapshots[-1]
        (frame,) = world.capture(2, [toys.request(2)], now.states + now.ambient)
        return [without_waits(boundary) for boundary in boundaries], frame.jpeg

    process = open_world("process", plugins=TOYS, installed=False)
    try:
        ours, theirs = played(world), played(process)
    finally:
        process.close()
    crowds = ["distant"] * 3 * (len(instance.entities) - 2) + ["traffic"] * 3  # by the names of their engines
    assert [mover.id.partition("/")[0] for mover in ours[0][-1].snapshots[-1].ambient] == crowds
    assert ours == theirs


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ("ambient_nan", "engine `toy_crowd` .*failed in advance: entity `traffic/2` has a number that is not finite"),
        ("ambient_twice", "its background mover `traffic/0` appears twice"),
        ("ambient_entity", "its background mover `ant` has the id of an entity"),
        ("ambient_text", "its answer is malformed"),
        ("foreign_route", "it planned a route for `ant`, which it does not own"),
        ("inf_route", r"its route \d+ of `cat` is empty or not finite"),
    ],
)
def test_incoherent_movers_and_routes_are_an_abort(world, fault, message):
    cat = toys.entity("cat", "toy_crowd", 5.0, fault=fault, fault_at=0.55)
    world.reset(toys.instance(cat, toys.entity("ant", "toy_a"), crowd=3.0), toys.CITY)
    with pytest.raises(InfrastructureError, match=message):
        world.step(1, ())


def test_two_engines_may_not_have_movers_of_one_id(world):
    fox = toys.entity("fox", "toy_crowd_too", 5.0, fault="ambient_clash", fault_at=0.55)
    world.reset(crowded(fox), toys.CITY)
    with pytest.raises(InfrastructureError, match="`traffic/0` is already one of `toy_crowd`"):
        world.step(1, ())


def test_an_unreachable_link_of_an_unknown_entity_is_an_abort(world):
    instance = toys.instance(toys.entity("dog", "toy_crowd"), crowd=1.0, silence=1.0)
    with pytest.raises(InfrastructureError, match="it reports `cat` as out of radio range, but no entity has this id"):
        world.reset(instance, toys.CITY)


def test_numbers_of_movers_become_plain(world):
    cat = toys.entity("cat", "toy_crowd", 5.0, fault="ambient_numpy", fault_at=0.0)
    world.reset(toys.instance(cat, toys.entity("ant", "toy_a"), crowd=2.0), toys.CITY)
    mover = world.step(1, ()).snapshots[-1].ambient[1]
    assert (mover.position, type(mover.position), type(mover.heading_deg)) == ((2.0, 1.0, 0.0), tuple, float)


def test_an_engine_is_selected_for_its_entities_or_at_its_own_request():
    host = PluginHost(entry_points=False, extra=(toys.plugin, toys.painter))
    ant = toys.entity("ant", "toy_a")
    assert select_engines(toys.instance(ant), host).local == ("toy_a",)
    assert select_engines(toys.instance(ant, crowd=1.0), host).local == ("toy_a", "toy_crowd")
    assert select_engines(toys.instance(toys.entity("cat", "toy_crowd")), host).local == ("toy_crowd",)


def test_a_reference_picture_needs_the_sensor_engine_as_a_camera_does():
    host = PluginHost(entry_points=False, extra=(toys.plugin, toys.painter))
    bare = toys.instance(toys.entity("ant", "toy_a"))
    assert select_engines(bare, host).sensor is None
    reveal = RevealSpec(what="image", entities=("ant",), role="searcher")
    assert select_engines(msgspec.structs.replace(bare, reveals=(reveal,)), host).sensor is not None


def test_an_engine_without_entities_takes_part_in_the_episode(world):
    world.reset(toys.instance(toys.entity("ant", "toy_a"), crowd=2.0), toys.CITY)
    boundary = world.step(1, ())
    assert [status.engine for status in boundary.engines] == ["toy_a", "toy_crowd"]
    assert len(boundary.snapshots[-1].ambient) == 2


def test_the_cost_of_checking_movers_is_linear_in_their_number():
    """Measured in function calls; `benchmarks/world.py --only movers` measures the time."""
    few, many = calls_to_check(200), calls_to_check(2000)
    assert 0 < many <= 11 * few < 11 * 200 * 20  # Python 3.12 has fewer calls besides those for each mover


def calls_to_check(count):
    crowd = toys.Crowd()
    movers = tuple(crowd.mover(f"traffic/{n}", float(n), 0.5) for n in range(count))
    report = Boundary(engine="road", time_s=0.5, ambient=movers)
    profile = cProfile.Profile()
    profile.runcall(checked_boundary, "road", "advance", report, 0.5, (), frozenset(("ant", "bee")))
    return sum(entry.callcount for entry in profile.getstats())


class Busy(kit.Shore):
    """A shore with traffic: two cars, and sometimes a route for a target."""

    colour = "red"

    def advance(self, until, mirrors):
        cars = tuple(
            BodyState(id=f"traffic/{n}", position=(float(n), until, 0.0), kind="car", status=self.colour)
            for n in (1, 2)
        )
        way = ((0.0, 0.0, 0.0), (9.0, 0.0, 0.0))
        route = Route(entity="victim[1]", number=1, waypoints=way, length_m=9.0, duration_s=1.0, time_s=until)
        boundary = super().advance(until, mirrors)
        return msgspec.structs.replace(boundary, ambient=cars, routes=(route,) if until == 5.0 else ())


class Onlooker(kit.TruthCamera):
    seen: ClassVar[list[str]] = []

    def draw(self, request):
        self.seen[:] = list(self.mirrors)
        return super().draw(request)


def test_background_movers_are_recorded_drawn_and_part_of_the_digest():
    kernel = kit.kernel(plugin=kit.RescueEngines(shore=Busy, table=Onlooker))
    kernel.reset()
    record = kernel.step(kit.decisions(scout_1=does("takePhoto"))).record
    assert [mover.id for mover in record.snapshots[-1].ambient] == ["traffic/1", "traffic/2"]
    assert not any(snapshot.ambient for snapshot in record.snapshots[:-1])
    assert [route.entity for route in record.routes] == ["victim[1]"]
    assert kernel.state.registry.routes["victim[1]"].time_s == 5.0
    assert Onlooker.seen[-2:] == ["traffic/1", "traffic/2"]
    assert len(Onlooker.seen) == len(kernel.instance.entities) + 2

    class Blue(Busy):
        colour = "blue"

    other = kit.kernel(plugin=kit.RescueEngines(shore=Blue, table=Onlooker))
    other.reset()
    assert other.step(kit.decisions(scout_1=does("takePhoto"))).record.digest != record.digest
