"""All motion engines in one world process: one thread, one answer in every process, forks to the last bit."""

import os

import msgspec
import pytest
from msgspec.structs import replace

import tests.kernel.world_mixed as mixed
from lingjing.kernel.stocks import current
from lingjing.kernel.world.messages import Stepped, encoded
from lingjing.testing.worlds import open_world

pytestmark = pytest.mark.slow

TICKS = 3


@pytest.fixture(scope="module")
def city():
    return mixed.city()


@pytest.fixture
def world():
    world = open_world("process")
    yield world
    world.close()


def played(world, instance, ticks):
    boundaries = [world.step(tick, mixed.orders(tick, instance)) for tick in ticks]
    return [replace(b, engines=tuple((s.engine, s.time_s, s.frame) for s in b.engines)) for b in boundaries]


def test_the_world_process_has_one_thread_and_its_fork_continues_bit_for_bit(world, city):
    """SUMO, MuJoCo and JSBSim in one process, as an episode uses them. The fork and its parent continue like a run
    without a fork.
    """
    instance = mixed.instance()
    ready = world.reset(instance, city)
    assert [status.engine for status in ready.engines] == ["city", "multirotor", "quadruped", "road", "vessel"]
    unforked = played(world, instance, range(1, 3 + TICKS))
    world.reset(instance, city)
    played(world, instance, (1, 2))
    twin = world.fork()
    pids = [each._workers.world.pid for each in (world, twin)]
    later = range(3, 3 + TICKS)
    ours = played(world, instance, later)
    assert played(twin, instance, later) == ours == unforked[2:]
    assert [len(os.listdir(f"/proc/{pid}/task")) for pid in pids] == [1, 1]
    assert len(ours[-1].snapshots[-1].ambient) == 20
    twin.close()


def test_a_warm_and_a_new_world_process_play_identically(world, city):
    instance = mixed.instance()
    runs = []
    for each in (world, world, open_world("process")):
        each.reset(instance, city)
        runs.append(played(each, instance, range(1, TICKS + 1)))
    each.close()
    assert runs[0] == runs[1] == runs[2]


def test_a_van_delivers_goods_and_its_engine_reads_the_accounts_of_the_city(world, city):
    instance = mixed.instance(dogs=0, traffic=0)
    world.reset(instance, city)
    driven = played(world, instance, range(1, 8))
    events = [(event.kind, event.entities) for boundary in driven for event in boundary.events]
    assert ("deliver", ("point", "van[1]")) in events
    van = next(entity for entity in instance.entities if entity.id == "van[1]")
    loads = [current(van, _states(boundary)["van[1]"], "load_kg") for boundary in driven]
    assert (loads[0], loads[-1]) == (200.0, 0.0)
    assert _states(driven[-1])["point"].resources["demand"] == 50.0


def _states(boundary):
    return {state.id: state for state in boundary.snapshots[-1].states}


def test_background_movers_cross_the_process_border_once_per_tick(world, city):
    """Only the movers of the boundary cross the process border, not those of the fifty macro-steps before it."""
    instance = mixed.instance(uavs=0, dogs=0, traffic=40)
    world.reset(instance, city)
    boundary = world.step(1, ())
    with_movers = sum(len(snapshot.ambient) for snapshot in boundary.snapshots)
    assert with_movers == 40
    bare = msgspec.structs.replace(boundary.snapshots[-1], ambient=())
    movers = len(encoded(Stepped(boundary=boundary))) - len(
        encoded(Stepped(boundary=replace(boundary, snapshots=(*boundary.snapshots[:-1], bare))))
    )
    assert movers < 40 * 400
